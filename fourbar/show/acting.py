"""Remarks on what acts: couples without a place, and springs that go on too far."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Spring, Springs
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.mobility import TURN
from fourbar.linkage import FIRST_PIN
from fourbar.quantities import Array
from fourbar.scene import Command, Scene, command, command_at
from fourbar.scene.motion import FEWEST_POINTS, Law, Sweep
from fourbar.show.motion_curves import goes_on_between
from fourbar.show.units import write_short
from fourbar.solution import Conversion, Solution
from fourbar.studies.course import MotionCourse, bisect
from fourbar.studies.passing import SAME_POSITION

_INSTANTS_OF_AN_END = 33
"""Instants of an interval of a table at which two choices of its ends are compared. The
difference of two cubics has one maximum in it.
"""
AT_END_OF_STROKE = 1e-6
"""Part of a gas spring's length within which it is at its end. A scene that states the
end as a place has fewer digits than that.
"""


def list_couple_notes(scene: Scene) -> list[str]:
    """Name where couples without a place enter their bars, in one line or none."""
    entries = [
        f"load {number} enters bar {load.bar} at"
        f" {'G' if load.bar == 3 else FIRST_PIN[load.bar]}"
        for number, load in enumerate(scene.loads, 1)
        if load.moment != 0.0 and load.force is None and load.place is None
    ]
    if not entries:
        return []
    return [
        f"  a moment alone: {', '.join(entries)}; its from_pin states another place"
    ]


def list_arm_notes(scene: Scene) -> list[str]:
    """Say from where the arm of a load counts on a bar whose centre is not stated."""
    return [
        f"load {number}: arm counts from G of bar {load.bar}, taken to be mid-bar;"
        " from_pin counts from the bar's pin"
        for number, load in enumerate(scene.loads, 1)
        if load.arm is not None
        and scene.linkage.bar(load.bar).mass == 0.0
        and scene.linkage.bar(load.bar).centre is None
    ]


def list_drawn_notes(scene: Scene, units: Conversion) -> list[str]:
    """Say where a sweep to or from the drawn angle goes by more than half a turn.

    The direction of a drawn bar leaves open which of its angles was meant.
    """
    sweep = scene.motion.angle
    if scene.drawing is None or not isinstance(sweep, Sweep):
        return []
    drawn = scene.drawing.angle(scene.motion.bar)
    if drawn not in (sweep.start, sweep.stop):
        return []
    key, other = ("to", sweep.stop) if drawn == sweep.start else ("from", sweep.start)
    away = math.remainder(other - drawn, TURN)
    width = abs(other - drawn)
    if width - abs(away) < SAME_POSITION or abs(away) < SAME_POSITION:
        return []
    swept, start, stop, nearer, gap = (
        write_short(angle, "rad", units)
        for angle in (width, sweep.start, sweep.stop, drawn + away, abs(away))
    )
    return [
        f"{scene.motion.commanded} goes by {swept} from {start} to {stop}; {key} ="
        f' "{nearer}" is the same direction, {gap} from the drawn one'
    ]


def list_law_notes(scene: Scene, units: Conversion) -> list[str]:
    """Say what the ends of a table of angles assume, and what the other choice changes.

    A periodic table leaves no choice, nor does one with speeds or with three points.
    """
    law = scene.motion.law
    if not isinstance(law, Law) or law.omega is not None or law.ends == "periodic":
        return []
    other = {"free": "rest", "rest": "free"}[law.ends]
    t = np.array(law.time)
    if len(t) < FEWEST_POINTS["free"]:
        return []
    ends = np.linspace(t[[0, -2]], t[[1, -1]], _INSTANTS_OF_AN_END).ravel()
    pairs = zip(law.at(ends), replace(law, ends=other).at(ends), strict=True)
    angle, _, acceleration = (float(np.abs(one - two).max()) for one, two in pairs)
    by = " and ".join(
        write_short(size, unit, units)
        for size, unit in ((angle, "rad"), (acceleration, "rad/s^2"))
    )
    assumed = "as the next intervals bend" if law.ends == "free" else "at rest"
    return [
        f'the law begins and ends {assumed} (ends = "{law.ends}"); "{other}" changes'
        f" angle and acceleration of its first and last intervals by up to {by};"
        f" omega_{law.bar} beside theta_{law.bar} states the speeds"
    ]


def list_spring_notes(scene: Scene, solution: Solution, units: Conversion) -> list[str]:
    """List where gas springs are beyond their stroke, and springs change their sense.

    A gas spring is taken to push on along the same line, and another one both to push
    and to pull: either may be a spring that does not exist.

    `units`: units of the numbers; one that is left out is the SI unit with a prefix.
    """
    springs = list_springs(scene)
    if not springs:
        return []
    command_between: CommandBetween = partial(_command_between, scene, solution.at)
    if _is_whole_motion(scene, solution):
        course = MotionCourse(scene, "position", solution)
        solution = course.solution
        command_between = course.command
    notes = []
    for number, spring in enumerate(springs, 1):
        distance = measure_end_distance(scene, spring, solution.at)
        distance = np.where(solution.assembled, distance, np.nan)
        if spring.stroke is None:
            if spring.acts is None and spring.stiffness > 0.0 and spring.slack < 0.0:
                end = -spring.slack / spring.stiffness
                pulls = distance > end
                if pulls.any() and (distance < end).any():
                    stretches = _list_stretches(
                        scene, command_between, solution, spring, end, pulls
                    )
                    where = _write_stretches(solution, stretches, units)
                    notes.append(
                        f"spring {number} pulls {where} and pushes elsewhere: with acts"
                        ' = "push" or "pull" it acts one way'
                    )
            continue
        for sign, end, word in (
            (1.0, spring.length, "longer than its extended length of"),
            (
                -1.0,
                spring.length - spring.stroke,
                "shorter than its compressed length of",
            ),
        ):
            room = AT_END_OF_STROKE * spring.length
            with np.errstate(invalid="ignore"):
                beyond = sign * (distance - end) > room
            stretches = _list_stretches(
                scene, command_between, solution, spring, end, beyond
            )
            if not stretches:
                continue
            length = write_short(end, "m", units)
            where = _write_stretches(solution, stretches, units)
            notes.append(
                f"spring {number}, a gas spring, is {word} {length} {where}: it is"
                " taken to push on, and has no stops"
            )
    return notes


def _is_whole_motion(scene: Scene, solution: Solution) -> bool:
    """Return True for the motion of a scene, which goes on between its positions."""
    if solution.command_at is not None:
        return True
    if not goes_on_between(scene, solution):
        return False
    ends = command(scene).places[[0, -1]]
    return set(ends) == set(solution.at.places[[0, -1]])


def list_springs(scene: Scene) -> tuple[Spring, ...]:
    """List the springs of a scene in the order of its file."""
    for effect in scene.settled().effects:
        if isinstance(effect, Springs):
            return effect.springs
    return ()


def measure_end_distance(scene: Scene, spring: Spring, at: Command) -> Array:
    """Measure how far the ends of a spring are apart at each position, m."""
    state = compute_shown_state(scene, at)
    across = spring.end.locate(state) - spring.start.locate(state)
    return np.broadcast_to(np.abs(across), at.places.shape)


CommandBetween = Callable[[Array], Command]
"""Function that returns the command at places between those of a solution."""
_Stretch = tuple[float | None, float | None]
"""Places of the start and of the end; None: the motion begins or ends within."""


def _list_stretches(
    scene: Scene,
    command_between: CommandBetween,
    solution: Solution,
    spring: Spring,
    end: float,
    beyond: NDArray[np.bool_],
) -> list[_Stretch]:
    """List where a spring is beyond a length, from where it is at positions."""
    rows = np.flatnonzero(beyond[1:] != beyond[:-1])
    known = np.where(beyond[rows], rows, rows + 1)
    crossings = _locate_crossings(
        scene, command_between, solution, spring, end, rows, known
    )
    stretches = list[_Stretch]()
    start = None
    for row, place in zip(rows, crossings, strict=True):
        if beyond[row]:
            stretches.append((start, float(place)))
        else:
            start = float(place)
    if beyond[-1]:
        stretches.append((start, None))
    return stretches


def _locate_crossings(
    scene: Scene,
    command_between: CommandBetween,
    solution: Solution,
    spring: Spring,
    end: float,
    rows: NDArray[np.intp],
    known: NDArray[np.intp],
) -> Array:
    """Find where a spring reaches a length in the steps that begin at rows.

    A step in which nothing lies between the two positions gives the known one of them:
    steps of a list, and those where the loop does not close.
    """
    at = solution.at
    places = np.array(at.places[known], dtype=float)
    assembled = solution.assembled[rows] & solution.assembled[rows + 1]
    if isinstance(scene.motion.angle, np.ndarray):
        assembled[:] = False
    if not assembled.any():
        return places
    rows = rows[assembled]
    low = at.places[rows]
    high = at.places[rows + 1]

    def is_longer(there: Array) -> NDArray[np.bool_]:
        distance = measure_end_distance(scene, spring, command_between(there))
        return np.greater(distance, end)

    before = is_longer(low)

    def is_as_before(middle: Array) -> NDArray[np.bool_]:
        return np.equal(is_longer(middle), before)

    low, high = bisect(is_as_before, low, high)
    places[assembled] = 0.5 * (low + high)
    return places


def _command_between(scene: Scene, at: Command, places: Array) -> Command:
    """Return the command at places between its own."""
    if at.moves_stroke:
        return command_at(scene, places)
    branch = np.full(places.shape, at.branch[0])
    return Command(places, branch, None, 0.0, at.bar)


def _write_stretches(
    solution: Solution, stretches: list[_Stretch], units: Conversion
) -> str:
    return " and ".join(_write_stretch(solution, one, units) for one in stretches)


def _write_stretch(solution: Solution, stretch: _Stretch, units: Conversion) -> str:
    """Write a stretch as "from theta_2 = 61.2 deg on"."""
    start, stop = stretch
    if solution.time is not None:
        name = "t"
        unit = "s"
    else:
        name = solution.commanded
        unit = solution.at.unit
    if start is None and stop is None:
        if len(solution) == 1:
            return "here"
        return "throughout"
    ends = [
        "" if place is None else f"{name} = {write_short(place, unit, units)}"
        for place in stretch
    ]
    if start == stop:
        return f"at {ends[0]}"
    if start is None:
        return f"up to {ends[1]}"
    if stop is None:
        return f"from {ends[0]} on"
    return f"from {ends[0]} to {ends[1]}"
