"""The closed formulas of the planar four-bar linkage.

Each file states one step and its source.
"""
