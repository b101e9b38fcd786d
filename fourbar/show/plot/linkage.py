"""The linkage drawn to scale over the paths of its points, and coupler curves."""

import math
from collections.abc import Iterator
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.linkage import ENDS
from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.mechanism import draw_mechanism, draw_support, locate_pins, pin_name, scale_of, write_bar_name
from fourbar.show.plot.style import BAR_COLOURS, INK, MUTED, OPEN, POINT
from fourbar.show.plot.symbols import draw_vectors
from fourbar.show.plot.view import View
from fourbar.solution import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COUPLER_CURVES: tuple[tuple[str, Any], ...] = (
    *((colour, "-") for colour in ("#0072B2", "#56A0C8", "#D55E00", "#5FA48B", "#007A5A")),
    *(("#8A3B78", dashes) for dashes in ((0, (5, 1.5)), (0, (1.4, 1.4)))),
)
"""Colours and dashes, one after the other."""


def draw_linkage(axes: "Axes", view: View, labels: Labels, *, moving: bool = False) -> None:
    """Draw the linkage at the position drawn, over the paths of its points; with velocities where it is `moving`."""
    factor, unit, size = scale_of(view)
    where = locate_pins(view, factor)
    draw_paths(axes, view, labels)
    if view.dimensions:
        at = tuple(0.5 * (a + b) for a, b in zip(where["O2"], where["O4"], strict=True))
        labels.add(Label(axes, write_bar_name(view, 1), (at[0], at[1]), where["B"], MUTED, 9.0, 2.0))
    draw_mechanism(axes, view, view.here, 0, labels)
    if moving:
        draw_vectors(axes, view, view.here, factor, size)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    title = f"Linkage at {view.at}, {view.branch_name} branch"
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    write_path_legend(axes)


def draw_paths(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw what does not move: the paths of points, the ground line and its supports."""
    factor, _, size = scale_of(view)
    for path, colour, dashes, name in list_paths(view):
        scaled = factor * path
        axes.plot(*scaled.T, color=colour, lw=1.0, ls=dashes, zorder=2, label=name)
        labels.keep_off(axes, *[(float(x), float(y)) for x, y in scaled[:: max(1, len(scaled) // 120)]])
    where = locate_pins(view, factor)
    O2, O4 = where["O2"], where["O4"]
    axes.plot(*zip(O2, O4, strict=True), color=MUTED, lw=1.0, ls=(0, (8, 3, 2, 3)), zorder=1)
    labels.keep_off(axes, O2, O4)
    for pin in (O2, O4):
        draw_support(axes, pin, size, labels)


def write_path_legend(axes: "Axes") -> float:
    """Write the legend of the paths above the drawing; return the distance of the title over it, typographic points."""
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.005), ncols=3)
    pad = 6.0 + 12.0 * math.ceil(len(legend.get_texts()) / 3)
    axes.set_title(axes.get_title(loc="left"), pad=pad)
    return pad


def list_paths(view: View) -> list[tuple[Array, str, Any, str]]:
    """Paths of A, B, mass centres (or the coupler's mid-point) and own points: (n, 2) in m, colour, dashes, name."""
    sweep = view.sweep
    massive = view.scene.linkage.coupler.mass > 0.0
    middle = sweep.G3 if massive else 0.5 * (sweep.A + sweep.B)
    found: list[tuple[Array, str, Any, str]] = [
        (sweep.A, BAR_COLOURS[2], (0, (1, 2)), "path of $A$"),
        (sweep.B, BAR_COLOURS[4], (0, (1, 2)), "path of $B$"),
        (middle, BAR_COLOURS[3], (0, (4, 1.5)), "coupler curve of " + ("$G_3$" if massive else "its mid-point")),
    ]
    for bar, centre in ((2, sweep.G2), (4, sweep.G4)):
        if view.scene.linkage.bar(bar).mass > 0.0:
            found.append((centre, BAR_COLOURS[bar], (0, (6, 2, 1, 2)), f"path of $G_{bar}$"))
    found += [(path, POINT, (0, (3, 1, 1, 1)), f"path of {name}") for name, path in sweep.points.items()]
    closes = sweep.assembled[:, None]
    return [(np.where(closes, path, np.nan), colour, dashes, name) for path, colour, dashes, name in found]


def draw_coupler_curves(axes: "Axes", view: View, labels: Labels) -> None:
    """Paths of the scene's own points of the coupler; where it has none, of points along its line and off it."""
    factor, unit, _ = scale_of(view)
    where, names = locate_pins(view, factor), [point.name for point in view.scene.points if point.bar == 3]
    for (name, path), (colour, dashes) in zip(_list_coupler_points(view, names), cycle(COUPLER_CURVES), strict=False):
        lw = 1.8 if name in (*names, "0.5") else 1.1
        axes.plot(*(factor * path).T, color=colour, lw=lw, ls=dashes, label=name, zorder=3)
    faint: dict[str, Any] = {"color": MUTED, "alpha": 0.55, "solid_capstyle": "round", "zorder": 2}
    for ends in ENDS.values():
        axes.plot(*zip(*(where[end] for end in ends), strict=True), lw=2.5, **faint)
    for name in names:
        x, y = (float(x) for x in factor * view.here.points[name][0])
        axes.plot(*zip(where["A"], (x, y), where["B"], strict=True), lw=0.8, ls=":", **faint)
        axes.plot([x], [y], "D", ms=4.5, mew=1.2, zorder=8, **{**OPEN, "mec": POINT})
        labels.keep_off(axes, where["A"], (x, y), where["B"])
        labels.add(Label(axes, name, (x, y), where["A"], POINT, 8.5, 2.5))
    for name, (x, y) in where.items():
        axes.plot([x], [y], "o", ms=4.5, mew=1.0, zorder=5, **OPEN)
        if name in ("O2", "O4"):
            labels.add(Label(axes, pin_name(name), (x, y), (0.0, 1e9), INK, 8.5, 2.0))
    labels.keep_off(axes, *where.values())
    axes.set_aspect("equal", adjustable="datalim")
    title = f"Coupler curves, {view.branch_name} branch"
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    heading = "point of the coupler" if names else "point along AB (and off it), in lengths of the coupler"
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, title=heading, title_fontsize=7.5)
    view.notes.append(f"The linkage is drawn at {view.at}.")


def _list_coupler_points(view: View, names: list[str]) -> Iterator[tuple[str, Array]]:
    """List the paths that are drawn of the coupler, each with its name."""
    sweep = view.sweep
    along = sweep.B - sweep.A
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    if names:
        yield from (("$A$", sweep.A), ("$B$", sweep.B), *((name, sweep.points[name]) for name in names))
        return
    for u, v in ((0.0, 0.0), (0.25, 0.0), (0.5, 0.0), (0.75, 0.0), (1.0, 0.0), (0.5, 0.5), (0.5, -0.5)):
        name = {0.0: "$A$", 1.0: "$B$"}.get(u, f"{u:g}") if v == 0.0 else f"{u:g}, {v:+g}".replace("-", "−")
        yield name, sweep.A + u * along + v * across
