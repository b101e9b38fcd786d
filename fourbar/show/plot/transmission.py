"""The transmission angle over theta_2 or time, with the limits and dead centres."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.formulas.mobility import limit_positions
from fourbar.show.plot.curves import bases
from fourbar.show.plot.style import INK, MUTED, OPEN, legend_above
from fourbar.show.plot.view import View
from fourbar.solution import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RECOMMENDED = 40.0
"""Smallest transmission angle that is usually recommended, deg (R. L. Norton, Design of Machinery)."""
CENTRE = "dead centre: bars 2, 3 in line"
REMARK = 0.34
"""Part that a remark takes along an axis, as a part of its length."""


def draw_transmission(axes: "Axes", view: View) -> None:
    """Acute angle between coupler and output, with limit and dead-centre positions."""
    over = bases(axes, view)
    sweep = view.sweep
    mu = np.degrees(np.arctan2(np.abs(sweep.sin_mu), np.abs(np.cos(sweep.theta_4 - sweep.theta_3))))
    axes.plot(over, mu, color=INK)
    axes.axhline(RECOMMENDED, color=MUTED, lw=0.9, ls=(0, (4, 2)))
    place = free_place(mu)
    at = (over[0] + place * (over[-1] - over[0]), RECOMMENDED)
    look: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "size": 7.0, "color": MUTED}
    axes.annotate(f"{RECOMMENDED:g}° recommended", at, xytext=(0, 2), **look)
    axes.set(ylim=(0.0, 96.0), yticks=range(0, 91, 15))
    for theta, height, marker, name in _marked(view):
        axes.plot(theta, height, marker, ms=6.0, mew=1.1, ls="none", label=name, clip_on=False, zorder=5, **OPEN)
    axes.set(ylabel=r"transmission angle $\mu$ (°)", title="Transmission angle")
    if view.time is None:
        legend_above(axes, 2)


def free_place(mu: Array) -> float:
    """Where along the axis the curve keeps furthest from a remark at 40 deg, as a part of its length."""
    half = REMARK / 2.0
    best, clearance = 1.0 - half, -1.0
    for place in np.linspace(1.0 - half, half, 25):
        part = mu[int((place - half) * len(mu)) : max(1, math.ceil((place + half) * len(mu)))]
        away = np.abs(part[np.isfinite(part)] - RECOMMENDED - 3.0)  # the remark stands on the line
        if away.size and away.min() > clearance:
            best, clearance = float(place), float(away.min())
    return best


def _marked(view: View) -> list[tuple[list[float], list[float], str, str]]:
    """Limits (bars 3, 4 collinear) and dead centres (bars 2, 3 collinear): theta_2, mu (degrees), mark, name."""
    if view.time is not None:
        return []
    degrees = view.degrees
    margin = 1.5 * float(np.median(np.diff(degrees))) if len(degrees) > 1 else 0.0
    limits = [t for own in limit_positions(view.scene.linkage) for t in _inside(view, own.theta_2, margin)]
    centres, heights = [], []
    for found in limit_positions(view.scene.linkage, 4):
        difference = found.theta_4 - found.theta_3
        for t in _inside(view, found.theta_2, 0.0):
            if view.sweep.branch[np.argmin(np.abs(degrees - t))] == found.branch:
                centres.append(t)
                heights.append(math.degrees(math.atan2(abs(math.sin(difference)), abs(math.cos(difference)))))
    marked = [(limits, [0.0] * len(limits), "s", "limit: bars 3, 4 in line"), (centres, heights, "D", CENTRE)]
    return [entry for entry in marked if entry[0]]


def _inside(view: View, angle: float, margin: float) -> list[float]:
    """List an angle (rad) and its full turns that lie in the sweep, degrees."""
    low, high = float(view.degrees[0]) - margin, float(view.degrees[-1]) + margin
    start = math.degrees(angle)
    first = math.ceil((low - start) / 360.0)
    return [start + 360.0 * k for k in range(first, math.floor((high - start) / 360.0) + 1)]
