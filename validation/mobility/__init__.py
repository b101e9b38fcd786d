"""What turns, how far, and how well it transmits: the statements of the formulas, asked of an exact engine."""
