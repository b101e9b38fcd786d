"""Compute the worst errors of an answer against the formulas.

Errors are of the torque and of each pin force, each on its scale.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fourbar.quantities import OK, Array, Mask
from fourbar.scene import Command, Scene
from fourbar.solving import solve
from fourbar_validation.compare.compare import mark_moving_drive
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import find_error
from fourbar_validation.engines.description import name_driving


class WorstErrors(NamedTuple):
    """Worst relative errors over the positions; inf where there is no answer."""

    torque: float
    """Worst error of the drive: of its torque, or of the force of a cylinder."""
    F12: float
    F32: float
    F43: float
    F14: float

    @property
    def force(self) -> float:
        """Return the error of the worst pin force."""
        return max(self[1:])

    @property
    def worst(self) -> float:
        """Return the greatest error, which a required error is compared with."""
        return max(self)


ERROR_NAMES = WorstErrors._fields
INFINITE_ERRORS = WorstErrors(*[math.inf] * len(ERROR_NAMES))


def compute_errors(
    scene: Scene,
    command: Command,
    quantities: dict[str, Array],
) -> WorstErrors:
    """Compute the errors of an answer at the motion that its engine really made.

    A drive on bar 3 or 4, and a cylinder, has a pole where that bar or the stroke
    stands still, and the pin forces have it with the drive. As in the regression report
    they are judged where it moves at more than a tenth of its greatest speed; their
    scale is that of the same positions.
    """
    if not np.isfinite(command.theta_2).all():
        return INFINITE_ERRORS
    formulas = solve(scene, "force", at=command)
    judged = (formulas.status_code == OK) & mark_moving_drive(scene, formulas)
    if not judged.any():
        return INFINITE_ERRORS
    if not judged.all():
        command = command.part(judged)
        formulas = solve(scene, "force", at=command)
    worst = {}
    for field in ERROR_NAMES:
        name = name_driving(scene) if field == "torque" else field
        ours = getattr(formulas, name)
        size = scale_of(name, scene, formulas, ours).size
        error = find_error(name, ours, quantities[name][judged], size)
        worst[field] = find_greatest(error)
    return WorstErrors(**worst)


def mark_far_from_poles(scene: Scene, command: Command) -> Mask:
    """Mark where the drive is far from a pole, (n,).

    The driven bar, or the stroke, moves fast enough there.
    """
    return mark_moving_drive(scene, solve(scene, "velocity", at=command))


def find_greatest(errors: Array | Sequence[float]) -> float:
    """Return the greatest error; inf if one is not finite, or if there are none."""
    value = float(np.max(errors, initial=-math.inf))
    return value if math.isfinite(value) else math.inf
