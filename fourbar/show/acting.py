"""Remarks on what acts: couples without a place, and springs that go on too far."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from fourbar.effects import Spring, Springs, Torsion
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.mobility import TURN
from fourbar.linkage import FIRST_PIN, PINS
from fourbar.quantities import CHANGE_POINT, WOUND, Array, Indices, Mask
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import FEWEST_POINTS, Law, Sweep
from fourbar.show.driving import name_places
from fourbar.show.motion_curves import goes_on_between
from fourbar.show.shown_units import POSITION_DIGITS, drop_rounding, write_short
from fourbar.solution import Conversion, Solution
from fourbar.solving import solve
from fourbar.studies.course import (
    Condition,
    MotionCourse,
    Stretch,
    bisect,
    list_stretches,
)
from fourbar.studies.passing import SAME_POSITION

_INSTANTS_OF_AN_END = 33
"""Instants of an interval of a table at which two choices of its ends are compared. The
difference of two cubics has one maximum in it.
"""
AT_END_OF_STROKE = 1e-6
"""Part of a gas spring's length within which it is at its end. A scene that states the
end as a place has fewer digits than that.
"""


def list_notes(solution: Solution, units: Conversion) -> list[str]:
    """List the remarks on what a scene states, and on what acts at its positions.

    `units`: units of the numbers; one that is left out is the SI unit with a prefix.
    """
    scene = solution.scene
    return [
        *list_drawn_notes(scene, units),
        *list_arm_notes(scene),
        *_list_law_notes(scene, units),
        *list_spring_notes(solution, units),
        *_list_torsion_notes(solution, units),
    ]


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
        f"  a moment alone: {', '.join(entries)}; its from_pin would state another"
        " place"
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
    write = partial(write_short, unit="rad", units=units)
    return [
        f"{scene.motion.commanded} goes by {write(width)} from {write(sweep.start)} to"
        f' {write(sweep.stop)}; {key} = "{write(drawn + away)}" is the same'
        f" direction, {write(abs(away))} from the drawn one"
    ]


def _list_law_notes(scene: Scene, units: Conversion) -> list[str]:
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
    assumed = "as the next intervals bend" if law.ends == "free" else "at rest"
    return [
        f'the law begins and ends {assumed} (ends = "{law.ends}"); "{other}" changes'
        f" angle and acceleration of its first and last intervals by up to"
        f" {write_short(angle, 'rad', units)} and"
        f" {write_short(acceleration, 'rad/s^2', units)};"
        f" omega_{law.bar} beside theta_{law.bar} states the speeds"
    ]


def list_spring_notes(solution: Solution, units: Conversion) -> list[str]:
    """List where gas springs are beyond their stroke, and springs change their sense.

    A gas spring is taken to push on along the same line, and another one both to push
    and to pull: either may be a spring that does not exist.
    """
    scene = solution.scene
    springs = list_springs(scene)
    if not springs:
        return []
    is_whole = solution.command_at is not None
    if not is_whole and goes_on_between(solution):
        is_whole = {*command(scene).places[[0, -1]]} == {*solution.at.places[[0, -1]]}
    notes = []
    for number, spring in enumerate(springs, 1):
        for sense, end, room, words in _list_ends(spring):
            is_beyond = partial(_mark_beyond, spring, sense, end + sense * room)
            motion = solution
            if is_whole:
                motion = MotionCourse(scene, "position", solution, is_beyond).solution
            beyond = is_beyond(motion)
            # a spring that pulls throughout may be one that does
            throughout = beyond[motion.assembled].all()
            if not beyond.any() or (throughout and not words):
                continue
            locate = partial(_locate_change, motion, is_beyond)
            stretches = list_stretches(beyond, motion.at.places, locate)
            where = " and ".join(
                write_stretch(motion, stretch, units) for stretch in stretches
            )
            said = (
                f", a gas spring, is {words} length of"
                f" {write_short(end, 'm', units)} {where}: it is taken to push on, and"
                " has no stops"
            )
            if not words:
                said = (
                    f' pulls {where} and pushes elsewhere: with acts = "push" or "pull"'
                    " it acts one way"
                )
            notes.append(f"spring {number}{said}")
    return notes


def _list_torsion_notes(solution: Solution, units: Conversion) -> list[str]:
    """Say which torsion springs are half a turn or more from rest, and where.

    Of one position it is said how far each is wound, and from what line.
    """
    scene = solution.scene
    effects = scene.settled().effects
    torsions = [effect for effect in effects if isinstance(effect, Torsion)]
    springs = [row for effect in torsions for row in effect.springs]
    notes = _list_wound(solution, springs, units)
    if notes or len(solution) > 1 or not solution.assembled[0]:
        return notes
    write = partial(write_short, unit="rad", units=units, digits=POSITION_DIGITS)
    lines = {1: "the ground's line", 2: "the line of bar 2", 3: "the line of bar 3"}
    theta_1 = math.remainder(scene.linkage.ground_angle, TURN)
    if abs(theta_1) >= SAME_POSITION:
        lines[1] += f", which lies at {write(theta_1)}"
    state = compute_shown_state(scene, solution.at)
    windings = [wound for effect in torsions for wound in effect.list_windings(state)]
    for winding, (pin, _, rest, _) in zip(windings, springs, strict=True):
        wound = np.ravel(winding)[0]
        shown = drop_rounding(np.array([rest + wound, wound]), 1.0).tolist()
        angle, by = map(write, shown)
        spring = f"torsion spring at {pin}: wound by {by}"
        notes.append(f"{spring}, at {angle} from {lines[PINS[pin][0]]}")
    return notes


def _list_wound(
    solution: Solution,
    springs: list[tuple[str, float, float, float]],
    units: Conversion,
) -> list[str]:
    """Say which torsion springs are half a turn or more from rest, and where."""
    notes = []
    known = solution.status_code != CHANGE_POINT
    places = solution.at.places[known]
    for spring in springs if WOUND in solution.status_code else []:
        alone = replace(solution.scene, loads=(), effects=(Torsion((spring,)),))
        wound = solve(alone, at=solution.at).status_code[known] == WOUND
        where = " and ".join(
            write_stretch(solution, stretch, units)
            for stretch in list_stretches(wound, places)
        )
        if where:
            notes.append(
                f"torsion spring at {spring[0]}: half a turn or more from rest {where},"
                " where there are no forces"
            )
    return notes


def _list_ends(spring: Spring) -> list[tuple[float, float, float, str]]:
    """List the lengths beyond which a remark on a spring is due.

    An entry has the sense of beyond, the length, the room at it, m, and the words that
    say what a gas spring is beyond it; the words are empty for any other spring.
    """
    if spring.stroke is None:
        if spring.acts is None and spring.stiffness > 0.0 and spring.slack < 0.0:
            return [(1.0, -spring.slack / spring.stiffness, 0.0, "")]
        return []
    room = AT_END_OF_STROKE * spring.length
    folded = spring.length - spring.stroke
    return [
        (1.0, spring.length, room, "longer than its extended"),
        (-1.0, folded, room, "shorter than its compressed"),
    ]


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


def _mark_beyond(spring: Spring, sense: float, end: float, solution: Solution) -> Mask:
    """Mark the positions at which a spring is longer, or shorter, than a length."""
    distance = measure_end_distance(solution.scene, spring, solution.at)
    return solution.assembled & (sense * distance > sense * end)


def _locate_change(
    solution: Solution, holds: Condition, rows: Indices, ends: Array
) -> Array:
    """Return where a condition changes after some rows, (n,), from `ends`.

    Between listed positions, strokes and times, and where the linkage does not close,
    nothing is sought: the change is at the position at which the condition holds.
    """
    at = solution.at
    passes = solution.assembled[rows] & solution.assembled[rows + 1]
    is_listed = isinstance(solution.scene.motion.angle, np.ndarray)
    if not passes.any() or is_listed or at.moves_stroke or at.time is not None:
        return ends
    before = at.part(rows[passes])._replace(origin=None)

    def mark(places: Array) -> Mask:
        between = before._replace(angle=places)
        return holds(solve(solution.scene, "position", at=between))

    low, high = (at.places[rows[passes] + after] for after in (0, 1))
    held = mark(low)
    low, high = bisect(lambda places: mark(places) == held, low, high)
    ends[passes] = 0.5 * (low + high)
    return ends


def write_stretch(solution: Solution, stretch: Stretch, units: Conversion) -> str:
    """Write a stretch as "from theta_2 = 61.2 deg on", of falling places "down"."""
    start, stop = stretch
    if start is None and stop is None:
        return "here" if len(solution) == 1 else "throughout"
    name, unit = name_places(solution)
    ends = [
        "" if place is None else f"{name} = {write_short(place, unit, units)}"
        for place in stretch
    ]
    if start == stop:
        return f"at {ends[0]}"
    falls = bool((np.diff(solution.at.places) < 0.0).all())
    if start is None:
        return f"{'down' if falls else 'up'} to {ends[1]}"
    if stop is None:
        return f"from {ends[0]} {'down' if falls else 'on'}"
    return f"from {ends[0]} to {ends[1]}"
