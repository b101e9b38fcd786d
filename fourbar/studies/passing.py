"""Positions of a scene's assembly at which an angle or the stroke has a value."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.errors import NotAssembledError, write_in_units
from fourbar.formulas.mobility import TURN, find_intervals
from fourbar.linkage import FourBar
from fourbar.scene import Command, Scene, command, command_at
from fourbar.scene.motion import (
    COMMAND_NAMES,
    SIDES,
    STROKE_COMMAND,
    Motion,
)
from fourbar.scene.scene import default_places, write_stroke_ranges
from fourbar.solving import solve

COMMANDED_ANGLES = tuple(names[0] for names in COMMAND_NAMES.values())
STATED_POSITIONS = (*COMMANDED_ANGLES, STROKE_COMMAND[0])
"""Names by which a position may be stated."""
SAME_POSITION = 1e-6
"""rad, or part of a length: two places that the formulas give in two ways are one."""
INSIDE_LIMIT = 1e-12
"""rad; distance from a limit at which a linkage assembles as doubles."""
_GRID_DIGITS = 4
"""Digits of an end of a range that is read from the positions of the default sweep."""


def find_positions(scene: Scene, name: str, value: float) -> Command:
    """Find the positions of a scene's assembly where a named quantity has a value.

    Parameters
    ----------
    scene : its motion has no time of its own.
    name : one of `STATED_POSITIONS`.
    value : rad or m.

    Raises
    ------
    InputError : a name that the motion has not.
    NotAssembledError : no position has the value; the message says the range.
    """
    commanded = scene.motion.commanded
    where = f"at {name} = {_write_position(name, value)}"
    if name == commanded:
        at = command_at(scene, np.array([value]))  # which refuses a stroke out of range
        if solve(scene, "position", at=at).assembled[0]:
            return at
        raise NotAssembledError(
            f"{where}: the linkage does not assemble there; {say_range(scene)}"
        )
    places: list[float] = []
    for place in _list_candidates(scene, name, value):
        if any(is_same_position(commanded, place, other) for other in places):
            continue
        here = solve(scene, "position", at=command_at(scene, np.array([place])))
        reached = getattr(here, name)[0]
        if math.isfinite(reached) and is_same_position(name, reached, value):
            places.append(place)
    if not places:
        # of the range that the scene's own motion is in
        places_of_range = default_places(
            scene, float(command(scene).angle[0]), INSIDE_LIMIT
        )
        whole = solve(scene, "position", at=command_at(scene, places_of_range))
        values = getattr(whole, name)
        low = _write_position(name, float(np.nanmin(values)), _GRID_DIGITS)
        high = _write_position(name, float(np.nanmax(values)), _GRID_DIGITS)
        raise NotAssembledError(
            f"{where}: no position of this assembly has it; {name} goes from {low} to"
            f" {high}"
        )
    return command_at(scene, np.array(sorted(places)))


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
        f"{math.degrees(low):.9g} to {math.degrees(high):.9g} deg"
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


def _write_position(name: str, value: float, digits: int = 6) -> str:
    if name in COMMANDED_ANGLES:
        return f"{math.degrees(value):.{digits}g} deg"
    return write_in_units("m", value, digits=digits)


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
