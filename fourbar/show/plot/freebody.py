"""Free-body diagrams of the three moving bars, all forces to one scale."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.effects.effect import list_bodies
from fourbar.errors import InputError
from fourbar.linkage import BAR_NAMES, ENDS, FIRST_PIN, MOVING_BARS, PIN_FORCE
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Scene
from fourbar.show.plot.labels import add_label
from fourbar.show.plot.linkage_figure import (
    draw_bar,
    draw_mass_centre,
    draw_pins,
    draw_plate,
)
from fourbar.show.plot.style import (
    BAR_COLOURS,
    FORCE_COLOURS,
    INK,
    MUTED,
    choose_scale,
    draw_arrow,
    largest_magnitude,
    write_force_name,
    write_labelled_quantity,
    write_pin_name,
)
from fourbar.show.plot.view import View, where_in_words
from fourbar.show.shown_units import choose_unit
from fourbar.show.summary import Facts
from fourbar.solution import Solution
from fourbar.studies.internal_forces import internal_forces, record_acting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

STATIONS_DRAWN = 401
"""Stations along a bar."""


class Arrow(NamedTuple):
    """A force on a bar: its point and its vector, N.

    The point is from the bar's first pin in world axes, m.
    """

    text: str
    at: complex
    force: complex
    colour: str = INK
    dashed: bool = False


def _take_one(vector: Any) -> complex:
    """Return the one complex number of an array, at the position drawn."""
    return complex(np.ravel(vector)[0])


class FreedBar:
    """A bar freed from its pins at the drawn position, and what acts on it.

    With d'Alembert's forces and couples all add up to zero.
    """

    def __init__(self, view: View, bar: int) -> None:
        self.bar = bar
        arrows: list[Arrow] = []
        recorder = record_acting(view.scene, view.here, bar)
        described = view.scene.linkage.bar(bar)
        u = _take_one(recorder.state.direction(bar))
        self.G = described.to_centre * u
        """Mass centre, from the bar's first pin, m."""
        first, second = ENDS[bar]
        self.pins = {first: 0.0j, second: described.length * u}
        for pin, arm in self.pins.items():
            of_pin = PIN_FORCE[pin]
            force = complex(*view.here[of_pin][0])
            shown = of_pin
            if of_pin[2] != str(bar):
                force = -force
                shown = f"F{of_pin[2]}{of_pin[1]}"
            colour = FORCE_COLOURS[of_pin]
            arrows.append(Arrow(write_force_name(shown), arm, force, colour))
        names = _list_names(view.scene, bar)
        turns = []
        for acting in recorder.items:
            name = names[acting.term]
            arm = _take_one(acting.place) * u
            arrows.append(Arrow(name, arm, _take_one(acting.force) * u))
            if acting.pin:
                name += f" at {write_pin_name(acting.pin)}"
            turns.append((name, _take_one(acting.couple).real))
        inertial = -described.mass * complex(*view.here[f"a_G{bar}"][0])
        text = rf"$-m_{bar}\,a_{{G{bar}}}$"
        arrows.append(Arrow(text, self.G, inertial, dashed=True))
        alpha = float(view.here[f"alpha_{bar}"][0])
        carried = list_bodies(view.scene.linkage, view.scene.effects)[bar - 2]
        turns.append((rf"$-I_{bar}\,\alpha_{bar}$", -carried.I * alpha))
        self.arrows = [arrow for arrow in arrows if arrow.force != 0.0]
        self.couples = [(text, moment) for text, moment in turns if moment != 0.0]
        """Couples on the bar by their texts, N m."""


def _list_names(scene: Scene, bar: int) -> list[str]:
    """Name what acts on a bar: each load and effect, and at last the drive."""
    names = [f"load {count}" for count, _ in enumerate(scene.loads, start=1)]
    for effect in scene.effects:
        name = effect.key.replace("_", " ")
        names.append(rf"$m_{bar}\,g$" if name == "gravity" else name)
    return [*names, f"$T_{bar}$" if scene.drive is None else "$F$"]


def draw_free_bodies(figure: "SubFigure", view: View) -> None:
    """Draw the three bars, each freed from its pins, over the couples.

    All arrows have one scale.
    """
    _require_forces(view.here, "freebody")
    freed = [FreedBar(view, bar) for bar in MOVING_BARS]
    biggest = max(
        (abs(arrow.force) for bar in freed for arrow in bar.arrows), default=0
    )
    longest = max(view.scene.linkage.lengths[1:])
    scale = 0.75 * longest / biggest if biggest else 0.0
    view.note(f"At {view.at}.")
    view.note_rest(view.here)
    panels = figure.subplots(1, 3)
    for axes, bar in zip(panels, freed, strict=True):
        _draw_one(axes, view, bar, scale)
    # one window size: the bars, too, are to one scale
    # 1.3 leaves space for the labels
    span = 1.3 * max(axes.dataLim.size.max() for axes in panels)
    for axes in panels:
        x, y = axes.dataLim.get_points().mean(axis=0) - 0.5 * span
        axes.set(xlim=(x, x + span), ylim=(y, y + span), xticks=[], yticks=[])
        axes.set_aspect("equal", adjustable="box")
        axes.spines[:].set_visible(False)
    view.note(
        "Bars and forces each to one scale (a short arrow is its head alone), in"
        " world axes; dashed: inertia forces −m a at G (d'Alembert), with which the"
        " forces and the moments on each bar add up to zero."
    )


def _require_forces(solution: Solution, figure: str) -> None:
    """Raise InputError if forces have a value at none of the positions."""
    if solution.F12 is None or not np.isfinite(solution.F12).any():
        where = "any of the positions"
        if len(solution) == 1:
            where = f"{where_in_words(solution)}: {solution.status[0]}"
        reason = f"needs forces, which have no value at {where}"
        raise InputError("figure", figure, reason)


def draw_internal_forces(figure: "SubFigure", view: View) -> None:
    """Draw N, V and M along each bar.

    The position is the one that is stated, or else that of the bar's largest bending
    moment.
    """
    panels = figure.subplots(3, 3, sharex="col")
    solution = view.here if view.stated else view.sweep
    _require_forces(solution, "bars")
    view.note_rest(solution)
    facts = Facts(solution)
    for column, (bar, worst) in zip(panels.T, facts.bending.items(), strict=True):
        coarse = internal_forces(view.scene, worst.solution, bar).x
        x = np.linspace(coarse[0], coarse[-1], STATIONS_DRAWN)
        forces = internal_forces(view.scene, worst.solution, bar, x)
        factor, unit = choose_unit(float(x[-1]), "m", view.units)
        place = view.axis.words(float(worst.solution.at.places[worst.row]))
        panels_of_bar = zip(column, ("N", "V", "M"), ("N", "N", "N m"), strict=True)
        for axes, name, si in panels_of_bar:
            curve = getattr(forces, name)[worst.row]
            scale, shown = choose_scale(largest_magnitude(curve), si, view.units)
            line = factor * x, scale * curve
            axes.plot(*line, color=BAR_COLOURS[bar])
            axes.fill_between(*line, color=BAR_COLOURS[bar], alpha=0.15, lw=0.0)
            axes.axhline(0.0, color=INK, lw=0.6)
            axes.set_ylabel(f"${name}$ ({shown})")
        first_pin = write_pin_name(FIRST_PIN[bar]).strip("$")
        column[0].set_title(f"Bar {bar} ({BAR_NAMES[bar]})\n{place}")
        column[2].set_xlabel(f"$x$ from ${first_pin}$ ({unit})")
        largest = "grows without bound; drawn is the largest of these positions,"
        if math.isfinite(worst.peak.value):
            moment = write_labelled_quantity(worst.peak.value, "N m", view.units)
            largest = f"= {moment}"
        foot = write_labelled_quantity(worst.x, "m", view.units)
        spread = "as a uniform bar's" if forces.uniform else "at G"
        spread = f"weight and inertia {spread}"
        view.note(f"Bar {bar}: largest |M| {largest} at x = {foot}, {spread}.")
    view.note(
        "x runs along the line between the pins, y to its left; N > 0 is tension.",
    )
    if not facts.motion.panels.growing.isdisjoint(PIN_FORCES):
        view.note(
            "Pin forces grow without bound: N beside such a place is a matter of how"
            " near it is."
        )


def _draw_one(axes: "Axes", view: View, freed: FreedBar, scale: float) -> None:
    """Draw a bar freed from its pins, with the forces on it, and list its couples."""
    bar = freed.bar
    start, end = freed.pins.values()
    middle = 0.5 * end
    draw_bar(axes, bar, [start, end], alpha=0.45, zorder=2)
    draw_pins(axes, freed.pins, middle, MUTED, 8.0)
    for arrow in freed.arrows:
        size = abs(arrow.force)
        text = f"{arrow.text} = {write_labelled_quantity(size, 'N', view.units)}"
        draw_plate(axes, bar, (start, arrow.at, end))
        shaft = scale * arrow.force
        ls = "--" if arrow.dashed else "-"
        draw_arrow(axes, arrow.at, arrow.at + shaft, arrow.colour, ls=ls)
        add_label(axes, text, arrow.at + shaft, shaft, arrow.colour, 7.5)
    if view.scene.linkage.bar(bar).mass > 0.0:
        draw_plate(axes, bar, (start, freed.G, end))
        draw_mass_centre(axes, bar, freed.G, freed.G - middle, MUTED)
    axes.set_title(f"Bar {bar} ({BAR_NAMES[bar]})")
    couples = [
        f"{'↺' if moment > 0.0 else '↻'} {text} ="
        f" {write_labelled_quantity(abs(moment), 'N m', view.units)}"
        for text, moment in freed.couples
    ]
    words = "\n".join(couples or ["no couples"])
    axes.set_xlabel(words, loc="left", size=7.5, linespacing=1.45)
