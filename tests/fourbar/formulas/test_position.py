"""Kinematic coefficients near change points, against differences in many digits."""

import mpmath as mp
import numpy as np
import pytest
from mpmath import mpf

from fourbar.formulas.arithmetic import cross, dot
from fourbar.formulas.motion import (
    State,
    coefficients,
    rates,
    take_sines_of_rates,
)
from fourbar.formulas.path import compute_state, drive_sine, prepare_path
from fourbar.formulas.pin_forces import Body, Wrenches, coupler_about_B, pin_forces
from fourbar.formulas.position import (
    close_loop,
    direction,
    half_angle,
    loop,
)
from fourbar.linkage import uniform

FEW_ROUNDINGS = 8.0 * 2.0**-52
"""Of 1 + |h3| + |h4|, which the coefficients are sums of; their slopes are quotients of
these and h.
"""
STEP = 30
"""Digits of the step: differences of angles with 90 digits keep 30."""
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


def find_assembly(psi: float, sign: int) -> int:
    """The assembly with this sign of the root at psi.

    With E2 = 0 it changes at psi = 0.
    """
    return sign if psi > 0.0 else -sign


def close_triangle(lengths: tuple[float, ...], psi: mpf, branch: int) -> list[mp.mpc]:
    """Return the vectors AB and O4B, m, by the triangle A, B, O4."""
    d, a, b, c = map(mpf, lengths)
    A = a * mp.expj(psi)
    e = abs(d - A)
    at_A = branch * mp.acos((b * b + e * e - c * c) / (2 * b * e))
    coupler = b * ((d - A) / e) * mp.expj(at_A)
    return [coupler, A + coupler - d]


def differences(lengths: tuple[float, ...], psi: float, branch: int) -> list[mpf]:
    """h3, h4, h3', h4' from the directions of the triangle A, B, O4 about psi."""
    with mp.workdps(90):
        step = mpf(10) ** -STEP
        before, middle, after = (
            [
                mp.arg(bar)
                for bar in close_triangle(lengths, mpf(psi) + k * step, branch)
            ]
            for k in (-1, 0, 1)
        )
        first = [(y - x) / (2 * step) for x, y in zip(before, after, strict=True)]
        return first + [
            (x - 2 * y + z) / step**2
            for x, y, z in zip(before, middle, after, strict=True)
        ]


@pytest.mark.parametrize(("lengths", "psi", "branch"), SHORT)
def test_coefficients_keep_their_digits_where_the_diagonal_is_short(
    lengths: tuple[float, ...],
    psi: float,
    branch: int,
) -> None:
    k = compute_state(uniform(*lengths), psi, find_assembly(psi, branch)).k
    h3, h4, dh3, dh4 = differences(lengths, psi, branch)
    size = FEW_ROUNDINGS * (1 + abs(h3) + abs(h4))
    for coefficient, exact in (
        (k.h3, h3),
        (k.h4, h4),
        (k.h23, 1 - h3),
        (k.h43, h4 - h3),
    ):
        assert abs(exact - float(coefficient)) < size
    for coefficient, exact in ((k.dh3, dh3), (k.dh4, dh4)):
        assert abs(exact - float(coefficient)) < size / abs(psi)


@pytest.mark.parametrize("theta_1", [0.0, 0.4])
@pytest.mark.parametrize(("lengths", "psi", "branch"), SHORT)
def test_small_sines_of_coupler_and_output_keep_their_digits(
    lengths: tuple[float, ...],
    psi: float,
    branch: int,
    theta_1: float,
) -> None:
    bars, half = loop(*lengths), half_angle(loop(*lengths), psi)
    u1 = complex(np.exp(1j * theta_1))
    assembly = find_assembly(psi, branch)
    plain = close_loop(bars, u1, direction(psi) * u1, half, assembly)
    corrected = take_sines_of_rates(bars, plain, coefficients(bars, plain))
    with mp.workdps(50):
        coupler, output = close_triangle(lengths, mpf(psi), branch)
        exact = coupler / mpf(lengths[2]), output / mpf(lengths[3])
    for ours, theirs, before in zip(
        (corrected.u3, corrected.u4),
        exact,
        (plain.u3, plain.u4),
        strict=True,
    ):
        apart = abs(mp.mpc(ours) - theirs * mp.mpc(u1))
        assert apart < FEW_ROUNDINGS / abs(psi) and abs(
            ours - before
        ) < FEW_ROUNDINGS / abs(psi)
        if theta_1 == 0.0:
            assert abs(ours.imag - theirs.imag) < 4.0 * FEW_ROUNDINGS * abs(theirs.imag)


def test_small_sines_are_those_of_the_triangle_elsewhere() -> None:
    bars, half = loop(0.3, 0.1, 0.25, 0.22), half_angle(loop(0.3, 0.1, 0.25, 0.22), 1.0)
    position = close_loop(bars, 1.0 + 0.0j, direction(1.0), half, 1)
    assert take_sines_of_rates(bars, position, coefficients(bars, position)) is position


def test_moment_of_the_coupler_about_B_is_that_of_its_inertia_at_the_mass_centre() -> (
    None
):
    s = compute_state(
        uniform(0.3, 0.1, 0.25, 0.22), np.array([0.4, 1.0, 4.0]), 1, 3.0, -5.0
    )
    three = Body(0.7, 0.02, 0.11 + 0.07j)
    arm = s.point(3, three.z) - s.point(4, s.lengths.c)
    expected = -three.I * s.alpha(3) - three.m * cross(arm, s.acceleration(3, three.z))
    moment = coupler_about_B(
        s.lengths, three, s.position, s.moving, drive_sine(s.position, 4)
    )
    assert np.allclose(moment, expected, rtol=0.0, atol=64 * FEW_ROUNDINGS)


def two_readings() -> tuple[State, State]:
    """The same positions with theta_2 and with theta_4 as the independent angle."""
    bars = uniform(0.3, 0.1, 0.25, 0.22)
    by_2 = compute_state(bars, np.array([0.4, 1.0, 4.0]), 1)
    lengths, theta_4 = by_2.lengths, np.angle(by_2.position.u4)
    reading = prepare_path(lengths[:4], 0.0, 4)
    sign = np.sign(drive_sine(by_2.position, 4))
    position, k = reading.motion(
        reading.position(theta_4, reading.half_angle(theta_4), sign), sign
    )
    return by_2, State(lengths, 0.0, by_2.theta_2, position, k, 1.0, rates(k, 1.0, 0.0))


def test_grounds_at_several_angles_are_those_of_each() -> None:
    bars, theta_2 = uniform(0.3, 0.1, 0.25, 0.22), np.array([0.4, 1.0, 4.0])
    lengths, theta_1 = bars.lengths, np.array([[0.0], [0.4], [1.0]])
    many = prepare_path(tuple(length + 0.0 * theta_1 for length in lengths), theta_1)
    positions = many.position(theta_2, many.half_angle(theta_2), 1)
    for row, angle in enumerate(theta_1[:, 0]):
        one = prepare_path(lengths, float(angle))
        alone = one.position(theta_2, one.half_angle(theta_2), 1)
        assert np.allclose(positions.u2[row], alone.u2, rtol=0.0, atol=FEW_ROUNDINGS)
        assert np.allclose(
            positions.u2[row],
            np.exp(1j * theta_2),
            rtol=0.0,
            atol=FEW_ROUNDINGS,
        )


@pytest.mark.parametrize("pin", ["O2", "A", "B", "O4"])
def test_slip_is_that_of_the_two_bars(pin: str) -> None:
    i, j = {"O2": (1, 2), "A": (2, 3), "B": (3, 4), "O4": (1, 4)}[pin]
    for s in two_readings():
        h = (0.0, s.k.h2, s.k.h3, s.k.h4)
        assert np.allclose(
            s.slip(pin),
            np.subtract(h[j - 1], h[i - 1]),
            rtol=0.0,
            atol=64 * FEW_ROUNDINGS,
        )


def test_a_point_moves_by_either_angle_alike() -> None:
    by_2, by_4 = two_readings()
    for bar in (2, 3, 4):
        z = 0.07 + 0.03j
        chain = by_4.point_coefficient(bar, z) * by_2.k.h4
        assert np.allclose(
            by_2.point_coefficient(bar, z),
            chain,
            rtol=0.0,
            atol=64 * FEW_ROUNDINGS,
        )


@pytest.mark.parametrize(("ground", "taken"), [(0.01, True), (1.1, False)])
def test_a_short_ground_takes_the_moment_of_the_force_at_A_from_virtual_work(
    ground: float,
    taken: bool,
) -> None:
    s = compute_state(uniform(ground, 1.0, 1.2, 1.1), np.array([0.4, 1.0, 4.0]), 1)
    wrenches = Wrenches(1.0 + 2.0j, -0.5j, 0.3 + 0.1j, 0.7, -0.4, 0.2)
    forces = [
        pin_forces(
            s.lengths, s.position, 2, s.position.sin_mu, wrenches, 0.2j, moment
        ).F32
        for moment in (0.3, -0.5)
    ]
    along = [dot(s.position.u2, F32) for F32 in forces]
    assert np.allclose(
        *along,
        rtol=0.0,
        atol=64 * FEW_ROUNDINGS * np.max(np.abs(forces)),
    )
    for F32, moment in zip(forces, (0.3, -0.5), strict=True):
        assert (
            np.allclose(
                cross(s.position.u2, F32),
                moment,
                rtol=0.0,
                atol=FEW_ROUNDINGS * np.max(np.abs(F32)),
            )
            is taken
        )
