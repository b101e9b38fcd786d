"""Free-body diagrams of the three moving bars, all forces to one scale."""

import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.effects.effect import Actions, list_bodies
from fourbar.errors import InputError
from fourbar.formulas.arithmetic import Number
from fourbar.linkage import BAR_NAMES, ENDS, FIRST_PIN, MOVING_BARS, PIN_FORCE, PINS
from fourbar.show.plot.labels import Label, Labels
from fourbar.show.plot.linkage_figure import (
    draw_mass_centre,
    draw_plate,
    locate_pins,
    pin_name,
)
from fourbar.show.plot.style import (
    BAR_COLOURS,
    FORCE_COLOURS,
    HEADED,
    INK,
    MUTED,
    RING_MARK,
    largest_magnitude,
    plot_points,
    split_complex,
    split_points,
    write_force_name,
    write_labelled_quantity,
)
from fourbar.show.plot.view import View, where_in_words
from fourbar.show.shown_units import choose_unit
from fourbar.show.summary import Facts
from fourbar.solution import Conversion
from fourbar.studies.internal_forces import internal_forces

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_PANEL, LINE_HEIGHT = 3.4, 0.16
"""Heights of a bar's panel and of a line of its couples, inches."""
LABEL_SPACE = 1.3
"""The window is this much wider than what it shows: space for the labels."""
STATIONS_DRAWN = 401
"""Stations along a bar."""
WITHOUT_VALUES = "they have a value at none of the positions"
LEAST_DRAWN_FORCE = 0.02
"""Share of the largest force below which a force is named in the caption only. Its
arrow would be shorter than its head.
"""


class Arrow(NamedTuple):
    """A force on a bar: its point and its vector, N.

    The point is from the bar's first pin in world axes, m.
    """

    text: str
    at: complex
    force: complex
    colour: str = INK
    dashed: bool = False


class Couple(NamedTuple):
    """A couple on a bar, N m."""

    text: str
    moment: float


def _take_one(vector: Any) -> complex:
    """Return the one complex number of an array, at the position drawn."""
    return complex(np.ravel(vector)[0])


class FreedBar(Actions):
    """A bar freed from its pins at the drawn position, and what acts on it.

    With d'Alembert's forces and couples all add up to zero.
    """

    def __init__(self, view: View, bar: int) -> None:
        super().__init__(view.state(), list_bodies(view.scene.linkage))
        self.bar = bar
        self.arrows: list[Arrow] = []
        self.turns: list[Couple] = []
        self.name = ""
        """Name of what acts."""
        described = view.scene.linkage.bar(bar)
        u = self.state.direction(bar)
        self.G = _take_one(described.to_centre * u)
        """Mass centre, from the bar's first pin, m."""
        first, second = ENDS[bar]
        pins = locate_pins(view)
        self.pins = {first: 0.0j, second: pins[second] - pins[first]}
        for pin, arm in self.pins.items():
            of_pin = PIN_FORCE[pin]
            force = complex(*getattr(view.here, of_pin)[0])
            shown = of_pin
            if of_pin[2] != str(bar):
                force = -force
                shown = f"F{of_pin[2]}{of_pin[1]}"
            colour = FORCE_COLOURS[of_pin]
            self.arrows.append(Arrow(write_force_name(shown), arm, force, colour))
        self._add_actions(view)
        inertial = -described.mass * complex(*getattr(view.here, f"a_G{bar}")[0])
        text = rf"$-m_{bar}\,a_{{G{bar}}}$"
        self.arrows.append(Arrow(text, self.G, inertial, dashed=True))
        alpha = float(getattr(view.here, f"alpha_{bar}")[0])
        carried = list_bodies(view.scene.linkage, view.scene.effects)[bar - 2]
        self.turns.append(Couple(rf"$-I_{bar}\,\alpha_{bar}$", -carried.I * alpha))
        self.arrows = [arrow for arrow in self.arrows if arrow.force != 0.0]
        self.turns = [couple for couple in self.turns if couple.moment != 0.0]

    def _add_actions(self, view: View) -> None:
        """Add what the drive, loads and effects put on the bar."""
        scene = view.scene.settled()
        here = view.here
        if scene.motion.free is None:
            self.name = f"$T_{self.bar}$"
            if scene.drive_bar == self.bar:
                self.couple(self.bar, here.torque)
            self.name = "$F$"
            if scene.drive is not None:
                scene.drive.act(self, here.drive_force)
        for count, load in enumerate(scene.loads, start=1):
            self.name = f"load {count}"
            load.act(self, self.state)
        forces = {name: getattr(here, name) for name in PIN_FORCE.values()}
        for effect in scene.effects:
            self.name = effect.key.replace("_", " ")
            if effect.key == "gravity":
                self.name = rf"$m_{self.bar}\,g$"
            effect.act(self, self.state)
            effect.act_known(self, forces)

    def force(
        self,
        bar: int,
        force: Number,
        point: Number = 0.0j,
        beyond: Number = None,
    ) -> None:
        """Add a force on a bar, at a point of its frame.

        `beyond`: arm from there in world axes.
        """
        if bar != self.bar:
            return
        arm = point * self.state.direction(bar) + (0.0j if beyond is None else beyond)
        self.arrows.append(Arrow(self.name, _take_one(arm), _take_one(force)))

    def pull(self, start: Any, end: Any, force: Number) -> None:
        """Add both forces, between neighbours too.

        A freed bar shows each where it acts.
        """
        self.pull_ends(start, end, force)

    def couple(self, bar: int, moment: Number, at: str = "") -> None:
        """Add a pure couple on a bar, `at` a pin that its name says."""
        if bar == self.bar:
            self.turns.append(Couple(self.name + at, _take_one(moment).real))

    def pin_couple(self, pin: str, couple: Number) -> None:
        """Add a couple on the second of the two bars at a pin, N m, and name the pin.

        The first bar gets the opposite couple.
        """
        for bar, sense in zip(PINS[pin], (-1.0, 1.0), strict=True):
            self.couple(bar, sense * couple, f" at {pin_name(pin)}")


def draw_free_bodies(figure: "SubFigure", view: View, labels: Labels) -> None:
    """Draw the three bars, each freed from its pins, over the couples.

    All arrows have one scale.
    """
    _require_forces(view, "freebody")
    freed = [FreedBar(view, bar) for bar in MOVING_BARS]
    lines = max(1, *(len(bar.turns) for bar in freed))  # or "no couples"
    panels, below = figure.subplots(2, 3, height_ratios=[_PANEL, LINE_HEIGHT * lines])
    sizes = [abs(arrow.force) for bar in freed for arrow in bar.arrows]
    biggest = max(sizes, default=0.0)
    longest = max(view.scene.linkage.bar(bar).length for bar in MOVING_BARS)
    scale = 0.75 * longest / biggest if biggest > 0.0 else 0.0
    windows = []
    for bar in freed:
        points = [*bar.pins.values(), bar.G]
        for arrow in bar.arrows:
            points += [arrow.at, arrow.at + scale * arrow.force]
        places = split_points(points)
        windows.append(np.array([places.min(axis=0), places.max(axis=0)]))
    # one window size: the bars, too, are to one scale
    span = LABEL_SPACE * max(float(np.ptp(window, axis=0).max()) for window in windows)
    view.note(f"At {view.at}.")
    for axes, text, bar, window in zip(panels, below, freed, windows, strict=True):
        _draw_one(axes, view, bar, scale, biggest, labels)
        low, high = window.mean(axis=0) + 0.5 * span * np.array([[-1.0], [1.0]])
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        _write_couples(text, view, bar.turns)
    if scale:
        _draw_scale(panels[0], scale, biggest, view.units)
    view.note(
        "Bars and forces each to one scale, in world axes; dashed: inertia forces −m a"
        " at G (d'Alembert), with which the forces and the moments on each bar add up"
        " to zero."
    )


def _require_forces(view: View, figure: str) -> None:
    """Raise InputError if the drawn position has no forces."""
    if not np.isfinite(view.here.F12).all():
        reason = (
            f"needs forces, which have no value at {where_in_words(view.here)}:"
            f" {view.here.status[0]}"
        )
        raise InputError("figure", figure, reason)


def draw_internal_forces(figure: "SubFigure", view: View, labels: Labels) -> None:
    """Draw N, V and M along each bar.

    The position is the one that is stated, or else that of the bar's largest bending
    moment.
    """
    panels = figure.subplots(3, 3, sharex="col")
    if view.stated:
        _require_forces(view, "bars")
    elif view.sweep.F12 is None or not np.isfinite(view.sweep.F12).any():
        raise InputError("figure", "bars", f"needs forces, and {WITHOUT_VALUES}")
    solution = view.here if view.stated else view.sweep
    bending = Facts(solution).bending
    for column, (bar, worst) in zip(panels.T, bending.items(), strict=True):
        x = np.linspace(0.0, view.scene.linkage.bar(bar).length, STATIONS_DRAWN)
        forces = internal_forces(view.scene, worst.solution, bar, x)
        factor, unit = choose_unit(float(x[-1]), "m", view.units)
        place = view.axis.words(float(worst.solution.at.places[worst.row]))
        panels_of_bar = zip(column, ("N", "V", "M"), ("N", "N", "N m"), strict=True)
        for axes, name, si in panels_of_bar:
            curve = getattr(forces, name)[worst.row]
            scale, shown = choose_unit(largest_magnitude(curve), si, view.units)
            line = factor * x, scale * curve
            axes.plot(*line, color=BAR_COLOURS[bar])
            axes.fill_between(*line, color=BAR_COLOURS[bar], alpha=0.15, lw=0.0)
            axes.axhline(0.0, color=INK, lw=0.6)
            axes.set_ylabel(f"${name}$ ({shown})")
        first_pin = pin_name(FIRST_PIN[bar]).strip("$")
        column[0].set_title(f"Bar {bar} ({BAR_NAMES[bar]})\n{place}")
        column[2].set_xlabel(f"$x$ from ${first_pin}$ ({unit})")
        largest = "grows without bound; drawn is the largest of these positions,"
        if worst.peak is not None:
            moment = write_labelled_quantity(worst.peak.value, "N m", view.units)
            largest = f"= {moment}"
        foot = write_labelled_quantity(worst.x, "m", view.units)
        spread = "as a uniform bar's" if forces.uniform else "at G"
        spread = f"weight and inertia {spread}"
        view.note(f"Bar {bar}: largest |M| {largest} at x = {foot}, {spread}.")
    view.note(
        "x runs along the line between the pins, y to its left; N > 0 is tension.",
    )


def _draw_one(
    axes: "Axes",
    view: View,
    freed: FreedBar,
    scale: float,
    biggest: float,
    labels: Labels,
) -> None:
    """Draw a bar freed from its pins, with the arrows of the forces on it."""
    bar = freed.bar
    pins = freed.pins
    start, end = pins.values()
    middle = 0.5 * end
    plot_points(
        axes,
        [start, end],
        color=BAR_COLOURS[bar],
        lw=5.0,
        alpha=0.45,
        solid_capstyle="round",
        zorder=2,
    )
    labels.keep_off(axes, start, end, width=5.0)
    for name, pin in pins.items():
        plot_points(axes, pin, "o", ms=5.5, mew=1.1, zorder=6, **RING_MARK)
        labels.add(Label(axes, pin_name(name), pin, middle, MUTED, 8.0, 2.5))
    short: list[str] = []
    for arrow in freed.arrows:
        size = abs(arrow.force)
        value = write_labelled_quantity(size, "N", view.units)
        if size < LEAST_DRAWN_FORCE * biggest:
            plain = re.sub(r"[$_{}]", "", arrow.text.replace("\\,", " "))
            short.append(f"{plain.replace('-', '−')} = {value}")
            continue
        draw_plate(axes, bar, (start, arrow.at, end), labels)
        tip = arrow.at + scale * arrow.force
        colour = arrow.colour
        ls = "--" if arrow.dashed else "-"
        axes.annotate(
            "",
            split_complex(tip),
            split_complex(arrow.at),
            arrowprops={**HEADED, "mutation_scale": 9, "color": colour, "ls": ls},
            zorder=5,
            annotation_clip=False,
        )
        labels.keep_off(axes, arrow.at, tip)
        text = f"{arrow.text} = {value}"
        labels.add(Label(axes, text, tip, arrow.at, colour, 7.5))
    if short:
        view.note(f"Too short to draw on bar {bar}: {', '.join(short)}.")
    if view.scene.linkage.bar(bar).mass > 0.0:
        draw_plate(axes, bar, (start, freed.G, end), labels)
        draw_mass_centre(axes, freed.G, 6.0)
        labels.add(Label(axes, f"$G_{bar}$", freed.G, middle, MUTED, 8.0, 3.0))
    axes.set_aspect("equal", adjustable="box")
    axes.set_axis_off()
    axes.set_title(f"Bar {bar} ({BAR_NAMES[bar]})")


def _write_couples(axes: "Axes", view: View, couples: list[Couple]) -> None:
    """Write one line for each couple."""
    lines = []
    for couple in couples:
        size = write_labelled_quantity(abs(couple.moment), "N m", view.units)
        lines.append(f"{'↺' if couple.moment > 0.0 else '↻'} {couple.text} = {size}")
    axes.set_axis_off()
    axes.text(
        0.0,
        1.0,
        "\n".join(lines) or "no couples",
        transform=axes.transAxes,
        color=INK if lines else MUTED,
        va="top",
        size=7.5,
        linespacing=1.45,
    )


def _draw_scale(axes: "Axes", scale: float, biggest: float, units: Conversion) -> None:
    """Draw a round force as a length, under the first panel."""
    factor, unit = choose_unit(biggest, "N", units)
    step = 10.0 ** math.floor(math.log10(factor * biggest))
    fitting = (m * step for m in (5.0, 2.0) if 2.0 * m * step <= factor * biggest)
    round_force = next(fitting, step) / factor
    x = axes.get_xlim()[0]
    y = axes.get_ylim()[0]
    ends = [x, x + scale * round_force]
    axes.plot(ends, [y, y], color=INK, lw=2.0, solid_capstyle="butt", clip_on=False)
    axes.annotate(
        f"{factor * round_force:g} {unit}",
        (x, y),
        xytext=(0, 4),
        textcoords="offset points",
        size=7.5,
        annotation_clip=False,
    )
