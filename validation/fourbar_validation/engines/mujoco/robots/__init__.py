"""Closed loops in a robot's own MJCF: compiled, posed, recognised and described."""
