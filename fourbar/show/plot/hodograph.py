"""Pin forces as hodographs: magnitude over direction, in polar axes."""

import math
from typing import TYPE_CHECKING

import numpy as np

from fourbar.show.plot.curves import break_at_poles, choose_limit, find_poles, list_force_sizes, note
from fourbar.show.plot.style import MUTED, OPEN, choose_force_line, find_greatest, write_number
from fourbar.show.plot.view import View
from fourbar.show.units import choose_unit
from fourbar.solution import Array

if TYPE_CHECKING:
    from matplotlib.projections.polar import PolarAxes

EVERY = 60.0
"""Dots on a hodograph stand this far apart in the commanded angle, deg ..."""
MOST_DOTS = 12
"""... or, over time or a stroke, a round number that gives no more than these."""
LONG_NUMBERS = 2000.0
"""From here on the numbers along a radius are too wide for four of them."""


def draw_hodograph(axes: "PolarAxes", view: View, name: str) -> None:
    """Draw the tips of a force's vectors from one origin; open dot: start of the sweep, dots every 60 deg."""
    from matplotlib.ticker import MaxNLocator

    force, look = getattr(view.sweep, name), choose_force_line(name)
    direction, own = np.arctan2(force[:, 1], force[:, 0]), np.hypot(*force.T)
    everywhere = list_force_sizes(view, (name,))
    limit = choose_limit(everywhere)
    top = limit or 1.08 * find_greatest(*everywhere) or 1.0
    factor, unit = choose_unit(top, "N", view.units)
    where = find_poles(view)
    over, every, apart = _describe_spacing(view)
    marks = np.unique(np.round((over - over[0]) / every).astype(int))
    dots = [int(np.argmin(np.abs(over - over[0] - every * k))) for k in marks]
    # drawn as a polyline in x, y: unwrapped angles keep matplotlib from going round by the longer arc
    known = np.isfinite(direction)
    free = _find_free_direction(direction[known])
    direction[known] = np.unwrap(direction[known])
    size = np.where(own <= top, own, np.nan) if limit else own
    axes.plot(break_at_poles(direction, where), factor * break_at_poles(size, where), **look)
    axes.plot(direction[dots], factor * size[dots], "o", ms=2.8, color=look["color"], ls="none")
    first = int(np.argmax(np.isfinite(size)))
    start = {**OPEN, "mec": look["color"]}
    axes.plot(direction[[first]], factor * size[[first]], "o", ms=4.6, mew=1.1, zorder=5, **start)
    if limit and find_greatest(own) > limit:
        note(view, f"Hodographs of {name} clipped at {write_number(factor * top)} {unit}.")
    axes.set_rlim(0.0, factor * top)
    axes.set_thetagrids(range(0, 360, 45))
    axes.tick_params(pad=0.5)
    many = 4 if factor * top < LONG_NUMBERS else 2
    ticks = MaxNLocator(many).tick_values(0.0, factor * top)
    axes.set_rticks([tick for tick in ticks if 0.0 < tick < 0.97 * factor * top])
    axes.set_rlabel_position(free)
    axes.tick_params(axis="y", labelsize=6.5, labelcolor=MUTED)
    axes.set_title(f"{look['label']} ({unit})", pad=12)
    note(view, f"Hodographs: open dot at the start, dots every {apart}; angles are directions in the x-y plane.")


def _describe_spacing(view: View) -> tuple[Array, float, str]:
    """Say what the dots are evenly spaced in, by how much, and that in words."""
    axis = view.axis
    if axis.unit == "°":
        return axis.values, EVERY, f"{EVERY:g}° of {axis.symbol}"
    duration = float(axis.values[-1] - axis.values[0]) or 1.0
    step = 10.0 ** math.floor(math.log10(duration))
    every = next(share * step for share in (0.1, 0.2, 0.5, 1.0) if duration <= MOST_DOTS * share * step)
    return axis.values, every, f"{every:g}{axis.unit}"


def _find_free_direction(directions: Array) -> float:
    """Find the multiple of 22.5 deg that lies furthest from the curve."""
    candidates = np.radians(np.arange(16) * 22.5)
    away = np.abs(np.angle(np.exp(1j * (directions - candidates[:, None])))).min(axis=1, initial=math.pi)
    return float(np.degrees(candidates[int(np.argmax(away))]))
