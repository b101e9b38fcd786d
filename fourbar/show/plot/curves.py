"""Curves over what is commanded or over time.

Angles and rates, points, torque, energy, transmission angle, shaking force and moment,
and ratios are drawn.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.quantities import Array
from fourbar.show.derived import derive
from fourbar.show.driving import read_drive_demand
from fourbar.show.duty import compute_energies
from fourbar.show.plot.labels import add_label
from fourbar.show.plot.style import (
    BAR_COLOURS,
    BAR_DASHES,
    FAINT,
    FORCE_COLOURS,
    INK,
    MUTED,
    RING_MARK,
    choose_bar_line,
    choose_force_line,
    choose_scale,
    find_peak_index,
    largest_magnitude,
    place_legend,
    plot_points,
    set_degree_ticks,
    write_labelled_quantity,
)
from fourbar.show.plot.view import View, collect_point_vectors

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ORDINARY_PERCENTILE = 95.0
"""Percentile of the magnitudes that counts as the ordinary size of a curve ..."""
OUTLIER = 3.0
"""... and the multiple of it that a curve must exceed to be clipped."""
CLIPPED = 1.6
"""A clipped axis ends at this multiple of the ordinary size."""
_SUBSCRIPTS = {2: "₂", 3: "₃", 4: "₄"}
_DEGREES = {"rad": ("°", math.degrees(1.0))}


class Curve(NamedTuple):
    """A curve of a chart."""

    name: str
    """Name in a note, and in the legend if its look has no other."""
    values: Array
    """Values at the positions of the sweep, (n,), SI."""
    look: dict[str, Any]


class Chart(NamedTuple):
    """Curves of one SI unit in axes that end short of what diverges."""

    title: str
    symbol: str
    """Symbol at the upright axis."""
    unit: str
    curves: list[Curve]
    zero: str = "line"
    """A line at zero, the end of the axis there ("end"), or neither (""); an axis
    without zero is not clipped.
    """
    has_peak: bool = False
    """True if the peak of its one curve is marked unless the axis is clipped."""
    poles: Sequence[float] = ()
    """Places of poles, as of what is commanded or s."""


def draw_chart(axes: "Axes", view: View, list_curves: Callable[[View], Chart]) -> None:
    """Draw a chart of a view over the command or over time."""
    chart = list_curves(view)
    positions = draw_axes(axes, view)
    sizes = [curve.values for curve in chart.curves]
    limit = choose_limit(sizes) if chart.zero else None
    units = {**view.units, **_DEGREES}
    factor, unit = choose_scale(limit or largest_magnitude(*sizes), chart.unit, units)
    poles = view.axis.factor * np.array(chart.poles)
    rows = np.searchsorted(positions, poles)
    places = np.insert(positions, rows, np.nan)  # no line crosses a pole
    for name, values, look in chart.curves:
        finite = np.where(np.isfinite(values), factor * values, np.nan)
        shown = np.insert(finite, rows, np.nan)
        axes.plot(places, shown, **{"label": name} | look)
    for pole in poles:
        axes.axvline(pole, color=MUTED, lw=0.9, ls=(0, (1, 1.5)))
    if chart.poles:
        view.note("Dotted: poles.")
    if chart.zero == "end":
        axes.set_ylim(bottom=0.0)
    elif chart.zero:
        axes.axhline(0.0, color=INK, lw=0.6, zorder=1)
    if unit == "°":
        set_degree_ticks(axes.yaxis, float(np.ptp(axes.get_ylim())))
    named = chart.symbol if unit == "1" else f"{chart.symbol} ({unit})"
    axes.set(ylabel=named, title=chart.title)
    if len(sizes) > 1:
        place_legend(axes, 6)
    if limit is not None:
        lowest = min(float(np.nanmin(values)) for values in sizes)
        axes.set_ylim(0.0 if lowest >= 0.0 else -factor * limit, factor * limit)
        _note_largest(view, chart, limit)
    elif chart.has_peak:
        values = sizes[0]
        peak = values[find_peak_index(values)]
        text = write_labelled_quantity(peak, chart.unit, view.units)
        mark_peak(axes, positions, factor * values, text)


def _note_largest(view: View, chart: Chart, limit: float) -> None:
    """Say where the axis ends, and what lies beyond."""
    name, values, *_ = max(chart.curves, key=lambda one: largest_magnitude(one.values))
    index = find_peak_index(values)
    words = view.axis.words(view.sweep.at.places[index], 5)
    end, largest = (
        write_labelled_quantity(value, chart.unit, view.units).removesuffix(" 1")
        for value in (limit, values[index])
    )
    view.note(
        f"{chart.title} clipped at {end}; the largest evaluated, {name} = {largest},"
        f" is at {words}."
    )


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
    for start, stop in between[edges].reshape(-1, 2):
        axes.axvspan(start, stop, zorder=0, fc="#f1f1f1", ec=FAINT, hatch="////", lw=0)
    if edges.size:
        view.note("Hatched: the linkage does not assemble.")
    if low < here < high:
        axes.axvline(here, color=MUTED, lw=0.8, ls=(0, (2, 2)), zorder=1)
        view.note(f"Dashed upright line: {view.at}.")
    return over


def choose_limit(values: Iterable[Array]) -> float | None:
    """Choose the end of a clipped axis; None if no value stands far out."""
    sizes = np.abs(np.concatenate([*values]))
    sizes = sizes[np.isfinite(sizes)]
    ordinary = float(np.percentile(sizes, ORDINARY_PERCENTILE)) if sizes.size else 0.0
    if sizes.max(initial=0.0) > OUTLIER * ordinary > 0.0:
        return CLIPPED * ordinary
    return None


def mark_peak(axes: "Axes", over: Array, values: Array, text: str) -> None:
    """Mark the largest magnitude of a curve by a ring, with its value as a label."""
    if not np.isfinite(values).any():
        return
    index = find_peak_index(values)
    place = complex(over[index], values[index])
    plot_points(axes, place, "o", ms=5.0, mew=1.1, ls="none", zorder=5, **RING_MARK)
    axes.margins(y=0.18)  # room for the words
    away = math.copysign(1.0, place.imag) * 1j
    add_label(axes, text, place, away, size=7.5)


def list_angles(view: View) -> Chart:
    """List the angles of the bars that are not the axis."""
    commanded = view.sweep.commanded if view.time is None else ""
    bars = [bar for bar in MOVING_BARS if f"theta_{bar}" != commanded]
    curves = []
    for bar in bars:
        values = getattr(view.sweep, f"theta_{bar}")
        curves.append(Curve(rf"$\theta_{bar}$", values, choose_bar_line(bar)))
    named = "the bars"
    symbol = r"$\theta$"
    if len(bars) < 3:
        symbol = ", ".join(curve.name for curve in curves)
        named = " and ".join(BAR_NAMES[bar] for bar in bars)
    return Chart(f"Angles of {named}", symbol, "rad", curves, "")


def _list_rates(view: View, letter: str, sign: str, unit: str, title: str) -> Chart:
    """List the rates of the bars; those of the commanded bar are left out if zero."""
    driven = view.sweep.at.bar
    curves = []
    for bar in MOVING_BARS:
        rate = getattr(view.sweep, f"{letter}_{bar}")
        look = choose_bar_line(bar) | {"label": rf"$\{letter}_{bar}$"}
        if bar == driven:
            look |= {"ls": "-", "lw": 1.0}
        if bar != driven or np.any(rate):
            curves.append(Curve(f"{sign}{_SUBSCRIPTS[bar]}", rate, look))
    return Chart(title, rf"$\{letter}$", unit, curves)


def _list_point_sizes(view: View, letter: str, unit: str, title: str) -> Chart:
    """List the sizes at A, B, the mass centres and the scene's own points."""
    colours = {"A": BAR_COLOURS[2], "B": BAR_COLOURS[4]}
    colours |= {f"G{bar}": BAR_COLOURS[bar] for bar in MOVING_BARS}
    vectors = collect_point_vectors(view.scene, view.sweep, letter)
    curves = []
    all_dashes = cycle(("-", "--", "-.", ":"))
    for (name, vector), dashes in zip(vectors.items(), all_dashes, strict=False):
        look = {
            "color": colours.get(name, FORCE_COLOURS["F43"]),
            "ls": ":" if name[0] == "G" else dashes,
            "lw": 2.0 if name in view.sweep.points else 1.2,
        }
        curves.append(Curve(name, np.hypot(*vector.T), look))
    return Chart(title, f"$|{letter}|$", unit, curves, "end")


def _list_drive(view: View, name: str, letter: str, unit: str, what: str) -> Chart:
    """List a quantity of the drive, with the poles of its torque or force."""
    bar = view.scene.drive_bar
    title = f"{what} of the drive"
    symbol = letter
    if bar:
        title += f" on bar {bar}"
        symbol += f"_{bar}"
    shown = letter + _SUBSCRIPTS.get(bar, "")
    curves = [Curve(shown, getattr(view.sweep, name), {"color": INK})]
    has_peak = name not in view.poles
    poles = _list_poles(view)
    return Chart(title, f"${symbol}$", unit, curves, poles=poles, has_peak=has_peak)


def _list_poles(view: View) -> list[float]:
    """List the poles of the drive's torque or force, and so of the pin forces."""
    return view.poles.get(read_drive_demand(view.sweep).keys.value, [])


def list_demand(view: View) -> Chart:
    """List the torque or force of the drive."""
    drive = read_drive_demand(view.sweep)
    what = "Torque" if view.scene.drive is None else "Force"
    chart = _list_drive(view, drive.keys.value, drive.symbol[0], drive.unit, what)
    for end, label in zip(drive.keys[2:], ("begins to move", "_"), strict=True):
        held = getattr(view.sweep, end)
        if held is None:
            break
        apart = np.abs(held - drive.values) > 0.0
        if np.any(apart[1:] & apart[:-1]):  # one position alone is no line
            look = {"color": MUTED, "ls": "--", "label": label}
            chart.curves.append(Curve(end, np.where(apart, held, np.nan), look))
    return chart


def list_stroke(view: View) -> Chart:
    """List the stroke of a linear drive."""
    curves = [Curve("stroke", view.sweep["stroke"], {"color": INK})]
    return Chart("Stroke of the drive", "stroke", "m", curves, "")


def list_forces(view: View) -> Chart:
    """List the magnitudes of the four pin forces."""
    curves = []
    for name in FORCE_COLOURS:
        size = np.hypot(*getattr(view.sweep, name).T)
        curves.append(Curve(name, size, choose_force_line(name)))
    return Chart("Pin forces", "$|F|$", "N", curves, "end", poles=_list_poles(view))


def list_energies(view: View) -> Chart:
    """List the kinetic energy of a free motion, and the work that made it."""
    energies = compute_energies(view.scene, view.sweep)
    curves = [Curve("kinetic", energies.kinetic, {"color": INK, "lw": 2.2})]
    # the cycles differ in length: twelve curves look different
    looks = zip(cycle(FORCE_COLOURS.values()), cycle(BAR_DASHES.values()), strict=False)
    for (name, values), (colour, dashes) in zip(
        energies.work.items(), looks, strict=False
    ):
        look = {"color": colour, "ls": dashes}
        curves.append(Curve(name.replace("_", " "), values, look))
    view.note(
        "The kinetic energy has grown by the work that loads and effects have done"
        " since the release."
    )
    return Chart("Kinetic energy and work", "energy", "J", curves)


def list_shaking_force(view: View) -> Chart:
    """List the size of the force on the frame, and its components."""
    x, y = derive(view.sweep, "shaking_force").T
    curves = [
        Curve("$|F|$", np.hypot(x, y), {"color": INK}),
        Curve("$F_x$", x, {"color": BAR_COLOURS[2], "ls": (0, (4, 1.5))}),
        Curve("$F_y$", y, {"color": BAR_COLOURS[4], "ls": (0, (1, 1))}),
    ]
    title = "Shaking force on the frame"
    return Chart(title, "$F$", "N", curves, poles=_list_poles(view))


def _list_derived(
    view: View, names: dict[int, tuple[str, str]], unit: str, symbol: str, title: str
) -> Chart:
    """List derived quantities, by the bars in whose colours they are drawn."""
    curves = []
    poles = [] if unit == "1" else _list_poles(view)
    for bar, (name, quantity) in names.items():
        values = derive(view.sweep, quantity)
        curves.append(Curve(name, values, choose_bar_line(bar)))
        if unit == "1":
            # a ratio changes its sign at a pole, where it is large, or at zero
            least = np.minimum(np.abs(values[1:]), np.abs(values[:-1]))
            changes = (values[1:] * values[:-1] < 0.0) & (least > 1.0)
            places = view.sweep.at.places
            poles += (0.5 * (places[1:] + places[:-1]))[changes].tolist()
    return Chart(title, symbol, unit, curves, poles=poles)


_RECOMMENDED = 40.0
"""Smallest transmission angle that is usually recommended, deg.

Source: R. L. Norton, Design of Machinery; H. Alt introduced the angle (1932).
"""


def list_transmission(view: View) -> Chart:
    """List the acute angle between coupler and output, and the least one wanted."""
    mu = derive(view.sweep, "transmission")
    least = np.full(len(mu), math.radians(_RECOMMENDED))
    thin = {"color": MUTED, "lw": 0.9, "ls": (0, (4, 2))}
    curves = [
        Curve("transmission angle", mu, {"color": INK}),
        Curve(f"{_RECOMMENDED:g}° recommended", least, thin),
    ]
    return Chart("Transmission angle", r"$\mu$", "rad", curves, "end")


CHARTS: dict[str, Callable[[View], Chart]] = {
    "angles": list_angles,
    "omega": partial(
        _list_rates,
        letter="omega",
        sign="ω",
        unit="rad/s",
        title="Angular velocities",
    ),
    "alpha": partial(
        _list_rates,
        letter="alpha",
        sign="α",
        unit="rad/s^2",
        title="Angular accelerations",
    ),
    "speeds": partial(
        _list_point_sizes, letter="v", unit="m/s", title="Speeds of points"
    ),
    "accelerations": partial(
        _list_point_sizes, letter="a", unit="m/s^2", title="Accelerations of points"
    ),
    "drive": list_demand,
    "energy": list_energies,
    "power": partial(_list_drive, name="power", letter="P", unit="W", what="Power"),
    "stroke": list_stroke,
    "forces": list_forces,
    "mu": list_transmission,
    "shaking force": list_shaking_force,
    "shaking moment": partial(
        _list_derived,
        names={2: ("M", "shaking_moment")},
        unit="N m",
        symbol="$M$",
        title="Shaking moment about O₂",
    ),
    "ratios": partial(
        _list_derived,
        names={3: ("ω₃/ω₂", "omega_3/omega_2"), 4: ("ω₄/ω₂", "omega_4/omega_2")},
        unit="1",
        symbol="ratio",
        title="Speed ratios",
    ),
    "advantage": partial(
        _list_derived,
        names={2: ("T₄/T₂", "mechanical_advantage")},
        unit="1",
        symbol="T₄/T₂",
        title="Mechanical advantage",
    ),
}
"""What the charts list, in the order in which their notes are written."""
