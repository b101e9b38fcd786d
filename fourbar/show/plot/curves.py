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
from fourbar.show.columns import read_column
from fourbar.show.derived import list_point_names
from fourbar.show.driving import leaves_range, read_drive_demand
from fourbar.show.duty import compute_energies
from fourbar.show.plot.labels import add_label
from fourbar.show.plot.style import (
    BAR_COLOURS,
    BAR_DASHES,
    BAR_LINES,
    FAINT,
    FORCE_COLOURS,
    FORCE_LINES,
    INK,
    MUTED,
    RING_MARK,
    choose_scale,
    find_peak_index,
    largest_magnitude,
    place_legend,
    plot_points,
    set_degree_ticks,
    write_force_name,
    write_labelled_quantity,
    write_plain,
)
from fourbar.show.plot.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_DEGREES = {"rad": ("°", math.degrees(1.0))}
Looks = dict[str, tuple[str, dict[str, Any]]]
"""Columns and the looks of their curves, by the label."""
ORDINARY_PERCENTILE = 95.0
"""Percentile of the magnitudes that counts as the ordinary size of a curve ..."""
OUTLIER = 3.0
"""... and the multiple of it that a curve must exceed to be clipped."""
CLIPPED = 1.6
"""A clipped axis ends at this multiple of the ordinary size."""


class Chart(NamedTuple):
    """Curves of one SI unit in axes that end short of what diverges."""

    title: str
    symbol: str
    """Symbol at the upright axis."""
    unit: str
    curves: dict[str, tuple[Array, dict[str, Any]]]
    """Values at the positions of the sweep, (n,), SI, and look, by the label, or by the
    name of a column whose look has the label.
    """
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
    sizes = [values for values, _ in chart.curves.values()]
    limit = choose_limit(sizes) if chart.zero else None
    units = {**view.units, **_DEGREES}
    factor, unit = choose_scale(limit or largest_magnitude(*sizes), chart.unit, units)
    poles = view.axis.factor * np.array(chart.poles)
    rows = np.searchsorted(positions, poles)
    places = np.insert(positions, rows, np.nan)  # no line crosses a pole
    for label, (values, look) in chart.curves.items():
        shown = np.insert(factor * values, rows, np.nan)
        axes.plot(places, shown, **{"label": label} | look)
    for pole in poles:
        axes.axvline(pole, color=MUTED, lw=0.9, ls=(0, (1, 1.5)))
    if len(poles):
        view.note("Dotted: poles.")
    if chart.zero == "end":
        axes.set_ylim(bottom=0.0)
    elif chart.zero:
        axes.axhline(0.0, color=INK, lw=0.6, zorder=1)
    if unit == "°":
        set_degree_ticks(axes.yaxis)
    named = chart.symbol if unit == "1" else f"{chart.symbol} ({unit})"
    axes.set(ylabel=named, title=chart.title)
    if len(sizes) > 1:
        place_legend(axes, 6)
    if limit is not None:
        lowest = min(float(np.nanmin(values)) for values in sizes)
        axes.set_ylim(0.0 if lowest >= 0.0 else -factor * limit, factor * limit)
        _note_largest(view, chart, limit)
    elif chart.has_peak:
        (values,) = sizes[:1]
        peak = values[find_peak_index(values)]
        text = write_labelled_quantity(peak, chart.unit, view.units)
        mark_peak(axes, positions, factor * values, text)


def _note_largest(view: View, chart: Chart, limit: float) -> None:
    """Say where the axis ends, and what lies beyond."""
    label, (values, _) = max(
        chart.curves.items(), key=lambda curve: largest_magnitude(curve[1][0])
    )
    name = write_plain(label) if "$" in label else label
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
    axis.lay_out(axes)
    low, high = axes.get_xlim()
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


def make_chart(title: str, symbol: str, looks: Looks, view: View, **more: Any) -> Chart:
    """Make the chart of columns of one unit.

    Forces have the poles of the drive, and ratios those at which they change their
    sign: it is large on both sides there, and small at a zero.
    """
    curves = {}
    for label, (name, look) in looks.items():
        column = read_column(view.sweep, name)
        curves[label] = column.values, look
    unit = column.unit
    poles = []
    if unit in ("N", "N m", "W"):
        poles = view.poles.get(read_drive_demand(view.sweep).keys.value, [])
    if unit == "1":
        places = view.sweep.at.places
        middles = 0.5 * (places[1:] + places[:-1])
        for values, _ in curves.values():
            least = np.minimum(np.abs(values[1:]), np.abs(values[:-1]))
            changes = (values[1:] * values[:-1] < 0.0) & (least > 1.0)
            poles += middles[changes].tolist()
    return Chart(title, symbol, unit, curves, poles=poles, **more)


def list_angles(view: View) -> Chart:
    """List the angles of the bars that are not the axis."""
    commanded = view.sweep.commanded if view.time is None else ""
    bars = [bar for bar in MOVING_BARS if f"theta_{bar}" != commanded]
    looks = {rf"$\theta_{bar}$": (f"theta_{bar}", BAR_LINES[bar]) for bar in bars}
    named = "the bars"
    symbol = r"$\theta$"
    if len(bars) < 3:
        symbol = ", ".join(looks)
        named = " and ".join(BAR_NAMES[bar] for bar in bars)
    return make_chart(f"Angles of {named}", symbol, looks, view, zero="")


def _list_rates(letter: str, sign: str, title: str, view: View) -> Chart:
    """List the rates of the bars; those of the commanded bar are left out if zero."""
    looks = {}
    for bar in MOVING_BARS:
        name = f"{letter}_{bar}"
        look = BAR_LINES[bar]
        if bar == view.sweep.at.bar:
            look = look | {"ls": "-", "lw": 1.0}
            if not np.any(view.sweep[name]):
                continue
        looks[f"${sign}_{bar}$"] = name, look
    return make_chart(title, f"${sign}$", looks, view)


def _list_point_sizes(letter: str, title: str, view: View) -> Chart:
    """List the sizes at A, B, the mass centres and the scene's own points."""
    colours = {"A": BAR_COLOURS[2], "B": BAR_COLOURS[4]}
    colours |= {f"G{bar}": BAR_COLOURS[bar] for bar in MOVING_BARS}
    looks = {}
    all_dashes = cycle(("-", "--", "-.", ":"))
    for name, dashes in zip(list_point_names(view.scene), all_dashes, strict=False):
        looks[name] = (
            f"{letter}_{name}",
            {
                "color": colours.get(name, FORCE_COLOURS["F43"]),
                "ls": ":" if name[0] == "G" else dashes,
                "lw": 2.0 if name in view.sweep.points else 1.2,
            },
        )
    return make_chart(title, f"$|{letter}|$", looks, view, zero="end")


def _list_drive(name: str, letter: str, what: str, view: View) -> Chart:
    """List a quantity of the drive."""
    bar = view.scene.drive_bar
    symbol = f"${letter}_{bar}$" if bar else f"${letter}$"
    title = f"{what} of the drive" + (f" on bar {bar}" if bar else "")
    looks = {symbol: (name, {"color": INK})}
    return make_chart(title, symbol, looks, view, has_peak=name not in view.poles)


def list_demand(view: View) -> Chart:
    """List the torque or force of the drive, and what moves a linkage at rest."""
    drive = read_drive_demand(view.sweep)
    what = "Torque" if view.scene.drive is None else "Force"
    chart = _list_drive(drive.keys.value, drive.symbol[0], what, view)
    rests = leaves_range(view.sweep)
    if np.any(rests[1:] & rests[:-1]):  # one position alone is no line
        for end, label in zip(drive.keys[2:], ("begins to move", "_"), strict=True):
            look = {"color": MUTED, "ls": "--", "label": label}
            chart.curves[end] = np.where(rests, view.sweep[end], np.nan), look
    return chart


def list_energies(view: View) -> Chart:
    """List the kinetic energy of a free motion, and the work that made it."""
    energies = compute_energies(view.scene, view.sweep)
    curves = {"kinetic": (energies.kinetic, {"color": INK, "lw": 2.2})}
    # the cycles differ in length: twelve curves look different
    looks = zip(cycle(FORCE_COLOURS.values()), cycle(BAR_DASHES.values()), strict=False)
    for (name, values), (colour, dashes) in zip(
        energies.work.items(), looks, strict=False
    ):
        curves[name.replace("_", " ")] = values, {"color": colour, "ls": dashes}
    view.note(
        "The kinetic energy has grown by the work that loads and effects have done"
        " since the release."
    )
    return Chart("Kinetic energy and work", "energy", "J", curves)


_RECOMMENDED = 40.0
"""Smallest transmission angle that is usually recommended, deg.

Source: R. L. Norton, Design of Machinery; H. Alt introduced the angle (1932).
"""


def list_transmission(view: View) -> Chart:
    """List the acute angle between coupler and output, and the least one wanted."""
    looks: Looks = {"transmission angle": ("transmission", {"color": INK})}
    chart = make_chart("Transmission angle", r"$\mu$", looks, view, zero="end")
    least = np.full(len(view.sweep), math.radians(_RECOMMENDED))
    thin = {"color": MUTED, "lw": 0.9, "ls": (0, (4, 2))}
    chart.curves[f"{_RECOMMENDED:g}° recommended"] = least, thin
    return chart


def list_pin_forces(view: View) -> Chart:
    """List the sizes of the pin forces."""
    view.note_rest(view.sweep)
    looks = {write_force_name(name): (name, look) for name, look in FORCE_LINES.items()}
    return make_chart("Pin forces", "$|F|$", looks, view, zero="end")


_SHAKING_LOOKS: Looks = {
    "$|F|$": ("shaking_force", {"color": INK}),
    "$F_x$": ("shaking_force_x", {"color": BAR_COLOURS[2], "ls": (0, (4, 1.5))}),
    "$F_y$": ("shaking_force_y", {"color": BAR_COLOURS[4], "ls": (0, (1, 1))}),
}
_STROKE_LOOKS: Looks = {"stroke": ("stroke", {"color": INK})}
_MOMENT_LOOKS: Looks = {"M": ("shaking_moment", BAR_LINES[2])}
_RATIO_LOOKS: Looks = {
    "ω₃/ω₂": ("omega_3/omega_2", BAR_LINES[3]),
    "ω₄/ω₂": ("omega_4/omega_2", BAR_LINES[4]),
}
_ADVANTAGE_LOOKS: Looks = {"T₄/T₂": ("mechanical_advantage", BAR_LINES[2])}
CHARTS: dict[str, Callable[[View], Chart]] = {
    "angles": list_angles,
    "omega": partial(_list_rates, "omega", "ω", "Angular velocities"),
    "alpha": partial(_list_rates, "alpha", "α", "Angular accelerations"),
    "speeds": partial(_list_point_sizes, "v", "Speeds of points"),
    "accelerations": partial(_list_point_sizes, "a", "Accelerations of points"),
    "drive": list_demand,
    "energy": list_energies,
    "power": partial(_list_drive, "power", "P", "Power"),
    "stroke": partial(
        make_chart, "Stroke of the drive", "stroke", _STROKE_LOOKS, zero=""
    ),
    "forces": list_pin_forces,
    "mu": list_transmission,
    "shaking force": partial(
        make_chart, "Shaking force on the frame", "$F$", _SHAKING_LOOKS
    ),
    "shaking moment": partial(
        make_chart, "Shaking moment about O₂", "$M$", _MOMENT_LOOKS
    ),
    "ratios": partial(make_chart, "Speed ratios", "ratio", _RATIO_LOOKS),
    "advantage": partial(make_chart, "Mechanical advantage", "T₄/T₂", _ADVANTAGE_LOOKS),
}
"""What the charts list, in the order in which their notes are written."""
