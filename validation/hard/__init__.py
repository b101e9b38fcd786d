"""Singular positions, extreme ratios and scales: what must happen there, what was predicted, and what did happen."""
