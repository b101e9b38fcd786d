"""Curves over what is commanded or over time.

Angles and rates, points, torque, energy and transmission angle are drawn.
"""

import math
import re
from functools import partial
from itertools import cycle
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import Case, compute_shown_state
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import find_signs
from fourbar.show.derived import derive
from fourbar.show.driving import read_drive_demand
from fourbar.show.duty import compute_energies
from fourbar.show.plot.style import (
    BAR_COLOURS,
    FAINT,
    FORCE_COLOURS,
    FORCE_DASHES,
    INK,
    MUTED,
    RING_MARK,
    choose_bar_line,
    choose_force_line,
    draw_zero_line,
    find_peak_index,
    largest_magnitude,
    place_legend,
    set_degree_ticks,
    write_labelled_quantity,
    write_number,
)
from fourbar.show.plot.view import View, collect_point_vectors
from fourbar.show.shown_units import choose_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ORDINARY_PERCENTILE = 95.0
"""Percentile of the magnitudes that counts as the ordinary size of a curve ..."""
OUTLIER = 3.0
"""... and the multiple of it that a curve must exceed to be clipped."""
CLIPPED = 1.6
"""A clipped axis ends at this multiple of the ordinary size."""
_Indices = NDArray[np.intp]
_SUBSCRIPTS = {2: "₂", 3: "₃", 4: "₄"}
_BINDING = re.compile(r" (?==)|(?<==) |(?<=[\d]) (?=[A-Za-zµ])|(?<=N) (?=m\b)")
_POLE_REASON = {2: "bars 3 and 4 collinear", 3: "ω₃ = 0", 4: "ω₄ = 0"}


def draw_axes(axes: "Axes", view: View) -> Array:
    """Draw the axis of the command or of time.

    Positions that do not assemble are shaded; the drawn position is marked.

    Returns what the curves are drawn over.
    """
    axis = view.axis
    over = axis.values
    here = axis.factor * float(view.here.at.places[0])
    axes.set_xlabel(f"{axis.label} ({axis.unit.strip()})")
    low = float(over[0])
    high = float(over[-1])
    if high == low:
        low = low - 1.0
        high = high + 1.0
    axes.set_xlim(low, high)
    if axis.unit == "°":
        set_degree_ticks(axes.xaxis, high - low)
    edges = np.flatnonzero(np.diff([False, *~view.sweep.assembled, False]))
    between = np.array([low, *0.5 * (over[:-1] + over[1:]), high])
    look: dict[str, Any] = {"fc": "#f1f1f1", "ec": FAINT, "hatch": "////", "lw": 0.0}
    for start, stop in between[edges].reshape(-1, 2):
        axes.axvspan(start, stop, zorder=0, **look)
    if edges.size:
        note(view, "Hatched: the linkage does not assemble.")
    if low < here < high:
        axes.axvline(here, color=MUTED, lw=0.8, ls=(0, (2, 2)), zorder=1)
        note(view, f"Dashed upright line: {view.at}.")
    return over


def note(view: View, text: str) -> None:
    """Add a note to the caption, once; its numbers stay on one line with units."""
    text = _BINDING.sub("\u00a0", text)
    if text not in view.notes:
        view.notes.append(text)


def find_poles(view: View) -> _Indices:
    """Find where the determinant of the drive changes sign.

    An index i stands for positions i and i + 1.
    """
    sweep = view.sweep
    if view.scene.motion.free is not None:  # no drive, no pole
        return np.array([], dtype=np.intp)
    if view.scene.drive is not None:
        case = Case.of(view.scene, sweep.at.bar)
        state = compute_shown_state(view.scene, sweep.at)
        assert case.drive is not None
        with np.errstate(all="ignore"):
            sine, _ = case.drive.leverage(state, case.sines(state.position))
    else:
        others = [bar for bar in MOVING_BARS if bar != view.scene.drive_bar]
        first, second = (getattr(sweep, f"theta_{bar}") for bar in others)
        sine = np.sin(second - first)
    return np.flatnonzero(sine[:-1] * sine[1:] <= 0.0)


def break_at_poles(values: Array, poles: _Indices) -> Array:
    """Copy a curve's values with NaN at the positions next to a pole.

    No line then crosses the pole.
    """
    return np.insert(np.where(np.isfinite(values), values, np.nan), poles + 1, np.nan)


def plot_between_poles(
    axes: "Axes",
    over: Array,
    values: Array,
    poles: _Indices,
    **look: Any,
) -> None:
    """Plot a curve that no line takes across a pole."""
    axes.plot(break_at_poles(over, poles), break_at_poles(values, poles), **look)


def choose_limit(values: list[Array]) -> float | None:
    """Choose the end of a clipped axis; None if no value stands far out."""
    sizes = np.abs(np.concatenate(values))
    sizes = sizes[np.isfinite(sizes)]
    ordinary = float(np.percentile(sizes, ORDINARY_PERCENTILE)) if sizes.size else 0.0
    if sizes.max(initial=0.0) > OUTLIER * ordinary > 0.0:
        return CLIPPED * ordinary
    return None


def choose_scale(
    values: list[Array], unit: str, view: View
) -> tuple[float | None, float, str]:
    """Choose the end of a clipped axis, the factor to its unit, and the unit."""
    limit = choose_limit(values)
    return limit, *choose_unit(limit or largest_magnitude(*values), unit, view.units)


def clip(
    axes: "Axes",
    view: View,
    curves: dict[str, Array],
    limit: float | None,
    what: str,
    unit: str,
) -> None:
    """End the axis short of what diverges, and say so; `unit` is that of SI."""
    if limit is None:
        return
    factor, name_of_unit = choose_unit(limit, unit, view.units)
    lowest = min(float(np.nanmin(value)) for value in curves.values())
    axes.set_ylim(0.0 if lowest >= 0.0 else -limit * factor, limit * factor)
    name = max(curves, key=lambda name: largest_magnitude(curves[name]))
    worst = curves[name]
    index = find_peak_index(worst)
    if abs(worst[index]) <= limit:
        return
    words = view.axis.words(view.sweep.at.places[index], 5)
    if view.time is not None:
        words = f"t = {view.time[index]:.4g} s"
    edge = f"{write_number(limit * factor)} {name_of_unit}"
    largest = write_labelled_quantity(worst[index], unit, view.units)
    if unit == "1":
        edge = edge.removesuffix(" 1")
        largest = largest.removesuffix(" 1")
    note(
        view,
        f"{what} clipped at {edge}; the largest evaluated, {name} = {largest}, is at"
        f" {words}.",
    )


def draw_angles(axes: "Axes", view: View) -> None:
    """Draw the angles of the bars that are not the axis."""
    over = draw_axes(axes, view)
    commanded = view.sweep.commanded if view.time is None else ""
    bars = [bar for bar in MOVING_BARS if f"theta_{bar}" != commanded]
    shown = np.degrees([getattr(view.sweep, f"theta_{bar}") for bar in bars])
    for bar, values in zip(bars, shown, strict=True):
        axes.plot(over, values, label=rf"$\theta_{bar}$", **choose_bar_line(bar))
    span = float(np.nanmax(shown) - np.nanmin(shown))
    set_degree_ticks(axes.yaxis, 1.3 * span + 1e-9)
    symbol = r"\theta"
    named = "the bars"
    if len(bars) < 3:
        symbol = ",\\ ".join(rf"\theta_{bar}" for bar in bars)
        named = " and ".join(BAR_NAMES[bar] for bar in bars)
    axes.set(ylabel=f"${symbol}$ (°)", title=f"Angles of {named}")
    place_legend(axes)


def _draw_rates(
    axes: "Axes",
    view: View,
    letter: str,
    unit: str,
    title: str,
    what: str,
) -> None:
    """Draw the rates of the bars; those of the commanded bar are left out if zero."""
    over = draw_axes(axes, view)
    driven = view.sweep.at.bar
    name = {"omega": "ω", "alpha": "α"}[letter]
    factor, shown_unit = choose_unit(0.0, unit, view.units)
    curves = {}
    for bar in sorted(MOVING_BARS, key=lambda bar: bar != driven):
        values = getattr(view.sweep, f"{letter}_{bar}")
        look = choose_bar_line(bar)
        if bar == driven:
            look |= {"ls": "-", "lw": 1.0}
        else:
            curves[f"{name}{_SUBSCRIPTS[bar]}"] = values
        if bar != driven or np.any(values):
            axes.plot(over, factor * values, label=rf"$\{letter}_{bar}$", **look)
    draw_zero_line(axes)
    axes.set(ylabel=rf"$\{letter}$ ({shown_unit})", title=title)
    clip(axes, view, curves, choose_limit([*curves.values()]), what, unit)
    place_legend(axes)


draw_velocities = partial(
    _draw_rates,
    letter="omega",
    unit="rad/s",
    title="Angular velocities",
    what="Angular velocity",
)
draw_accelerations = partial(
    _draw_rates,
    letter="alpha",
    unit="rad/s^2",
    title="Angular accelerations",
    what="Angular acceleration",
)


def _draw_point_sizes(
    axes: "Axes",
    view: View,
    letter: str,
    unit: str,
    title: str,
) -> None:
    """Draw the sizes at A, B, the mass centres and the scene's own points."""
    over = draw_axes(axes, view)
    vectors = collect_point_vectors(view.scene, view.sweep, letter)
    curves = {name: np.hypot(*vector.T) for name, vector in vectors.items()}
    limit, factor, shown_unit = choose_scale([*curves.values()], unit, view)
    colours = {"A": BAR_COLOURS[2], "B": BAR_COLOURS[4]}
    colours |= {f"G{bar}": BAR_COLOURS[bar] for bar in MOVING_BARS}
    all_dashes = cycle(("-", "--", "-.", ":"))
    for (name, values), dashes in zip(curves.items(), all_dashes, strict=False):
        look: dict[str, Any] = {
            "color": colours.get(name, FORCE_COLOURS["F43"]),
            "ls": ":" if name[0] == "G" else dashes,
            "lw": 2.0 if name in view.sweep.points else 1.2,
        }
        axes.plot(over, factor * values, label=name, **look)
    axes.set_ylim(bottom=0.0)
    axes.set(ylabel=f"$|{letter}|$ ({shown_unit})", title=title)
    clip(axes, view, curves, limit, title, unit)
    place_legend(axes, 6)


draw_speeds = partial(
    _draw_point_sizes,
    letter="v",
    unit="m/s",
    title="Speeds of points",
)
draw_point_accelerations = partial(
    _draw_point_sizes,
    letter="a",
    unit="m/s^2",
    title="Accelerations of points",
)


def _draw_drive(
    axes: "Axes",
    view: View,
    name: str,
    letter: str,
    unit: str,
    what: str,
) -> None:
    """Draw a quantity of the drive, with its poles."""
    over = draw_axes(axes, view)
    bar = view.scene.drive_bar
    poles = find_poles(view)
    values = getattr(view.sweep, name)
    limit, factor, shown_unit = choose_scale([values], unit, view)
    symbol = f"${letter}$"
    curve_name = letter
    on_bar = ""
    poles_of = "drive's force (its line has no lever)"
    if bar:
        symbol = f"${letter}_{bar}$"
        curve_name = f"{letter}{_SUBSCRIPTS[bar]}"
        on_bar = f" on bar {bar}"
        poles_of = f"torque{on_bar} ({_POLE_REASON[bar]})"
    plot_between_poles(axes, over, factor * values, poles, color=INK, label=symbol)
    for index in poles:
        middle = 0.5 * float(over[index] + over[index + 1])
        axes.axvline(middle, color=MUTED, lw=0.9, ls=(0, (1, 1.5)))
    if poles.size:
        note(view, f"Dotted: poles of the {poles_of}.")
    draw_zero_line(axes)
    title = f"{what} of the drive{on_bar}"
    axes.set(ylabel=f"{symbol} ({shown_unit})", title=title)
    if limit is None:  # a clipped axis says its largest value in the caption
        mark_peak(axes, over, factor * values, shown_unit)
    clip(axes, view, {curve_name: values}, limit, what, unit)


def mark_peak(axes: "Axes", over: Array, values: Array, unit: str) -> None:
    """Mark the largest magnitude of a curve by a ring with its value."""
    if not np.isfinite(values).any():
        return
    index = find_peak_index(values)
    place = float(over[index])
    peak = float(values[index])
    axes.plot(place, peak, "o", ms=5.0, mew=1.1, ls="none", zorder=5, **RING_MARK)
    low, high = axes.get_xlim()
    quarter = (place - low) / (high - low) * 4.0
    side = "left" if quarter < 1.0 else "right" if quarter > 3.0 else "center"
    axes.margins(y=0.18)  # room for the words
    above = peak >= 0.0
    axes.annotate(
        f"{write_number(peak)} {unit}",
        (place, peak),
        xytext=(0.0, 5.0 if above else -5.0),
        textcoords="offset points",
        ha=side,
        va="bottom" if above else "top",
        size=7.5,
    )


def draw_drive(axes: "Axes", view: View) -> None:
    """Draw the torque or force of the drive."""
    drive = read_drive_demand(view.sweep)
    what = "Torque" if view.scene.drive is None else "Force"
    _draw_drive(axes, view, drive.keys.value, drive.symbol[0], drive.unit, what)


draw_power = partial(_draw_drive, name="power", letter="P", unit="W", what="Power")


def draw_stroke(axes: "Axes", view: View) -> None:
    """Draw the stroke of a linear drive."""
    over = draw_axes(axes, view)
    factor, unit = choose_unit(max(view.scene.linkage.lengths), "m", view.units)
    axes.plot(over, factor * view.sweep.stroke, color=INK)
    axes.set(ylabel=f"stroke ({unit})", title="Stroke of the drive")


def draw_forces(axes: "Axes", view: View) -> None:
    """Draw the magnitudes of the four pin forces."""
    over = draw_axes(axes, view)
    sizes = {name: np.hypot(*getattr(view.sweep, name).T) for name in FORCE_COLOURS}
    limit, factor, unit = choose_scale([*sizes.values()], "N", view)
    poles = find_poles(view)
    for name, values in sizes.items():
        look = choose_force_line(name)
        plot_between_poles(axes, over, factor * values, poles, **look)
    axes.set_ylim(bottom=0.0)
    axes.set(ylabel=f"$|F|$ ({unit})", title="Pin forces")
    clip(axes, view, sizes, limit, "Pin forces", "N")
    place_legend(axes)


def draw_energy(axes: "Axes", view: View) -> None:
    """Draw the kinetic energy of a free motion, and the work that made it."""
    over = draw_axes(axes, view)
    energies = compute_energies(view.scene, view.sweep)
    most = largest_magnitude(energies.kinetic, *energies.work.values())
    factor, unit = choose_unit(most, "J", view.units)
    axes.plot(over, factor * energies.kinetic, color=INK, lw=2.2, label="kinetic")
    for number, (name, values) in enumerate(energies.work.items()):
        # after all colours with their dashes, the colours with the next ones
        turn, column = divmod(number, len(PIN_FORCES))
        dashes = PIN_FORCES[(column + turn) % len(PIN_FORCES)]
        look: dict[str, Any] = {
            "color": FORCE_COLOURS[PIN_FORCES[column]],
            "ls": FORCE_DASHES[dashes],
        }
        axes.plot(over, factor * values, label=name.replace("_", " "), **look)
    draw_zero_line(axes)
    axes.set(ylabel=f"energy ({unit})", title="Kinetic energy and work")
    place_legend(axes, 3)
    note(
        view,
        "The kinetic energy has grown by the work that loads and effects have done"
        " since the release.",
    )


_RECOMMENDED = 40.0
"""Smallest transmission angle that is usually recommended, deg.

Source: R. L. Norton, Design of Machinery; H. Alt introduced the angle (1932).
"""
_REMARK = 0.34
"""Part that a remark takes along an axis, as a part of its length."""


def draw_transmission(axes: "Axes", view: View) -> None:
    """Draw the acute angle between coupler and output.

    Limit and dead-centre positions are marked.
    """
    over = draw_axes(axes, view)
    mu = np.degrees(derive(view.sweep, "transmission"))
    axes.plot(over, mu, color=INK)
    axes.axhline(_RECOMMENDED, color=MUTED, lw=0.9, ls=(0, (4, 2)))
    place = find_free_place(mu)
    corner = (over[0] + place * (over[-1] - over[0]), _RECOMMENDED)
    look: dict[str, Any] = {
        "textcoords": "offset points",
        "ha": "center",
        "size": 7.0,
        "color": MUTED,
    }
    axes.annotate(f"{_RECOMMENDED:g}° recommended", corner, xytext=(0, 2), **look)
    axes.set(ylim=(0.0, 96.0), yticks=range(0, 91, 15))
    ring: dict[str, Any] = {"ms": 6.0, "mew": 1.1, "clip_on": False, **RING_MARK}
    for theta, height, marker, name in _list_marked(view):
        axes.plot(theta, height, marker, ls="none", label=name, zorder=5, **ring)
    axes.set(ylabel=r"transmission angle $\mu$ (°)", title="Transmission angle")
    if view.time is None:
        place_legend(axes, 1)


def find_free_place(mu: Array) -> float:
    """Return where the curve is furthest from a remark, as a part of the axis's length.

    The remark stands at 40 deg.
    """
    half = _REMARK / 2.0
    # the remark stands on the line of the recommended angle
    distances = np.abs(mu - _RECOMMENDED - 3.0)
    best = (-1.0, 1.0 - half)
    for place in np.linspace(1.0 - half, half, 25).tolist():
        first = int((place - half) * len(mu))
        last = max(1, math.ceil((place + half) * len(mu)))
        beside = distances[first:last]
        if np.isfinite(beside).any():
            best = max(best, (float(np.nanmin(beside)), place), key=itemgetter(0))
    return best[1]


def _list_marked(view: View) -> list[tuple[list[float], list[float], str, str]]:
    """List limits of the commanded bar and dead centres, on the axis.

    An entry has place, mu (degrees), mark and name.
    """
    if view.time is not None:
        return []
    positions = view.sweep.at
    linkage = view.scene.linkage
    degrees = np.degrees(positions.angle)
    order = np.argsort(degrees)
    margin = 0.0
    if len(degrees) > 1:
        margin = 1.5 * float(np.median(np.abs(np.diff(degrees))))
    one, follower = (bar for bar in MOVING_BARS if bar != positions.bar)
    signs = find_signs(linkage, positions.angle, positions.branch, positions.bar)

    marked = list[tuple[list[float], list[float], str, str]]()
    for bar in sorted({2, 4, positions.bar}, key=lambda bar: bar != positions.bar):
        is_commanded = bar == positions.bar
        places = list[float]()
        heights = list[float]()
        for limit in limit_positions(linkage, bar):
            theta = dict(zip(MOVING_BARS, limit[:3], strict=True))
            sign = math.copysign(1.0, math.sin(theta[follower] - theta[one]))
            difference = theta[4] - theta[3]
            mu = math.atan2(abs(math.sin(difference)), abs(math.cos(difference)))
            angle = theta[positions.bar]
            for place in _list_inside(degrees, angle, margin if is_commanded else 0.0):
                nearest = np.argmin(np.abs(degrees - place))
                if is_commanded or signs[nearest] == sign:
                    places.append(place)
                    heights.append(math.degrees(mu))
        # over a stroke its bar's angle rises or falls throughout
        if positions.moves_stroke:
            places = np.interp(places, degrees[order], view.axis.values[order]).tolist()
        if not places:
            continue
        pair = ", ".join(str(number) for number in MOVING_BARS if number != bar)
        mark, word = ("s", "limit") if is_commanded else ("D", "dead centre")
        marked.append((places, heights, mark, f"{word}: bars {pair} in line"))
    return marked


def _list_inside(angles: Array, angle: float, margin: float) -> list[float]:
    """List an angle (rad) and its full turns that lie in the sweep, degrees."""
    low = float(angles.min()) - margin
    high = float(angles.max()) + margin
    start = math.degrees(angle)
    first = math.ceil((low - start) / 360.0)
    last = math.floor((high - start) / 360.0)
    return [start + 360.0 * turn for turn in range(first, last + 1)]
