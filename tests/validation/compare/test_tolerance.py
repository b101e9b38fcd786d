"""The one relative error.

What a size of nothing demands, and that what is no number is never small.
"""

from math import pi, tau

import numpy as np
from pytest import approx, mark

import fourbar
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    FULL_ACCURACY,
    IDENTITY,
    SIMULATED,
    compute_difference,
    divide,
    find_condition,
    find_error,
    find_lever,
    find_used,
    mark_touching,
    replace_zero_size,
)
from tests.support.rows import read_rows
from tests.support.scenes import crank_rocker


@mark.parametrize(
    "name, ours, theirs, apart",
    [
        ("theta_3", pi - 0.25, -pi + 0.25, 0.5),
        ("theta_3", 1.0, 1.0 + pi, pi),
        ("theta_3", -3.0, 0.5, tau - 3.5),
        ("omega_3", 1.0, 8.0, 7.0),
        ("F12", [4.0, 4.0], [1.0, 0.0], 5.0),
    ],
)
def test_angles_differ_modulo_a_turn_and_vectors_by_their_norm(
    name, ours, theirs, apart
):
    pair = np.array([ours]), np.array([theirs])
    assert compute_difference(name, *pair) == approx([apart], rel=1e-15)
    assert find_error(name, *pair, np.array([10.0])) == approx(apart / 10.0)


def test_arrays_of_two_shapes_have_no_error_and_no_size_demands_zero():
    assert np.isnan(find_error("torque", np.ones(2), np.ones((2, 2)), np.ones(2))).all()
    assert divide(0.0, 0.0) == 0.0 and divide(1e-300, 0.0) > 1e15
    assert divide(np.array([0.25]), replace_zero_size(np.zeros(1))) == 0.25


@mark.parametrize(
    "error, allowed, share",
    read_rows("""
1 | 4 | 0.25
0 | 0 | 0
1e-300 | 0 | inf
nan | 1 | inf
1 | nan | inf
inf | inf | inf
-inf | 1 | inf
"""),
)
def test_what_is_no_number_uses_more_than_is_allowed(error, allowed, share):
    assert find_used(float(error), float(allowed)) == float(share)


def test_conditions_of_several_quantities_are_those_of_their_units():
    """Of angles s, of rates s^2, of forces s^2 times the drive's; of the input 1."""
    scene = crank_rocker(
        fourbar.Motion(theta_3=np.linspace(0.7, 1.3, 5), omega_3=1.0),
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
    found = [find_condition(name, scene.linkage, s) for name in wanted]
    assert np.ptp(s.drive_condition) > 0.0 and np.ptp(s.condition) > 0.0
    np.testing.assert_allclose(found, [*wanted.values()], rtol=1e-15)


@mark.parametrize(
    "bound, power",
    [(EQUIVALENCE, 1.0), (IDENTITY, 0.0), (SIMULATED, 0.0), (FULL_ACCURACY, 0.0)],
)
def test_only_an_exact_comparison_is_allowed_more_as_the_condition_falls(bound, power):
    condition = np.array([1.0, 0.125, 0.01])
    assert EQUIVALENCE.factor == IDENTITY.factor == 50.0 * 2.0**-52
    allowed = bound.factor / condition**power
    assert bound.allowed(condition) == approx(allowed, rel=1e-12)


def test_only_a_loop_that_misses_by_its_rounding_touches():
    linkage = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    limit = fourbar.limit_positions(linkage)[0].theta_2
    off = np.array([0.0, 1e-9, -1e-9, 1e-3])
    assert mark_touching(linkage, limit + off).tolist() == [True, False, False, False]
