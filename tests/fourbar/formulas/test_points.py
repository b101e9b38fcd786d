"""Kinematic coefficients by differentiation in 50 digits, and curves.

Instant centres follow by Kennedy's theorem; the curves are those of the coupler.
"""

import math
from typing import NamedTuple

import mpmath as mp
import numpy as np
import pytest

from fourbar.errors import InputError
from fourbar.formulas.mobility import circuits, find_intervals, turns_fully
from fourbar.formulas.motion import State
from fourbar.formulas.path import compute_state
from fourbar.formulas.points import (
    coupler_curve,
    instant_centres,
    point_coefficients,
)
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Command, with_signs

EPS = 2.0**-52
FIRST, SECOND = 32.0, 128.0
"""Roundings in a first and a second coefficient; each is magnified by 1/sin^2 mu and
1/sin^4 mu at most:
one power of 1/sin^2 mu from the angles, one from the division by the root of the area.
"""


class Drawn(NamedTuple):
    """A linkage in one position."""

    bars: FourBar
    theta_2: np.ndarray
    branch: int

    def moving(self, omega_2: float = 1.0, alpha_2: float = 0.0) -> State:
        return compute_state(self.bars, self.theta_2, self.branch, omega_2, alpha_2)

    @property
    def sine(self) -> float:
        return float(abs(self.moving().position.sin_mu[0]))


def random_positions(seed: int, count: int, least_sine: float = 0.05) -> list[Drawn]:
    """One regular position each of random linkages, on a random branch."""
    rng = np.random.default_rng(seed)
    positions: list[Drawn] = []
    while len(positions) < count:
        d, a, b, c = rng.uniform(0.1, 1.0, 4).tolist()
        if 2.0 * max(d, a, b, c) > d + a + b + c - 0.01:
            continue
        bars = FourBar(d, Bar(a), Bar(b), Bar(c), float(rng.uniform(-math.pi, math.pi)))
        start, stop = find_intervals(bars)[-1]
        drawn = Drawn(bars, rng.uniform(start, stop, 1), int(rng.choice([-1, 1])))
        if drawn.sine > least_sine:
            positions.append(drawn)
    return positions


class Exact:
    """Position in 50 digits by the intersection of two circles in the complex plane."""

    def __init__(self, drawn: Drawn) -> None:
        self.d, self.a, self.b, self.c = (
            mp.mpf(length) for length in drawn.bars.lengths
        )
        self.theta_1 = mp.mpf(drawn.bars.ground_angle)
        branch = np.array([drawn.branch], dtype=np.int8)
        position = Command(drawn.theta_2, branch, None, 0.0)
        self.sign = int(with_signs(drawn.bars, position).branch[0])

    def pin_b(self, theta_2: mp.mpf) -> tuple[mp.mpc, mp.mpc, mp.mpc]:
        pin_a, pin_4 = self.a * mp.expj(theta_2), self.d * mp.expj(self.theta_1)
        gap = pin_4 - pin_a
        foot = (abs(gap) ** 2 + self.b**2 - self.c**2) / (2 * abs(gap))
        height = mp.sqrt(self.b**2 - foot**2)
        return pin_a, pin_a + gap / abs(gap) * mp.mpc(foot, self.sign * height), pin_4

    def angle(self, bar: int, theta_2: mp.mpf) -> mp.mpf:
        pin_a, pin_b, pin_4 = self.pin_b(theta_2)
        return mp.arg(pin_b - (pin_a if bar == 3 else pin_4))

    def point(self, theta_2: mp.mpf, along: float, across: float) -> mp.mpc:
        pin_a, pin_b, _ = self.pin_b(theta_2)
        return pin_a + (pin_b - pin_a) / self.b * mp.mpc(along, across)


SPECIAL = {
    "a = d": (0.3, 0.3, 0.25, 0.22, -2.0),
    "b = c": (0.3, 0.1, 0.25, 0.25, 1.0),
    "input longer than ground": (0.1, 0.3, 0.25, 0.32, 0.0),
    "parallelogram": (0.3, 0.1, 0.3, 0.1, 0.4),
    "kite b = c, a = d": (0.3, 0.3, 0.2, 0.2, 0.4),
    "change point in line": (0.3, 0.1, 0.2, 0.2, 0.4),
    "touching folded": (0.2, 0.1, 0.4, 0.3, 0.4),
}
"""Ground, input, coupler, output, m, and theta_1, rad."""


def special_positions() -> list[Drawn]:
    """Return positions of linkages some of whose terms vanish, on both branches."""
    every = [
        Drawn(
            FourBar(d, Bar(a), Bar(b), Bar(c), theta_1),
            np.array([theta_1 + psi]),
            branch,
        )
        for d, a, b, c, theta_1 in SPECIAL.values()
        for psi in (0.7, 2.5, 4.6)
        for branch in (1, -1)
    ]
    return [drawn for drawn in every if drawn.sine > 0.05]


@pytest.mark.parametrize(
    "positions",
    [random_positions(11, 20), special_positions()],
    ids=["random", "special"],
)
def test_directions_and_bar_coefficients_are_those_of_the_loop(
    positions: list[Drawn],
) -> None:
    with mp.workdps(50):
        for drawn in positions:
            exact, theta_2 = Exact(drawn), mp.mpf(float(drawn.theta_2[0]))
            moving, sine = drawn.moving(), drawn.sine
            k, slopes = moving.k, {}
            size = 1.0 + drawn.bars.input.length / min(drawn.bars.lengths)
            for bar, first, second in ((3, k.h3, k.dh3), (4, k.h4, k.dh4)):
                # about the direction itself, so that the angle never jumps
                theta = exact.angle(bar, theta_2)
                assert (
                    abs(complex(moving.direction(bar)[0]) - mp.expj(theta))
                    <= FIRST * EPS * size / sine
                )
                slopes[bar], bend = (
                    mp.diff(
                        lambda x, e=exact, b=bar, about=theta: _near(
                            e.angle(b, x), about
                        ),
                        theta_2,
                        n,
                    )
                    for n in (1, 2)
                )
                assert abs(first[0] - slopes[bar]) <= FIRST * EPS * size**2 / sine**2
                assert abs(second[0] - bend) <= SECOND * EPS * size**3 / sine**4
            assert abs(k.h23[0] - (1 - slopes[3])) <= FIRST * EPS * size**2 / sine**2
            assert (
                abs(k.h43[0] - (slopes[4] - slopes[3]))
                <= FIRST * EPS * size**2 / sine**2
            )
            assert (k.h2, k.dh2) == (1.0, 0.0)


def _near(angle: mp.mpf, about: mp.mpf) -> mp.mpf:
    return angle - 2 * mp.pi * mp.nint((angle - about) / (2 * mp.pi))


def test_point_coefficients_are_derivatives() -> None:
    with mp.workdps(50):
        for drawn in random_positions(12, 15):
            exact, theta_2, sine = (
                Exact(drawn),
                mp.mpf(float(drawn.theta_2[0])),
                drawn.sine,
            )
            coefficients = point_coefficients(*drawn, 3, 0.3 - 0.2j)
            size = 1.0 + drawn.bars.input.length / min(drawn.bars.lengths)
            for n, value, roundings in (
                (1, coefficients.first, FIRST),
                (2, coefficients.second, SECOND),
            ):
                derivative = mp.diff(
                    lambda angle, e=exact: e.point(angle, 0.3, -0.2), theta_2, n
                )
                error = abs(mp.mpc(value[0]) - derivative)
                assert error <= roundings * EPS * size ** (n + 1) / sine ** (2 * n)


def test_the_coupler_turns_about_I13_and_bars_2_and_4_share_I24() -> None:
    for drawn in random_positions(16, 60):
        moving, sine = drawn.moving(), drawn.sine
        O4 = drawn.bars.ground * moving.position.u1
        x, y = instant_centres(*drawn)[1, 3].point
        spin = float(moving.omega(3)[0])
        pin, speed = moving.foot(3)[0], moving.velocity(3, 0.0)[0]
        still = abs(speed + 1j * spin * (complex(x[0], y[0]) - pin))
        reach = abs(spin) * math.hypot(x[0], y[0]) + 1.0
        assert still <= 1e3 * EPS * reach / sine**3
        x, y = instant_centres(*drawn)[2, 4].point
        spin_4 = float(moving.omega(4)[0])
        # both bars give the same velocity there: x r_2 = omega_4 (r_2 - O4)
        here = complex(x[0], y[0])
        apart = abs(here - spin_4 * (here - O4))
        assert apart <= 1e3 * EPS * (abs(here) + 1.0) * (1.0 + abs(spin_4)) / sine**3


def test_centres_at_infinity_have_a_direction() -> None:
    # a parallelogram: bars 2, 4 are parallel, so is the coupler to the ground
    centres = instant_centres(
        FourBar(2.0, Bar(1.0), Bar(2.0), Bar(1.0)), np.array([1.0]), 1
    )
    assert centres[1, 3].w[0] == 0.0 and centres[2, 4].w[0] == 0.0
    assert math.atan2(
        centres[1, 3].y[0], centres[1, 3].x[0]
    ) % math.pi == pytest.approx(1.0, abs=4 * EPS)
    assert centres[2, 4].y[0] == 0.0 and centres[2, 4].x[0] != 0.0
    assert not np.isfinite(centres[1, 3].point[0][0])


CURVES = {
    "crank-rocker": (3.0, 1.0, 2.5, 2.2),
    "drag link": (1.0, 3.0, 2.5, 3.2),
    "double rocker": (3.0, 2.5, 1.0, 2.2),
    "triple rocker": (2.0, 2.5, 4.0, 2.2),
    "parallelogram": (2.0, 1.0, 2.0, 1.0),
    "change-point crank": (2.0, 1.0, 4.0, 3.0),
    "kite, short ground": (1.0, 1.0, 2.0, 2.0),
    "rhombus": (1.0, 1.0, 1.0, 1.0),
}


@pytest.mark.parametrize("lengths", CURVES.values(), ids=CURVES)
def test_coupler_curves_are_closed_and_lie_on_the_sextic(
    lengths: tuple[float, float, float, float],
) -> None:
    d, a, b, c = lengths
    bars = FourBar(d, Bar(a), Bar(b), Bar(c), 0.3)
    along, across = 0.4 * b, 0.3 * b
    for circuit in range(len(circuits(bars))):
        curve = coupler_curve(bars, along, across, circuit, steps=720)
        assert curve.theta_2.shape == curve.x.shape == curve.branch.shape == (721,)
        point = curve.x + 1j * curve.y
        assert np.isfinite(point).all()
        assert point[0] == point[-1] and curve.branch[0] == curve.branch[-1]
        steps = np.abs(np.diff(point))
        # a jump to another branch or circuit is as long as a bar; a step of the curve
        # is not
        assert steps.max() < 0.1 * min(lengths)
        assert (curve.branch == 1).any() == (1 in circuits(bars)[circuit].branches)
        assert _off_sextic(bars, point, along, across) < 1e-9


def _off_sextic(bars: FourBar, point: np.ndarray, along: float, across: float) -> float:
    """How far the points are from the coupler curve's own equation, free of theta_2.

    A lies on the circle a about O2 and at the distance |(along, across)| of the point
    P; B follows from A and P alone and must lie on the circle c about O4: one of the
    two possible A fulfils it.
    """
    d, a, b, c = bars.lengths
    arm = complex(along, across)
    feet = (np.abs(point) ** 2 + a * a - abs(arm) ** 2) / (2 * np.abs(point))
    height = np.sqrt(np.maximum(a * a - feet**2, 0.0))
    off = []
    for side in (1, -1):
        pin_a = point / np.abs(point) * (feet + 1j * side * height)
        pin_b = pin_a + (point - pin_a) / arm * b
        off.append(np.abs(np.abs(pin_b - d * np.exp(1j * bars.ground_angle)) - c))
    return float(np.minimum(*off)[height > 1e-3 * a].max())


def test_symmetric_circuits_draw_mirror_images() -> None:
    bars = FourBar(3.0, Bar(2.5), Bar(1.0), Bar(2.2))
    circuit_0, circuit_1 = (
        coupler_curve(bars, 0.5, 0.0, circuit) for circuit in (0, 1)
    )
    assert (circuit_0.y > 0.0).mean() > 0.5 > (circuit_1.y > 0.0).mean()
    for x, y in (
        (circuit_0.x[10], -circuit_0.y[10]),
        (circuit_0.x[200], -circuit_0.y[200]),
    ):
        assert np.hypot(circuit_1.x - x, circuit_1.y - y).min() < 1e-12


def test_a_curve_with_one_change_point_takes_two_turns() -> None:
    curve = coupler_curve(FourBar(2.0, Bar(1.0), Bar(4.0), Bar(3.0)), 1.0, 1.0)
    assert turns_fully(FourBar(2.0, Bar(1.0), Bar(4.0), Bar(3.0)))
    assert curve.theta_2[-1] - curve.theta_2[0] == pytest.approx(
        4 * math.pi,
        rel=4 * EPS,
    )
    assert set(curve.branch.tolist()) == {1, -1}


def test_a_circuit_that_does_not_exist_is_refused() -> None:
    bars = FourBar(2.0, Bar(2.5), Bar(4.0), Bar(2.2))
    with pytest.raises(InputError, match="from 0 to 0"):
        coupler_curve(bars, 0.0, 0.0, 1)
    with pytest.raises(InputError, match="multiple of 4"):
        coupler_curve(bars, 0.0, 0.0, steps=90)
