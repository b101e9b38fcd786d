"""What changed since the accepted state: new, gone, better, worse, changed verdict, and what is only round-off."""
