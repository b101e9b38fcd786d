"""The thesis's method for the forces: thirteen equations per position.

The equations are assembled and solved as a batch, against which the speed of the
eliminated form is measured. Moments are taken about the mass centres, unknowns in the
order F12, F32, F23, F43, F14, F34 (x, y each), T, as in the thesis (section 5.7).
"""

from typing import NamedTuple

import numpy as np

from fourbar.quantities import Array

Vectors = dict[int, Array]
"""Vectors of each bar 2, 3, 4, an array (n, 2)."""


class EquationTerms(NamedTuple):
    """Terms of the thirteen equations."""

    to_first: Vectors
    """Vectors from the mass centre to the first pin (O2, A, O4), m."""
    to_second: Vectors
    """Vectors from the mass centre to the second pin (A, B, B), m."""
    inertia_force: Vectors
    """m a_G minus the forces that act besides the pins', N."""
    inertia_moment: dict[int, Array]
    """I alpha minus the moments about G that act besides the pins', N m, (n,)."""


F12 = 0
F32 = 2
F23 = 4
F43 = 6
F14 = 8
F34 = 10
TORQUE_COLUMN = 12


def assemble_equations(bodies: EquationTerms, drive_bar: int) -> tuple[Array, Array]:
    """Assemble the matrices (n, 13, 13) and right-hand sides (n, 13)."""
    n = len(bodies.inertia_moment[2])
    matrix = np.zeros((n, 13, 13))
    right = np.zeros((n, 13))
    for newton_x, bar, first, second in (
        (0, 2, F12, F32),
        (3, 3, F23, F43),
        (6, 4, F14, F34),
    ):
        newton_y = newton_x + 1
        euler = newton_x + 2
        arms = {first: bodies.to_first[bar], second: bodies.to_second[bar]}
        for force_x, arm in arms.items():
            force_y = force_x + 1
            matrix[:, newton_x, force_x] = 1.0
            matrix[:, newton_y, force_y] = 1.0
            matrix[:, euler, force_x] = -arm[:, 1]
            matrix[:, euler, force_y] = arm[:, 0]
        if bar == drive_bar:
            matrix[:, euler, TORQUE_COLUMN] = 1.0
        right[:, newton_x:euler] = bodies.inertia_force[bar]
        right[:, euler] = bodies.inertia_moment[bar]
    opposite = (
        (F32, F23),
        (F32 + 1, F23 + 1),
        (F43, F34),
        (F43 + 1, F34 + 1),
    )
    for row, (force, reaction) in enumerate(opposite, start=9):
        matrix[:, row, force] = 1.0
        matrix[:, row, reaction] = 1.0
    return matrix, right


def solve_thirteen(bodies: EquationTerms, drive_bar: int) -> Array:
    """Solve for the thirteen unknowns of each position, (n, 13)."""
    matrix, right = assemble_equations(bodies, drive_bar)
    return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0])
