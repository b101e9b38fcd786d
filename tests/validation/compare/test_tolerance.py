"""The one relative error.

What a size of nothing demands, and that what is no number is never small.
"""

import math

import numpy as np
import pytest

import fourbar
from fourbar.effects import LinearDrive, Place
from fourbar_validation.compare.scales import scale_of
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    FULL_ACCURACY,
    IDENTITY,
    SIMULATED,
    compute_difference,
    divide,
    find_condition,
    find_conditions,
    find_error,
    find_lever,
    find_used,
    find_worst,
    mark_touching,
    replace_zero_size,
)
from tests.support.scenes import crank_rocker

NAN, INF = float("nan"), float("inf")


def test_angles_differ_modulo_a_turn_and_vectors_by_their_norm():
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


def test_a_size_of_nothing_demands_nothing_but_zero():
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
def test_what_is_no_number_uses_more_than_is_allowed(error, allowed, share):
    assert find_used(error, allowed) == share


def test_the_worst_error_is_the_one_that_is_no_number():
    assert find_worst(np.array([1.0, NAN, 3.0])) == 1
    assert find_worst(np.array([1.0, 2.0, 0.0])) == 1


def test_conditions_of_several_quantities_are_those_of_their_units():
    """Of angles s, of rates s^2, of forces s^2 times the drive's; of the input 1."""
    scene = crank_rocker(
        motion=fourbar.Motion(theta_3=np.linspace(0.7, 1.3, 5), omega_3=1.0),
        drive_bar=4,
    )
    s = fourbar.solve(scene)
    lever = find_lever(scene.linkage, 3)
    wanted = {
        "theta_3": np.ones(5),
        "omega_3": np.ones(5),
        "theta_2": lever * s.condition,
        "alpha_4": lever * s.condition**2,
        "torque": lever * s.condition**2 * s.drive_condition,
        "F12": lever * s.condition**2 * s.drive_condition,
    }
    found = find_conditions([*wanted], scene.linkage, s)
    assert np.ptp(s.drive_condition) > 0.0 and np.ptp(s.condition) > 0.0
    np.testing.assert_allclose(found, [*wanted.values()], rtol=1e-15)


def test_of_a_stroke_the_angle_of_its_bar_is_conditioned_by_the_lever():
    """From O2 to the line over the longer of both arms.

    What follows by |sin(theta_4 - theta_3)| too.
    """
    r, arm = 0.25, 0.09
    drive = LinearDrive(Place(1, (r, 2.5)), Place(2, (arm, 0.3)))
    motion = fourbar.Motion(
        stroke=np.array([0.2, 0.3, 0.339]),
        side="left",
        stroke_speed=0.1,
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
        motion=fourbar.Motion(theta_2=s.theta_2, omega_2=1.0),
        drive=drive,
    )
    assert (find_condition("theta_2", linkage, fourbar.solve(at_angles)) == 1.0).all()


def test_an_angle_is_compared_modulo_one_turn_and_not_half_a_turn():
    ours = np.array([0.0, 1.0, -3.0])
    for apart, error in ((math.pi, math.pi), (0.5, 0.5), (3.5, 2.0 * math.pi - 3.5)):
        found = compute_difference("theta_3", ours, ours + apart)
        assert found == pytest.approx(np.full(3, error))
    assert compute_difference("omega_3", ours, ours + 7.0) == pytest.approx(7.0)


def test_what_is_allowed_grows_as_the_condition_falls():
    """50 eps at condition 1, a hundred times as much at 0.01.

    An identity is allowed the same everywhere.
    """
    condition = np.array([1.0, 0.1, 0.01])
    allowed = 50.0 * 2.0**-52 * np.array([1.0, 10.0, 100.0])
    assert EQUIVALENCE.allowed(condition) == pytest.approx(allowed, rel=1e-12)
    assert IDENTITY.allowed(condition) == pytest.approx(50.0 * 2.0**-52, rel=1e-12)


def test_only_a_loop_that_misses_by_its_rounding_touches():
    linkage = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    limit = fourbar.limit_positions(linkage)[0].theta_2
    off = np.array([0.0, 1e-9, -1e-9, 1e-3])
    assert mark_touching(linkage, limit + off).tolist() == [True, False, False, False]


@pytest.mark.parametrize("missing", (math.nan, math.inf, -math.inf))
def test_an_error_that_is_no_number_is_the_worst(missing):
    errors = np.array([0.0, missing, 1.0])
    assert find_used(errors, np.ones(3))[1] == math.inf
    if math.isnan(missing):
        assert find_worst(errors) == 1


def test_the_scale_is_of_positions_whose_condition_is_a_tenth_at_least():
    """A rocker's pin forces grow towards its limit, and those of worse conditions
    excuse no others.
    """
    linkage = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    limit = fourbar.limit_positions(linkage)[0].theta_2
    away = np.array([0.3, 0.2, 1e-2, 1e-4, 1e-6])
    solved = (
        fourbar.solve(fourbar.Scene(linkage, motion, effects=(fourbar.Gravity(),)))
        for motion in (
            fourbar.Motion(limit + away, 0.0),
            fourbar.Motion(limit - away, 0.0),
        )
    )
    (s,) = (solution for solution in solved if solution.assembled.all())
    assert s.F12 is not None and s.scene is not None
    size = np.hypot(*s.F12.T)
    well = s.condition >= 0.1
    assert well.any() and not well.all() and size[~well].max() > 10.0 * size[well].max()
    scale = scale_of("F12", s.scene, s, s.F12).size
    assert scale[well] == pytest.approx(size[well].max())
    assert (scale[~well] < 2.0 * size[~well]).all()


@pytest.mark.parametrize(
    ("bound", "times"),
    [(EQUIVALENCE, 8.0), (IDENTITY, 1.0), (SIMULATED, 1.0), (FULL_ACCURACY, 1.0)],
)
def test_only_an_exact_comparison_is_allowed_more_where_the_condition_is_poor(
    bound, times
):
    good, poor = bound.allowed(np.array([1.0, 0.125]))
    assert good == bound.factor and poor == times * good
