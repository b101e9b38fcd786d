"""Couples of sliding friction, each in proportion to the force at its pin.

The pin forces are linear in the couples. Friction grows from none to its full size, and
jams where the growth turns back. Vectors of the plane are complex numbers, x + i y.
"""

import numpy as np

from fourbar.quantities import Array, ComplexArray, Mask

_FRICTION_STEPS = 60
"""Newton's steps in a stage; where it converges it needs a tenth of them."""
_FRICTION_SETTLED = 8.0 * 2.0**-52
"""Residual of a friction couple's equation, over the sum of its terms, that counts as
rounding.
"""


def solve_refined(matrix: Array, right: Array) -> Array:
    """Solve linear systems by elimination and one step of refinement.

    Elimination leaves in every unknown the rounding of the largest one: the
    acceleration of a bar that is commanded to turn steadily gets that of the bar that
    turns fastest. After the step each equation holds to the rounding of its own terms,
    and an unknown that equations without the large ones fix keeps its digits.

    Parameters
    ----------
    matrix : (..., n, n).
    right : (n,), or (..., n, k).

    Raises LinAlgError for a singular matrix.

    Source: R. D. Skeel, Iterative refinement implies numerical stability for Gaussian
    elimination, Mathematics of Computation 35 (1980).
    """
    x = np.linalg.solve(matrix, right)
    return x + np.linalg.solve(matrix, right - matrix @ x)


def solve_system(matrix: Array, right: Array) -> tuple[Array, float]:
    """Solve linear systems, NaN where singular.

    The largest residual over |matrix| |x| + |right| is returned too.
    """
    x = np.full(right.shape, np.nan)
    finite = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    finite[finite] = np.linalg.det(matrix[finite]) != 0.0
    matrix = matrix[finite]
    right = right[finite]
    x[finite] = solve_refined(matrix, right)
    terms = np.abs(matrix) @ np.abs(x[finite]) + np.abs(right)
    remaining = np.abs(right - matrix @ x[finite]) / np.where(terms == 0.0, 1.0, terms)
    return x, float(np.max(remaining, initial=0.0, where=np.isfinite(remaining)))


_FRICTION_STAGES = 16
"""Stages in which friction grows to its full coefficient. Each is the start of the
next.
"""


@np.errstate(invalid="ignore")
def continue_couples(F: ComplexArray, C: ComplexArray, k: Array) -> tuple[Array, Array]:
    """Solve x_p = k_p |F_p + sum over q of C_pq x_q|, (n, p).

    The continuation starts from no friction; NaN where it jams. The Jacobian of the
    equations is returned too, (n, p, p).

    Parameters
    ----------
    F : pin forces without this friction, (n, p), N.
    C : force that a couple of 1 N m against the rotation at pin q adds at pin p, (n, p,
        p), 1/m.
    k : mu r of each pin, m.
    """
    x = np.zeros(F.shape)
    for stage in range(1, _FRICTION_STAGES + 1):
        x, settled, matrix = solve_couples(F, C, k * (stage / _FRICTION_STAGES), x)
        # without friction the determinant is 1; a change of its sign means that the
        # branch has turned back
        grown = settled & (np.linalg.det(matrix) > 0.0) & (x >= 0.0).all(axis=1)
        x = np.where(grown[:, None], x, np.nan)
    return x, np.where(grown[:, None, None], matrix, np.nan)


def solve_couples(
    F: ComplexArray,
    C: ComplexArray,
    k: Array,
    x: Array,
) -> tuple[Array, Mask, Array]:
    """Solve by Newton's method from couples `x`.

    Return also where it converged, and the Jacobian, (n, p, p).
    """
    x = x.copy()
    settled = np.zeros(len(x), dtype=bool)
    matrix = np.empty((*x.shape, x.shape[-1]))
    left = np.arange(len(x))  # positions where a step is still to be taken
    for _ in range(_FRICTION_STEPS):
        load, adds, couples = F[left], C[left], x[left]
        force = load + (adds * couples[:, None, :]).sum(axis=-1)
        size = np.abs(force)
        direction = force / np.where(size == 0.0, 1.0, size)
        slopes = k[:, None] * (np.conj(direction)[..., None] * adds).real
        matrix[left] = np.eye(len(k)) - slopes
        gap = k * size - couples
        terms = k * (np.abs(load) + (np.abs(adds) * couples[:, None, :]).sum(axis=-1))
        settled[left] = (np.abs(gap) <= _FRICTION_SETTLED * terms).all(axis=1)
        step = solve_system(matrix[left], gap[..., None])[0][..., 0]
        moving = ~settled[left] & np.isfinite(step).all(axis=1)
        left = left[moving]
        if not len(left):
            break
        x[left] += step[moving]
    return x, settled, matrix
