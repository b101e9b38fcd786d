"""Pin forces on a change point: the limits to which they tend along the assembly."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.evaluation.free_motion import release_at
from fourbar.quantities import CHANGE_POINT, PIN_FORCES, Array
from fourbar.scene import Command, command_at
from fourbar.scene.scene import compute_bar_motion
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
    rising, order = np.unique(MULTIPLES, return_inverse=True)
    places = _list_places(solution, rising)
    if places is None:
        return solution, (
            "on the change point pin forces have no value: the motion begins, ends or"
            " stands still there, and has one side alone"
        )
    beside = solve(solution.scene, "force", at=places)
    limits = _extrapolate_forces(beside, order)
    bounded = [np.isfinite(limit).all() for limit in limits.values()]
    said = "on the change point no pin force has a limit"
    if any(bounded):
        said = "on the change point: the limits from both sides"
        said += "" if all(bounded) else "; - has none"
    forces: Any = {name: limit[None] for name, limit in limits.items()}
    return replace(solution, **forces), said


def has_growing_forces(solution: Solution) -> bool:
    """Return True if pin forces grow without bound at a change point of a release.

    A change point at which the motion begins or ends has one side alone, and is not
    asked.

    `solution`: of the release, over time.
    """
    assert solution.time is not None
    assert solution.command_at is not None
    instants = np.array([0.0, *(solution.change_points or ())])
    speed = np.asarray(solution.command_at(instants).speed, dtype=float)
    # a motion that comes to rest before it meets the last of them has fewer instants
    instants = instants[: len(speed)]
    moving = speed != 0.0
    time_steps = ANGLE_STEP / np.abs(speed[moving])
    times = instants[moving, None] + time_steps[:, None] * MULTIPLES
    within_motion = (times >= 0.0) & (times <= solution.time[-1])
    times = times[within_motion.all(axis=1)]
    # the release begins at time 0, which is the first row
    rising, rows = np.unique([0.0, *times.ravel()], return_inverse=True)
    beside = solve(solution.scene, "force", at=solution.command_at(rising))
    for rows_of_one in rows[1:].reshape(times.shape):
        limits = _extrapolate_forces(beside, rows_of_one)
        if np.isnan([*limits.values()]).any():
            return True
    return False


def _list_places(solution: Solution, multiples: Array) -> Command | None:
    """List the positions at multiples of the step, which rise; None without a side.

    Along a motion over time the bar has the speed and acceleration of each instant.
    """
    scene = solution.scene
    at = solution.at
    law = scene.motion.law
    if law is None and scene.motion.free is None:
        # a stroke changes by as much as turns its bar by the step; an angle has turn 1
        here = float(at.places[0])
        _, turn, *_ = compute_bar_motion(scene, here, 1.0, 0.0)
        with suppress(InputError):  # a cylinder at an end of its range
            return command_at(scene, here + ANGLE_STEP / abs(turn) * multiples)
        return None
    speed = abs(float(np.ravel(np.asarray(at.speed, dtype=float))[0]))
    if speed == 0.0:
        return None
    times = at.places[0] + ANGLE_STEP / speed * multiples
    begin, *_, end = law.time if law else (0.0, math.inf)
    if times[0] < begin or times[-1] > end:
        return None
    if law:
        return command_at(scene, times)
    released = release_at(scene, np.array([0.0, *times])).command
    # one that comes to rest before has fewer instants
    return released.part(slice(1, None)) if len(released.angle) > len(times) else None


def _extrapolate_forces(beside: Solution, rows: NDArray[np.intp]) -> dict[str, Array]:
    """Extrapolate the pin forces to a change point, each (2,); NaN without a limit.

    Parameters
    ----------
    beside : positions on both sides of it.
    rows : those at the `MULTIPLES` of the step.
    """
    forces = np.array([getattr(beside, name)[rows] for name in PIN_FORCES])
    # by force, side, parabola, multiple of the step and component
    values = forces.reshape(len(PIN_FORCES), 2, 2, 3, 2)
    size = np.abs(values[:, :, 1, -1]).max()
    first, second, third = np.moveaxis(values, 3, 0)
    extrapolations = 3.0 * first - 3.0 * second + third
    distance = np.ptp(extrapolations, axis=(1, 2)).max(axis=-1)
    limits = extrapolations[:, :, 0].mean(axis=1)
    limits[np.abs(limits) <= ZERO_LIMIT * size] = 0.0
    limits[~(distance <= SAME_LIMIT * size)] = np.nan
    return dict(zip(PIN_FORCES, limits, strict=True))
