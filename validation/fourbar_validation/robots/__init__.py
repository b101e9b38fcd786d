"""Somebody's robot: its file, its closed loops, and a scene from one of them."""
