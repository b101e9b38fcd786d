"""What the formulas state of a linkage whatever its motion, asked of the engines."""
