"""The linkage drawn to scale over the paths of its points; coupler curves, centres.

Plots and films draw it alike.
"""

from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.linkage import ENDS, MOVING_BARS
from fourbar.quantities import Array
from fourbar.show.derived import derive
from fourbar.show.plot.labels import add_label
from fourbar.show.plot.style import (
    BAR_COLOURS,
    GROUND_LINE,
    INK,
    MUTED,
    POINT,
    RING_MARK,
    join_points,
    place_legend,
    plot_points,
    split_complex,
    split_points,
    write_labelled_quantity,
    write_pin_name,
)
from fourbar.show.plot.symbols import Pose, draw_symbol, draw_vectors, list_acting
from fourbar.show.plot.view import View
from fourbar.solution import Solution
from fourbar.studies.paths import measure_paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_ON_BAR = 1e-3
"""Part of a bar's length below which a point seems to lie on the bar's line."""


def label_plane(axes: "Axes", view: View, title: str) -> None:
    """Label the axes of a drawing to scale."""
    unit = view.plane.unit
    axes.margins(0.08)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel=f"$x$ ({unit})", ylabel=f"$y$ ({unit})", title=title)


def draw_bar(axes: "Axes", bar: int, ends: Any, **look: Any) -> None:
    """Draw a bar as a broad line between its pins."""
    look = {"color": BAR_COLOURS[bar], "lw": 4.5, "zorder": 4} | look
    plot_points(axes, ends, solid_capstyle="round", **look)


def draw_pins(
    axes: "Axes",
    pins: dict[str, complex],
    middle: complex,
    colour: str = INK,
    size: float = 9.0,
) -> None:
    """Draw pins as rings, their names away from the middle."""
    places = [*pins.values()]
    plot_points(axes, places, "o", ms=6.0, mew=1.2, zorder=6, **RING_MARK)
    for name, pin in pins.items():
        add_label(axes, write_pin_name(name), pin, pin - middle, colour, size)


def draw_mechanism(
    axes: "Axes", view: View, solution: Solution, index: int, *, moving: bool = False
) -> None:
    """Draw bars, pins, mass centres, points and what acts at a position.

    `moving`: with the arrows of velocity and acceleration.
    """
    scene = view.scene.settled()
    pose = Pose(view, solution, index)
    middle = sum(pose.pins.values()) / 4.0

    def join_to_bar(bar: int, at: complex) -> None:
        first, second = ENDS[bar]
        draw_plate(axes, bar, (pose.pins[first], at, pose.pins[second]))

    for bar in MOVING_BARS:
        start, stop = ends = [pose.pins[pin] for pin in ENDS[bar]]
        draw_bar(axes, bar, ends)
        # beside the middle, where a mass centre often is
        named_at = start + 0.35 * (stop - start)
        name = _write_bar_name(view, bar)
        add_label(axes, name, named_at, named_at - middle, BAR_COLOURS[bar], 9.0)
    draw_pins(axes, pose.pins, middle)
    for point in scene.points:
        at = pose.point(point.bar, point.place.vector())
        join_to_bar(point.bar, at)
        _mark_point(axes, point.name, at, at - middle)
    for bar in MOVING_BARS:
        described = scene.linkage.bar(bar)
        if described.mass == 0.0:
            continue
        G = pose.point(bar, described.to_centre)
        join_to_bar(bar, G)
        # across the bar from its number
        draw_mass_centre(axes, bar, G, middle - G, BAR_COLOURS[bar])
    for symbol in list_acting(scene):
        if symbol.kind != "gravity":
            join_to_bar(symbol.bar, pose.tail(symbol))
        if symbol.end is not None:
            join_to_bar(symbol.end[0], pose.point(*symbol.end))
        draw_symbol(axes, symbol, pose)
    if moving:
        draw_vectors(axes, view, solution, index)


def draw_plate(
    axes: "Axes", bar: int, corners: tuple[complex, complex, complex]
) -> None:
    """Join a point to its bar, from pin to point to pin, as a plate.

    Nothing is drawn for a point that lies on the bar.
    """
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Polygon

    first, point, last = corners
    along = (point - first) / (last - first)
    if abs(along.imag) < _ON_BAR and -_ON_BAR < along.real < 1.0 + _ON_BAR:
        return
    colour = BAR_COLOURS.get(bar, MUTED)
    face = to_rgba(colour, 0.08 if bar > 1 else 0.0)
    look = {"fc": face, "ec": colour, "lw": 0.8, "ls": ":", "zorder": 1.5}
    axes.add_patch(Polygon(split_points(corners), closed=False, **look))


def _mark_point(axes: "Axes", name: str, point: complex, away: complex) -> None:
    """Mark a point of the scene by a diamond, and name it."""
    add_label(axes, name, point, away, POINT, 8.5)
    look = {**RING_MARK, "mec": POINT}
    plot_points(axes, point, "D", ms=4.5, mew=1.2, zorder=8, **look)


def draw_mass_centre(
    axes: "Axes", bar: int, point: complex, away: complex, colour: str
) -> None:
    """Draw the quartered circle that marks a mass centre, and name it."""
    from matplotlib.path import Path

    quarters: Any = Path.make_compound_path(Path.wedge(0, 90), Path.wedge(180, 270))
    plot_points(axes, point, "o", ms=7.0, zorder=7, mew=0.8, **RING_MARK)
    plot_points(axes, point, marker=quarters, ms=7.0, zorder=7, mec="none", mfc=INK)
    add_label(axes, f"$G_{bar}$", point, away, colour)


def draw_support(axes: "Axes", pin: complex, size: float) -> None:
    """Draw the hatched support under a fixed pin."""
    from matplotlib.patches import Polygon, Rectangle

    wide = 1.7 * size
    foot = pin - 1j * wide
    corners = split_points([pin, foot - size, foot + size])
    axes.add_patch(Polygon(corners, fc="white", ec=INK, lw=1.0, zorder=3))
    place = split_complex(foot - wide - 0.8j * size)
    ground = Rectangle(place, 2.0 * wide, 0.8 * size, fc="none", ec=INK, lw=0.0)
    ground.set(hatch="//////", zorder=2)
    axes.add_patch(ground)
    plot_points(axes, [foot - wide, foot + wide], color=INK, lw=1.0, zorder=3)


def _write_bar_name(view: View, bar: int) -> str:
    """Write the number of a bar, with its length where dimensions are wanted."""
    if not view.dimensions:
        return str(bar)
    length = view.scene.linkage.lengths[bar - 1]
    return f"{bar}: {write_labelled_quantity(length, 'm', view.units)}"


def draw_linkage(axes: "Axes", view: View, *, moving: bool = False) -> None:
    """Draw the linkage at the drawn position, over the paths of its points.

    `moving`: with velocities.
    """
    draw_frame(axes, view)
    if not moving:  # stroke and straightness of paths, as rectangles about them
        factor = view.plane.factor
        for measured in measure_paths(view.sweep).values():
            corners = join_points(measured.corners)
            outline = factor * np.append(corners, corners[0])
            plot_points(axes, outline, color=POINT, lw=0.6, zorder=2)
    if view.dimensions:
        pins = Pose(view, view.here, 0).pins
        middle = 0.5 * (pins["O2"] + pins["O4"])
        add_label(
            axes, _write_bar_name(view, 1), middle, middle - pins["B"], MUTED, 9.0
        )
    draw_mechanism(axes, view, view.here, 0, moving=moving)
    label_plane(axes, view, f"Linkage at {view.at}, {view.branch_name} branch")
    place_legend(axes, 3)


def draw_frame(axes: "Axes", view: View) -> None:
    """Draw what does not move: paths of points, ground line and supports."""
    _draw_paths(axes, view)
    pose = Pose(view, view.here, 0)
    ends = pose.pins["O2"], pose.pins["O4"]
    plot_points(axes, ends, **GROUND_LINE)
    for pin in ends:
        draw_support(axes, pin, pose.plane.size)


def _draw_path(axes: "Axes", view: View, path: Array, **look: Any) -> None:
    """Draw the path of a point, (n, 2), m from O2."""
    look = {"lw": 1.0, "zorder": 2} | look
    plot_points(axes, view.plane.place(join_points(path)), **look)


def _draw_paths(axes: "Axes", view: View) -> None:
    """Draw paths of A, B, mass centres and the scene's points.

    The mid-point of a massless coupler stands for its mass centre.
    """
    sweep = view.trace()
    bars = view.scene.linkage
    centre = 0.5 * (sweep.A + sweep.B)
    name = "coupler curve of its mid-point"
    if bars.coupler.mass > 0.0:
        centre = sweep.G3
        name = "coupler curve of $G_3$"
    paths: list[Any] = [
        (sweep.A, BAR_COLOURS[2], (1, 2), "path of $A$"),
        (sweep.B, BAR_COLOURS[4], (3, 2), "path of $B$"),
        (centre, BAR_COLOURS[3], (4, 1.5), name),
    ]
    for bar, centre in ((2, sweep.G2), (4, sweep.G4)):
        if bars.bar(bar).mass > 0.0:
            name = f"path of $G_{bar}$"
            paths.append((centre, BAR_COLOURS[bar], (6, 2, 1, 2), name))
    for name, points in sweep.points.items():
        paths.append((points, POINT, (3, 1, 1, 1), f"path of {name}"))
    for path, colour, dashes, name in paths:
        _draw_path(axes, view, path, color=colour, ls=(0, dashes), label=name)


_COUPLER_LOOKS: tuple[tuple[str, Any], ...] = (
    ("#0072B2", "-"),
    ("#56A0C8", "-"),
    ("#D55E00", "-"),
    ("#5FA48B", "-"),
    ("#007A5A", "-"),
    ("#8A3B78", (0, (5, 1.5))),
    ("#8A3B78", (0, (1.4, 1.4))),
)
"""Colours and dashes, one after the other."""


def draw_coupler_curves(axes: "Axes", view: View) -> None:
    """Draw the paths of the scene's points of the coupler.

    If it has none, they are of points along its line and off it.
    """
    names = [point.name for point in view.scene.points if point.bar == 3]
    _draw_coupler_paths(axes, view, names)
    faint: dict[str, Any] = {"color": MUTED, "alpha": 0.55, "zorder": 2}
    pins = Pose(view, view.here, 0).pins
    A, B = pins["A"], pins["B"]
    for bar in MOVING_BARS:
        draw_bar(axes, bar, [pins[pin] for pin in ENDS[bar]], lw=2.5, **faint)
    for name in names:
        at = view.plane.place(complex(*view.here.points[name][0]))
        plot_points(axes, [A, at, B], lw=0.8, ls=":", **faint)
        _mark_point(axes, name, at, at - A)
    draw_pins(axes, pins, 0.5 * (A + B))
    title = f"Coupler curves, {view.branch_name} branch"
    heading = "point along AB (and off it), in lengths of the coupler"
    if view.goes_round:
        title = "Coupler curves of the circuit"
    if names:
        heading = "point of the coupler"
    label_plane(axes, view, title)
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
        ncols=4,
        title=heading,
        title_fontsize=7.5,
    )
    view.notes.append(f"The linkage is drawn at {view.at}.")


def _draw_coupler_paths(axes: "Axes", view: View, names: list[str]) -> None:
    """Draw the paths of points of the coupler, or of some along it and off it."""
    sweep = view.trace()
    along = sweep.B - sweep.A
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    paths = {"$A$": sweep.A}
    if names:
        paths |= {"$B$": sweep.B} | {name: sweep.points[name] for name in names}
    else:
        for share in (0.25, 0.5, 0.75):
            paths[str(share)] = sweep.A + share * along
        middle = sweep.A + 0.5 * along
        paths["$B$"] = sweep.B
        paths["0.5, +0.5"] = middle + 0.5 * across
        paths["0.5, −0.5"] = middle - 0.5 * across
    looks = cycle(_COUPLER_LOOKS)
    for (name, path), (colour, dashes) in zip(paths.items(), looks, strict=False):
        width = 1.8 if name in (*names, "0.5") else 1.1
        _draw_path(axes, view, path, color=colour, ls=dashes, label=name, lw=width)


FARTHEST_CENTRE = 1.5
"""Instant centres are drawn up to this multiple of the linkage's size from it."""


def draw_centres(axes: "Axes", view: View) -> None:
    """Draw the paths of the instant centres I13 and I24 near the linkage."""
    reach = FARTHEST_CENTRE * max(view.scene.linkage.lengths)
    marked: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 4.5, "zorder": 6}
    for name, colour, dashes in (("I13", POINT, "-"), ("I24", INK, (0, (4, 1.5)))):
        line = {"ls": dashes, "lw": 1.2, "label": f"$I_{{{name[1:]}}}$"}
        for solution, look in ((view.sweep, line), (view.here, marked)):
            path = derive(solution, name) - view.scene.origin
            is_near = np.hypot(*path.T) <= reach
            near = np.where(is_near[:, None], path, np.nan)
            _draw_path(axes, view, near, color=colour, **look)
    draw_mechanism(axes, view, view.here, 0)
    axes.grid(color=MUTED, alpha=0.2)
    label_plane(axes, view, f"Instant centres at {view.at}")
    place_legend(axes)
    view.note(
        f"Centres further than {FARTHEST_CENTRE:g} longest bars from O2 are left out.",
    )
