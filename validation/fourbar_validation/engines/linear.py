"""Linear systems whose equations have terms of very different size."""

import numpy as np

from fourbar.quantities import Array


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
