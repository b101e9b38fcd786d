"""The closed formulas of the planar four-bar linkage; each file states one step and its source."""
