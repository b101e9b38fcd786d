"""The thirteen equations that the formulas eliminate, solved as a batch.

The speed of the eliminated form is measured against them. Moments are taken about the
mass centres, unknowns in the order F12, F32, F23, F43, F14, F34 (x, y each), T, as in
the thesis (section 5.7).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Actions
from fourbar.effects.effect import list_bodies
from fourbar.evaluation.case import compute_shown_state
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.pin_forces import Wrenches
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Command, Scene

_OPPOSITE = ((2, 4), (3, 5), (6, 10), (7, 11))
"""Columns of F32 = -F23 and F43 = -F34, component by component."""


class EquationTerms(NamedTuple):
    """Terms of the thirteen equations of bars 2, 3, 4, of one position or of many."""

    arms: Array
    """Vectors from each bar's mass centre to the points of its two forces, m,
    (..., 3, 2, 2).
    """
    inertia_force: Array
    """m a_G minus the forces that act besides the pins', N, (..., 3, 2)."""
    inertia_moment: Array
    """I alpha minus the moments about G that act besides the pins', N m, (..., 3)."""


def make_bodies(scene: Scene, command: Command) -> EquationTerms:
    """Set up the free bodies with what acts on them, by our kinematics."""
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
    return EquationTerms(
        _stack(arms, n).reshape(n, 3, 2, 2), _stack(forces, n), np.stack(moments, 1)
    )


def _stack(vectors: Sequence[Any], n: int) -> Array:
    """Stack k complex vectors, each of one position or of n, to (n, k, 2)."""
    stacked = np.stack([np.broadcast_to(one, n) for one in vectors], 1)
    return np.stack((stacked.real, stacked.imag), -1).astype(float)


def solve_thirteen(terms: EquationTerms, drive_bar: int) -> Array:
    """Solve for the thirteen unknowns of each position, (..., 13)."""
    matrix = np.zeros((*terms.inertia_moment.shape[:-1], 13, 13))
    right = np.zeros(matrix.shape[:-1])
    for k in range(3):
        row = 3 * k
        of_bar = matrix[..., row : row + 3, 4 * k : 4 * k + 4]
        of_bar[..., 0, ::2] = 1.0
        of_bar[..., 1, 1::2] = 1.0
        of_bar[..., 2, ::2] = -terms.arms[..., k, :, 1]
        of_bar[..., 2, 1::2] = terms.arms[..., k, :, 0]
        right[..., row : row + 2] = terms.inertia_force[..., k, :]
        right[..., row + 2] = terms.inertia_moment[..., k]
    matrix[..., 3 * drive_bar - 4, -1] = 1.0
    for row, columns in enumerate(_OPPOSITE, 9):
        matrix[..., row, columns] = 1.0
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0])
