"""Directions and coefficients of every reading against circles in many digits."""

import numpy as np
import pytest
from mpmath import mp, mpf
from pytest import approx

from fourbar.formulas.arithmetic import cross, dot
from fourbar.formulas.mobility import choose_range, limit_positions
from fourbar.formulas.motion import coefficients, take_sines_of_rates
from fourbar.formulas.path import (
    compute_state,
    drive_sine,
    drive_sine_of_triangle,
    prepare_path,
)
from fourbar.formulas.pin_forces import Body, Wrenches, coupler_about_B, pin_forces
from fourbar.formulas.position import close_loop, direction, half_angle, loop
from fourbar.linkage import MOVING_BARS, uniform
from tests.support.exact_loop import ExactLoop
from tests.support.scenes import bare, draw_linkage

EPS = 2.0**-52
FIRST, SECOND = 32.0, 128.0
"""Roundings in a first and a second coefficient; each is magnified by 1/sin^2 mu and
1/sin^4 mu at most: one power of 1/sin^2 mu from the angles, one from the division by
the root of the area.
"""
FEW_ROUNDINGS = 8.0 * EPS
"""Of 1 + |h3| + |h4|, which the coefficients are sums of; their slopes are quotients of
these and h.
"""
LEAST_SINE = 0.02
DRIVEN = {2: (3, 4), 3: (2, 4), 4: (2, 3)}
"""The two bars whose sine a drive on a bar is divided by."""
LINKAGES = {
    "a = d": bare(0.3, 0.3, 0.25, 0.22, -2.0),
    "b = c": bare(0.3, 0.1, 0.25, 0.25, 1.0),
    "input longer than ground": bare(0.1, 0.3, 0.25, 0.32),
    "parallelogram": bare(0.3, 0.1, 0.3, 0.1, 0.4),
    "kite b = c, a = d": bare(0.3, 0.3, 0.2, 0.2, 0.4),
    "kite a = b, c = d": bare(0.2, 0.3, 0.3, 0.2),
    "change point in line": bare(0.3, 0.1, 0.2, 0.2, 0.4),
    "touching folded": bare(0.2, 0.1, 0.4, 0.3, 0.4),
    "rocker": bare(0.5, 0.4, 0.3, 0.25, 0.2),
    "4 a d > 4 b c": bare(0.4, 0.35, 0.1, 0.08),
    **{f"drawn {n}": draw_linkage(np.random.default_rng(n)) for n in range(4)},
}


@pytest.mark.parametrize("bar", MOVING_BARS)
@pytest.mark.parametrize("name", LINKAGES)
def test_every_reading_lies_and_moves_as_circles_meet(name, bar):
    """Read from a bar the limits of the others are positions like any other."""
    linkage, compared = LINKAGES[name], 0
    path = prepare_path(linkage.lengths, linkage.ground_angle, bar)
    low, high = choose_range(linkage, bar)
    angles = [low + (high - low) * part for part in (0.03, 0.21, 0.45, 0.7, 0.96)]
    for other in DRIVEN[bar]:
        angles += [limit[bar - 2] for limit in limit_positions(linkage, other)]
    size = 1.0 + max(linkage.lengths) / min(linkage.lengths)
    for q, branch in [(q, branch) for q in angles for branch in (1, -1)]:
        with np.errstate(all="ignore"):
            position, k, own_sine = path.close(q, path.half_angle(q), branch)
        sine = abs(float(own_sine))
        if not sine > LEAST_SINE:
            continue
        compared += 1
        directions = dict(zip((1, *MOVING_BARS), position[:4], strict=True))
        sign = int(path.sign(q, branch))
        with mp.workdps(50):
            exact = ExactLoop(linkage)
            right = exact.close(bar, mpf(q), sign)
            rates = exact.rates(bar, mpf(q), sign)
            to_O4 = exact.lengths[0] * right[1] - exact.lengths[1] * right[2]
            turned = FIRST * EPS * size / sine
            assert abs(mp.mpc(complex(position.diagonal)) - to_O4) <= turned
            for number, u in directions.items():
                assert abs(mp.mpc(complex(u)) - right[number]) <= turned
            for drive, (i, j) in DRIVEN.items():
                between = (mp.conj(right[i]) * right[j]).imag
                for computed in (
                    path.drive_sine(position, drive),
                    drive_sine(position, drive),
                ):
                    assert abs(computed - between) <= 2.0 * turned
            assert abs(position.sin_mu - (mp.conj(right[3]) * right[4]).imag) <= turned
            slopes = [
                [mpf(float(h)) - derivatives[order] for h, derivatives in pairs]
                for order, pairs in enumerate(
                    zip(values, rates.values(), strict=True)
                    for values in (k[:3], k[5:])
                )
            ]
            first, second = (max(map(abs, missed)) for missed in slopes)
            allowed = FIRST * EPS * size**2 / sine**2
            assert first <= allowed
            assert second <= SECOND * EPS * size**3 / sine**4
            assert abs(k.h23 - (rates[2][0] - rates[3][0])) <= 2.0 * allowed
            assert abs(k.h43 - (rates[4][0] - rates[3][0])) <= 2.0 * allowed
    assert compared >= 3


SHORT = (
    # (d, a, b, c), psi, sign of the root: d - a = +-(b - c) exactly, so the diagonal
    # turns fast and the bars do not
    ((0.859375, 0.853515625, 0.58984375, 0.583984375), -0.0018, -1),
    ((0.859375, 0.853515625, 0.58984375, 0.583984375), 0.0018, 1),
    ((0.859375, 0.853515625, 0.583984375, 0.58984375), 0.0018, -1),
    ((0.859375, 0.853515625, 0.583984375, 0.58984375), 0.0018, 1),
    ((0.853515625, 0.859375, 0.58984375, 0.583984375), 0.0018, -1),
    ((0.853515625, 0.859375, 0.58984375, 0.583984375), 0.0018, 1),
    ((0.853515625, 0.859375, 0.583984375, 0.58984375), -0.0005, -1),
    ((0.8125, 0.810546875, 0.140625, 0.138671875), 0.0008, 1),
    ((0.75, 0.71875, 0.53125, 0.5), 0.01, 1),
)


@pytest.mark.parametrize("lengths, psi, sign", SHORT)
def test_digits_are_kept_where_the_diagonal_is_short(lengths, psi, sign):
    """With E2 = 0 the assembly of this sign of the root changes at psi = 0."""
    assembly = sign if psi > 0.0 else -sign
    k = compute_state(uniform(*lengths), psi, assembly).k
    with mp.workdps(90):
        exact = ExactLoop(uniform(*lengths))
        right = exact.close(2, mpf(psi), sign)
        rates = exact.rates(2, mpf(psi), sign)
    (h3, dh3), (h4, dh4) = rates[3], rates[4]
    size = FEW_ROUNDINGS * (1 + abs(h3) + abs(h4))
    for ours, theirs in ((k.h3, h3), (k.h4, h4), (k.h23, 1 - h3), (k.h43, h4 - h3)):
        assert abs(theirs - float(ours)) < size
    for ours, theirs in ((k.dh3, dh3), (k.dh4, dh4)):
        assert abs(theirs - float(ours)) < size / abs(psi)

    bars, half = loop(*lengths), half_angle(loop(*lengths), psi)
    for theta_1 in (0.0, 0.4):
        u1 = complex(np.exp(1j * theta_1))
        plain = close_loop(bars, u1, direction(psi) * u1, half, assembly)
        corrected = take_sines_of_rates(bars, plain, coefficients(bars, plain))
        for ours, theirs, before in (
            (corrected.u3, right[3], plain.u3),
            (corrected.u4, right[4], plain.u4),
        ):
            assert abs(mp.mpc(ours) - theirs * mp.mpc(u1)) < FEW_ROUNDINGS / abs(psi)
            assert abs(ours - before) < FEW_ROUNDINGS / abs(psi)
            if theta_1 == 0.0:  # a small sine has all its digits
                apart = abs(ours.imag - theirs.imag)
                assert apart < 4.0 * FEW_ROUNDINGS * abs(theirs.imag)


def test_small_sines_are_those_of_the_triangle_elsewhere():
    bars = loop(0.3, 0.1, 0.25, 0.22)
    position = close_loop(bars, 1.0 + 0.0j, direction(1.0), half_angle(bars, 1.0), 1)
    assert take_sines_of_rates(bars, position, coefficients(bars, position)) is position


@pytest.mark.parametrize("drive", [3, 4])
@pytest.mark.parametrize("branch", [1, -1])
def test_the_sine_of_the_drive_keeps_its_digits_on_a_short_ground(branch, drive):
    lengths = loop(2.0**-14, 1.5, 0.75, 1.25)
    half = half_angle(lengths, 0.7)
    position = close_loop(lengths, 1.0, direction(0.7), half, branch)
    i, j = DRIVEN[drive]
    with mp.workdps(60):
        right = ExactLoop(bare(*lengths[:4])).close(2, mpf(0.7), branch)
        exact = float((mp.conj(right[i]) * right[j]).imag)
    computed = drive_sine_of_triangle(lengths, position, drive)
    assert computed == approx(exact, rel=8.0 * EPS)


def test_moment_of_the_coupler_about_B_is_that_of_its_inertia_at_the_mass_centre():
    linkage, theta_2 = uniform(0.3, 0.1, 0.25, 0.22), np.array([0.4, 1.0, 4.0])
    s = compute_state(linkage, theta_2, 1, 3.0, -5.0)
    three = Body(0.7, 0.02, 0.11 + 0.07j)
    arm = s.point(3, three.z) - s.point(4, s.lengths.c)
    expected = -three.I * s.alpha(3) - three.m * cross(arm, s.acceleration(3, three.z))
    sine = drive_sine(s.position, 4)
    moment = coupler_about_B(s.lengths, three, s.position, s.moving, sine)
    assert moment == approx(expected, abs=64 * FEW_ROUNDINGS)


def test_grounds_at_several_angles_are_those_of_each():
    lengths, theta_2 = (0.3, 0.1, 0.25, 0.22), np.array([0.4, 1.0, 4.0])
    theta_1 = np.array([[0.0], [0.4], [1.0]])
    many = prepare_path(tuple(length + 0.0 * theta_1 for length in lengths), theta_1)
    positions = many.position(theta_2, many.half_angle(theta_2), 1)
    for row, angle in enumerate(theta_1[:, 0]):
        one = prepare_path(lengths, float(angle))
        alone = one.position(theta_2, one.half_angle(theta_2), 1)
        for u2 in (alone.u2, np.exp(1j * theta_2)):
            assert positions.u2[row] == approx(u2, abs=FEW_ROUNDINGS)


@pytest.mark.parametrize("pin", ["O2", "A", "B", "O4"])
def test_slip_is_that_of_the_two_bars(pin):
    s = compute_state(uniform(0.3, 0.1, 0.25, 0.22), np.array([0.4, 1.0, 4.0]), 1)
    i, j = {"O2": (1, 2), "A": (2, 3), "B": (3, 4), "O4": (1, 4)}[pin]
    slip = np.subtract(s.omega(j), s.omega(i))
    assert s.slip(pin) == approx(slip, abs=64 * FEW_ROUNDINGS)


@pytest.mark.parametrize("ground, taken", [(0.01, True), (1.1, False)])
def test_a_short_ground_takes_the_moment_of_the_force_at_A_from_virtual_work(
    ground, taken
):
    s = compute_state(uniform(ground, 1.0, 1.2, 1.1), np.array([0.4, 1.0, 4.0]), 1)
    wrenches = Wrenches(1.0 + 2.0j, -0.5j, 0.3 + 0.1j, 0.7, -0.4, 0.2)
    asked = s.lengths, s.position, 2, s.position.sin_mu, wrenches, 0.2j
    first, second = (pin_forces(*asked, moment).F32 for moment in (0.3, -0.5))
    allowed = 64 * FEW_ROUNDINGS * np.abs([first, second]).max()
    u2 = s.position.u2
    assert dot(u2, first) == approx(dot(u2, second), abs=allowed)
    for F32, moment in ((first, 0.3), (second, -0.5)):
        taken_up = np.abs(cross(u2, F32) - moment).max() <= allowed
        assert taken_up is np.bool_(taken)
