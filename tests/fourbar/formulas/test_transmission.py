"""Transmission angle against the cosine law in many digits, the rest against a scan."""

import math

import mpmath as mp
import numpy as np
import pytest

from fourbar.formulas.mobility import find_intervals, limit_positions
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
PARALLEL = 1e-9
"""Sine of two bars that stay parallel, with the rounding of two circles that touch."""
OUTSIDE = 1e-9
"""rad beyond an edge of assembly."""


def test_transmission_angle_is_the_acute_angle_between_coupler_and_output() -> None:
    with mp.workdps(50):
        for drawn in random_positions(21, 60, 1e-4):
            d, a, b, c = (mp.mpf(length) for length in drawn.bars.lengths)
            psi = mp.mpf(float(drawn.theta_2[0])) - mp.mpf(drawn.bars.ground_angle)
            squares = b * b + c * c - a * a - d * d
            at_B = mp.acos((squares + 2 * a * d * mp.cos(psi)) / (2 * b * c))
            slope = float(a * d / (b * c)) + 1.0  # of mu sin(mu) over psi
            size = max(1.0, float(a * a + d * d) / float(b * c))
            error = transmission_angle(drawn.moving())[0] - min(at_B, mp.pi - at_B)
            assert abs(error) <= ANGLE * (slope + size) / drawn.sine


def test_transmission_angle_keeps_its_digits_where_it_vanishes() -> None:
    psi = 10.0 ** -np.arange(1.0, 14.0)
    parallelogram = FourBar(0.3, Bar(0.1), Bar(0.3), Bar(0.1))
    mu = transmission_angle(compute_state(parallelogram, psi, 1))
    assert mu == pytest.approx(psi, rel=8 * EPS)


def test_extremes_are_those_of_a_scan() -> None:
    rng = np.random.default_rng(22)
    kinds = set()
    for _ in range(80):
        d, a, b, c = rng.uniform(0.1, 1.0, 4).tolist()
        if 2.0 * max(d, a, b, c) > d + a + b + c - 0.01:
            continue
        theta_1 = float(rng.uniform(-3.0, 3.0))
        bars = FourBar(d, Bar(a), Bar(b), Bar(c), theta_1)
        extremes = transmission_extremes(bars)
        kinds.add((extremes.least == 0.0, extremes.greatest == math.pi))
        start, stop = find_intervals(bars)[0]
        psi = np.linspace(start, stop, SCAN)[1:-1] - theta_1
        e2 = d * d + a * a - 2.0 * a * d * np.cos(psi)
        at_B = np.arccos((b * b + c * c - e2) / (2.0 * b * c))
        step = (stop - start) / (SCAN - 1)
        steep = a * d / (b * c)  # d cos(mu)/d theta_2 = -steep sin psi
        for end, scanned, theta_2 in (
            (extremes.least, at_B.min(), extremes.theta_2_least),
            (extremes.greatest, at_B.max(), extremes.theta_2_greatest),
        ):
            # mu^2/2 = steep sin psi delta at a limit;
            # else mu'' = steep/sin mu, a whole step away at most
            if end in (0.0, math.pi):
                miss = math.sqrt(2.0 * steep * step)
            else:
                miss = 0.5 * steep / math.sin(end) * step**2
            assert end == pytest.approx(scanned, abs=HIGHER_ORDER * miss)
            assert 0.0 <= theta_2 - theta_1 <= math.pi * (1.0 + EPS) + 2.0 * EPS
            e = abs(a * np.exp(1j * theta_2) - d * np.exp(1j * theta_1))
            by_cosines = b * b + c * c - 2 * b * c * math.cos(end)
            assert e**2 == pytest.approx(by_cosines, abs=64 * EPS)
        assert extremes.worst == min(extremes.least, math.pi - extremes.greatest)
    assert len(kinds) == 4


@pytest.mark.parametrize("gap", [1e-3, 1e-7, 1e-11, 1e-14])
def test_extremes_keep_their_digits_near_a_change_point(gap: float) -> None:
    d, a, b, c = 0.3, 0.1, 0.25, 0.15 + gap
    extremes = transmission_extremes(FourBar(d, Bar(a), Bar(b), Bar(c)))
    with mp.workdps(50):
        d, a, b, c = map(mp.mpf, (d, a, b, c))
        least, greatest = (
            mp.acos((b * b + c * c - e * e) / (2 * b * c)) for e in (d - a, d + a)
        )
        left = math.pi - extremes.greatest
        assert abs(left - (mp.pi - greatest)) <= 4 * EPS * math.pi
        assert abs(extremes.least - least) <= 8 * EPS * least


def test_speeds_follow_from_the_lever_of_the_coupler_and_power_is_kept() -> None:
    for drawn in random_positions(23, 40):
        moving = drawn.moving(3.0)
        theta_3, theta_4 = (np.angle(moving.direction(bar))[0] for bar in (3, 4))
        lever_in = drawn.bars.input.length * math.sin(drawn.theta_2[0] - theta_3)
        lever_out = drawn.bars.output.length * math.sin(theta_4 - theta_3)
        rounding = 256 * EPS * (drawn.bars.input.length + drawn.bars.output.length)
        assert speed_ratio(moving)[0] * lever_out == pytest.approx(
            lever_in, abs=rounding / drawn.sine**2
        )
        for radii in ((), (0.1, 0.4)):
            r_in, r_out = radii or (1.0, 1.0)
            power = mechanical_advantage(moving, *radii) * r_out * moving.omega(4)
            assert power == pytest.approx(r_in * 3.0, rel=16 * EPS)


def test_advantage_where_the_output_stands_and_where_the_input_does() -> None:
    folded = FourBar(2.0, Bar(1.0), Bar(1.0), Bar(2.0))  # a kite with B on O2
    standing = compute_state(folded, np.array([1.0]), -1)
    assert np.isinf(mechanical_advantage(standing)).all()
    rocker = FourBar(3.0, Bar(2.5), Bar(1.0), Bar(2.2))
    limit = limit_positions(rocker)[0].theta_2
    near = compute_state(rocker, limit + np.array([1e-4, 1e-6, 1e-8]), 1)
    advantage = np.abs(mechanical_advantage(near))
    # it falls as the root of the distance
    assert advantage[:-1] / advantage[1:] == pytest.approx([10.0, 10.0], rel=1e-2)
    parallelogram = FourBar(2.0, Bar(1.0), Bar(2.0), Bar(1.0))
    on_change_point = compute_state(parallelogram, np.array([0.0]), 1)
    assert speed_ratio(on_change_point) == mechanical_advantage(on_change_point) == 1.0


LINKAGES = {
    "crank": (3.0, 1.0, 2.5, 2.2, 0.5),
    "rocker": (3.0, 2.5, 1.0, 2.2, 0.7),
    "inner limits alone": (2.0, 2.5, 4.0, 2.2, -2.0),
    "outer limits alone": (4.0, 2.0, 2.5, 2.2, 3.0),
    "parallelogram": (2.0, 1.0, 2.0, 1.0, 0.5),
}


def close(lengths: tuple[float, ...], theta_2: np.ndarray, branch: int) -> list:
    """Directions of bars 2, 3 and 4 by two circles; NaN where they do not meet."""
    d, a, b, c, theta_1 = lengths
    if lengths == LINKAGES["parallelogram"]:  # goes on through its change points
        branch = branch * np.sign(np.sin(theta_2 - theta_1))
    A = a * np.exp(1j * theta_2)
    gap = d * np.exp(1j * theta_1) - A
    e = np.abs(gap)
    foot = (e**2 + b * b - c * c) / (2.0 * e)
    with np.errstate(invalid="ignore"):
        height = np.sqrt(b * b - foot**2)
    to_B = gap / e * (foot + 1j * branch * height)
    return [np.exp(1j * theta_2), to_B / b, (to_B - gap) / c]


def scan_singular(lengths: tuple[float, ...], drive: int, branch: int) -> list[float]:
    """Angles of the input between whose neighbours the sine of the drive vanishes."""
    theta_2 = np.linspace(0.0, math.tau, SCAN) + 1e-4
    directions = close(lengths, theta_2, branch)
    edges = np.diff(np.isnan(directions[1]).astype(int)) != 0
    one, other = (directions[bar - 2] for bar in (2, 3, 4) if bar != drive)
    sine = np.where(np.isnan(one), 1.0, (one.conj() * other).imag)
    sine[np.abs(sine) < PARALLEL] = 1.0
    edges |= sine[:-1] * sine[1:] < 0.0
    return (0.5 * (theta_2[1:] + theta_2[:-1]))[edges].tolist()


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("drive", [2, 3, 4])
@pytest.mark.parametrize("name", LINKAGES)
def test_the_distance_is_that_to_what_a_scan_finds(
    name: str, drive: int, branch: int
) -> None:
    lengths = LINKAGES[name]
    d, a, b, c, theta_1 = lengths
    bars = FourBar(d, Bar(a), Bar(b), Bar(c), theta_1)
    theta_2 = np.linspace(-9.0, 9.0, 600)
    theta_2 = theta_2[np.isfinite(close(lengths, theta_2, branch)[1])]
    places = scan_singular(lengths, drive, branch)
    if name == "parallelogram":
        places += [theta_1, theta_1 + math.pi]
    away = np.remainder(theta_2[:, None] - places + math.pi, math.tau) - math.pi
    nearest = np.abs(away).min(axis=1, initial=math.inf)
    ours = distance_to_singular(bars, theta_2, drive, branch)
    assert ours == pytest.approx(nearest, abs=math.tau / (SCAN - 1))
    sides = np.full(theta_2.shape, branch)
    assert np.array_equal(distance_to_singular(bars, theta_2, drive, sides), ours)
    both = np.minimum(ours, distance_to_singular(bars, theta_2, drive, -branch))
    assert np.array_equal(distance_to_singular(bars, theta_2, drive), both)


@pytest.mark.parametrize("name", list(LINKAGES)[1:4])
def test_the_distance_to_the_edge_of_assembly_has_all_digits(name: str) -> None:
    d, a, b, c, theta_1 = LINKAGES[name]
    bars = FourBar(d, Bar(a), Bar(b), Bar(c), theta_1)
    theta_2 = np.linspace(*find_intervals(bars)[0], 9)[1:-1] + 4 * math.pi
    distance = distance_to_singular(bars, theta_2)

    def assembles(offset: np.ndarray) -> np.ndarray:
        state = compute_state(bars, theta_2 + offset, 1)
        return np.isfinite(state.position.sin_mu)

    inside = distance * (1.0 - OUTSIDE)
    outside = distance * (1.0 + OUTSIDE)
    assert (assembles(inside) & assembles(-inside)).all()
    assert not (assembles(outside) & assembles(-outside)).any()
    coarse = theta_2.astype(np.float32)
    of_doubles = distance_to_singular(bars, coarse.astype(float))
    assert np.array_equal(distance_to_singular(bars, coarse), of_doubles)
