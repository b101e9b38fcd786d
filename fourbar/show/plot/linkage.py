"""The linkage drawn to scale over the paths of its points; coupler curves.

Plots and films draw it alike.
"""

import math
from collections.abc import Iterator
from functools import cache
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.linkage import ENDS, MOVING_BARS
from fourbar.quantities import Array
from fourbar.show.plot import symbols
from fourbar.show.plot.labels import DrawnPoint, Label, Labels
from fourbar.show.plot.paths import trace
from fourbar.show.plot.style import (
    BAR_COLOURS,
    INK,
    MUTED,
    POINT,
    RING_MARK,
    largest_magnitude,
    write_labelled_quantity,
)
from fourbar.show.plot.symbols import (
    Pose,
    draw_vectors,
    list_acting,
    place_of,
    split_complex,
)
from fourbar.show.plot.view import View
from fourbar.show.units import choose_unit
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
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    class ShiftedLocator(MaxNLocator):
        """Ticks at round numbers of the drawing."""

        def __init__(self, shift: float) -> None:
            super().__init__(nbins="auto", steps=[1, 2, 5, 10])
            self.shift = shift

        def tick_values(self, vmin: float, vmax: float) -> list[float]:
            ticks = super().tick_values(vmin + self.shift, vmax + self.shift)
            return [float(tick) - self.shift for tick in ticks]

    def shift_axis(axis: Any, shift: float) -> None:
        def write_tick(value: float, _: Any) -> str:
            return f"{value + shift:.6g}".replace("-", "−")

        axis.set_major_locator(ShiftedLocator(shift))
        axis.set_major_formatter(FuncFormatter(write_tick))

    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)
    x, y = view.scene.origin
    if x != 0.0:
        shift_axis(axes.xaxis, factor * x)
    if y != 0.0:
        shift_axis(axes.yaxis, factor * y)


def locate_pins(view: View, factor: float = 1.0) -> dict[str, DrawnPoint]:
    """Locate the pins O2, A, B, O4 at the drawn position, in m times the factor."""
    place = place_of(view.scene.linkage, view.here, 0, factor)
    return {name: split_complex(pin) for name, pin in place.pins.items()}


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
        place = place._replace(
            barrel=symbols.BARREL * factor * float(np.nanmin(view.sweep.stroke))
        )
    pins = {name: split_complex(pin) for name, pin in place.pins.items()}
    centre = sum(place.pins.values()) / 4.0
    middle = split_complex(centre)
    drawn = []
    for number in MOVING_BARS:
        start, stop = ENDS[number]
        x, y = zip(pins[start], pins[stop], strict=True)
        x_name, y_name = (a + _NAMED_AT * (b - a) for a, b in (x, y))
        colour = BAR_COLOURS[number]
        drawn += axes.plot(x, y, color=colour, lw=4.5, solid_capstyle="round", zorder=4)
        labels.keep_off(axes, pins[start], pins[stop], width=4.5)
        labels.add(
            Label(
                axes,
                _write_bar_name(view, number),
                (x_name, y_name),
                middle,
                colour,
                9.0,
                2.0,
            )
        )
    x, y = zip(*pins.values(), strict=True)
    drawn += axes.plot(x, y, "o", ms=6.0, mew=1.2, zorder=6, **RING_MARK)
    for name, point in pins.items():
        labels.add(Label(axes, pin_name(name), point, middle, INK, 9.0, 2.5))
    for name, path in solution.points.items():
        here = split_complex(factor * complex(*path[index]))
        drawn += _mark_point(axes, here)
        labels.keep_off(axes, here, here)
        labels.add(Label(axes, name, here, middle, POINT, 8.5, 2.5))
    for carrier, corner in _list_off_bars(view, place):
        first, last = (place.pins[pin] for pin in ENDS[carrier])
        drawn += draw_plate(axes, carrier, (first, corner, last), labels)
    for number in MOVING_BARS:
        bar = view.scene.linkage.bar(number)
        colour = BAR_COLOURS[number]
        if bar.mass == 0.0:
            continue
        G = place.point(number, bar.to_centre)
        here = split_complex(G)
        drawn += draw_mass_centre(axes, here)
        labels.keep_off(axes, here, here)
        beyond = split_complex(2.0 * G - centre)  # across the bar from its number
        labels.add(Label(axes, f"$G_{number}$", here, beyond, colour, 8.0, 3.0))
    for symbol in list_acting(view.scene):
        shown = symbols.draw_symbol(axes, symbol, place, size)
        drawn += shown.artists
        for line in shown.lines:
            labels.keep_off(axes, *line)
        if shown.label is not None:
            if shown.away:
                away = split_complex(complex(*shown.label) - shown.away)
            else:
                away = middle
            labels.add(
                Label(
                    axes,
                    shown.text,
                    shown.label,
                    away,
                    shown.colour,
                    8.0,
                    ring=shown.ring,
                )
            )
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
            bar_of_end, at_end = symbol.end
            yield bar_of_end, place.point(bar_of_end, at_end)


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
    shape = [split_complex(corner) for corner in corners]
    colour = BAR_COLOURS.get(bar, MUTED)
    labels.keep_off(axes, *shape)
    shade = to_rgba(colour, 0.08 if bar > 1 else 0.0)
    return [
        axes.add_patch(
            Polygon(
                shape,
                closed=False,
                fc=shade,
                ec=colour,
                lw=0.8,
                ls=":",
                zorder=1.5,
            )
        )
    ]


def _mark_point(axes: "Axes", point: DrawnPoint) -> "list[Line2D]":
    """Mark a point of the scene by a diamond."""
    x, y = point
    look = {**RING_MARK, "mec": POINT}
    return axes.plot([x], [y], "D", ms=4.5, mew=1.2, zorder=8, **look)


def draw_mass_centre(
    axes: "Axes",
    point: DrawnPoint,
    ms: float = 7.0,
) -> "list[Line2D]":
    """Draw the quartered circle that marks a mass centre."""
    x, y = point
    quarters = _make_quarters()
    return [
        *axes.plot([x], [y], "o", ms=ms, mfc="white", mec=INK, mew=0.8, zorder=7),
        *axes.plot([x], [y], marker=quarters, ms=ms, mfc=INK, mec="none", zorder=7),
    ]


@cache
def _make_quarters() -> "Path":
    from matplotlib.path import Path

    return Path.make_compound_path(Path.wedge(0, 90), Path.wedge(180, 270))


def draw_support(axes: "Axes", pin: DrawnPoint, size: float, labels: Labels) -> None:
    """Draw the hatched support under a fixed pin."""
    from matplotlib.patches import Polygon, Rectangle

    x, y = pin
    wide = 1.7 * size
    foot = y - wide
    triangle = Polygon(
        [pin, (x - size, foot), (x + size, foot)],
        closed=True,
        fc="white",
        ec=INK,
        lw=1.0,
        zorder=3,
    )
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
        below = y - share * size
        half = size * (share / 1.7 if share <= 1.7 else 1.7)
        labels.keep_off(axes, (x - half, below), (x + half, below))


def _write_bar_name(view: View, number: int) -> str:
    """Write the number of a bar, with its length where dimensions are wanted."""
    length = write_labelled_quantity(
        view.scene.linkage.lengths[number - 1],
        "m",
        view.units,
    )
    if view.dimensions:
        return f"{number}: {length}"
    return str(number)


def choose_drawing_scale(view: View) -> tuple[float, str, float]:
    """Choose the factor to the unit of length, that unit, and a support's size."""
    sweep = view.sweep
    pins = np.array([*locate_pins(view).values()])
    most = largest_magnitude(sweep.A, sweep.B, sweep.G3, pins)
    factor, unit = choose_unit(most, "m", view.units)
    places = [sweep.A, sweep.B, sweep.G3, *sweep.points.values(), pins]
    reached = np.concatenate(places)
    extents = np.nanmax(reached, axis=0) - np.nanmin(reached, axis=0)
    size_of_support = 0.03 * factor * float(np.max(extents))
    return factor, unit, size_of_support


def pin_name(name: str) -> str:
    """Write a pin as it is typeset."""
    if len(name) == 2:
        return f"${name[0]}_{name[1]}$"
    return f"${name}$"


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
    pins = locate_pins(view, factor)
    draw_paths(axes, view, labels)
    if not moving:
        _mark_paths(axes, view)
    if view.dimensions:
        middle = tuple(
            0.5 * (a + b) for a, b in zip(pins["O2"], pins["O4"], strict=True)
        )
        labels.add(
            Label(
                axes,
                _write_bar_name(view, 1),
                (middle[0], middle[1]),
                pins["B"],
                MUTED,
                9.0,
                2.0,
            )
        )
    draw_mechanism(axes, view, view.here, 0, labels)
    if moving:
        draw_vectors(axes, view, view.here, factor, size)
    axes.margins(0.08)
    title = f"Linkage at {view.at}, {view.branch_name} branch"
    _label_plane(axes, view, title, factor, unit)
    write_path_legend(axes)


def _mark_paths(axes: "Axes", view: View) -> None:
    """Draw stroke and straightness of the points' paths as rectangles about them."""
    factor, _, _ = choose_drawing_scale(view)
    for path in measure_paths(view.sweep).values():
        corners = factor * (path.corners - view.scene.origin)
        x, y = np.append(corners, corners[:1], axis=0).T
        axes.plot(x, y, color=POINT, lw=0.6, zorder=2)


def draw_paths(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw what does not move: paths of points, ground line and supports."""
    factor, _, size = choose_drawing_scale(view)
    for path, colour, dashes, name in _list_paths(view):
        scaled = factor * path
        x, y = scaled.T
        axes.plot(x, y, color=colour, lw=1.0, ls=dashes, zorder=2, label=name)
        some = scaled[:: max(1, len(scaled) // 120)]
        labels.keep_off(axes, *[(float(x), float(y)) for x, y in some])
    pins = locate_pins(view, factor)
    O2 = pins["O2"]
    O4 = pins["O4"]
    axes.plot(
        (O2[0], O4[0]),
        (O2[1], O4[1]),
        color=MUTED,
        lw=1.0,
        ls=(0, (8, 3, 2, 3)),
        zorder=1,
    )
    labels.keep_off(axes, O2, O4)
    for pin in (O2, O4):
        draw_support(axes, pin, size, labels)


def write_path_legend(axes: "Axes") -> float:
    """Write the legend of the paths above the drawing.

    Return the distance of the title over it, typographic points.
    """
    legend = axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.005), ncols=3)
    pad = 6.0 + 12.0 * math.ceil(len(legend.get_texts()) / 3)
    axes.set_title(axes.get_title(loc="left"), pad=pad)
    return pad


def _list_paths(view: View) -> list[tuple[Array, str, Any, str]]:
    """List paths of A, B, mass centres and the scene's points.

    An entry has the path, (n, 2) in m, its colour, dash and name; the mid-point of a
    massless coupler stands for its mass centre.
    """
    traced = trace(view)
    sweep = traced.solution
    paths: list[tuple[Array, str, Any, str]] = []

    def add(points: Array, colour: str, dashes: tuple[float, ...], name: str) -> None:
        paths.append((traced.path(points), colour, (0, dashes), name))

    add(sweep.A, BAR_COLOURS[2], (1, 2), "path of $A$")
    add(sweep.B, BAR_COLOURS[4], (3, 2), "path of $B$")
    if view.scene.linkage.coupler.mass > 0.0:
        add(sweep.G3, BAR_COLOURS[3], (4, 1.5), "coupler curve of $G_3$")
    else:
        middle = 0.5 * (sweep.A + sweep.B)
        add(middle, BAR_COLOURS[3], (4, 1.5), "coupler curve of its mid-point")
    for bar, centre in ((2, sweep.G2), (4, sweep.G4)):
        if view.scene.linkage.bar(bar).mass > 0.0:
            add(centre, BAR_COLOURS[bar], (6, 2, 1, 2), f"path of $G_{bar}$")
    for name, path in sweep.points.items():
        add(path, POINT, (3, 1, 1, 1), f"path of {name}")
    return paths


def draw_coupler_curves(axes: "Axes", view: View, labels: Labels) -> None:
    """Draw the paths of the scene's points of the coupler.

    If it has none, they are of points along its line and off it.
    """
    factor, unit, _ = choose_drawing_scale(view)
    pins = locate_pins(view, factor)
    names = [point.name for point in view.scene.points if point.bar == 3]
    traced = trace(view)
    curves = _list_coupler_points(traced.solution, names)
    looks = cycle(_COUPLER_CURVES)
    for (name, points), (colour, dashes) in zip(curves, looks, strict=False):
        lw = 1.8 if name in (*names, "0.5") else 1.1
        x, y = factor * traced.path(points).T
        axes.plot(
            x,
            y,
            color=colour,
            lw=lw,
            ls=dashes,
            label=name,
            zorder=3,
        )
    faint: dict[str, Any] = {
        "color": MUTED,
        "alpha": 0.55,
        "solid_capstyle": "round",
        "zorder": 2,
    }
    for number in MOVING_BARS:
        (x_start, y_start), (x_stop, y_stop) = (pins[pin] for pin in ENDS[number])
        axes.plot((x_start, x_stop), (y_start, y_stop), lw=2.5, **faint)
    x_A, y_A = pins["A"]
    x_B, y_B = pins["B"]
    for name in names:
        x, y = (factor * view.here.points[name][0]).tolist()
        axes.plot((x_A, x, x_B), (y_A, y, y_B), lw=0.8, ls=":", **faint)
        _mark_point(axes, (x, y))
        labels.keep_off(axes, pins["A"], (x, y), pins["B"])
        labels.add(Label(axes, name, (x, y), pins["A"], POINT, 8.5, 2.5))
    for name, (x, y) in pins.items():
        axes.plot([x], [y], "o", ms=4.5, mew=1.0, zorder=5, **RING_MARK)
        if name in ("O2", "O4"):
            labels.add(Label(axes, pin_name(name), (x, y), (0.0, 1e9), INK, 8.5, 2.0))
    labels.keep_off(axes, *pins.values())
    title = f"Coupler curves, {view.branch_name} branch"
    if traced.circuit:
        title = "Coupler curves of the circuit"
    _label_plane(axes, view, title, factor, unit)
    if names:
        heading = "point of the coupler"
    else:
        heading = "point along AB (and off it), in lengths of the coupler"
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
    along = sweep.B - sweep.A
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    if names:
        yield from (
            ("$A$", sweep.A),
            ("$B$", sweep.B),
            *((name, sweep.points[name]) for name in names),
        )
        return
    for u, v in (
        (0.0, 0.0),
        (0.25, 0.0),
        (0.5, 0.0),
        (0.75, 0.0),
        (1.0, 0.0),
        (0.5, 0.5),
        (0.5, -0.5),
    ):
        if v == 0.0:
            name = {0.0: "$A$", 1.0: "$B$"}.get(u, f"{u:g}")
        else:
            name = f"{u:g}, {v:+g}".replace("-", "−")
        yield name, sweep.A + u * along + v * across
