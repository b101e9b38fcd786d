"""Free-body diagrams of the three moving bars, all forces to one scale."""

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.effect import Actions, list_bodies
from fourbar.errors import InputError
from fourbar.formulas.arithmetic import Number
from fourbar.formulas.motion import State
from fourbar.linkage import BAR_NAMES, ENDS, FIRST_PIN, MOVING_BARS, PIN_FORCE, PINS
from fourbar.scene import Scene
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


@dataclass(slots=True)
class Arrow:
    """A force on a bar: its point and its vector, N.

    The point is from the bar's first pin in world axes, m.
    """

    text: str
    at: complex
    force: complex
    colour: str
    dashed: bool = False


@dataclass(slots=True)
class Couple:
    """A couple on a bar, N m."""

    text: str
    moment: float


def list_actions(view: View, bar: int) -> tuple[list[Arrow], list[Couple]]:
    """List every force and couple on a bar at the drawn position.

    With d'Alembert's they add up to zero.
    """
    pins = locate_pins(view)
    arrows: list[Arrow] = []
    couples: list[Couple] = []
    for pin in ENDS[bar]:
        name = PIN_FORCE[pin]
        force = complex(*getattr(view.here, name)[0])
        shown = name
        if name[2] != str(bar):
            force = -force
            shown = f"F{name[2]}{name[1]}"
        arm = pins[pin] - pins[FIRST_PIN[bar]]
        arrows.append(Arrow(write_force_name(shown), arm, force, FORCE_COLOURS[name]))
    if view.scene.drive_bar == bar and view.scene.motion.free is None:
        couples.append(Couple(f"$T_{bar}$", float(view.here.torque[0])))
    recorder = _record_actions(view)
    arrows += recorder.arrows[bar]
    couples += recorder.turns[bar]
    described = view.scene.linkage.bar(bar)
    G = _take_one(described.to_centre * view.state().direction(bar))
    inertial = -described.mass * complex(*getattr(view.here, f"a_G{bar}")[0])
    arrows.append(Arrow(rf"$-m_{bar}\,a_{{G{bar}}}$", G, inertial, INK, dashed=True))
    alpha = float(getattr(view.here, f"alpha_{bar}")[0])
    carried = list_bodies(view.scene.linkage, view.scene.effects)[bar - 2]
    couples.append(Couple(rf"$-I_{bar}\,\alpha_{bar}$", -carried.I * alpha))
    arrows = [arrow for arrow in arrows if arrow.force != 0.0]
    couples = [couple for couple in couples if couple.moment != 0.0]
    return arrows, couples


class _ActionRecorder(Actions):
    """Forces and couples, kept one by one under the name of their source."""

    name = ""

    def __init__(self, scene: Scene, state: State) -> None:
        super().__init__(state, list_bodies(scene.linkage))
        self.arrows: dict[int, list[Arrow]] = {bar: [] for bar in BAR_NAMES}
        self.turns: dict[int, list[Couple]] = {bar: [] for bar in BAR_NAMES}

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
        arm = point * self.state.direction(bar) + (0.0j if beyond is None else beyond)
        name = self.name.replace("#", str(bar))
        self.arrows[bar].append(Arrow(name, _take_one(arm), _take_one(force), INK))

    def pull(self, start: Any, end: Any, force: Number) -> None:
        """Add both forces, between neighbours too.

        A freed bar shows each where it acts.
        """
        self.pull_ends(start, end, force)

    def couple(self, bar: int, moment: Number) -> None:
        """Add a pure couple on a bar."""
        name = self.name.replace("#", str(bar))
        self.turns[bar].append(Couple(name, _take_one(moment).real))

    def pin_couple(self, pin: str, couple: Number) -> None:
        """Add a couple on the second of the two bars at a pin, N m, and name the pin.

        The first bar gets the opposite couple.
        """
        for bar, sense in zip(PINS[pin], (-1.0, 1.0), strict=True):
            self.couple(bar, sense * couple)
            self.turns[bar][-1].text += f" at {pin_name(pin)}"


def _take_one(vector: Any) -> complex:
    """Return the one complex number of an array, at the position drawn."""
    return complex(np.ravel(vector)[0])


def _record_actions(view: View) -> _ActionRecorder:
    """Record what a drive that exerts a force, loads and effects put on the bars."""
    scene = view.scene.settled()
    state = view.state()
    recorder = _ActionRecorder(scene, state)
    if scene.drive is not None and scene.motion.free is None:
        recorder.name = "$F$"
        scene.drive.act(recorder, view.here.drive_force)
    for count, load in enumerate(scene.loads, start=1):
        recorder.name = f"load {count}"
        load.act(recorder, state)
    forces = {name: getattr(view.here, name) for name in PIN_FORCE.values()}
    for effect in scene.effects:
        recorder.name = effect.key.replace("_", " ")
        if effect.key == "gravity":
            recorder.name = r"$m_#\,g$"
        effect.act(recorder, state)
        effect.act_known(recorder, forces)
    return recorder


def draw_free_bodies(figure: "SubFigure", view: View, labels: Labels) -> None:
    """Draw the three bars, each freed from its pins, over the couples.

    All arrows have one scale.
    """
    _require_forces(view, "freebody")
    freed = [(bar, *list_actions(view, bar)) for bar in MOVING_BARS]
    lines = max(1, *(len(couples) for *_, couples in freed))  # or "no couples"
    panels, below = figure.subplots(2, 3, height_ratios=[_PANEL, LINE_HEIGHT * lines])
    sizes = [abs(arrow.force) for _, arrows, _ in freed for arrow in arrows]
    biggest = max(sizes, default=0.0)
    longest = max(view.scene.linkage.bar(bar).length for bar in MOVING_BARS)
    scale = 0.75 * longest / biggest if biggest > 0.0 else 0.0
    windows = [_find_window(view, bar, arrows, scale) for bar, arrows, _ in freed]
    # one window size: the bars, too, are to one scale
    span = LABEL_SPACE * max(float(np.ptp(window, axis=0).max()) for window in windows)
    view.note(f"At {view.at}.")
    for axes, text, (bar, arrows, couples), window in zip(
        panels, below, freed, windows, strict=True
    ):
        _draw_one(axes, view, bar, arrows, scale, biggest, labels)
        low, high = window.mean(axis=0) + 0.5 * span * np.array([[-1.0], [1.0]])
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        _write_couples(text, view, couples)
    _scale_bar(panels[0], scale, biggest, view.units)
    view.note(
        "Bars and forces each to one scale, in world axes; dashed: inertia forces −m a"
        " at G (d'Alembert), with which the forces and the moments on each bar add up"
        " to zero.",
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


def _find_window(
    view: View, bar: int, arrows: list[Arrow], scale: float
) -> NDArray[np.float64]:
    """Return the lower left and the upper right corner of what a bar's panel shows.

    Places are from the bar's first pin, m, (2, 2).
    """
    described = view.scene.linkage.bar(bar)
    u = view.state().direction(bar)
    points = [0.0j, _take_one(described.length * u), _take_one(described.to_centre * u)]
    for arrow in arrows:
        points += [arrow.at, arrow.at + scale * arrow.force]
    places = split_points(points)
    return np.array([places.min(axis=0), places.max(axis=0)])


def _draw_one(
    axes: "Axes",
    view: View,
    bar: int,
    arrows: list[Arrow],
    scale: float,
    biggest: float,
    labels: Labels,
) -> None:
    """Draw a bar freed from its pins, with the arrows of the forces on it."""
    pins = locate_pins(view)
    first_pin, second_pin = ENDS[bar]
    end = pins[second_pin] - pins[first_pin]
    middle = 0.5 * end
    look: dict[str, Any] = {
        "lw": 5.0,
        "alpha": 0.45,
        "solid_capstyle": "round",
        "zorder": 2,
    }
    plot_points(axes, [0.0j, end], color=BAR_COLOURS[bar], **look)
    labels.keep_off(axes, 0.0j, end, width=5.0)
    for name, pin in ((first_pin, 0.0j), (second_pin, end)):
        plot_points(axes, pin, "o", ms=5.5, mew=1.1, zorder=6, **RING_MARK)
        labels.add(Label(axes, pin_name(name), pin, middle, MUTED, 8.0, 2.5))
    short: list[str] = []
    for arrow in arrows:
        size = abs(arrow.force)
        value = write_labelled_quantity(size, "N", view.units)
        if size < LEAST_DRAWN_FORCE * biggest:
            plain = re.sub(r"[$_{}]", "", arrow.text.replace("\\,", " "))
            plain = plain.replace("-", "−")
            short.append(f"{plain} = {value}")
            continue
        draw_plate(axes, bar, (0.0j, arrow.at, end), labels)
        tip = arrow.at + scale * arrow.force
        look = {"color": arrow.colour, "ls": "--" if arrow.dashed else "-"}
        axes.annotate(
            "",
            split_complex(tip),
            split_complex(arrow.at),
            arrowprops={**HEADED, "mutation_scale": 9, **look},
            zorder=5,
            annotation_clip=False,
        )
        labels.keep_off(axes, arrow.at, tip)
        text = f"{arrow.text} = {value}"
        labels.add(Label(axes, text, tip, arrow.at, arrow.colour, 7.5))
    if short:
        view.note(f"Too short to draw on bar {bar}: {', '.join(short)}.")
    described = view.scene.linkage.bar(bar)
    if described.mass > 0.0:
        G = _take_one(described.to_centre * view.state().direction(bar))
        draw_plate(axes, bar, (0.0j, G, end), labels)
        draw_mass_centre(axes, G, 6.0)
        labels.add(Label(axes, f"$G_{bar}$", G, middle, MUTED, 8.0, 3.0))
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
    text = "\n".join(lines) or "no couples"
    look: dict[str, Any] = {"va": "top", "size": 7.5, "linespacing": 1.45}
    colour = INK if lines else MUTED
    axes.text(0.0, 1.0, text, transform=axes.transAxes, color=colour, **look)


def _scale_bar(axes: "Axes", scale: float, biggest: float, units: Conversion) -> None:
    """Draw a round force as a length, under the first panel."""
    if scale == 0.0:
        return
    factor, unit = choose_unit(biggest, "N", units)
    step = 10.0 ** math.floor(math.log10(factor * biggest))
    fitting = (m * step for m in (5.0, 2.0) if 2.0 * m * step <= factor * biggest)
    round_force = next(fitting, step) / factor
    x = axes.get_xlim()[0]
    y = axes.get_ylim()[0]
    look: dict[str, Any] = {"lw": 2.0, "solid_capstyle": "butt", "clip_on": False}
    axes.plot([x, x + scale * round_force], [y, y], color=INK, **look)
    axes.annotate(
        f"{factor * round_force:g} {unit}",
        (x, y),
        xytext=(0, 4),
        textcoords="offset points",
        size=7.5,
        annotation_clip=False,
    )
