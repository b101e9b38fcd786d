"""One adapter per engine; each engine is imported in its own place here and nowhere else."""
