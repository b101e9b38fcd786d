import mpmath as mp
import numpy as np
import pytest

from fourbar_validation.compare.tolerance import EPS, K
from fourbar_validation.engines.sliding import solve_refined


@pytest.mark.parametrize("steady", [0.0, 2.5])
def test_what_few_equations_fix_keeps_its_digits_beside_unknowns_that_are_large(steady):
    """A bar is commanded to turn steadily while the others accelerate 1e5 as fast.

    Elimination alone takes another equation's pivot first and leaves the rounding of
    the large unknowns in the small one.
    """
    rng = np.random.default_rng(57)
    lost = 0.0
    for _ in range(20):
        matrix = np.vstack([np.eye(3)[0], rng.uniform(1.0, 5.0, (2, 3))])
        right = np.array([steady, *rng.uniform(1e5, 1e6, 2)])
        x = solve_refined(matrix, right)
        allowed = EPS * steady + (K * EPS) ** 2 * abs(x).max()
        assert abs(x[0] - steady) <= allowed
        with mp.workdps(50):
            exact = [float(one) for one in mp.lu_solve(matrix.tolist(), right.tolist())]
        assert abs(x[1:] / exact[1:] - 1.0).max() <= K * EPS * np.linalg.cond(matrix)
        lost = max(lost, abs(np.linalg.solve(matrix, right)[0] - steady))
    assert lost > 1e-12  # the scene shows what the step is for
