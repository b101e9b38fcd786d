"""Compare what the formulas state of a linkage, independently of its motion, with the engines."""
