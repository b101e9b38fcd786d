"""Points of the bars by differentiation in 50 digits, instant centres, coupler curves.

Instant centres follow by Kennedy's theorem.
"""

import cmath
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pytest import approx, mark

from fourbar import (
    FourBar,
    coupler_curve,
    instant_centres,
    point_coefficients,
)
from fourbar.formulas.mobility import circuits, find_intervals
from fourbar.formulas.path import compute_state
from tests.support.balls import move_in_balls
from tests.support.rows import read_rows, refused
from tests.support.scenes import EPS, bare, draw_linkage


class Drawn(NamedTuple):
    """A linkage in one position."""

    bars: FourBar
    theta_2: np.ndarray
    branch: int

    @property
    def sine(self):
        state = compute_state(self.bars, self.theta_2, self.branch)
        return float(abs(state.position.sin_mu[0]))


def random_positions(seed, count, least_sine=0.05):
    """One regular position each of random linkages, on a random branch."""
    rng = np.random.default_rng(seed)
    positions = []
    while len(positions) < count:
        bars = draw_linkage(rng)
        start, stop = find_intervals(bars)[-1]
        drawn = Drawn(bars, rng.uniform(start, stop, 1), int(rng.choice([-1, 1])))
        if drawn.sine > least_sine:
            positions.append(drawn)
    return positions


@mark.parametrize("drawn", random_positions(12, 15))
def test_point_coefficients_are_derivatives(drawn):
    """Balls move the mass centre of the coupler, put at the point.

    The roundings of a first and a second coefficient are magnified by 1/sin^2 mu and
    1/sin^4 mu at most: one power of 1/sin^2 mu from the angles, one from the division
    by the root of the area.
    """
    z, sine, theta_2 = 0.3 - 0.2j, drawn.sine, float(drawn.theta_2[0])
    coefficients = point_coefficients(*drawn, 3, z)
    size = 1.0 + drawn.bars.input.length / min(drawn.bars.lengths)
    coupler = replace(drawn.bars.coupler, centre=cmath.polar(z))
    moved = replace(drawn.bars, coupler=coupler)
    exact = move_in_balls(moved, 2, theta_2, drawn.branch)
    for n, name, value, roundings in (
        (1, "v_G3", coefficients.first, 32.0),
        (2, "a_G3", coefficients.second, 128.0),
    ):
        right = complex(float(exact[f"{name}_x"]), float(exact[f"{name}_y"]))
        allowed = roundings * EPS * size ** (n + 1) / sine ** (2 * n)
        assert abs(value[0] - right) <= allowed


def test_centres_at_infinity_have_a_direction():
    """In a parallelogram bars 2 and 4 are parallel, and the coupler to the ground."""
    centres = instant_centres(bare(2.0, 1.0, 2.0, 1.0), np.array([1.0]), 1)
    of_coupler, of_arms = centres[1, 3], centres[2, 4]
    assert of_coupler.w[0] == 0.0 == of_arms.w[0]
    along = math.atan2(of_coupler.y[0], of_coupler.x[0]) % math.pi
    assert along == approx(1.0, abs=4 * EPS)
    assert of_arms.y[0] == 0.0 != of_arms.x[0]
    assert not np.isfinite(of_coupler.point[0][0])


CURVES = read_rows("""
crank-rocker | 3 1 2.5 2.2
drag link | 1 3 2.5 3.2
double rocker | 3 2.5 1 2.2
triple rocker | 2 2.5 4 2.2
parallelogram | 2 1 2 1
change-point crank | 2 1 4 3
kite, short ground | 1 1 2 2
rhombus | 1 1 1 1
""")


@mark.parametrize("name, lengths", CURVES)
def test_coupler_curves_are_closed_and_lie_on_the_sextic(name, lengths):
    """The coupler curve's own equation is free of theta_2.

    A lies on the circle a about O2 and at the distance |(along, across)| of the point
    P; B follows from A and P alone and must lie on the circle c about O4: one of the
    two possible A fulfils it.
    """
    d, a, b, c = lengths = [float(length) for length in lengths.split()]
    bars = bare(*lengths, 0.3)
    arm = (0.4 + 0.3j) * b
    for circuit in range(len(circuits(bars))):
        curve = coupler_curve(bars, arm.real, arm.imag, circuit, steps=720)
        assert curve.theta_2.shape == curve.x.shape == curve.branch.shape == (721,)
        point = curve.x + 1j * curve.y
        assert np.isfinite(point).all()
        assert point[0] == point[-1] and curve.branch[0] == curve.branch[-1]
        steps = abs(np.diff(point))
        # a jump to another branch or circuit is as long as a bar; a step of the curve
        # is not
        assert steps.max() < 0.1 * min(lengths)
        assert (curve.branch == 1).any() == (1 in circuits(bars)[circuit].branches)
        feet = (abs(point) ** 2 + a * a - abs(arm) ** 2) / (2 * abs(point))
        height = np.sqrt(np.maximum(a * a - feet**2, 0.0))
        off = []
        for side in (1, -1):
            pin_a = point / abs(point) * (feet + 1j * side * height)
            pin_b = pin_a + (point - pin_a) / arm * b
            off.append(abs(abs(pin_b - d * np.exp(0.3j)) - c))
        assert np.minimum(*off)[height > 1e-3 * a].max() < 1e-9


def test_symmetric_circuits_draw_mirror_images():
    bars = bare(3.0, 2.5, 1.0, 2.2)
    first, second = (coupler_curve(bars, 0.5, 0.0, circuit) for circuit in (0, 1))
    assert (first.y > 0.0).mean() > 0.5 > (second.y > 0.0).mean()
    for n in (10, 200):
        assert np.hypot(second.x - first.x[n], second.y + first.y[n]).min() < 1e-12


def test_a_circuit_that_does_not_exist_is_refused():
    bars = bare(2.0, 2.5, 4.0, 2.2)
    with refused("from 0 to 0"):
        coupler_curve(bars, 0.0, 0.0, 1)
    with refused("multiple of 4"):
        coupler_curve(bars, 0.0, 0.0, steps=90)
