"""Trends over commits: `asv run`, `asv publish`, `asv find`.

CONTRIBUTING.md has the commands.
"""
