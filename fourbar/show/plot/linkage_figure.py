"""The linkage drawn to scale over the paths of its points; coupler curves, centres.

Plots and films draw it alike.
"""

from collections.abc import Iterator
from functools import cache
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.linkage import ENDS, MOVING_BARS
from fourbar.quantities import Array
from fourbar.show.derived import derive
from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.style import (
    BAR_COLOURS,
    GROUND_LINE,
    INK,
    MUTED,
    POINT,
    RING_MARK,
    Points,
    join_points,
    largest_magnitude,
    place_legend,
    plot_points,
    split_points,
    write_labelled_quantity,
)
from fourbar.show.plot.symbols import (
    BARREL,
    Pose,
    draw_symbol,
    draw_vectors,
    list_acting,
    place_of,
)
from fourbar.show.plot.traced_paths import trace
from fourbar.show.plot.view import View
from fourbar.show.shown_units import choose_unit
from fourbar.solution import Solution
from fourbar.studies.paths import measure_paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.path import Path


_NAMED_AT = 0.35
"""Part of a bar's length at which its name stands: a mass centre is often mid-bar."""
_ON_BAR = 1e-3
"""Part of a bar's length below which a point seems to lie on the bar's line."""


def _label_plane(
    axes: "Axes", view: View, title: str, factor: float, unit: str
) -> None:
    """Label the axes of a drawing to scale, with round numbers of its coordinates."""
    from matplotlib.ticker import MaxNLocator

    class ShiftedLocator(MaxNLocator):
        """Ticks at round numbers of the drawing."""

        def __init__(self, shift: float) -> None:
            super().__init__(nbins="auto", steps=[1, 2, 5, 10])
            self.shift = shift

        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            ticks = super().tick_values(vmin + self.shift, vmax + self.shift)
            return [float(tick) - self.shift for tick in ticks]

    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    for axis, origin in zip((axes.xaxis, axes.yaxis), view.scene.origin, strict=True):
        if origin == 0.0:
            continue
        shift = factor * origin

        def write_tick(value: float, _: Any, shift: float = shift) -> str:
            return f"{value + shift:.6g}".replace("-", "−")

        axis.set_major_locator(ShiftedLocator(shift))
        axis.set_major_formatter(write_tick)


def locate_pins(view: View, factor: float = 1.0) -> dict[str, complex]:
    """Locate the pins O2, A, B, O4 at the drawn position, in m times the factor."""
    return place_of(view.scene.linkage, view.here, 0, factor).pins


def draw_mechanism(
    axes: "Axes",
    view: View,
    solution: Solution,
    index: int,
    labels: Labels,
) -> list[Any]:
    """Draw bars, pins, mass centres, points and what acts at a position.

    Return what was drawn. Labels are asked for, each away from what it names; whoever
    calls places them.
    """
    factor, _, size = choose_drawing_scale(view)
    place = place_of(view.scene.linkage, solution, index, factor)
    if view.sweep.stroke is not None:
        shortest = float(np.nanmin(view.sweep.stroke))
        place = place._replace(barrel=BARREL * factor * shortest)
    pins = place.pins
    middle = sum(pins.values()) / 4.0
    drawn = []
    for number in MOVING_BARS:
        start, stop = (pins[pin] for pin in ENDS[number])
        colour = BAR_COLOURS[number]
        ends = [start, stop]
        drawn += plot_points(
            axes, ends, color=colour, lw=4.5, solid_capstyle="round", zorder=4
        )
        labels.keep_off(axes, start, stop, width=4.5)
        name = _write_bar_name(view, number)
        named_at = start + _NAMED_AT * (stop - start)
        labels.add(Label(axes, name, named_at, middle, colour, 9.0, 2.0))
    joints = [*pins.values()]
    drawn += plot_points(axes, joints, "o", ms=6.0, mew=1.2, zorder=6, **RING_MARK)
    for name, point in pins.items():
        labels.add(Label(axes, pin_name(name), point, middle, INK, 9.0, 2.5))
    for name, path in solution.points.items():
        here = factor * complex(*path[index])
        labels.keep_off(axes, here)
        drawn += _mark_point(axes, name, here, middle, labels)
    for carrier, corner in _list_off_bars(view, place):
        first, last = (pins[pin] for pin in ENDS[carrier])
        drawn += draw_plate(axes, carrier, (first, corner, last), labels)
    for number in MOVING_BARS:
        bar = view.scene.linkage.bar(number)
        if bar.mass == 0.0:
            continue
        G = place.point(number, bar.to_centre)
        drawn += draw_mass_centre(axes, G)
        labels.keep_off(axes, G)
        beyond = 2.0 * G - middle  # across the bar from its number
        colour = BAR_COLOURS[number]
        labels.add(Label(axes, f"$G_{number}$", G, beyond, colour, 8.0, 3.0))
    for symbol in list_acting(view.scene):
        drawn += draw_symbol(axes, symbol, place, size, labels)
    return drawn


def _list_off_bars(view: View, place: Pose) -> Iterator[tuple[int, complex]]:
    """List what may lie off its bar.

    Points, mass centres, and the places where forces, moments and springs act may do
    so.
    """
    for point in view.scene.settled().points:
        yield point.bar, place.point(point.bar, point.place.vector())
    for number in MOVING_BARS:
        bar = view.scene.linkage.bar(number)
        if bar.mass > 0.0:
            yield number, place.point(number, bar.to_centre)
    for symbol in list_acting(view.scene):
        if symbol.kind in ("force", "push", "moment", "spring"):
            yield symbol.bar, place.tail(symbol)
        if symbol.end is not None:
            yield symbol.end[0], place.point(*symbol.end)


def draw_plate(
    axes: "Axes",
    bar: int,
    corners: tuple[complex, complex, complex],
    labels: Labels,
) -> list[Any]:
    """Join a point to its bar, from pin to point to pin, as a plate.

    Nothing is drawn for a point that lies on the bar.
    """
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Polygon

    first, point, last = corners
    along = (point - first) / (last - first)
    if abs(along.imag) < _ON_BAR and -_ON_BAR < along.real < 1.0 + _ON_BAR:
        return []
    colour = BAR_COLOURS.get(bar, MUTED)
    labels.keep_off(axes, *corners)
    plate = Polygon(
        split_points(corners),
        closed=False,
        fc=to_rgba(colour, 0.08 if bar > 1 else 0.0),
        ec=colour,
        lw=0.8,
        ls=":",
        zorder=1.5,
    )
    return [axes.add_patch(plate)]


def _mark_point(
    axes: "Axes", name: str, point: complex, shun: complex, labels: Labels
) -> "list[Line2D]":
    """Mark a point of the scene by a diamond, and ask for its label."""
    labels.add(Label(axes, name, point, shun, POINT, 8.5, 2.5))
    look = {**RING_MARK, "mec": POINT}
    return plot_points(axes, point, "D", ms=4.5, mew=1.2, zorder=8, **look)


def draw_mass_centre(
    axes: "Axes",
    point: complex,
    ms: float = 7.0,
) -> "list[Line2D]":
    """Draw the quartered circle that marks a mass centre."""
    quarters: Any = _make_quarters()
    disc = {"ms": ms, "zorder": 7, "mec": INK, "mew": 0.8, "mfc": "white"}
    dark = {"ms": ms, "zorder": 7, "mec": "none", "mfc": INK}
    return [
        *plot_points(axes, point, "o", **disc),
        *plot_points(axes, point, marker=quarters, **dark),
    ]


@cache
def _make_quarters() -> "Path":
    from matplotlib.path import Path

    return Path.make_compound_path(Path.wedge(0, 90), Path.wedge(180, 270))


def draw_support(axes: "Axes", pin: complex, size: float, labels: Labels) -> None:
    """Draw the hatched support under a fixed pin."""
    from matplotlib.patches import Polygon, Rectangle

    x = pin.real
    y = pin.imag
    wide = 1.7 * size
    foot = y - wide
    corners = [(x, y), (x - size, foot), (x + size, foot)]
    triangle = Polygon(corners, closed=True, fc="white", ec=INK, lw=1.0, zorder=3)
    hatching = Rectangle(
        (x - wide, foot - 0.8 * size),
        2.0 * wide,
        0.8 * size,
        fc="none",
        ec=INK,
        lw=0.0,
        hatch="//////",
        zorder=2,
    )
    axes.add_patch(triangle)
    axes.add_patch(hatching)
    axes.plot([x - wide, x + wide], [foot, foot], color=INK, lw=1.0, zorder=3)
    for share in (0.5, 1.0, 1.7, 2.1, 2.5):
        level = complex(x, y - share * size)
        half = size * (share / 1.7 if share <= 1.7 else 1.7)
        labels.keep_off(axes, level - half, level + half)


def _write_bar_name(view: View, number: int) -> str:
    """Write the number of a bar, with its length where dimensions are wanted."""
    if not view.dimensions:
        return str(number)
    length = view.scene.linkage.lengths[number - 1]
    return f"{number}: {write_labelled_quantity(length, 'm', view.units)}"


def choose_drawing_scale(view: View) -> tuple[float, str, float]:
    """Choose the factor to the unit of length, that unit, and a support's size."""
    sweep = view.sweep
    pins = split_points([*locate_pins(view).values()])
    most = largest_magnitude(sweep.A, sweep.B, sweep.G3, pins)
    factor, unit = choose_unit(most, "m", view.units)
    reached = np.concatenate([sweep.A, sweep.B, sweep.G3, *sweep.points.values(), pins])
    extents = np.nanmax(reached, axis=0) - np.nanmin(reached, axis=0)
    size_of_support = 0.03 * factor * float(np.max(extents))
    return factor, unit, size_of_support


def pin_name(name: str) -> str:
    """Write a pin as it is typeset."""
    return "$" + "_".join(name) + "$"


_COUPLER_CURVES: tuple[tuple[str, Any], ...] = (
    ("#0072B2", "-"),
    ("#56A0C8", "-"),
    ("#D55E00", "-"),
    ("#5FA48B", "-"),
    ("#007A5A", "-"),
    ("#8A3B78", (0, (5, 1.5))),
    ("#8A3B78", (0, (1.4, 1.4))),
)
"""Colours and dashes, one after the other."""


def draw_linkage(
    axes: "Axes",
    view: View,
    labels: Labels,
    *,
    moving: bool = False,
) -> None:
    """Draw the linkage at the drawn position, over the paths of its points.

    `moving`: with velocities.
    """
    factor, unit, size = choose_drawing_scale(view)
    draw_paths(axes, view, labels)
    if not moving:
        _mark_paths(axes, view, factor, labels)
    if view.dimensions:
        pins = locate_pins(view, factor)
        middle = 0.5 * (pins["O2"] + pins["O4"])
        name = _write_bar_name(view, 1)
        labels.add(Label(axes, name, middle, pins["B"], MUTED, 9.0, 2.0))
    draw_mechanism(axes, view, view.here, 0, labels)
    if moving:
        draw_vectors(axes, view, view.here, factor, size)
    axes.margins(0.08)
    title = f"Linkage at {view.at}, {view.branch_name} branch"
    _label_plane(axes, view, title, factor, unit)
    place_legend(axes, 3)


def _mark_paths(axes: "Axes", view: View, factor: float, labels: Labels) -> None:
    """Draw stroke and straightness of the points' paths as rectangles about them."""
    for path in measure_paths(view.sweep).values():
        corners = factor * join_points(path.corners - view.scene.origin)
        outline = [*corners, corners[0]]
        plot_points(axes, outline, color=POINT, lw=0.6, zorder=2)
        labels.keep_off(axes, *outline)


def draw_paths(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw what does not move: paths of points, ground line and supports."""
    factor, _, size = choose_drawing_scale(view)
    for path, colour, dashes, name in _list_paths(view):
        scaled = factor * path
        dashed = (0, dashes)
        plot_points(axes, scaled, color=colour, ls=dashed, label=name, lw=1.0, zorder=2)
        labels.keep_off(axes, *scaled[:: max(1, len(path) // 120)])
    pins = locate_pins(view, factor)
    ends = pins["O2"], pins["O4"]
    plot_points(axes, ends, **GROUND_LINE)
    labels.keep_off(axes, *ends)
    for pin in ends:
        draw_support(axes, pin, size, labels)


def _list_paths(view: View) -> Iterator[tuple[Points, str, tuple[float, ...], str]]:
    """List paths of A, B, mass centres and the scene's points.

    An entry has the path, (n,) in m, its colour, dashes and name; the mid-point of a
    massless coupler stands for its mass centre.
    """
    traced = trace(view)
    sweep = traced.solution
    bars = view.scene.linkage
    yield traced.path(sweep.A), BAR_COLOURS[2], (1, 2), "path of $A$"
    yield traced.path(sweep.B), BAR_COLOURS[4], (3, 2), "path of $B$"
    centre = 0.5 * (sweep.A + sweep.B)
    name = "its mid-point"
    if bars.coupler.mass > 0.0:
        centre = sweep.G3
        name = "$G_3$"
    yield traced.path(centre), BAR_COLOURS[3], (4, 1.5), f"coupler curve of {name}"
    for bar, centre in ((2, sweep.G2), (4, sweep.G4)):
        if bars.bar(bar).mass > 0.0:
            path = traced.path(centre)
            yield path, BAR_COLOURS[bar], (6, 2, 1, 2), f"path of $G_{bar}$"
    for name, points in sweep.points.items():
        yield traced.path(points), POINT, (3, 1, 1, 1), f"path of {name}"


def draw_coupler_curves(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw the paths of the scene's points of the coupler.

    If it has none, they are of points along its line and off it.
    """
    factor, unit, _ = choose_drawing_scale(view)
    pins = locate_pins(view, factor)
    names = [point.name for point in view.scene.points if point.bar == 3]
    traced = trace(view)
    curves = _list_coupler_points(traced.solution, names)
    for (name, points), (colour, dashes) in zip(
        curves, cycle(_COUPLER_CURVES), strict=False
    ):
        plot_points(
            axes,
            factor * traced.path(points),
            color=colour,
            ls=dashes,
            label=name,
            lw=1.8 if name in (*names, "0.5") else 1.1,
            zorder=3,
        )
    faint: dict[str, Any] = {
        "color": MUTED,
        "alpha": 0.55,
        "solid_capstyle": "round",
        "zorder": 2,
    }
    for number in MOVING_BARS:
        plot_points(axes, [pins[pin] for pin in ENDS[number]], lw=2.5, **faint)
    A = pins["A"]
    B = pins["B"]
    for name in names:
        here = factor * complex(*view.here.points[name][0])
        plot_points(axes, [A, here, B], lw=0.8, ls=":", **faint)
        _mark_point(axes, name, here, A, labels)
        labels.keep_off(axes, A, here, B)
    for name, pin in pins.items():
        plot_points(axes, pin, "o", ms=4.5, mew=1.0, zorder=5, **RING_MARK)
        if name in ("O2", "O4"):
            labels.add(Label(axes, pin_name(name), pin, 1e9j, INK, 8.5, 2.0))
    labels.keep_off(axes, *pins.values())
    title = f"Coupler curves, {view.branch_name} branch"
    if traced.circuit:
        title = "Coupler curves of the circuit"
    _label_plane(axes, view, title, factor, unit)
    heading = "point along AB (and off it), in lengths of the coupler"
    if names:
        heading = "point of the coupler"
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        ncols=4,
        title=heading,
        title_fontsize=7.5,
    )
    view.notes.append(f"The linkage is drawn at {view.at}.")


def _list_coupler_points(
    sweep: Solution,
    names: list[str],
) -> Iterator[tuple[str, Array]]:
    """List the points of the coupler whose paths are drawn, each with its name."""
    if names:
        yield from (("$A$", sweep.A), ("$B$", sweep.B))
        yield from ((name, sweep.points[name]) for name in names)
        return
    along = sweep.B - sweep.A
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    for name, u in {"$A$": 0.0, "0.25": 0.25, "0.5": 0.5, "0.75": 0.75}.items():
        yield name, sweep.A + u * along
    yield "$B$", sweep.A + along
    for name, v in {"0.5, +0.5": 0.5, "0.5, −0.5": -0.5}.items():
        yield name, sweep.A + 0.5 * along + v * across


FARTHEST_CENTRE = 1.5
"""Instant centres are drawn up to this multiple of the linkage's size from it."""


def draw_centres(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw the paths of the instant centres I13 and I24 near the linkage."""
    factor, unit, _ = choose_drawing_scale(view)
    middle = sum(locate_pins(view).values()) / 4.0
    reach = FARTHEST_CENTRE * max(view.scene.linkage.lengths)
    for name, colour, dashes in (("I13", POINT, "-"), ("I24", INK, (0, (4, 1.5)))):
        path, here = (
            join_points(derive(solution, name)) for solution in (view.sweep, view.here)
        )
        near = factor * np.where(np.abs(path - middle) <= reach, path, np.nan)
        label = f"$I_{{{name[1:]}}}$"
        plot_points(axes, near, color=colour, ls=dashes, lw=1.2, label=label)
        if np.abs(here - middle) <= reach:
            plot_points(axes, factor * here, "o", ms=4.5, color=colour, zorder=6)
    draw_mechanism(axes, view, view.here, 0, labels)
    axes.grid(color=MUTED, alpha=0.2)
    title = f"Instant centres at {view.at}"
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    place_legend(axes)
    axes.set_aspect("equal", adjustable="datalim")
    view.note(
        f"Centres further than {FARTHEST_CENTRE:g} longest bars away are left out.",
    )
