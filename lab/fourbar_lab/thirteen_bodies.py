"""The thirteen equations that the formulas eliminate, solved as a batch.

The speed of the eliminated form is measured against them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fourbar.effects import Actions
from fourbar.effects.effect import list_bodies
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.pin_forces import Wrenches
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Command, Scene
from fourbar_lab import thirteen


def make_bodies(scene: Scene, command: Command) -> thirteen.EquationTerms:
    """Set up the free bodies with what acts on them, by our kinematics.

    Moments are about the mass centres.
    """
    state = compute_shown_state(scene, command)
    parts = list_bodies(scene.linkage, scene.effects)
    n = len(state.theta_2)
    placed = scene.settled()
    actions = Actions(state, parts).add((*placed.loads, *placed.effects))
    acting = actions.wrenches(Wrenches())
    arms: list[Any] = []
    forces = []
    moments = []
    for k, body in zip(MOVING_BARS, parts, strict=True):
        direction = state.direction(k)
        centre = body.z * direction
        # the thesis's order: bar 4's second pin is B as well, and its first is O4
        tip = scene.linkage.bar(k).length * direction
        arms += (-centre, tip - centre)
        R, M = acting.on(k)
        forces.append(body.m * state.acceleration(k, body.z) - R)
        about_G = M - cross(centre, R + 0.0j)
        inertial = body.I * np.asarray(state.alpha(k))
        moments.append(np.broadcast_to(inertial, n) - about_G)
    return thirteen.EquationTerms(
        _stack(arms, n).reshape(n, 3, 2, 2), _stack(forces, n), np.stack(moments, 1)
    )


def _stack(vectors: Sequence[Any], n: int) -> Array:
    """Stack k complex vectors, each of one position or of n, to (n, k, 2)."""
    stacked = np.stack([np.broadcast_to(one, n) for one in vectors], 1)
    return np.stack((stacked.real, stacked.imag), -1).astype(float)


def solve_thirteen(terms: thirteen.EquationTerms, drive_bar: int) -> Array:
    """Solve for the thirteen unknowns of each position, (..., 13)."""
    matrix, right = thirteen.assemble_equations(terms, drive_bar)
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
