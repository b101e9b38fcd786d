"""Forward error of the formulas against ball arithmetic, per family of hard cases."""
