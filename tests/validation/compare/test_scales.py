"""What an error is divided by.

No other size than that of the quantity itself, where it has one.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fourbar.effects import Load
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Motion, Sweep
from fourbar.solving import solve
from fourbar_validation.compare.scales import Scale, scale_of, size_answer
from fourbar_validation.compare.tolerance import WELL_CONDITIONED, magnitude
from tests.support.scenes import balance, recommand

ROCKER = uniform(0.3, 0.25, 0.1, 0.22)


def solve_with_scale(name, scene):
    """Return the solution of a scene, and the scale of one of its quantities."""
    solution = solve(scene)
    return solution, scale_of(
        name,
        scene,
        solution,
        solution[name],
    )


LOW, HIGH = sorted(x.theta_2 for x in limit_positions(ROCKER) if 0.0 < x.theta_2 < 3.0)


@pytest.mark.parametrize("quantity", ("torque", "F12", "a_G3", "omega_3"))
def test_the_scale_is_the_greatest_well_conditioned_value_and_elsewhere_the_value(
    quantity,
):
    """It would be larger of terms that cancel.

    Near a limit, where forces diverge, it would be too.
    """
    middle, tenth = 0.5 * (LOW + HIGH), 0.1 * (HIGH - LOW)
    inside = np.linspace(middle - tenth, middle + tenth, 7)
    scene = Scene(ROCKER, Motion(np.append(inside, HIGH - 1e-7), 10.0))
    solution, scale = solve_with_scale(quantity, scene)
    assert solution.condition[-1] < WELL_CONDITIONED <= solution.condition[:-1].min()
    size = magnitude(solution[quantity])
    assert_allclose(scale.size, np.append(np.full(7, size[:-1].max()), size[-1]))


def test_where_everything_cancels_the_scale_is_that_of_the_forces_that_cancel():
    """Two opposite forces at one point of bar 2 of a linkage at rest: no torque.

    2 x 50 N on 0.25 m cancel.
    """
    loads = (Load(2, (size, 0.0), arm=(0.05, 0.0)) for size in (50.0, -50.0))
    scene = Scene(ROCKER, Motion(Sweep(0.5, 0.6, 3), 0.0), loads=tuple(loads))
    _, scale = solve_with_scale("torque", scene)
    assert np.all(scale.size >= 0.25 * 100.0)
    assert np.all(scale.size <= 4.0 * 0.25 * 100.0)
    assert np.all(scale.vanishes) and np.all(scale.cancellation == 1.0)


def test_what_the_input_alone_decides_has_no_scale_of_the_other_bars():
    """Beside a limit alpha_3 grows without bound, and a_A does not."""
    for name in ("v_A", "v_G2", "a_A", "a_G2"):
        scene = Scene(ROCKER, Motion([LOW + 1e-9], 10.0))
        solution, scale = solve_with_scale(name, scene)
        assert abs(solution.alpha_3[0]) > 1e9
        assert_allclose(scale.size, magnitude(solution[name]))


def test_terms_that_cancel_raise_what_is_allowed_by_what_they_exceed_the_rest():
    """The weights of counterweight and coupler have moments of 0.5 kg g 0.1 m each.

    The rest is `left` of one of them; in the harness's sum every force has a lever as
    long as the longest bar.
    """
    cancelled = {}
    for left in (1e-1, 1e-2, 1e-4):
        _, scale = solve_with_scale("torque", balance(left))
        moment = 0.5 * 9.80665 * 0.1
        assert_allclose(scale.size, left * moment, rtol=0.02)
        assert not scale.vanishes.any()
        cancelled[left] = scale.cancellation[0]
        assert 2.0 / left <= cancelled[left] <= 100.0 / left
        assert_allclose(scale.factor, cancelled[left] / 50.0)
        assert_allclose(scale.of_terms, cancelled[left] * scale.size)
    assert cancelled[1e-4] / cancelled[1e-2] == pytest.approx(100.0, rel=0.01)
    _, scale = solve_with_scale("torque", balance(1.0))
    assert np.all(scale.factor == 1.0) and np.all(scale.of_terms == scale.size)
    _, angles = solve_with_scale("theta_3", balance(1.0))
    assert np.all(angles.size == 1.0) and np.all(angles.cancellation == 1.0)


def test_what_vanishes_is_judged_by_its_terms_and_what_has_none_by_nothing():
    scene = balance(1e-13, 0.0)
    _, scale = solve_with_scale("torque", scene)
    assert np.all(scale.vanishes) and np.all(scale.cancellation == 1.0)
    assert np.all(scale.size > 0.5 * 9.8 * 0.1)
    _, nothing = solve_with_scale("omega_3", scene)
    assert not (nothing.size.any() or nothing.vanishes.any())


def test_the_terms_of_an_angular_acceleration_are_those_of_its_own_bar():
    """The accelerations of A and B, over the bar's length and the sine between both."""
    a, b, c = 0.25, 0.1, 0.22
    for name, length in (("alpha_3", b), ("alpha_4", c)):
        s, scale = solve_with_scale(name, Scene(ROCKER, Motion([0.9], 10.0, 7.0)))
        terms = a * 107.0 + b * s.omega_3**2 + c * s.omega_4**2
        expected = terms / (length * s.condition * abs(s[name]))
        assert_allclose(scale.cancellation, expected)


def test_an_answer_has_a_scale_of_its_own_from_its_rates_alone():
    """Accelerations of mass centres that it lacks follow from its own motion."""
    scene = recommand(balance(1e-2, 5.0), acceleration=40.0)
    solution = solve(scene)
    expected = size_answer(scene, solution)
    bare = replace(solution, a_G2=None, a_G3=None, a_G4=None)
    sizes = size_answer(scene, bare)
    assert expected is not None and sizes is not None
    for name in ("torque", "F12"):
        assert_allclose(
            sizes.scale(name, solution[name]).cancellation,
            expected.scale(name, solution[name]).cancellation,
            rtol=1e-12,
        )
    assert_allclose(sizes.solution.a_G3, solution.a_G3, rtol=1e-12)
    assert size_answer(scene, replace(bare, alpha_4=None)) is None


def test_the_pair_that_allows_less_of_an_error_is_taken_whole():
    """Allowed are size times max(1, N/50): 4 and 3, 2 and 6, nothing known and 1."""
    ours, theirs = (
        Scale(np.array(size), np.array(cancellation), np.full(3, vanishes))
        for size, cancellation, vanishes in (
            ([2.0, 2.0, np.nan], [100.0, 1.0, np.nan], False),
            ([3.0, 1.0, 1.0], [1.0, 300.0, 1.0], True),
        )
    )
    taken = ours.take_strictest(theirs)
    assert taken.size.tolist() == [3.0, 2.0, 1.0]
    assert taken.cancellation.tolist() == [1.0, 1.0, 1.0]
    assert taken.vanishes.tolist() == [True, False, True]
    assert theirs.take_strictest(ours).size.tolist() == taken.size.tolist()
