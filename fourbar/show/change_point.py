"""Pin forces on a change point: the limits to which they tend along the assembly."""

from dataclasses import replace
from typing import Any

import numpy as np

from fourbar.quantities import CHANGE_POINT, PIN_FORCES
from fourbar.scene import Scene, command_at
from fourbar.solution import Array, Solution
from fourbar.solving import solve

STEP = 2e-4
"""rad, of the commanded bar. Forces are read at multiples of it on both sides. A
parabola through three of them meets a limit within the third power, and rounding, which
grows beside a change point as 1/STEP, is 1e-11 of them.
"""
NEAR, _FAR = (1.0, 2.0, 3.0), (2.0, 4.0, 6.0)
"""Multiples of the step at which each of two parabolas meets the forces of a side."""
SAME = 1e-6
"""Part of the forces within which four extrapolations are one limit: as is shown."""
ZERO = 1e-9
"""Part of the forces below which a limit is zero."""


def find_limits(scene: Scene, solution: Solution) -> Solution | None:
    """Return the solution of one position with the limits of its pin forces.

    They are those from both sides of a change point; a force without one keeps NaN.
    None elsewhere, and where a side cannot be asked: of a released motion, a commanded
    stroke, and the ends and standstills of a law.
    """
    if solution.F12 is None or solution.status_code[0] != CHANGE_POINT:
        return None
    at = solution.at
    law = scene.motion.law
    if at.stroke is not None or at.independent is not None:
        return None
    step = STEP
    if law is not None:
        speed = np.abs(np.ravel(np.asarray(at.speed, dtype=float)))[0]
        if speed == 0.0:
            return None
        step = STEP / float(speed)
    multiples = np.array([[sign * m for m in (*NEAR, *_FAR)] for sign in (-1.0, 1.0)])
    places = float(at.places[0]) + step * multiples
    if (
        law is not None
        and not law.time[0] <= places.min() < places.max() <= law.time[-1]
    ):
        return None
    beside = solve(scene, "force", at=command_at(scene, places.ravel()))
    forces = {
        name: np.reshape(getattr(beside, name), (2, 2, 3, 2)) for name in PIN_FORCES
    }
    size = max(np.abs(values[:, 1, -1]).max() for values in forces.values())
    limits: dict[str, Any] = {
        name: _extrapolate(values, size)[None] for name, values in forces.items()
    }
    return replace(solution, **limits)


def _extrapolate(values: Array, size: float) -> Array:
    """Extrapolate a force to the change point, (2,); NaN where it has no limit.

    Parameters
    ----------
    values : by side, parabola, multiple of the step and component.
    size : of the forces beside the change point, N.
    """
    first, second, third = np.moveaxis(values, 2, 0)
    met = 3.0 * first - 3.0 * second + third
    apart = np.ptp(met, axis=(0, 1)).max()
    if not apart <= SAME * size:
        return np.full(2, np.nan)
    limit = met[:, 0].mean(axis=0)
    return np.where(np.abs(limit) <= ZERO * size, 0.0, limit)
