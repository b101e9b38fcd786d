"""The one relative error: what a size of nothing demands, and that what is no number is never small."""

import numpy as np
import pytest

from fourbar_validation.compare.tolerance import difference, in_own_unit, relative, relative_error, used, worst

NAN, INF = float("nan"), float("inf")


def test_angles_differ_modulo_a_turn_and_vectors_by_their_norm() -> None:
    apart = difference("theta_3", np.array([np.pi - 0.25]), np.array([-np.pi + 0.25]))
    assert apart == pytest.approx([0.5], rel=1e-15)
    assert relative_error("omega_3", np.array([8.0]), np.array([2.0]), np.array([4.0])) == 1.5
    assert relative_error("F12", np.array([[4.0, 4.0]]), np.array([[1.0, 0.0]]), np.array([10.0])) == 0.5
    assert np.isnan(relative_error("torque", np.ones(2), np.ones((2, 2)), np.ones(2))).all()


def test_a_size_of_nothing_demands_nothing_but_zero() -> None:
    assert relative(0.0, 0.0) == 0.0 and relative(1e-300, 0.0) > 1e15
    assert relative(np.array([0.25]), in_own_unit(np.zeros(1))) == 0.25


@pytest.mark.parametrize(
    ("error", "allowed", "share"),
    [(1.0, 4.0, 0.25), (0.0, 0.0, 0.0), (1e-300, 0.0, INF), (NAN, 1.0, INF), (1.0, NAN, INF), (INF, INF, INF)],
)
def test_what_is_no_number_uses_more_than_is_allowed(error: float, allowed: float, share: float) -> None:
    assert used(error, allowed) == share


def test_the_worst_error_is_the_one_that_is_no_number() -> None:
    assert worst(np.array([1.0, NAN, 3.0])) == 1
    assert worst(np.array([1.0, 2.0, 0.0])) == 1
