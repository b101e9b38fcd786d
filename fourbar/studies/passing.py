"""Positions of a scene's assembly at which an angle or the stroke has a value."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.errors import NotAssembledError, write_in_units
from fourbar.formulas.mobility import TURN, find_intervals, turns_fully
from fourbar.linkage import FourBar
from fourbar.scene import Command, Scene, command, command_at, default_places, say_range
from fourbar.scene.motion import COMMAND_NAMES, STROKE_COMMAND, Sweep
from fourbar.solving import solve

COMMANDED_ANGLES = tuple(names[0] for names in COMMAND_NAMES.values())
STATED_POSITIONS = (*COMMANDED_ANGLES, STROKE_COMMAND[0])
"""Names by which a position may be stated."""
SAME_POSITION = 1e-6
"""rad, or part of a length: two places that the formulas give in two ways are one."""
INSIDE_LIMIT = 1e-12
"""rad; distance from a limit at which a linkage assembles as doubles."""


def find_commanded(scene: Scene, value: float) -> Command:
    """Return the command of one angle or stroke of a scene's assembly.

    Parameters
    ----------
    scene : its motion has no time of its own.
    value : rad or m.

    Raises
    ------
    InputError : the cylinder cannot have the stroke.
    NotAssembledError : the linkage does not assemble there; the message says the range.
    """
    at = command_at(scene, np.array([value]))
    if solve(scene, "position", at=at).assembled[0]:
        return at
    raise NotAssembledError(
        f"at {at.commanded} = {write_in_units(at.unit, value)}: the linkage does not"
        f" assemble there; {say_range(scene)}"
    )


def say_nowhere(scene: Scene) -> str:
    """Say that no position of a scene assembles, and where the linkage does."""
    return (
        f"motion.{scene.motion.commanded}: the linkage assembles at none of the"
        f" positions requested; {say_range(scene)}"
    )


def extend_motion(scene: Scene) -> Scene:
    """Return a scene that sweeps all positions of its assembly, from limit to limit.

    Whole turns are counted so that the positions of the scene's own motion are among
    them. Rates stay.
    """
    motion = scene.motion
    at = command(scene)
    closes = solve(scene, "position", at=at).assembled
    angles = at.angle[closes] if closes.any() else at.angle
    begins = float(angles.min())
    places = default_places(scene, float(angles[0]), INSIDE_LIMIT)
    start, stop = places[[0, -1]].tolist()
    if motion.stroke is None:
        turned = TURN * math.floor((begins - start + SAME_POSITION) / TURN)
        ends_within = angles.max() <= stop + turned + SAME_POSITION
        if turns_fully(scene.linkage, motion.bar) and not ends_within:
            turned = begins - start
        start += turned
        stop += turned
    motion.find_rates(places)  # which refuses those of each stated position
    sweep = Sweep(start, stop, len(places) - 1)
    return replace(scene, motion=motion.replace(angle=sweep))


def meet_limit(linkage: FourBar, bar: int, angle: float, rounding: float) -> float:
    """Return the limit of a bar for an angle beyond it that may be its rounding, rad.

    Any other angle stays.
    """
    nearest = math.inf
    met = angle
    for low, high in find_intervals(linkage, bar):
        if high - low >= TURN:
            continue
        for limit, outwards in ((low, -1.0), (high, 1.0)):
            away = math.remainder(angle - limit, TURN)
            if abs(away) < nearest:
                nearest = abs(away)
                met = angle - away if 0.0 < outwards * away <= rounding else angle
    return met


def is_same_position(name: str, first: float, second: float) -> bool:
    """Return True if two values of an angle (whole turns apart) or a stroke are one."""
    if name in COMMANDED_ANGLES:
        return abs(math.remainder(first - second, TURN)) <= SAME_POSITION
    return abs(first - second) <= SAME_POSITION * abs(second)


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
