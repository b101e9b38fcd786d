"""Compute the worst errors of an answer: torque and each pin force against the formulas, each on its scale."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fourbar.quantities import OK
from fourbar.scene import Command, Scene
from fourbar.solve import solve
from fourbar_validation.compare.answer import Array
from fourbar_validation.compare.compare import mark_turning
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import find_error


class WorstErrors(NamedTuple):
    """Worst relative errors over the positions; inf where there is no answer."""

    torque: float
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


QUANTITIES = WorstErrors._fields
NO_ANSWER = WorstErrors(*[math.inf] * len(QUANTITIES))


def compute_errors(
    scene: Scene, command: Command, quantities: dict[str, Array]
) -> WorstErrors:
    """Compute the errors of an answer at the motion that its engine really made.

    The torque on bar 3 or 4 has poles where that bar stands still: it is judged where the bar turns
    at more than a tenth of its greatest speed, as in the regression report.
    """
    if not np.isfinite(command.theta_2).all():
        return NO_ANSWER
    formulas = solve(scene, "force", at=command)
    judged = formulas.status_code == OK
    if not judged.any():
        return NO_ANSWER
    worst = {}
    for name in QUANTITIES:
        ours, counted = getattr(formulas, name), judged
        if name == "torque" and scene.drive_bar != 2:
            counted = judged & mark_turning(
                getattr(formulas, f"omega_{scene.drive_bar}")
            )
        error = find_error(
            name, ours, quantities[name], scale_of(name, scene, formulas, ours)
        )
        worst[name] = find_greatest(error[counted])
    return WorstErrors(**worst)


def find_greatest(errors: Array | Sequence[float]) -> float:
    """Return the greatest of some errors; inf if one is NaN or the greatest is not finite, or if there are none."""
    value = float(np.max(errors, initial=-math.inf))
    return value if math.isfinite(value) else math.inf
