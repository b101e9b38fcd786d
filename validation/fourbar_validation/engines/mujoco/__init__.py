"""MuJoCo, imported in this package alone."""
