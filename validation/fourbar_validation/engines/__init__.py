"""Adapt each engine in a module of its own.

An engine is imported here and nowhere else.
"""
