"""Curves over what is commanded or over time.

Angles and rates, points, torque, energy, transmission angle, shaking force and moment,
and ratios are drawn.
"""

import math
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import cycle
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
    for start, stop in between[edges].reshape(-1, 2):
        axes.axvspan(start, stop, zorder=0, fc="#f1f1f1", ec=FAINT, hatch="////", lw=0)
    if edges.size:
        view.note("Hatched: the linkage does not assemble.")
    if low < here < high:
        axes.axvline(here, color=MUTED, lw=0.8, ls=(0, (2, 2)), zorder=1)
        view.note(f"Dashed upright line: {view.at}.")
    return over


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


def choose_limit(values: Iterable[Array]) -> float | None:
    """Choose the end of a clipped axis; None if no value stands far out."""
    sizes = np.abs(np.concatenate([*values]))
    sizes = sizes[np.isfinite(sizes)]
    ordinary = float(np.percentile(sizes, ORDINARY_PERCENTILE)) if sizes.size else 0.0
    if sizes.max(initial=0.0) > OUTLIER * ordinary > 0.0:
        return CLIPPED * ordinary
    return None


class _Chart:
    """Curves of one SI unit in axes that end short of what diverges.

    Parameters
    ----------
    curves : values by the name that a note gives them.
    sized : name of the one that scales the axis; left out: all do.
    """

    def __init__(
        self,
        axes: "Axes",
        view: View,
        si: str,
        curves: dict[str, Array],
        sized: str | None = None,
    ) -> None:
        self.axes = axes
        self.view = view
        self.si = si
        self.curves = curves
        self.over = draw_axes(axes, view)
        values = [curves[sized]] if sized else [*curves.values()]
        self.limit = choose_limit(values)
        largest = self.limit or largest_magnitude(*values)
        self.factor, self.unit = choose_unit(largest, si, view.units)

    def plot(self, values: Array, poles: _Indices | None = None, **look: Any) -> None:
        """Plot a curve that no line takes across a pole."""
        if poles is None:
            poles = np.empty(0, dtype=np.intp)
        over = break_at_poles(self.over, poles)
        self.axes.plot(over, break_at_poles(self.factor * values, poles), **look)

    def finish(self, symbol: str, title: str, what: str, *, sizes: bool) -> None:
        """Name the axis, and clip it.

        `what`: is clipped. `sizes`: the axis begins at zero.
        """
        if sizes:
            self.axes.set_ylim(bottom=0.0)
        else:
            draw_zero_line(self.axes)
        named = symbol if self.si == "1" else f"{symbol} ({self.unit})"
        self.axes.set(ylabel=named, title=title)
        if self.limit is not None:
            self._clip(what, self.limit)

    def _clip(self, what: str, limit: float) -> None:
        """End the axis at a limit, and say what lies beyond."""
        view = self.view
        lowest = min(float(np.nanmin(values)) for values in self.curves.values())
        edge = limit * self.factor
        self.axes.set_ylim(0.0 if lowest >= 0.0 else -edge, edge)
        sizes = {name: largest_magnitude(one) for name, one in self.curves.items()}
        name = max(sizes, key=lambda name: sizes[name])
        if sizes[name] <= limit:
            return
        worst = self.curves[name]
        index = find_peak_index(worst)
        words = view.axis.words(view.sweep.at.places[index], 5)
        if view.time is not None:
            words = f"t = {view.time[index]:.4g} s"
        end = f"{write_number(edge)} {self.unit}".removesuffix(" 1")
        largest = write_labelled_quantity(worst[index], self.si, view.units)
        view.note(
            f"{what} clipped at {end}; the largest evaluated, {name} ="
            f" {largest.removesuffix(' 1')}, is at {words}."
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
    driven = view.sweep.at.bar
    rates = {bar: getattr(view.sweep, f"{letter}_{bar}") for bar in MOVING_BARS}
    if not np.any(rates[driven]):
        del rates[driven]
    name = {"omega": "ω", "alpha": "α"}[letter]
    curves = {f"{name}{_SUBSCRIPTS[bar]}": rate for bar, rate in rates.items()}
    chart = _Chart(axes, view, unit, curves)
    for bar, rate in rates.items():
        look = choose_bar_line(bar)
        if bar == driven:
            look |= {"ls": "-", "lw": 1.0}
        chart.plot(rate, label=rf"$\{letter}_{bar}$", **look)
    chart.finish(rf"$\{letter}$", title, what, sizes=False)
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
    vectors = collect_point_vectors(view.scene, view.sweep, letter)
    curves = {name: np.hypot(*vector.T) for name, vector in vectors.items()}
    chart = _Chart(axes, view, unit, curves)
    colours = {"A": BAR_COLOURS[2], "B": BAR_COLOURS[4]}
    colours |= {f"G{bar}": BAR_COLOURS[bar] for bar in MOVING_BARS}
    all_dashes = cycle(("-", "--", "-.", ":"))
    for (name, values), dashes in zip(curves.items(), all_dashes, strict=False):
        chart.plot(
            values,
            label=name,
            color=colours.get(name, FORCE_COLOURS["F43"]),
            ls=":" if name[0] == "G" else dashes,
            lw=2.0 if name in view.sweep.points else 1.2,
        )
    chart.finish(f"$|{letter}|$", title, title, sizes=True)
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
    bar = view.scene.drive_bar
    symbol = f"${letter}$"
    curve_name = letter
    on_bar = ""
    poles_of = "drive's force (its line has no lever)"
    if bar:
        symbol = f"${letter}_{bar}$"
        curve_name = f"{letter}{_SUBSCRIPTS[bar]}"
        on_bar = f" on bar {bar}"
        poles_of = f"torque{on_bar} ({_POLE_REASON[bar]})"
    values = getattr(view.sweep, name)
    chart = _Chart(axes, view, unit, {curve_name: values})
    chart.plot(values, find_poles(view), color=INK, label=symbol)
    poles = view.poles.get(read_drive_demand(view.sweep).keys.value, [])
    for pole in poles:
        place = view.axis.factor * pole
        axes.axvline(place, color=MUTED, lw=0.9, ls=(0, (1, 1.5)))
    if poles:
        view.note(f"Dotted: poles of the {poles_of}.")
    chart.finish(symbol, f"{what} of the drive{on_bar}", what, sizes=False)
    # a clipped axis says its largest value in the caption
    if chart.limit is None and name not in view.poles:
        mark_peak(axes, chart.over, chart.factor * values, chart.unit)


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
    sizes = {name: np.hypot(*getattr(view.sweep, name).T) for name in FORCE_COLOURS}
    chart = _Chart(axes, view, "N", sizes)
    poles = find_poles(view)
    for name, values in sizes.items():
        chart.plot(values, poles, **choose_force_line(name))
    chart.finish("$|F|$", "Pin forces", "Pin forces", sizes=True)
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
        colour = FORCE_COLOURS[PIN_FORCES[column]]
        dashes = FORCE_DASHES[PIN_FORCES[(column + turn) % len(PIN_FORCES)]]
        label = name.replace("_", " ")
        axes.plot(over, factor * values, label=label, color=colour, ls=dashes)
    draw_zero_line(axes)
    axes.set(ylabel=f"energy ({unit})", title="Kinetic energy and work")
    place_legend(axes, 3)
    view.note(
        "The kinetic energy has grown by the work that loads and effects have done"
        " since the release."
    )


_FORCE_LOOKS: dict[str, dict[str, Any]] = {
    "|F|": {"color": INK, "ls": "-"},
    "F_x": {"color": BAR_COLOURS[2], "ls": (0, (4, 1.5))},
    "F_y": {"color": BAR_COLOURS[4], "ls": (0, (1, 1))},
}


def draw_shaking_force(axes: "Axes", view: View) -> None:
    """Draw the force on the frame: its size and its components."""
    x, y = derive(view.sweep, "shaking_force").T
    curves = {"|F|": np.hypot(x, y), "F_x": x, "F_y": y}
    chart = _Chart(axes, view, "N", curves, "|F|")
    poles = find_poles(view)
    for name, look in _FORCE_LOOKS.items():
        chart.plot(curves[name], poles, label=f"${name}$", **look)
    chart.finish("$F$", "Shaking force on the frame", "Shaking force", sizes=False)
    place_legend(axes)


def draw_shaking_moment(axes: "Axes", view: View) -> None:
    """Draw the moment on the frame about O2."""
    moment = derive(view.sweep, "shaking_moment")
    chart = _Chart(axes, view, "N m", {"M": moment})
    chart.plot(moment, find_poles(view), color=INK)
    title = "Shaking moment about $O_2$"
    chart.finish("$M$", title, "Shaking moment", sizes=False)


def draw_speed_ratios(axes: "Axes", view: View) -> None:
    """Draw the ratios of the speeds of coupler and output to that of the input."""
    ratios = {3: ("ω₃/ω₂", "omega_3/omega_2"), 4: ("ω₄/ω₂", "omega_4/omega_2")}
    _draw_ratios(axes, view, ratios, "ratio", "Speed ratios")
    place_legend(axes)


def draw_advantage(axes: "Axes", view: View) -> None:
    """Draw the mechanical advantage, the torque of the output to that of the input."""
    ratio = {2: ("T₄/T₂", "mechanical_advantage")}
    _draw_ratios(axes, view, ratio, "T₄/T₂", "Mechanical advantage")


def _draw_ratios(
    axes: "Axes",
    view: View,
    ratios: dict[int, tuple[str, str]],
    symbol: str,
    title: str,
) -> None:
    """Draw ratios, with label and name, by the bars whose colours they have.

    No line goes on beyond a pole.
    """
    curves = {label: derive(view.sweep, name) for label, name in ratios.values()}
    chart = _Chart(axes, view, "1", curves)
    for bar, (label, values) in zip(ratios, curves.items(), strict=True):
        before = values[:-1]
        after = values[1:]
        # a ratio changes its sign at a pole, where it is large, or at zero
        is_large = np.minimum(np.abs(before), np.abs(after)) > 1.0
        poles = np.flatnonzero((before * after < 0.0) & is_large)
        chart.plot(values, poles, label=label, **choose_bar_line(bar))
    chart.finish(symbol, title, "Ratio", sizes=False)


_RECOMMENDED = 40.0
"""Smallest transmission angle that is usually recommended, deg.

Source: R. L. Norton, Design of Machinery; H. Alt introduced the angle (1932).
"""


def draw_transmission(axes: "Axes", view: View) -> None:
    """Draw the acute angle between coupler and output.

    Limit and dead-centre positions are marked.
    """
    over = draw_axes(axes, view)
    mu = np.degrees(derive(view.sweep, "transmission"))
    axes.plot(over, mu, color=INK)
    least = f"{_RECOMMENDED:g}° recommended"
    axes.axhline(_RECOMMENDED, color=MUTED, lw=0.9, ls=(0, (4, 2)), label=least)
    axes.set(ylim=(0.0, 96.0), yticks=range(0, 91, 15))
    ring: dict[str, Any] = {"ms": 6.0, "mew": 1.1, "clip_on": False, **RING_MARK}
    for theta, height, marker, name in _list_marked(view):
        axes.plot(theta, height, marker, ls="none", label=name, zorder=5, **ring)
    axes.set(ylabel=r"transmission angle $\mu$ (°)", title="Transmission angle")
    place_legend(axes, 1)


def _list_marked(view: View) -> Iterator[tuple[list[float], list[float], str, str]]:
    """List limits of the commanded bar and dead centres, on the axis.

    An entry has place, mu (degrees), mark and name.
    """
    if view.time is not None:
        return
    positions = view.sweep.at
    linkage = view.scene.linkage
    commanded = positions.bar
    degrees = np.degrees(positions.angle)
    beside = 0.0
    if len(degrees) > 1:
        beside = 1.5 * float(np.median(np.abs(np.diff(degrees))))
    one, follower = (bar for bar in MOVING_BARS if bar != commanded)
    signs = find_signs(linkage, positions.angle, positions.branch, commanded)
    for bar in dict.fromkeys((commanded, 2, 4)):
        margin = beside if bar == commanded else 0.0
        low = float(degrees.min()) - margin
        high = float(degrees.max()) + margin
        places = list[float]()
        heights = list[float]()
        for limit in limit_positions(linkage, bar):
            theta = dict(zip(MOVING_BARS, limit[:3], strict=True))
            sign = math.copysign(1.0, math.sin(theta[follower] - theta[one]))
            difference = theta[4] - theta[3]
            mu = math.atan2(abs(math.sin(difference)), abs(math.cos(difference)))
            start = math.degrees(theta[commanded])
            first = math.ceil((low - start) / 360.0)
            last = math.floor((high - start) / 360.0)
            for turn in range(first, last + 1):
                place = start + 360.0 * turn
                nearest = np.argmin(np.abs(degrees - place))
                if bar == commanded or signs[nearest] == sign:
                    places.append(place)
                    heights.append(math.degrees(mu))
        # over a stroke its bar's angle rises or falls throughout
        if positions.moves_stroke:
            order = np.argsort(degrees)
            places = np.interp(places, degrees[order], view.axis.values[order]).tolist()
        if places:
            mark, word = ("s", "limit") if bar == commanded else ("D", "dead centre")
            pair = ", ".join(str(number) for number in MOVING_BARS if number != bar)
            yield places, heights, mark, f"{word}: bars {pair} in line"
