"""An answer against the formulas: tolerances, scales, errors, rows, identities."""
