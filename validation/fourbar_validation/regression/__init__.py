"""Find what changed since the accepted state.

A row is new, gone, better, worse, of another verdict, or mere round-off.
"""
