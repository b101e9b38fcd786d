"""Content of a drawing: the sweep of a scene on one branch, and one position.

The position is shown in detail, and the paths of points on the whole circuit.
"""

import cmath
import math
import re
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import NotAssembledError, write_in_units
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.mobility import find_circuit
from fourbar.formulas.points import list_circuit
from fourbar.quantities import ANGLES, Array
from fourbar.scene import Command, Scene, command, command_at, default_places
from fourbar.scene.motion import BRANCH_NAMES, Sweep
from fourbar.show.driving import lacks_friction, leaves_range, read_drive_demand
from fourbar.show.plot.style import (
    join_points,
    set_degree_ticks,
    write_labelled_quantity,
)
from fourbar.show.shown_units import choose_unit, drop_place_rounding
from fourbar.solution import Conversion, Solution
from fourbar.solving import solve, turn_first

_BINDING = re.compile(r" (?==)|(?<==) |(?<=[\d]) (?=[A-Za-zµ])|(?<=N) (?=m\b)")
"""Blanks of a note that stay on one line with what stands beside them."""
CLEAR = 0.3
"""Motion and drive condition that the drawn position should have. Next to a pole forces
dwarf all others.
"""
STEPS_OF_A_PATH = 36_000
"""Steps along a circuit, a multiple of 4: near a small transmission angle a degree may
be a long chord.
"""
_LEAD = math.radians(60.0)
"""Angle of the drawn position from the first that is well conditioned, rad. In a
shorter sweep it is half of the sweep.
"""
BARREL = 0.85
"""Length of a cylinder's barrel over the shortest stroke of the sweep. The rod is what
comes out of it.
"""


class DrawingPlane:
    """Coordinates of a drawing to scale that hold a sweep, as complex numbers."""

    def __init__(self, scene: Scene, sweep: Solution, units: Conversion) -> None:
        bars = scene.linkage
        O4 = cmath.rect(bars.ground, bars.ground_angle)
        paths = [sweep.A, sweep.B, sweep.G3, *sweep.points.values()]
        reached = np.concatenate([*map(join_points, paths), [0.0, O4]])
        reached = reached[np.isfinite(reached)]
        largest = float(np.abs(reached).max())
        self.factor, self.unit = choose_unit(largest, "m", units)
        """Factor from m to the unit of the drawing, and that unit."""
        self.origin = self.factor * complex(*scene.origin)
        """Place of O2, in the unit of the drawing as all that follows."""
        extent = max(np.ptp(reached.real), np.ptp(reached.imag))
        self.size = 0.03 * self.factor * float(extent)
        """Size of a support."""
        self.barrel = 0.0
        """Length of what of a cylinder keeps its length; 0 without a cylinder."""
        if sweep.stroke is not None:
            self.barrel = BARREL * self.factor * float(np.nanmin(sweep.stroke))
        state = compute_shown_state(scene, sweep.at)
        for load in scene.settled().loads:
            foot = load.foot(bars.bar(load.bar).to_centre)
            arm = 0j if load.arm is None else cmath.rect(*load.arm)
            reached = np.append(reached, state.point(load.bar, foot) + arm)
        highest = complex(np.nanmax(reached.real), np.nanmax(reached.imag))
        self.corner = self.origin + self.factor * highest + 2.0 * self.size
        """Place to the upper right of what the linkage reaches."""

    def place(self, points: Any) -> Any:
        """Place points that are given from O2 as complex numbers, m."""
        return self.origin + self.factor * points


@dataclass(slots=True)
class View:
    """A scene on one branch.

    `sweep` runs over what is commanded in rising order, `here` is the one position
    drawn to scale, `notes` collects what a caption has to say about the panels.
    """

    scene: Scene
    sweep: Solution
    here: Solution
    notes: list[str] = field(default_factory=list)
    units: Conversion = field(default_factory=dict)
    """Units of the numbers drawn; one that is left out is the SI unit with a prefix."""
    dimensions: bool = False
    """The lengths of the bars are written at them."""
    stated: bool = False
    """The scene, or whoever draws it, states the one position."""
    poles: dict[str, list[float]] = field(default_factory=dict)
    """Places at which a curve grows without bound, by its name; none for others."""

    @property
    def axis(self) -> "Axis":
        """Quantity on the horizontal axis: time, or the commanded quantity."""
        if self.time is None:
            return axis_of(self.scene, self.sweep.at, self.units)
        # s, or a smaller unit of a shorter motion
        factor, unit = choose_unit(min(float(self.time[-1]), 1.0), "s")
        return Axis("t", "$t$", f" {unit}", factor, factor * self.time)

    @property
    def time(self) -> Array | None:
        """Times of a motion given over time, s."""
        return self.sweep.time

    @property
    def at(self) -> str:
        """The position drawn, in words."""
        place = float(self.here.at.places[0])
        if self.time is None:
            return self.axis.words(place)
        theta = f"θ₂ = {math.degrees(float(self.here.theta_2[0])):.4g}°"
        return f"{theta}, t = {place:.4g} s".replace("-", "−")

    @property
    def plane(self) -> DrawingPlane:
        """Coordinates that hold all positions of the sweep."""
        return DrawingPlane(self.scene, self.sweep, self.units)

    @property
    def goes_round(self) -> bool:
        """Return True if paths are those of the circuit of the position drawn.

        The input then names no sweep and no list. A sweep, the command of another bar
        and a motion through time have their own range.
        """
        motion = self.scene.motion
        has_range = isinstance(motion.angle, Sweep | np.ndarray)
        return motion.commanded == "theta_2" and self.time is None and not has_range

    def trace(self) -> Solution:
        """Solve the positions that the paths of points run through.

        A circuit ends where it begins, and runs through both branches where the input
        has limits.
        """
        scene = self.scene
        if self.goes_round:
            here = self.here
            number = int(find_circuit(scene.linkage, here.theta_2, here.branch)[0])
            branch = scene.motion.branch
            steps = list_circuit(scene.linkage, number, branch, STEPS_OF_A_PATH)
            theta_2, assembly = (
                np.append(of_step, of_step[0]) for of_step in steps[:2]
            )
            at = Command(theta_2, assembly.astype(np.int8), None, 0.0)
        elif self.time is not None or isinstance(scene.motion.angle, np.ndarray):
            return self.sweep
        else:
            first, last = self.sweep.at.places[[0, -1]]
            at = command_at(scene, np.linspace(first, last, STEPS_OF_A_PATH + 1))
        return solve(scene, "position", at=at)

    @property
    def moves(self) -> bool:
        """Return True if velocities, accelerations and forces were evaluated."""
        return self.sweep.omega_2 is not None

    @property
    def rests(self) -> bool:
        """Return True if each position is one at rest: nothing has a speed or power."""
        motion = self.scene.motion
        has_rates = np.any(motion.speed) or np.any(motion.acceleration)
        return self.moves and not (is_over_time(self.scene) or has_rates)

    @property
    def branch_name(self) -> str:
        """Return "open" or "crossed", the assembly that the scene states."""
        return BRANCH_NAMES[self.scene.motion.branch]

    def note(self, text: str) -> None:
        """Add a note to the caption, once; its numbers stay on one line with units."""
        text = _BINDING.sub("\u00a0", text)
        if text not in self.notes:
            self.notes.append(text)

    def note_rest(self, solution: Solution) -> None:
        """Say where dry friction at rest is left out; at one position, its range."""
        if not lacks_friction(solution).any():
            return
        text = "Dry friction at rest is taken as 0"
        if len(solution) == 1 and leaves_range(solution)[0]:
            drive = read_drive_demand(solution)
            low, high = (
                write_labelled_quantity(solution[end][0], drive.unit, self.units)
                for end in drive.keys[2:]
            )
            text += f"; with it the {drive.name} is between {low} and {high}"
        self.note(f"{text}.")


class Axis(NamedTuple):
    """Quantity on the horizontal axis."""

    symbol: str
    label: str
    """Symbol as it is typeset at the axis."""
    unit: str
    factor: float
    """Factor from the SI unit to the unit."""
    values: Array
    """Values of the sweep, in the unit."""

    def lay_out(self, axes: Any, most_ticks: int = 8) -> None:
        """Set the ends, the ticks and the name of a horizontal axis."""
        low = float(self.values.min())
        high = float(self.values.max())
        room = 1.0 if low == high else 0.0
        axes.set_xlim(low - room, high + room)
        if self.unit == "°":
            set_degree_ticks(axes.xaxis, most_ticks)
        axes.set_xlabel(f"{self.label} ({self.unit.strip()})")

    def words(self, place: float, digits: int = 4) -> str:
        """Write a place, which is in SI, with its symbol and unit."""
        return f"{self.symbol} = {self.write(place, digits)}"

    def write(self, place: float, digits: int = 4) -> str:
        """Write a place, which is in SI, with its unit."""
        shown = drop_place_rounding(self.factor * place, np.ptp(self.values))
        return f"{shown:.{digits}g}{self.unit}".replace("-", "−")


def axis_of(scene: Scene, positions: Command, units: Conversion) -> Axis:
    """Make the axis of what is commanded."""
    if positions.moves_stroke:
        factor, unit = choose_unit(max(scene.linkage.lengths), "m", units)
        strokes = factor * positions.stated[0]
        return Axis("stroke", "stroke", f" {unit}", factor, strokes)
    return Axis(
        f"θ{'₀₁₂₃₄'[positions.bar]}",
        rf"$\{positions.commanded}$",
        "°",
        math.degrees(1.0),
        np.degrees(positions.angle),
    )


def where_in_words(solution: Solution) -> str:
    """Say the first position of a solution as the scene's file has it."""
    if solution.at.moves_stroke:
        where = write_in_units("m", float(solution.at.stated[0][0]))
    else:
        where = f"{math.degrees(solution.at.angle[0]):.6g} deg"
    return f"{solution.commanded} = {where}"


def is_over_time(scene: Scene) -> bool:
    """Return True if the motion is one through time: released, or by a law."""
    return scene.motion.free is not None or scene.motion.law is not None


def list_sweep(scene: Scene) -> tuple[Command, float | None]:
    """List the positions in ascending order of what is commanded.

    A single one is put among those of the default range. The place of a single one, or
    of the one that is drawn, is returned too.
    """
    stated = command(scene)
    if len(stated.angle) > 1:
        order = np.argsort(stated.places, kind="stable")
        low, high = stated.places[order[[0, -1]]]
        drawn = find_drawn_place(scene)
        if drawn is not None and low < drawn < high:
            return command_at(scene, np.union1d(stated.places, drawn)), drawn
        return stated.part(order), drawn
    wide = command_at(scene, default_places(scene, float(stated.angle[0])))
    place = stated.places
    if not stated.moves_stroke:
        # the same position may lie whole turns away from the default range
        middle = 0.5 * (wide.angle[0] + wide.angle[-1])
        turns = np.round((middle - stated.angle) / math.tau)
        place = place + turns * math.tau
    return command_at(scene, np.union1d(wide.places, place)), float(place[0])


def find_drawn_place(scene: Scene) -> float | None:
    """Return the commanded angle that is drawn, within the default range, rad.

    None is returned if another range is stated.
    """
    if scene.drawing is None or scene.motion.angle is not None:
        return None
    places = command(scene).places
    drawn = scene.drawing.angle(scene.motion.bar)
    middle = 0.5 * float(places[0] + places[-1])
    return middle + math.remainder(drawn - middle, math.tau)


def describe_change_points(motion: Solution) -> str:
    """Say when a free motion passed change points, where another motion is possible."""
    times = " and ".join(f"{time:.4g} s" for time in motion.change_points or ())
    return (
        f"At t = {times} all bars are in line, a change point: "
        "it goes on smoothly, and another motion is possible"
    )


def set_branch(scene: Scene, branch: int) -> Scene:
    """Put the same scene on the given branch."""
    return replace(scene, motion=scene.motion.replace(branch=branch))


def make_view(scene: Scene, position: float | None = None) -> View:
    """Evaluate the sweep of a scene, or its motion, and one position of it.

    Parameters
    ----------
    position : what is commanded where the linkage is drawn to scale, rad or m; left
        out: the scene's own where it names one (the start of a motion through time),
        else 60 deg into what assembles, clear of poles.

    Raises
    ------
    NotAssembledError : no position of the sweep assembles, or the one named does not.
    """
    over_time = is_over_time(scene)
    sweep = solve(scene) if over_time else solve(scene, at=list_sweep(scene)[0])
    if not sweep.assembled.any():
        raise NotAssembledError(
            "nothing to draw: the linkage assembles at none of the scene's positions"
        )
    if over_time:
        return _view_motion(sweep, position)
    of_scene = command(scene)
    if of_scene.places[0] > of_scene.places[-1]:  # with the turns of the motion
        for name in {"theta_2", *ANGLES} - {sweep.commanded}:
            sweep[name][...] = turn_first(sweep[name][::-1])[::-1]
    if position is None and len(of_scene.angle) == 1:
        position = float(of_scene.places[0])
    stated = position is not None
    if position is None:
        position = find_drawn_place(scene)
    if position is None:
        position = _choose_position(sweep)
    here = solve(scene, at=command_at(scene, np.array([position])))
    if not here.assembled[0]:
        where = where_in_words(here)
        raise NotAssembledError(f"the linkage does not assemble at {where}")
    return View(scene, sweep, here, stated=stated)


def _view_motion(sweep: Solution, position: float | None) -> View:
    """Return the view of a motion through time.

    The drawn instant is the first that assembles, or that whose theta_2 comes nearest
    to the position.
    """
    scene = sweep.scene
    angle = sweep.at.angle
    name = sweep.commanded
    if position is None:
        index = int(np.argmax(sweep.assembled))
    else:
        low, wanted, high = np.degrees([np.min(angle), position, np.max(angle)])
        if not low <= wanted <= high:
            raise NotAssembledError(
                f"the motion does not pass {name} = {wanted:.6g} deg:"
                f" it stays within {low:.6g} and {high:.6g} deg"
            )
        index = int(np.argmin(np.abs(angle - position)))
    here = solve(scene, at=sweep.at.part(slice(index, index + 1)))
    shown = View(scene, sweep, here, stated=position is not None)
    if sweep.change_points:
        shown.notes.append(f"{describe_change_points(sweep)}.")
    return shown


def _choose_position(sweep: Solution) -> float:
    """Choose a well-conditioned position that shows the bars apart."""
    conditions = [sweep.condition, sweep.drive_condition]
    known = [condition for condition in conditions if condition is not None]
    quality = np.nan_to_num(np.min(known, axis=0))
    good = sweep.at.places[quality >= min(CLEAR, float(quality.max()))]
    lead = 0.5 * float(np.ptp(good))
    if not sweep.at.moves_stroke:
        lead = min(_LEAD, lead)
    return float(good[np.argmin(np.abs(good - good[0] - lead))])
