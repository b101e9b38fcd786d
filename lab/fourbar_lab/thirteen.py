"""The thesis's method for the forces: thirteen equations per position.

The equations of all positions are assembled at once. Moments are taken about the mass
centres, unknowns in the order F12, F32, F23, F43, F14, F34 (x, y each), T, as in the
thesis (section 5.7).
"""

from typing import NamedTuple

import numpy as np

from fourbar.quantities import Array

FORCES = ("F12", "F32", "F23", "F43", "F14", "F34")
"""Forces among the unknowns, in their order: two on each of bars 2, 3, 4."""
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


def assemble_equations(terms: EquationTerms, drive_bar: int) -> tuple[Array, Array]:
    """Assemble the matrices (..., 13, 13) and right-hand sides (..., 13)."""
    positions = terms.inertia_moment.shape[:-1]
    matrix = np.zeros((*positions, 13, 13))
    right = np.zeros((*positions, 13))
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
    return matrix, right
