"""Kinematics against second derivations: Newton on the closure, 50-digit differences of positions, symmetry."""

import cmath
import math
from decimal import Decimal

import mpmath
import numpy as np
import pytest

import fourbar
from fourbar.kinematics import add_accelerations, add_velocities, close_loop
from fourbar.sixty_digits import limit_remainder

EPS = 2.0**-52
LENGTHS = (0.3, 0.1, 0.25, 0.22)
ANGLES = np.linspace(-3.0, 6.0, 41)
CLOSURE = 8 * EPS
"""Of the sum of the lengths: eight roundings of unit vectors and their sum."""
DIFFERENCES = 1e-12
"""Relative: the double results against 50-digit differences, well away from limits."""


def linkage(theta_1: float = 0.4) -> fourbar.FourBar:
    d, a, b, c = LENGTHS
    return fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c), theta_1)


def newton(link: fourbar.FourBar, theta_2: mpmath.mpf, start: tuple[float, float]) -> tuple[mpmath.mpf, mpmath.mpf]:
    """theta_3, theta_4 of the branch nearest to a start, by Newton's iteration on the closure in 50 digits."""
    d, a, b, c = (mpmath.mpf(length) for length in link.lengths)

    def gap(t3: mpmath.mpf, t4: mpmath.mpf) -> list[mpmath.mpf]:
        z = (
            a * mpmath.expj(mpmath.mpc(theta_2))
            + b * mpmath.expj(mpmath.mpc(t3))
            - d * mpmath.expj(mpmath.mpc(link.ground_angle))
            - c * mpmath.expj(mpmath.mpc(t4))
        )
        return [z.real, z.imag]

    solution = mpmath.findroot(gap, start)
    return solution[0], solution[1]


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("theta_1", [0.0, 0.4, -2.5])
def test_the_loop_closes_on_the_branch_asked_for(branch: int, theta_1: float) -> None:
    state = close_loop(linkage(theta_1), ANGLES, branch)
    d, a, b, c = LENGTHS
    e2, e3, e4 = (np.exp(1j * state.angle(bar)) for bar in (2, 3, 4))
    gap = a * e2 + b * e3 - d * cmath.exp(1j * theta_1) - c * e4
    assert np.max(np.abs(gap)) <= CLOSURE * sum(LENGTHS)
    diagonal = d * cmath.exp(1j * theta_1) - a * e2
    assert np.all(np.sign((np.conj(diagonal) * b * e3).imag) == branch)


def test_velocity_and_acceleration_are_differences_of_the_position() -> None:
    link, omega, alpha = linkage(), 3.0, -7.0
    state = close_loop(link, np.array([1.1]), -1)
    add_velocities(state, omega)
    add_accelerations(state, alpha)
    start = (float(state.angle(3)[0]), float(state.angle(4)[0]))
    with mpmath.workdps(50):
        h = mpmath.mpf("1e-12")
        at = [newton(link, mpmath.mpf(1.1) + omega * t + alpha * t * t / 2, start) for t in (-h, mpmath.mpf(0), h)]
        for k, bar in enumerate((3, 4)):
            speed = (at[2][k] - at[0][k]) / (2 * h)
            growth = (at[2][k] - 2 * at[1][k] + at[0][k]) / h**2
            assert abs(state.omega(bar)[0] / speed - 1) < DIFFERENCES  # type: ignore[index]
            assert abs(state.alpha(bar)[0] / growth - 1) < DIFFERENCES  # type: ignore[index]


def test_mirror_image() -> None:
    """Mirrored at the ground line: angles change sign, and so does the branch."""
    up, down = close_loop(linkage(0.0), ANGLES, 1), close_loop(linkage(0.0), -ANGLES, -1)
    for bar in (3, 4):
        assert np.array_equal(up.angle(bar), -down.angle(bar))


@pytest.mark.parametrize("lengths", [(0.3, 0.1, 0.3, 0.1), (0.1, 0.3, 0.3, 0.1)], ids=["parallelogram", "kite"])
def test_parallel_bars_are_exact_beside_the_change_point(lengths: tuple[float, ...]) -> None:
    d, a, b, c = lengths
    link = fourbar.FourBar(d, fourbar.Bar(a), fourbar.Bar(b), fourbar.Bar(c))
    parallelogram = a == c
    for delta in (1e-8, 1e-4, 0.5):
        state = close_loop(link, np.array([math.pi - delta]), 1 if parallelogram else -1)
        add_velocities(state, 2.0)
        add_accelerations(state, 0.0)
        expected = (0.0, 2.0) if parallelogram else (2.0, 0.0)
        assert (state.omega(3)[0], state.omega(4)[0]) == expected  # type: ignore[index]
        assert (state.alpha(3)[0], state.alpha(4)[0]) == (0.0, 0.0)  # type: ignore[index]


def test_positions_that_cannot_close_are_nan_and_say_so() -> None:
    link = fourbar.uniform(1.0, 1.0, 0.4, 0.4)
    state = close_loop(link, np.array([0.5, 2.0]), 1)
    assert state.assembled.tolist() == [True, False]
    assert np.isnan(state.angle(3)).tolist() == [False, True]


@pytest.mark.parametrize("offset", [1e-6, 1e-12, 1e-20, 1e-40])
def test_beyond_a_limit_nothing_assembles_however_near(offset: float) -> None:
    link = fourbar.FourBar(0.5, fourbar.Bar(0.4), fourbar.Bar(0.3), fourbar.Bar(0.25), 0.2)
    # the first limit ends the range in which the linkage closes, the second begins it
    for limit, inside in ((1, -1.0), (2, 1.0)):
        status = [
            fourbar.solve(fourbar.Scene(link, fourbar.Motion(fourbar.FromLimit(limit, side * offset), 1.0))).status
            for side in (inside, 0.0, -inside)
        ]
        assert status == [["ok"], ["singular"], ["not_assembled"]]


@pytest.mark.parametrize("offset", [1e-6, 1e-12, 1e-20])
def test_an_offset_from_a_limit_keeps_all_its_digits(offset: float) -> None:
    """Near a limit sin mu grows as the square root of the offset, however small."""
    link = fourbar.FourBar(0.5, fourbar.Bar(0.4), fourbar.Bar(0.3), fourbar.Bar(0.25), 0.2)
    with mpmath.workdps(60):
        D, A, B, C = (mpmath.mpf(x) for x in link.lengths)
        limit = mpmath.mpf(0.2) + mpmath.acos((A**2 + D**2 - (B + C) ** 2) / (2 * A * D))
        psi = limit - mpmath.mpf(offset) - mpmath.mpf(0.2)
        squared = A**2 + D**2 - 2 * A * D * mpmath.cos(psi)
        cosine = (B**2 + C**2 - squared) / (2 * B * C)
        sine = float(mpmath.sqrt(1 - cosine**2))
        theta_2 = float(limit) - offset
    remainder = limit_remainder(link, float(limit), theta_2, -offset)
    at = fourbar.scene.Command(np.array([theta_2]), np.array([1], np.int8), 1.0, 0.0, remainder)
    scene = fourbar.Scene(link, fourbar.Motion(theta_2, 1.0))
    solution = fourbar.solve(scene, at=at)
    assert isinstance(remainder, Decimal)
    assert abs(solution.sin_mu[0] / sine - 1.0) < 8 * EPS
    assert solution.status == ["ok"]
    assert solution.omega_3 is not None and np.isfinite(solution.omega_3).all()
