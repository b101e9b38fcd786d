"""Transmission angle against the cosine law in many digits, the rest against a scan."""

from math import cos, pi

import mpmath as mp
import numpy as np
from pytest import approx

from fourbar import Motion, Scene, solve, transmission_extremes
from fourbar.formulas.mobility import find_intervals
from fourbar.show.derived import derive
from tests.fourbar.formulas.test_points import random_positions
from tests.support.scenes import EPS, cis, draw_linkage

ANGLE = 16.0 * EPS
"""Rounding of an angle at B, rad: eight operations, and theta_2 itself; magnified by
1/|sin mu|.
"""
SCAN = 4001


def test_transmission_angle_is_the_acute_angle_between_coupler_and_output():
    with mp.workdps(50):
        for drawn in random_positions(21, 60, 1e-4):
            d, a, b, c = (mp.mpf(length) for length in drawn.bars.lengths)
            psi = mp.mpf(float(drawn.theta_2[0])) - mp.mpf(drawn.bars.ground_angle)
            squares = b * b + c * c - a * a - d * d
            at_B = mp.acos((squares + 2 * a * d * mp.cos(psi)) / (2 * b * c))
            slope = float(a * d / (b * c)) + 1.0  # of mu sin(mu) over psi
            size = max(1.0, float(a * a + d * d) / float(b * c))
            motion = Motion(drawn.theta_2, branch=drawn.branch)
            (mu,) = derive(solve(Scene(drawn.bars, motion)), "transmission")
            error = mu - min(at_B, mp.pi - at_B)
            assert abs(error) <= ANGLE * (slope + size) / drawn.sine


def test_extremes_are_those_of_a_scan():
    rng = np.random.default_rng(22)
    kinds = set()
    for _ in range(80):
        bars = draw_linkage(rng)
        (d, a, b, c), theta_1 = bars.lengths, bars.ground_angle
        extremes = transmission_extremes(bars)
        kinds.add((extremes.least == 0.0, extremes.greatest == pi))
        start, stop = find_intervals(bars)[0]
        psi = np.linspace(start, stop, SCAN)[1:-1] - theta_1
        e2 = d * d + a * a - 2.0 * a * d * np.cos(psi)
        at_B = np.arccos((b * b + c * c - e2) / (2.0 * b * c))
        assert extremes.least <= at_B.min() + 1e-9
        assert extremes.greatest >= at_B.max() - 1e-9
        for end, theta_2 in (
            (extremes.least, extremes.theta_2_least),
            (extremes.greatest, extremes.theta_2_greatest),
        ):
            # it is the angle of a position
            assert 0.0 <= theta_2 - theta_1 <= pi * (1.0 + EPS) + 2.0 * EPS
            e = abs(a * cis(theta_2) - d * cis(theta_1))
            assert e**2 == approx(b * b + c * c - 2 * b * c * cos(end), abs=64 * EPS)
        assert extremes.worst == min(extremes.least, pi - extremes.greatest)
    assert len(kinds) == 4
