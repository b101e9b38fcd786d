"""The transmission angle over theta_2 or time, with the limits and dead centres."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.show.plot.curves import draw_axes
from fourbar.show.plot.style import INK, MUTED, OPEN, place_legend
from fourbar.show.plot.view import View
from fourbar.solution import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RECOMMENDED = 40.0
"""Smallest transmission angle that is usually recommended, deg (R. L. Norton, Design of Machinery)."""
REMARK = 0.34
"""Part that a remark takes along an axis, as a part of its length."""


def draw_transmission(axes: "Axes", view: View) -> None:
    """Acute angle between coupler and output, with limit and dead-centre positions."""
    over = draw_axes(axes, view)
    sweep = view.sweep
    mu = np.degrees(np.arctan2(np.abs(sweep.sin_mu), np.abs(np.cos(sweep.theta_4 - sweep.theta_3))))
    axes.plot(over, mu, color=INK)
    axes.axhline(RECOMMENDED, color=MUTED, lw=0.9, ls=(0, (4, 2)))
    place = find_free_place(mu)
    at = (over[0] + place * (over[-1] - over[0]), RECOMMENDED)
    look: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "size": 7.0, "color": MUTED}
    axes.annotate(f"{RECOMMENDED:g}° recommended", at, xytext=(0, 2), **look)
    axes.set(ylim=(0.0, 96.0), yticks=range(0, 91, 15))
    for theta, height, marker, name in _list_marked(view):
        axes.plot(theta, height, marker, ms=6.0, mew=1.1, ls="none", label=name, clip_on=False, zorder=5, **OPEN)
    axes.set(ylabel=r"transmission angle $\mu$ (°)", title="Transmission angle")
    if view.time is None:
        place_legend(axes, 2)


def find_free_place(mu: Array) -> float:
    """Where along the axis the curve keeps furthest from a remark at 40 deg, as a part of its length."""
    half = REMARK / 2.0
    best, clearance = 1.0 - half, -1.0
    for place in np.linspace(1.0 - half, half, 25):
        part = mu[int((place - half) * len(mu)) : max(1, math.ceil((place + half) * len(mu)))]
        away = np.abs(part[np.isfinite(part)] - RECOMMENDED - 3.0)  # the remark stands on the line
        if away.size and away.min() > clearance:
            best, clearance = float(place), float(away.min())
    return best


def _list_marked(view: View) -> list[tuple[list[float], list[float], str, str]]:
    """Limits of the commanded bar and dead centres, on the axis: places, mu (degrees), mark, name."""
    if view.time is not None:
        return []
    at, marked = view.sweep.at, list[tuple[list[float], list[float], str, str]]()
    own = np.degrees(at.angle)
    order = np.argsort(own)
    margin = 1.5 * float(np.median(np.abs(np.diff(own)))) if len(own) > 1 else 0.0
    one, other = (bar for bar in MOVING_BARS if bar != at.bar)
    for bar in sorted({2, 4, at.bar}, key=lambda bar: bar != at.bar):
        turned, heights = list[float](), list[float]()
        for found in limit_positions(view.scene.linkage, bar):
            theta = {2: found.theta_2, 3: found.theta_3, 4: found.theta_4}
            sign = math.copysign(1.0, math.sin(theta[other] - theta[one]))
            difference = found.theta_4 - found.theta_3
            for place in _list_inside(own, theta[at.bar], margin if bar == at.bar else 0.0):
                if bar == at.bar or at.branch[np.argmin(np.abs(own - place))] == sign:
                    turned.append(place)
                    heights.append(math.degrees(math.atan2(abs(math.sin(difference)), abs(math.cos(difference)))))
        if at.stroke is not None:  # over which its bar's angle rises or falls throughout
            turned = np.interp(turned, own[order], view.axis.values[order]).tolist()
        pair = ", ".join(str(each) for each in MOVING_BARS if each != bar)
        mark, what = ("s", "limit") if bar == at.bar else ("D", "dead centre")
        marked.append((turned, heights, mark, f"{what}: bars {pair} in line"))
    return [entry for entry in marked if entry[0]]


def _list_inside(own: Array, angle: float, margin: float) -> list[float]:
    """List an angle (rad) and its full turns that lie in the sweep, degrees."""
    low, high = float(own.min()) - margin, float(own.max()) + margin
    start = math.degrees(angle)
    first = math.ceil((low - start) / 360.0)
    return [start + 360.0 * k for k in range(first, math.floor((high - start) / 360.0) + 1)]
