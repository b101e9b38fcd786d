"""Transmission angle against the dot product, its extremes against a scan.

Power and the distance to singular positions are tested too.
"""

import math

import mpmath as mp
import numpy as np
import pytest

from fourbar.formulas.mobility import (
    choose_range,
    find_intervals,
    limit_positions,
    turns_fully,
)
from fourbar.formulas.path import compute_state
from fourbar.formulas.transmission import (
    distance_to_singular,
    mechanical_advantage,
    speed_ratio,
    transmission_angle,
    transmission_extremes,
)
from fourbar.linkage import Bar, FourBar
from tests.fourbar.formulas.test_points import random_positions

EPS = 2.0**-52
ANGLE = 16.0 * EPS
"""Rounding of an angle at B, rad: eight operations, and theta_2 itself; magnified by
1/|sin mu|.
"""
SCAN = 4001
HIGHER_ORDER = 1.1
"""What the terms beyond the leading one may add to the miss of a scan."""


def test_transmission_angle_is_the_acute_angle_between_coupler_and_output() -> None:
    with mp.workdps(50):
        for drawn in random_positions(21, 200, 1e-4):
            d, a, b, c = (mp.mpf(length) for length in drawn.bars.lengths)
            psi = mp.mpf(float(drawn.theta_2[0])) - mp.mpf(drawn.bars.ground_angle)
            cosine = (b * b + c * c - a * a - d * d + 2 * a * d * mp.cos(psi)) / (
                2 * b * c
            )
            exact = min(mp.acos(cosine), mp.pi - mp.acos(cosine))
            stretch = (
                float(a * d / (b * c)) + 1.0
            )  # d mu/d psi = a d sin(psi)/(b c sin(mu))
            size = max(1.0, float(a * a + d * d) / float(b * c))
            error = abs(transmission_angle(drawn.moving())[0] - exact)
            assert error <= ANGLE * (stretch + size) / drawn.sine


def test_transmission_angle_keeps_its_digits_where_it_vanishes() -> None:
    psi = 10.0 ** -np.arange(1.0, 14.0)
    # in a parallelogram the angle at B is the angle of the input
    mu = transmission_angle(
        compute_state(FourBar(0.3, Bar(0.1), Bar(0.3), Bar(0.1)), psi, 1)
    )
    assert mu == pytest.approx(psi, rel=8 * EPS)


def test_extremes_are_those_of_a_scan() -> None:
    rng = np.random.default_rng(22)
    kinds = set()
    for _ in range(200):
        d, a, b, c = rng.uniform(0.1, 1.0, 4).tolist()
        if 2.0 * max(d, a, b, c) > d + a + b + c - 0.01:
            continue
        bars = FourBar(d, Bar(a), Bar(b), Bar(c), float(rng.uniform(-3.0, 3.0)))
        extremes = transmission_extremes(bars)
        kinds.add((extremes.least == 0.0, extremes.greatest == math.pi))
        start, stop = find_intervals(bars)[0]
        theta_2 = np.linspace(start, stop, SCAN)[1:-1]
        position = compute_state(bars, theta_2, 1).position
        ba, bo = -b * position.u3, -c * position.u4
        angle = np.abs(np.angle(ba / bo))  # A-B-O4
        step = (stop - start) / (SCAN - 1)
        steep = a * d / (b * c)  # d cos(mu)/d theta_2 = -steep sin psi
        for end, scanned in (
            (extremes.least, angle.min()),
            (extremes.greatest, angle.max()),
        ):
            # mu^2/2 = steep sin psi delta at a limit;
            # else mu'' = steep/sin mu, a whole step away at most
            at_limit = end in (0.0, math.pi)
            miss = (
                math.sqrt(2.0 * steep * step)
                if at_limit
                else 0.5 * steep / math.sin(end) * step**2
            )
            assert end == pytest.approx(scanned, abs=HIGHER_ORDER * miss)
        assert extremes.worst == min(extremes.least, math.pi - extremes.greatest)
        for end, theta in (
            (extremes.least, extremes.theta_2_least),
            (extremes.greatest, extremes.theta_2_greatest),
        ):
            assert 0.0 <= theta - bars.ground_angle <= math.pi * (1.0 + EPS) + 2.0 * EPS
            e = abs(a * np.exp(1j * theta) - d * np.exp(1j * bars.ground_angle))
            assert e**2 == pytest.approx(
                b * b + c * c - 2 * b * c * math.cos(end),
                abs=64 * EPS,
            )
    assert kinds == {(True, True), (True, False), (False, True), (False, False)}


def test_extremes_keep_their_digits_near_a_change_point() -> None:
    with mp.workdps(50):
        for gap in (1e-3, 1e-7, 1e-11, 1e-14):
            d, a, b, c = 0.3, 0.1, 0.25, 0.15 + gap
            extremes = transmission_extremes(FourBar(d, Bar(a), Bar(b), Bar(c)))
            e, b_, c_ = mp.mpf(d) + mp.mpf(a), mp.mpf(b), mp.mpf(c)
            # relative to the distance from pi, which is what is left to transmit
            exact = mp.pi - mp.acos((b_ * b_ + c_ * c_ - e * e) / (2 * b_ * c_))
            assert abs((math.pi - extremes.greatest) - exact) <= 4 * EPS * math.pi
            least = mp.acos(
                (b_ * b_ + c_ * c_ - (mp.mpf(d) - mp.mpf(a)) ** 2) / (2 * b_ * c_)
            )
            assert abs(extremes.least - least) <= 8 * EPS * least


def test_speed_ratio_follows_from_the_centres_of_rotation() -> None:
    # the velocity of B along the coupler equals that of A:
    # a sin(theta_2 - theta_3) = (omega_4/omega_2) c sin(...)
    for drawn in random_positions(23, 100):
        _, a, _, c = drawn.bars.lengths
        moving = drawn.moving()
        theta_3, theta_4 = (float(np.angle(moving.direction(bar))[0]) for bar in (3, 4))
        lever_in = a * math.sin(drawn.theta_2[0] - theta_3)
        lever_out = c * math.sin(theta_4 - theta_3)
        assert speed_ratio(moving)[0] * lever_out == pytest.approx(
            lever_in,
            abs=256 * EPS * (a + c) / drawn.sine**2,
        )


def test_power_in_is_power_out() -> None:
    for drawn in random_positions(24, 100):
        moving = drawn.moving(3.0)
        force_in, r_in, r_out = 2.0, 0.1, 0.4
        force_out = mechanical_advantage(moving, r_in, r_out) * force_in
        power_out = force_out * r_out * moving.omega(4)
        assert power_out == pytest.approx(force_in * r_in * 3.0, rel=16 * EPS)
        # at equal distances, which is what is taken where none are given, it is the
        # ratio of torques
        assert mechanical_advantage(moving) == pytest.approx(
            mechanical_advantage(moving, 0.7, 0.7),
            rel=4 * EPS,
        )


def test_advantage_where_the_output_stands_and_where_the_input_does() -> None:
    # the output stands still exactly: antiparallel kite folded onto itself, B on O2
    kite = FourBar(2.0, Bar(1.0), Bar(1.0), Bar(2.0))
    assert np.isinf(
        mechanical_advantage(compute_state(kite, np.array([1.0]), -1))
    ).all()
    rocker = FourBar(3.0, Bar(2.5), Bar(1.0), Bar(2.2))
    limit = limit_positions(rocker)[0].theta_2
    near = compute_state(rocker, limit + np.array([1e-4, 1e-6, 1e-8]), 1)
    advantage = np.abs(mechanical_advantage(near))
    assert np.isfinite(near.position.sin_mu).all()
    # it falls as the root of the distance
    assert advantage[:-1] / advantage[1:] == pytest.approx([10.0, 10.0], rel=1e-2)
    parallelogram = FourBar(2.0, Bar(1.0), Bar(2.0), Bar(1.0))
    on_change_point = compute_state(parallelogram, np.array([0.0]), 1)
    assert speed_ratio(on_change_point) == mechanical_advantage(on_change_point) == 1.0


def test_distance_is_that_to_the_edge_of_assembly() -> None:
    for bars in (
        FourBar(3.0, Bar(2.5), Bar(1.0), Bar(2.2), 0.7),
        FourBar(2.0, Bar(2.5), Bar(4.0), Bar(2.2), -2.0),
        FourBar(4.0, Bar(2.0), Bar(2.5), Bar(2.2), 3.0),
    ):
        assert not turns_fully(bars)
        theta_2 = np.linspace(*choose_range(bars), 40) + 4 * math.pi
        distance = distance_to_singular(bars, theta_2)
        inside, outside = (
            [
                ~np.isnan(
                    compute_state(
                        bars, theta_2 + s * distance * (1.0 + away), 1
                    ).position.sin_mu
                )
                for s in (1, -1)
            ]
            for away in (-1e-9, 1e-9)
        )
        assert np.all(inside[0] & inside[1])
        assert not np.any(outside[0] & outside[1])


def test_distance_counts_change_points_and_the_dead_centres_of_the_drive() -> None:
    crank = FourBar(3.0, Bar(1.0), Bar(2.5), Bar(2.2), 0.5)
    theta_2 = np.linspace(0.0, 6.0, 50)
    assert np.isinf(distance_to_singular(crank, theta_2)).all()
    dead = distance_to_singular(crank, theta_2, 4, 1)
    assert (
        np.isfinite(dead).all()
        and (dead >= distance_to_singular(crank, theta_2, 4)).all()
    )
    # at a dead centre of a drive on bar 4 the output stands: the speed ratio changes
    # its sign there
    angles = (
        theta_2 + dead * 0.999,
        theta_2 + dead * 1.001,
        theta_2 - dead * 0.999,
        theta_2 - dead * 1.001,
    )
    sign = [np.sign(speed_ratio(compute_state(crank, angle, 1))) for angle in angles]
    assert ((sign[0] != sign[1]) | (sign[2] != sign[3])).all()
    parallelogram = FourBar(2.0, Bar(1.0), Bar(2.0), Bar(1.0), 0.5)
    assert distance_to_singular(
        parallelogram, np.array([0.6, 3.5, 0.5 + math.pi / 2])
    ) == pytest.approx([0.1, 0.5 + math.pi - 3.5, math.pi / 2], abs=8 * EPS)


def test_what_ends_the_input_is_near_for_every_drive_and_branch() -> None:
    rocker = FourBar(3.0, Bar(2.5), Bar(1.0), Bar(2.2), 0.7)
    theta_2 = np.linspace(*choose_range(rocker), 9)
    from_its_ends = distance_to_singular(rocker, theta_2)
    parallelogram = FourBar(2.0, Bar(1.0), Bar(2.0), Bar(1.0), 0.5)
    for branch in (1, -1, np.where(np.arange(9) < 4, 1, -1)):
        assert np.array_equal(
            distance_to_singular(rocker, theta_2, branch=branch), from_its_ends
        )
        for drive in (3, 4):
            assert (
                distance_to_singular(rocker, theta_2, drive, branch) <= from_its_ends
            ).all()
        assert distance_to_singular(
            parallelogram,
            np.full(9, 0.6),
            branch=branch,
        ) == pytest.approx(0.1, abs=8 * EPS)


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("drive", [3, 4])
def test_a_dead_centre_is_where_the_driven_bar_reverses(
    drive: int,
    branch: int,
) -> None:
    crank = FourBar(3.0, Bar(1.0), Bar(2.5), Bar(2.2), 0.5)
    theta_2 = np.linspace(0.0, 2.0 * math.pi, 1201)
    reverses = np.flatnonzero(
        np.diff(np.sign(compute_state(crank, theta_2, branch).omega(drive)))
    )
    assert reverses.size == 2
    step = theta_2[1] - theta_2[0]
    sides = np.full(theta_2.shape, branch)
    assert (distance_to_singular(crank, theta_2, drive, sides)[reverses] <= step).all()
    nearest = np.abs(
        theta_2[:, None]
        - theta_2[reverses]
        - np.array([[-2.0 * math.pi], [0.0], [2.0 * math.pi]])[:, None]
    )
    assert distance_to_singular(crank, theta_2, drive, branch) == pytest.approx(
        nearest.min(axis=(0, 2)),
        abs=step,
    )


def test_distances_of_single_precision_angles_are_in_doubles() -> None:
    rocker = FourBar(3.0, Bar(2.5), Bar(1.0), Bar(2.2), 0.7)
    coarse = np.linspace(*choose_range(rocker), 9).astype(np.float32)
    assert np.array_equal(
        distance_to_singular(rocker, coarse),
        distance_to_singular(rocker, coarse.astype(float)),
    )
