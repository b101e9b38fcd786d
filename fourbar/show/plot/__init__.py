"""Drawings of a scene in publication quality.

Linkage, curves over theta_2, forces and free bodies can be drawn. Needs matplotlib (the
extra ``plot``), which is loaded when something is drawn.
"""

from fourbar.show.plot.figures import FIGURES, draw, draw_figure
from fourbar.show.plot.style import FORMATS, format_of
from fourbar.show.plot.tolerance_figures import draw_tolerances

__all__ = (
    "FIGURES",
    "FORMATS",
    "draw",
    "draw_figure",
    "draw_tolerances",
    "format_of",
)
