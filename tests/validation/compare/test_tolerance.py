"""The one relative error: what a size of nothing demands, and that what is no number is never small."""

import numpy as np
import pytest

import fourbar
from fourbar.effects import LinearDrive, Place
from fourbar_validation.compare.tolerance import (
    compute_difference,
    divide,
    find_condition,
    find_error,
    find_lever,
    find_used,
    find_worst,
    replace_zero_size,
)
from tests.support.scenes import crank_rocker

NAN, INF = float("nan"), float("inf")


def test_angles_differ_modulo_a_turn_and_vectors_by_their_norm() -> None:
    apart = compute_difference(
        "theta_3", np.array([np.pi - 0.25]), np.array([-np.pi + 0.25])
    )
    assert apart == pytest.approx([0.5], rel=1e-15)
    assert (
        find_error("omega_3", np.array([8.0]), np.array([2.0]), np.array([4.0])) == 1.5
    )
    assert (
        find_error(
            "F12", np.array([[4.0, 4.0]]), np.array([[1.0, 0.0]]), np.array([10.0])
        )
        == 0.5
    )
    assert np.isnan(find_error("torque", np.ones(2), np.ones((2, 2)), np.ones(2))).all()


def test_a_size_of_nothing_demands_nothing_but_zero() -> None:
    assert divide(0.0, 0.0) == 0.0 and divide(1e-300, 0.0) > 1e15
    assert divide(np.array([0.25]), replace_zero_size(np.zeros(1))) == 0.25


@pytest.mark.parametrize(
    ("error", "allowed", "share"),
    [
        (1.0, 4.0, 0.25),
        (0.0, 0.0, 0.0),
        (1e-300, 0.0, INF),
        (NAN, 1.0, INF),
        (1.0, NAN, INF),
        (INF, INF, INF),
    ],
)
def test_what_is_no_number_uses_more_than_is_allowed(
    error: float, allowed: float, share: float
) -> None:
    assert find_used(error, allowed) == share


def test_the_worst_error_is_the_one_that_is_no_number() -> None:
    assert find_worst(np.array([1.0, NAN, 3.0])) == 1
    assert find_worst(np.array([1.0, 2.0, 0.0])) == 1


def test_of_a_stroke_the_angle_of_its_bar_is_conditioned_by_the_lever() -> None:
    """From O2 to the line over the longer of both arms; what follows by |sin(theta_4 - theta_3)| too."""
    r, arm = 0.25, 0.09
    drive = LinearDrive(Place(1, (r, 2.5)), Place(2, (arm, 0.3)))
    motion = fourbar.Motion(
        stroke=np.array([0.2, 0.3, 0.339]), side="left", stroke_speed=0.1
    )
    s = fourbar.solve(crank_rocker(motion=motion, drive=drive))
    share = (
        arm
        * np.sin(np.arccos((arm * arm + r * r - s.stroke**2) / (2.0 * arm * r)))
        / s.stroke
    )
    linkage = crank_rocker().linkage
    assert s.condition == pytest.approx(np.abs(np.sin(s.theta_4 - s.theta_3)) * share)
    for name, wanted in (
        ("theta_2", share),
        ("omega_2", share**2),
        ("theta_4", find_lever(linkage) * s.condition),
    ):
        assert find_condition(name, linkage, s) == pytest.approx(wanted)
    at_angles = crank_rocker(
        motion=fourbar.Motion(theta_2=s.theta_2, omega_2=1.0), drive=drive
    )
    assert (find_condition("theta_2", linkage, fourbar.solve(at_angles)) == 1.0).all()
