"""Simulators under test, each run in an environment of its own.

The formulas check what they answer.
"""
