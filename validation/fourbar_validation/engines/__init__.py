"""Adapters of the harness's engines, each in a module of its own.

The library of an engine is imported by its adapter alone.
"""
