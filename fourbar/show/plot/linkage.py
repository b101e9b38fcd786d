"""The linkage drawn to scale: bars, pins, ground, mass centres and coupler curves."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.linkage import ENDS, MOVING_BARS
from fourbar.show.acting import acting
from fourbar.show.plot import symbols
from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.style import BAR_COLOURS, INK, MUTED, OPEN, largest, length_unit, quantity
from fourbar.show.plot.symbols import components, place_of, vectors
from fourbar.show.plot.view import View
from fourbar.solution import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

Point = tuple[float, float]
POINT = "#8A3B78"
"""Of the scene's own points."""


def pins(view: View, factor: float = 1.0) -> dict[str, Point]:
    """Locate the pins at the position drawn, in the order O2, A, B, O4, m or what the factor makes of it."""
    place = place_of(view.scene.linkage, view.here, 0, factor)
    return {name: components(pin) for name, pin in place.pins.items()}


def draw_linkage(axes: "Axes", view: View, labels: Labels, *, moving: bool = False) -> None:
    """Draw the linkage at the position drawn, over the paths of its points; with velocities where it is `moving`."""
    factor, unit, size = scale_of(view)
    where = pins(view, factor)
    for path, colour, dashes, name in paths(view):
        scaled = factor * path
        axes.plot(*scaled.T, color=colour, lw=1.0, ls=dashes, zorder=2, label=name)
        labels.keep_off(axes, *[(float(x), float(y)) for x, y in scaled[:: max(1, len(scaled) // 120)]])
    _ground(axes, labels, where["O2"], where["O4"], size)
    if view.dimensions:
        at = tuple(0.5 * (a + b) for a, b in zip(where["O2"], where["O4"], strict=True))
        labels.add(Label(axes, _bar_name(view, 1), (at[0], at[1]), where["B"], MUTED, 9.0, 2.0))
    middle = (float(np.mean([p[0] for p in where.values()])), float(np.mean([p[1] for p in where.values()])))
    for number, (start, stop) in ENDS.items():
        (x, y), colour = zip(where[start], where[stop], strict=True), BAR_COLOURS[number]
        axes.plot(x, y, color=colour, lw=4.5, solid_capstyle="round", zorder=4)
        labels.keep_off(axes, where[start], where[stop], width=4.5)
        labels.add(Label(axes, _bar_name(view, number), (0.5 * sum(x), 0.5 * sum(y)), middle, colour, 9.0, 2.0))
    for name, point in where.items():
        axes.plot(*[[v] for v in point], "o", ms=6.0, mew=1.2, zorder=6, **OPEN)
        labels.add(Label(axes, pin_name(name), point, middle, INK, 9.0, 2.5))
    for name, path in view.here.points.items():
        x, y = factor * path[0]
        axes.plot([x], [y], "D", ms=4.5, mew=1.2, zorder=8, **{**OPEN, "mec": POINT})
        labels.keep_off(axes, (float(x), float(y)), (float(x), float(y)))
        labels.add(Label(axes, name, (float(x), float(y)), middle, POINT, 8.5, 2.5))
    _mass_centres(axes, view, labels, where, middle)
    if moving:
        vectors(axes, view, view.here, factor, size)
    place = place_of(view.scene.linkage, view.here, 0, factor)
    for symbol in acting(view.scene):
        drawn = symbols.draw(axes, symbol, place, size)
        for line in drawn.lines:
            labels.keep_off(axes, *line)
        if drawn.label is not None:
            labels.add(Label(axes, drawn.text, drawn.label, middle, symbols.COLOURS[symbol.kind], 8.0))
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    title = f"Linkage at {view.at}, {view.branch_name} branch"
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    path_legend(axes)


def _mass_centres(axes: "Axes", view: View, labels: Labels, where: dict[str, Point], middle: Point) -> None:
    factor, _, _ = scale_of(view)
    for number in MOVING_BARS:
        bar, colour = view.scene.linkage.bar(number), BAR_COLOURS[number]
        if bar.mass == 0.0:
            continue
        x, y = factor * getattr(view.here, f"G{number}")[0]
        here = (float(x), float(y))
        r_along, r_across = bar.to_centre.real, bar.to_centre.imag
        if r_across != 0.0 or not 0.0 <= r_along <= bar.length:  # off the bar: tied to it by a line
            axes.plot(*zip(where[ENDS[number][0]], here, strict=True), color=colour, lw=0.8, ls=":", zorder=3)
            labels.keep_off(axes, where[ENDS[number][0]], here)
        mass_centre(axes, here)
        labels.keep_off(axes, here, here)
        labels.add(Label(axes, f"$G_{number}$", here, middle, colour, 8.0, 3.0))


def path_legend(axes: "Axes") -> float:
    """Write the legend of the paths above the drawing; return the distance of the title over it, typographic points."""
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.005), ncols=3)
    pad = 6.0 + 12.0 * math.ceil(len(legend.get_texts()) / 3)
    axes.set_title(axes.get_title(loc="left"), pad=pad)
    return pad


def _bar_name(view: View, number: int) -> str:
    """Write the number of a bar, with its length where dimensions are wanted."""
    length = quantity(view.scene.linkage.lengths[number - 1], "m", view.units)
    return f"{number}: {length}" if view.dimensions else str(number)


def scale_of(view: View) -> tuple[float, str, float]:
    """Choose the factor to the unit of length, the same for both branches; that unit; the size of a support."""
    most = max(largest(v.sweep.A, v.sweep.B, v.sweep.G3, *np.array(list(pins(v).values()))) for v in view.alike)
    factor, unit = length_unit(most, view.units)
    sweep = view.sweep
    reached = np.concatenate([sweep.A, sweep.B, sweep.G3, *sweep.points.values(), list(pins(view).values())])
    return factor, unit, 0.03 * factor * float(np.max(np.nanmax(reached, axis=0) - np.nanmin(reached, axis=0)))


def pin_name(name: str) -> str:
    """Write a pin as it is typeset."""
    return f"${name[0]}_{name[1]}$" if len(name) == 2 else f"${name}$"


def paths(view: View) -> list[tuple[Array, str, Any, str]]:
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


def _ground(axes: "Axes", labels: Labels, O2: Point, O4: Point, size: float) -> None:
    supports(axes, O2, O4, size)
    labels.keep_off(axes, O2, O4)
    for x, y in (O2, O4):
        for share in (0.5, 1.0, 1.7, 2.1, 2.5):
            wide = size * (share / 1.7 if share <= 1.7 else 1.7)
            labels.keep_off(axes, (x - wide, y - share * size), (x + wide, y - share * size))


def supports(axes: "Axes", O2: Point, O4: Point, size: float) -> None:
    """Draw the ground line between the fixed pins, and a hatched support under each."""
    from matplotlib.patches import Polygon, Rectangle

    axes.plot(*zip(O2, O4, strict=True), color=MUTED, lw=1.0, ls=(0, (8, 3, 2, 3)), zorder=1)
    for x, y in (O2, O4):
        wide, foot = 1.7 * size, y - 1.7 * size
        triangle = [(x, y), (x - size, foot), (x + size, foot)]
        axes.add_patch(Polygon(triangle, closed=True, fc="white", ec=INK, lw=1.0, zorder=3))
        strip = ((x - wide, foot - 0.8 * size), 2.0 * wide, 0.8 * size)
        axes.add_patch(Rectangle(*strip, fc="none", ec=INK, lw=0.0, hatch="//////", zorder=2))
        axes.plot([x - wide, x + wide], [foot, foot], color=INK, lw=1.0, zorder=3)


def mass_centre(axes: "Axes", point: Point, ms: float = 7.0) -> "list[Line2D]":
    """Draw the quartered circle that marks a mass centre."""
    from matplotlib.path import Path

    x, y = point
    marks = axes.plot([x], [y], "o", ms=ms, mfc="white", mec=INK, mew=0.8, zorder=7)
    for quarter in ((0, 90), (180, 270)):
        marks += axes.plot([x], [y], marker=Path.wedge(*quarter), ms=ms, mfc=INK, mec="none", zorder=7)
    return marks


def draw_coupler_curves(axes: "Axes", view: View, labels: Labels) -> None:
    """Paths of points along the coupler's line and off it, from one full sweep."""
    sweep = view.sweep
    along = sweep.B - sweep.A
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    points = ((0.0, 0.0), (0.25, 0.0), (0.5, 0.0), (0.75, 0.0), (1.0, 0.0), (0.5, 0.5), (0.5, -0.5))
    paths = [sweep.A + u * along + v * across for u, v in points]
    factor, unit, _ = scale_of(view)
    greys = ("#0072B2", "#56A0C8", "#D55E00", "#5FA48B", "#007A5A", "#8A3B78", "#8A3B78")
    for (u, v), path, colour in zip(points, paths, greys, strict=True):
        dashes = "-" if v == 0.0 else (0, (5, 1.5)) if v > 0 else (0, (1.4, 1.4))
        lw = 1.8 if (u, v) == (0.5, 0.0) else 1.1
        name = {0.0: "$A$", 1.0: "$B$"}.get(u, f"{u:g}") if v == 0.0 else f"{u:g}, {v:+g}".replace("-", "−")
        axes.plot(*(factor * path).T, color=colour, lw=lw, ls=dashes, label=name, zorder=3)
    where = pins(view, factor)
    for ends in ENDS.values():
        axes.plot(
            *zip(*(where[end] for end in ends), strict=True),
            color=MUTED,
            lw=2.5,
            alpha=0.55,
            solid_capstyle="round",
            zorder=2,
        )
    for name, (x, y) in where.items():
        axes.plot([x], [y], "o", ms=4.5, mew=1.0, zorder=5, **OPEN)
        if name in ("O2", "O4"):
            labels.add(Label(axes, pin_name(name), (x, y), (0.0, 1e9), INK, 8.5, 2.0))
    labels.keep_off(axes, *where.values())
    axes.set_aspect("equal", adjustable="datalim")
    title = f"Coupler curves, {view.branch_name} branch"
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    of_points: dict[str, Any] = {
        "title": "point along AB (and off it), in lengths of the coupler",
        "title_fontsize": 7.5,
    }
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, **of_points)
    view.notes.append(f"The linkage is drawn at {view.at}.")
