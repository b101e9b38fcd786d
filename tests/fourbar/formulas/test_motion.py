"""Positions and motion of points by differences.

What is exact or has no value near limits and change points is tested too.
"""

from math import copysign, pi

import numpy as np
from pytest import approx, mark

from fourbar import Motion, Scene, solve
from fourbar.formulas.arithmetic import dot
from fourbar.formulas.path import NO_DIGIT_LEFT, compute_state
from tests.support.rows import each_branch
from tests.support.scenes import EPS, PARALLELOGRAM, bare, cis


def find_singular(position):
    """Mark positions whose bars 3 and 4 lie in one line."""
    return abs(position.sin_mu) <= NO_DIGIT_LEFT


def assembled(state):
    return (state.position.half.outer >= 0.0) & (state.position.half.inner >= 0.0)


def test_on_a_change_point_everything_is_the_limit_of_its_assembly():
    """A parallelogram's bar 4 turns as bar 2.

    An antiparallelogram has h4 = -(d - a)/(d + a) and its inverse there.
    """
    link, theta_2 = bare(*PARALLELOGRAM), np.array([0.0, 1.0, pi])
    parallel = compute_state(link, theta_2, 1, 2.0, 5.0)
    assert find_singular(parallel.position).tolist() == [True, False, True]
    assert np.array_equal(parallel.omega(4), [2.0, 2.0, 2.0])
    assert np.array_equal(parallel.alpha(4), [5.0, 5.0, 5.0])
    crossed = compute_state(link, theta_2, -1, 2.0, 0.0)
    assert crossed.k.h4[[0, 2]] == approx([-2.0, -0.5], rel=4 * EPS)
    assert crossed.k.h3[[0, 2]] == approx([-1.0, 0.5], rel=4 * EPS)
    assert crossed.alpha(4)[[0, 2]] == approx([0.0, 0.0], abs=8 * EPS)


@mark.parametrize("theta_1", [0.0, 0.4, -2.5])
@each_branch
def test_a_kite_whose_A_lies_on_O4_lies_where_its_neighbours_do(branch, theta_1):
    """As theta_2 falls to theta_1 bars 3 and 4 come to lie together on the ground's
    line.
    """
    link, step = bare(0.3, 0.3, 0.2, 0.2, theta_1), 2.0**-30
    # on it, and so near that e^2 leaves the range of doubles
    for psi in (0.0, *((1e-170, -1e-170) if theta_1 == 0.0 else ())):
        on, near = (
            compute_state(link, theta_1 + np.array([at, 0.5]), branch, 2.0, 3.0)
            for at in (psi, copysign(step, psi))
        )
        assert find_singular(on.position).tolist() == [True, False]
        for bar in (3, 4):
            assert on.direction(bar) == approx(near.direction(bar), abs=2.0 * step)
        assert on.omega(3) == approx(near.omega(3), abs=8.0 * step)
        assert on.alpha(4) == approx(near.alpha(4), abs=8.0 * step)
    # with b and c unlike each other nothing closes there
    open_one = compute_state(bare(0.3, 0.3, 0.2, 0.25), np.zeros(1), branch)
    assert not assembled(open_one).any()


def test_near_parallel_bars_mu_is_the_angle_of_the_input_to_the_last_bit():
    """Bars 3 and 4 of a parallelogram lie as its ground and input do.

    So does the angle between them.
    """
    link = bare(*PARALLELOGRAM)
    position = compute_state(link, np.linspace(0.01, 3.1, 200), 1).position
    assert np.array_equal(position.sin_mu, position.u2.imag)
    assert np.array_equal(dot(position.u3, position.u4), position.u2.real)
    # 8 EPS has no digit left, the next double has
    next_double = np.array([8.0 * EPS, 8.0 * EPS * (1.0 + EPS)])
    beside = find_singular(compute_state(link, next_double, 1).position)
    assert beside.tolist() == [True, False]


def test_short_ground_and_input_leave_no_digit_of_mu():
    """b = c, d and a a billiardth of them.

    mu = e/b, and A passes O4 so near that 8 EPS is reached.
    """
    b, psi = 0.9, np.linspace(0.0, 2.0 * pi, 41)
    for least, most in ((0.7, 2.0), (0.02, 0.03), (1.1, 1.3)):
        d, a = (4.0 * EPS * b * part for part in (most + least, most - least))
        link = bare(d, a, b, b)
        moving = compute_state(link, psi, 1, 2.0)
        singular = find_singular(moving.position)
        e = abs(d - a * cis(psi))
        assert assembled(moving).all()
        assert np.array_equal(singular, e / b <= 8.0 * EPS)
        assert np.array_equal(np.isnan(moving.omega(3)), singular)
        status = solve(Scene(link, Motion(psi, 2.0))).status
        assert [word == "singular" for word in status] == singular.tolist()
