"""Measure what accuracy costs in time."""
