"""The closed formulas of the planar four-bar linkage: a file has one step.

Every file names the source of its step.
"""
