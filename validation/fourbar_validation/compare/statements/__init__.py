"""Compare what the formulas state of a linkage with the engines.

The statements do not depend on its motion.
"""
