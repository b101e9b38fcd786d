"""What the formulas state of a linkage whatever its motion, held against the engines."""
