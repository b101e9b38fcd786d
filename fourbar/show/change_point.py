"""Pin forces on a change point: the limits to which they tend along the assembly."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.quantities import CHANGE_POINT, PIN_FORCES, Array
from fourbar.scene import command_at
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
    keeps NaN, and so do all of a motion over time, and where a cylinder is at an end of
    its range. Other positions, and those without forces, stay as they are, without a
    word.
    """
    if solution.F12 is None or solution.status_code[0] != CHANGE_POINT:
        return solution, ""
    scene = solution.scene
    rising, order = np.unique(MULTIPLES, return_inverse=True)
    here = float(solution.at.places[0])
    try:
        if solution.time is not None:
            raise InputError("at", None, "is a time")
        # a stroke changes by as much as turns its bar by the step; an angle has turn 1
        _, turn, *_ = compute_bar_motion(scene, here, 1.0, 0.0)
        places = command_at(scene, here + ANGLE_STEP / abs(turn) * rising)
    except InputError:
        return solution, "on the change point pin forces have no value"
    beside = solve(scene, "force", at=places)
    limits = _extrapolate_forces(beside, order)
    forces: Any = {name: limit[None] for name, limit in limits.items()}
    bounded = [np.isfinite(limit).all() for limit in limits.values()]
    said = "on the change point no pin force has a limit"
    if any(bounded):
        said = "on the change point: the limits from both sides"
        said += "" if all(bounded) else "; - has none"
    return replace(solution, **forces), said


def _extrapolate_forces(beside: Solution, rows: NDArray[np.intp]) -> dict[str, Array]:
    """Extrapolate the pin forces to a change point, each (2,); NaN without a limit.

    Parameters
    ----------
    beside : positions on both sides of it.
    rows : those at the `MULTIPLES` of the step.
    """
    forces = {
        name: np.reshape(getattr(beside, name)[rows], (2, 2, 3, 2))
        for name in PIN_FORCES
    }
    size = max(np.abs(values[:, 1, -1]).max() for values in forces.values())
    return {name: _extrapolate_force(values, size) for name, values in forces.items()}


def _extrapolate_force(values: Array, size: float) -> Array:
    """Extrapolate a force to the change point, (2,); NaN where it has no limit.

    Parameters
    ----------
    values : by side, parabola, multiple of the step and component.
    size : of the forces beside the change point, N.
    """
    first, second, third = np.moveaxis(values, 2, 0)
    extrapolations = 3.0 * first - 3.0 * second + third
    distance = np.ptp(extrapolations, axis=(0, 1)).max()
    if not distance <= SAME_LIMIT * size:
        return np.full(2, np.nan)
    limit = extrapolations[:, 0].mean(axis=0)
    return np.where(np.abs(limit) <= ZERO_LIMIT * size, 0.0, limit)
