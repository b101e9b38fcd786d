"""Mutants of the formulas, and who catches them."""
