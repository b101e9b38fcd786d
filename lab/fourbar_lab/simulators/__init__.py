"""Simulators under test.

Each is compared with the formulas in an environment of its own.
"""
