"""Positions at which a named quantity of a scene's motion has a value.

The quantity is an angle, the stroke or the time.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.errors import InputError, NotAssembledError, write_in_units
from fourbar.formulas.mobility import TURN, find_intervals
from fourbar.linkage import FourBar
from fourbar.quantities import Array
from fourbar.scene import Command, Scene, command, command_at
from fourbar.scene.motion import (
    COMMAND_NAMES,
    SIDES,
    STROKE_COMMAND,
    Motion,
)
from fourbar.scene.scene import default_places, write_stroke_ranges
from fourbar.solution import Solution, compute_times, where_assembled
from fourbar.solving import solve
from fourbar.studies.course import MotionCourse, bisect

COMMANDED_ANGLES = tuple(names[0] for names in COMMAND_NAMES.values())
STATED_POSITIONS = (*COMMANDED_ANGLES, STROKE_COMMAND[0], "time")
"""Names by which a position may be stated."""
SAME_POSITION = 1e-6
"""rad, or part of a length: two places that the formulas give in two ways are one."""
INSIDE_LIMIT = 1e-12
"""rad; distance from a limit at which a linkage assembles as doubles."""
_GRID_DIGITS = 4
"""Digits of an end of a range that is read from the positions of the default sweep."""


def find_positions(scene: Scene, name: str, value: float) -> Command:
    """Find the positions of a scene's motion where a named quantity has a value.

    The positions are those of the scene's assembly, of a motion over time those that it
    passes, of a released one the first.

    Parameters
    ----------
    name : one of `STATED_POSITIONS`.
    value : rad, m or s.

    Raises
    ------
    InputError : a name that the motion has not.
    NotAssembledError : no position has the value; the message says the range.
    """
    if scene.motion.free is not None or scene.motion.law is not None:
        return _find_times(scene, name, value)
    return command_at(scene, np.array(_find_places(scene, name, value)))


def _find_places(scene: Scene, name: str, value: float) -> list[float]:
    """Find the commanded angles or strokes at which a named one has a value."""
    motion = scene.motion
    if name == motion.commanded:
        at = command_at(scene, np.array([value]))  # which refuses a stroke out of range
        if solve(scene, "position", at=at).assembled[0]:
            return [value]
        raise NotAssembledError(
            f"{_say_position(name, value)}: the linkage does not assemble there;"
            f" {say_range(scene)}"
        )
    if name == "time":
        return [_find_place_of_sweep(scene, value)]
    places: list[float] = []
    for place in _list_candidates(scene, name, value):
        if any(is_same_position(motion.commanded, place, other) for other in places):
            continue
        here = solve(scene, "position", at=command_at(scene, np.array([place])))
        reached = getattr(here, name)[0]
        if math.isfinite(reached) and is_same_position(name, reached, value):
            places.append(place)
    if not places:
        # of the range that the scene's own motion is in
        places_of_range = default_places(scene, float(command(scene).angle[0]))
        whole = solve(scene, "position", at=command_at(scene, places_of_range))
        low, high = _write_extent(getattr(whole, name), name, _GRID_DIGITS)
        raise NotAssembledError(
            f"{_say_position(name, value)}: no position of this assembly has it;"
            f" {name} goes from {low} to {high}"
        )
    return sorted(places)


def _find_place_of_sweep(scene: Scene, time: float) -> float:
    """Find what a steady sweep commands at a time."""
    sweep = command(scene)
    times = compute_times(scene, sweep)
    if times is None:
        raise InputError(
            "at",
            "time",
            "needs a motion over time: a sweep at one speed, motion.law or motion.free",
        )
    last = float(times.max())
    if not 0.0 <= time <= last:
        raise NotAssembledError(
            f"{_say_position('time', time)}: the sweep goes from 0 to"
            f" {_write_position('time', last)}"
        )
    order = np.argsort(times)
    return float(np.interp(time, times[order], sweep.places[order]))


def say_nowhere(scene: Scene) -> str:
    """Say that no position of a scene assembles, and where the linkage does."""
    return (
        f"motion.{scene.motion.commanded}: the linkage assembles at none of the"
        f" positions requested; {say_range(scene)}"
    )


def say_range(scene: Scene) -> str:
    """Say between which angles the commanded bar can be, or between which strokes."""
    motion = scene.motion
    if motion.stroke is not None:
        return f"this cylinder can have {write_stroke_ranges(scene)}"
    ranges = [
        f"{math.degrees(low):.6g} to {math.degrees(high):.6g} deg"
        for low, high in find_intervals(scene.linkage, motion.bar)
    ]
    return f"theta_{motion.bar} goes from {' and from '.join(ranges)}"


def _list_candidates(scene: Scene, name: str, value: float) -> list[float]:
    """List the commanded angles or strokes at which a named quantity has a value.

    Both assemblies and a second turn are searched.
    """
    commanded = scene.motion.commanded
    candidates: list[float] = []
    is_limit = False
    if name in COMMANDED_ANGLES:
        value, is_limit = move_inside_limit(scene, int(name[-1]), value)
    for branch in (1, -1):
        for side in SIDES if name == STROKE_COMMAND[0] else (None,):
            stated: dict[str, Any] = {name: value, "branch": branch, "side": side}
            other = replace(scene, motion=Motion(**stated))
            found = solve(other, "position")
            place = getattr(found, commanded)
            if place is not None and math.isfinite(place[0]):
                candidates.append(float(place[0]))
    if is_limit and len(candidates) > 1:
        first, second = candidates
        apart = second - first
        if commanded in COMMANDED_ANGLES:
            apart = math.remainder(apart, TURN)
        candidates = [first + 0.5 * apart]
    if commanded not in COMMANDED_ANGLES:
        return candidates
    # with one change point an assembly repeats after two turns; the sweep's own turn
    # first
    turned = [place + turns * TURN for place in candidates for turns in (0, 1, -1)]
    sweep = command(scene).angle
    low = float(sweep.min()) - SAME_POSITION
    high = float(sweep.max()) + SAME_POSITION
    return sorted(turned, key=lambda place: not low <= place <= high)


def move_inside_limit(scene: Scene, bar: int, angle: float) -> tuple[float, bool]:
    """Move the angle of a bar from its limit inside, and return True if it was there.

    Both assemblies meet at a limit, and lie as far from it on both sides beside it.
    """
    for limit, beyond, outwards in _find_nearest_limit(scene.linkage, bar, angle):
        if abs(beyond) <= SAME_POSITION:
            return limit - outwards * INSIDE_LIMIT, True
    return angle, False


def meet_limit(linkage: FourBar, bar: int, angle: float, rounding: float) -> float:
    """Return the limit of a bar for an angle beyond it that may be its rounding, rad.

    Any other angle stays.
    """
    for _, beyond, outwards in _find_nearest_limit(linkage, bar, angle):
        if 0.0 < beyond <= rounding:
            return angle - outwards * beyond
    return angle


def _find_nearest_limit(
    linkage: FourBar, bar: int, angle: float
) -> list[tuple[float, float, float]]:
    """Find the limit of a bar that is nearest to an angle; none of one that turns.

    An entry has the limit, how far the angle is beyond it, and the sense that leads
    out of the range there, +1 or -1.
    """
    limits = []
    for low, high in find_intervals(linkage, bar):
        if high - low < TURN:
            for limit, outwards in ((low, -1.0), (high, 1.0)):
                beyond = outwards * math.remainder(angle - limit, TURN)
                limits.append((limit, beyond, outwards))
    return sorted(limits, key=lambda entry: (abs(entry[1]), entry[1]))[:1]


def is_same_position(name: str, first: float, second: float) -> bool:
    """Return True if two values of an angle (whole turns apart) or a stroke are one."""
    if name in COMMANDED_ANGLES:
        return abs(math.remainder(first - second, TURN)) <= SAME_POSITION
    return abs(first - second) <= SAME_POSITION * abs(second)


def _find_times(scene: Scene, name: str, value: float) -> Command:
    """Find the instants at which a motion over time passes a value."""
    course = MotionCourse(scene, "position")
    start, stop = course.places[[0, -1]].tolist()
    if name == "time":
        if not start <= value <= stop:
            raise NotAssembledError(
                f"{_say_position(name, value)}: the motion goes from {start:.6g} to"
                f" {stop:.6g} s"
            )
        return course.command(np.array([value]))

    def read(solution: Solution) -> Array:
        values = _require_values(getattr(solution, name), name)
        return where_assembled(solution, values)

    def measure_gaps(solution: Solution) -> Array:
        gaps = read(solution) - value
        if name in COMMANDED_ANGLES:
            gaps = np.angle(np.exp(1j * gaps))
        return np.asarray(gaps)

    gaps = measure_gaps(course.solution)
    before = gaps[:-1]
    after = gaps[1:]
    # half a turn away an angle changes its side, too
    near = name not in COMMANDED_ANGLES or np.abs(after - before) < 0.5 * math.pi
    rows = np.flatnonzero((before != 0.0) & (before * after <= 0.0) & near)
    times = course.places[:1][gaps[:1] == 0.0]
    if scene.motion.free is not None:
        rows = rows[: 1 - times.size]
    if rows.size:
        sides = before[rows]
        _, passed = bisect(
            lambda there: measure_gaps(course.solve(there)) * sides > 0.0,
            course.places[rows],
            course.places[rows + 1],
        )
        times = np.concatenate([times, passed])
    if not times.size:
        low, high = _write_extent(read(course.solution), name)
        raise NotAssembledError(
            f"{_say_position(name, value)}: the motion does not pass it; it stays"
            f" within {low} and {high}"
        )
    return course.command(times)


def _write_extent(values: Array | None, name: str, digits: int = 6) -> list[str]:
    """Write the least and the greatest of the values of a quantity."""
    known = _require_values(values, name)
    ends = float(np.nanmin(known)), float(np.nanmax(known))
    return [_write_position(name, end, digits) for end in ends]


def _require_values(values: Array | None, name: str) -> Array:
    if values is None:
        raise InputError("at", name, "needs a drive along a line")
    return values


def _say_position(name: str, value: float) -> str:
    """Return a position as a message names it, "at theta_4 = 30 deg"."""
    return f"at {name} = {_write_position(name, value)}"


def _write_position(name: str, value: float, digits: int = 6) -> str:
    if name in COMMANDED_ANGLES:
        return f"{math.degrees(value):.{digits}g} deg"
    return write_in_units("s" if name == "time" else "m", value, digits=digits)


def join_commands(values: Sequence[Any]) -> Any:
    """Join commands of one motion into one command.

    Arrays are joined, those of origins too; of other fields the first is taken.
    """
    first = values[0]
    if isinstance(first, tuple):
        return type(first)(*map(join_commands, zip(*values, strict=True)))
    if isinstance(first, np.ndarray) and first.ndim:
        return np.concatenate(values)
    return first
