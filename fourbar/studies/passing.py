"""Positions at which a named quantity of a scene's motion has a value.

The quantity is an angle, the stroke or the time.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError, NotAssembledError, write_in_units
from fourbar.evaluation.free_motion import Released, release
from fourbar.formulas.mobility import TURN, find_intervals
from fourbar.quantities import Array
from fourbar.scene import Command, Scene, command, command_at
from fourbar.scene.motion import (
    COMMAND_NAMES,
    SIDES,
    STROKE_COMMAND,
    Motion,
)
from fourbar.scene.scene import default_places, write_stroke_ranges
from fourbar.solution import compute_times
from fourbar.solving import solve

COMMANDED_ANGLES = tuple(names[0] for names in COMMAND_NAMES.values())
STATED_POSITIONS = (*COMMANDED_ANGLES, STROKE_COMMAND[0], "time")
"""Names by which a position may be stated."""
SAME_POSITION = 1e-6
"""rad, or part of a length: two places that the formulas give in two ways are one."""
INSIDE_LIMIT = 1e-12
"""rad; distance from a limit at which a linkage assembles as doubles."""
_GRID_DIGITS = 4
"""Digits of an end of a range that is read from the positions of the default sweep."""
LAW_INSTANTS = 2000
"""Instants of a motion by a law among which passings are looked for."""
LAST_DIGIT = 1e-15
"""Relative width at which a time is located."""
HALVINGS_OF_A_PASSING = 60
"""Halvings of an interval: each passing is located to the last digits."""


def find_positions(scene: Scene, wanted: list[tuple[str, float]]) -> Command:
    """Find the positions of a scene's motion where named quantities have values.

    Parameters
    ----------
    wanted : names among `STATED_POSITIONS` and values, rad, m or s. Each gives the
        positions of the scene's assembly that have it, of a motion over time those
        that it passes,
        of a released one the first.

    Raises
    ------
    InputError : a name that the motion has not.
    NotAssembledError : no position has the value; the message says the range.
    """
    if scene.motion.free is not None:
        return join_commands([_find_released(scene, *entry) for entry in wanted])
    find = _find_places if scene.motion.law is None else _find_times
    places = [place for entry in wanted for place in find(scene, *entry)]
    return command_at(scene, np.array(places))


def _find_places(scene: Scene, name: str, value: float) -> list[float]:
    """Find the commanded angles or strokes at which a named one has a value."""
    motion = scene.motion
    if name == motion.commanded:
        _require_assembled(scene, name, value)
        return [value]
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
        values = _require_values(getattr(whole, name), name)
        low, high = _find_extent(values)
        raise NotAssembledError(
            f"{_say_position(name, value)}: no position of this assembly has it;"
            f" {name} goes from {_write_position(name, low, _GRID_DIGITS)} to"
            f" {_write_position(name, high, _GRID_DIGITS)}"
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


def _require_assembled(scene: Scene, name: str, value: float) -> None:
    """Raise NotAssembledError where the linkage does not assemble.

    The error states the range of the commanded quantity.
    """
    at = command_at(scene, np.array([value]))  # which refuses a stroke out of range
    if solve(scene, "position", at=at).assembled[0]:
        return
    raise NotAssembledError(
        f"{_say_position(name, value)}: the linkage does not assemble there;"
        f" {say_range(scene)}"
    )


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
    for low, high in find_intervals(scene.linkage, bar):
        for end, inwards in ((low, INSIDE_LIMIT), (high, -INSIDE_LIMIT)):
            is_limit = abs(math.remainder(angle - end, TURN)) <= SAME_POSITION
            if is_limit and high - low < TURN:
                return end + inwards, True
    return angle, False


def is_same_position(name: str, first: float, second: float) -> bool:
    """Return True if two values of an angle (whole turns apart) or a stroke are one."""
    if name in COMMANDED_ANGLES:
        return abs(math.remainder(first - second, TURN)) <= SAME_POSITION
    return abs(first - second) <= SAME_POSITION * abs(second)


def _find_times(scene: Scene, name: str, value: float) -> list[float]:
    """Find the times at which a motion by a law passes a value."""
    law = scene.motion.law
    assert law is not None
    start = law.time[0]
    stop = law.time[-1]
    if name == "time":
        if not start <= value <= stop:
            raise NotAssembledError(
                f"{_say_position(name, value)}:"
                f" the law goes from {start:.6g} to {stop:.6g} s"
            )
        return [value]

    def read(times: Array) -> Array:
        solution = solve(scene, "position", at=command_at(scene, times))
        return _require_values(getattr(solution, name), name)

    grid = np.unique([*np.linspace(start, stop, LAW_INSTANTS + 1), *law.time])
    gaps = _measure_gaps(name, read(grid), value)

    def gap(time: float) -> float:
        return float(_measure_gaps(name, read(np.array([time])), value)[0])

    times = [float(start)] if gaps[0] == 0.0 else []
    times += [
        _bisect_gap(gap, *grid[row : row + 2]) for row in _find_crossings(name, gaps)
    ]
    if not times:
        raise _never_passed(name, value, read(grid))
    return times


def _measure_gaps(name: str, values: Array, value: float) -> Array:
    """Return how far values lie from one, of angles within half a turn."""
    if name in COMMANDED_ANGLES:
        return np.asarray(np.angle(np.exp(1j * (values - value))))
    return values - value


def _find_crossings(name: str, gaps: Array) -> NDArray[np.intp]:
    """Return the index before each change of sign; a jump by a turn is none.

    A zero counts once, with the step that ends there.
    """
    before = gaps[:-1]
    after = gaps[1:]
    near = name not in COMMANDED_ANGLES or np.abs(after - before) < 0.5 * math.pi
    return np.flatnonzero((before != 0.0) & (before * after <= 0.0) & near)


def _bisect_gap(gap: Callable[[float], float], low: float, high: float) -> float:
    """Bisect an interval in which a gap changes its sign."""
    start = gap(low)
    for _ in range(HALVINGS_OF_A_PASSING):
        middle = 0.5 * (low + high)
        if gap(middle) * start > 0.0:
            low = middle
        else:
            high = middle
    return high


def _never_passed(name: str, value: float, values: Array) -> NotAssembledError:
    low, high = _find_extent(values)
    return NotAssembledError(
        f"{_say_position(name, value)}: the motion does not pass it; it stays within "
        f"{_write_position(name, low)} and {_write_position(name, high)}"
    )


def _find_extent(values: Array) -> tuple[float, float]:
    return float(np.nanmin(values)), float(np.nanmax(values))


def _require_values(values: Array | None, name: str) -> Array:
    if values is None:
        raise InputError("at", name, "needs a drive along a line")
    return values


def _say_position(name: str, value: float) -> str:
    """Say a place as the command line has it."""
    return f"at {name} = {_write_position(name, value)}"


def _write_position(name: str, value: float, digits: int = 6) -> str:
    if name in COMMANDED_ANGLES:
        return f"{math.degrees(value):.{digits}g} deg"
    return write_in_units("s" if name == "time" else "m", value, digits=digits)


def _find_released(scene: Scene, name: str, value: float) -> Command:
    """Find the instant at which a released motion first passes a value."""
    free = scene.motion.free
    assert free is not None

    released = release(scene)
    whole = released.command

    def read(at: Command) -> Array:
        return _require_values(getattr(solve(scene, "position", at=at), name), name)

    if name == "time":
        if not 0.0 <= value <= free.duration:
            raise NotAssembledError(
                f"{_say_position(name, value)}: the release lasts {free.duration:.6g} s"
            )
        return _take_instant(released, value)
    times = whole.time
    assert times is not None
    values = read(whole)
    gaps = _measure_gaps(name, values, value)
    if gaps[0] == 0.0:
        return whole.part(slice(0, 1))
    rows = _find_crossings(name, gaps)
    if len(rows) == 0:
        raise _never_passed(name, value, values)
    low, high = times[rows[0] : rows[0] + 2].tolist()

    def gap(time: float) -> float:
        here = read(_take_instant(released, time))
        return float(_measure_gaps(name, here, value)[0])

    from scipy.optimize import brentq

    time = float(brentq(gap, low, high, xtol=LAST_DIGIT * high, rtol=LAST_DIGIT))
    return _take_instant(released, time)


def _take_instant(released: Released, time: float) -> Command:
    """Take one instant of a free motion."""
    return released.command_at(np.unique([0.0, time])).part(slice(-1, None))


def join_commands(commands: list[Command]) -> Command:
    """Join commands of one motion into one command."""
    joined: Command = _join(commands)
    return joined


def _join(values: Sequence[Any]) -> Any:
    """Join arrays, and the fields of commands and origins; of others take the first."""
    first = values[0]
    if isinstance(first, tuple):
        return type(first)(*map(_join, zip(*values, strict=True)))
    if isinstance(first, np.ndarray) and first.ndim:
        return np.concatenate(values)
    return first
