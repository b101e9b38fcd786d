"""Drawings of a scene in publication quality.

Linkage, curves over theta_2, forces and free bodies can be drawn. Needs matplotlib (the
extra ``plot``), which is loaded when something is drawn.
"""

from fourbar.show.plot.figures import BRANCHES as BRANCHES
from fourbar.show.plot.figures import FIGURES as FIGURES
from fourbar.show.plot.figures import draw as draw
from fourbar.show.plot.figures import draw_figure as draw_figure
from fourbar.show.plot.studies import draw_tolerances as draw_tolerances
from fourbar.show.plot.style import FORMATS as FORMATS
from fourbar.show.plot.style import format_of as format_of
