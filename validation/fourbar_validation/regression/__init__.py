"""Find what changed since the accepted state: new, gone, better, worse, changed verdict, and mere round-off."""
