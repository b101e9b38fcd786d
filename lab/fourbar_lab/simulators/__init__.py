"""Simulators under test: each is compared with the formulas in an environment of its own."""
