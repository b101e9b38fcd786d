"""Adapt each engine in a module of its own; an engine is imported here and nowhere else."""
