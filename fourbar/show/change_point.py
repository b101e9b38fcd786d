"""Pin forces on a change point: the limits to which they tend along the assembly."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.evaluation.free_motion import release_at
from fourbar.quantities import CHANGE_POINT, PIN_FORCES, Array
from fourbar.scene import Command, Scene, command_at, compute_bar_motion
from fourbar.solution import Solution
from fourbar.solving import solve

ANGLE_STEP = 2e-4
"""rad, of the commanded bar. Forces are read at multiples of it on both sides. A
parabola through three of them meets a limit within the third power, and rounding, which
grows beside a change point as 1/ANGLE_STEP, is 1e-11 of them.
"""
_ONE_SIDE = np.array([1.0, 2.0, 3.0, 2.0, 4.0, 6.0])
"""Multiples of the step at which two parabolas, three each, meet the forces of a side.
"""
MULTIPLES = np.concatenate([-_ONE_SIDE, _ONE_SIDE])
"""Multiples of the step on both sides, by side, parabola and place."""
_RISING, _ORDER = np.unique(MULTIPLES, return_inverse=True)
SAME_LIMIT = 1e-6
"""Part of the forces within which four extrapolations are one limit: as is shown."""
ZERO_LIMIT = 1e-9
"""Part of the forces below which a limit is zero."""


def find_limits(solution: Solution) -> tuple[Solution, str]:
    """Return the solution of one position, and what is said of its pin forces.

    At a change point these are the limits from both sides; a force without a limit
    keeps NaN, and so do all where a side cannot be asked: where a law or a release
    begins or ends, or stands still, and where a cylinder is at an end of its range.
    Other positions, and those without forces, stay as they are, without a word.
    """
    if solution.F12 is None or solution.status_code[0] != CHANGE_POINT:
        return solution, ""
    scene = solution.scene
    limits = _extrapolate_forces(
        scene, solution.at, lambda times: release_at(scene, times).command
    )
    if limits is None:
        return solution, (
            "on the change point pin forces have no value: the motion begins, ends or"
            " stands still there, and has one side alone"
        )
    bounded = np.isfinite(limits)
    said = "on the change point no pin force has a limit"
    if bounded.any():
        said = "on the change point: the limits from both sides"
        said += "" if bounded.all() else "; - has none"
    forces: Any = dict(zip(PIN_FORCES, limits[:, None], strict=True))
    return replace(solution, **forces), said


def has_growing_forces(solution: Solution) -> bool:
    """Return True if pin forces grow without bound at a change point of a release.

    A change point at which the motion begins or ends has one side alone, and is not
    asked.

    `solution`: of the release, over time.
    """
    command_of_run = solution.command_at
    assert command_of_run is not None
    for instant in solution.change_points or ():
        at = command_of_run(np.array([0.0, instant])).part(slice(1, None))
        limits = _extrapolate_forces(solution.scene, at, command_of_run)
        if limits is not None and np.isnan(limits).any():
            return True
    return False


def _list_places(
    scene: Scene, at: Command, command_of_run: Callable[[Array], Command]
) -> Command | None:
    """List the positions at multiples of the step, which rise; None without a side.

    Along a motion over time the bar has the speed and acceleration of each instant.
    """
    law = scene.motion.law
    free = scene.motion.free
    if law:
        begin, *_, end = law.time
    elif free:
        begin, end = 0.0, free.duration
    else:
        # a stroke changes by as much as turns its bar by the step; an angle has turn 1
        here = float(at.places[0])
        _, turn, *_ = compute_bar_motion(scene, here, 1.0, 0.0)
        with suppress(InputError):  # a cylinder at an end of its range
            return command_at(scene, here + ANGLE_STEP / abs(turn) * _RISING)
        return None
    # a motion that comes to rest before has fewer instants
    speed = np.abs(np.ravel(np.asarray(at.speed, dtype=float))[:1])
    if not speed.any():
        return None
    times = at.places[0] + ANGLE_STEP / speed * _RISING
    if times[0] < begin or times[-1] > end:
        return None
    if law:
        return command_at(scene, times)
    beside = command_of_run(np.array([0.0, *times])).part(slice(1, None))
    return beside if len(beside.angle) == len(times) else None


def _extrapolate_forces(
    scene: Scene, at: Command, command_of_run: Callable[[Array], Command]
) -> Array | None:
    """Extrapolate the pin forces to a change point from positions on both sides.

    Returned are their vectors, (4, 2), NaN without a limit; None without a side.

    `command_of_run`: command of a release at other times, which rise from 0.
    """
    places = _list_places(scene, at, command_of_run)
    if places is None:
        return None
    beside = solve(scene, "force", at=places)
    forces = np.array([getattr(beside, name)[_ORDER] for name in PIN_FORCES])
    # by force, side, parabola, multiple of the step and component
    values = forces.reshape(len(PIN_FORCES), 2, 2, 3, 2)
    size = np.abs(values[:, :, 1, -1]).max()
    first, second, third = np.moveaxis(values, 3, 0)
    extrapolations = 3.0 * first - 3.0 * second + third
    distance = np.ptp(extrapolations, axis=(1, 2)).max(axis=-1)
    limits = extrapolations[:, :, 0].mean(axis=1)
    limits[np.abs(limits) <= ZERO_LIMIT * size] = 0.0
    limits[~(distance <= SAME_LIMIT * size)] = np.nan
    return np.asarray(limits)
