"""The formulas as they stand: exact sums, the half angle in many digits, shapes."""

import os
from fractions import Fraction
from math import pi, tau

import mpmath as mp
import numpy as np
from pytest import approx, mark

from fourbar.formulas.arithmetic import power_of_two
from fourbar.formulas.many_digits import decide_half_angles, exact_half_angle
from fourbar.formulas.path import prepare_path
from fourbar.formulas.position import half_angle, loop
from fourbar.linkage import MOVING_BARS, uniform
from tests.support.rows import read_rows
from tests.support.scenes import (
    CRANK_ROCKER_LENGTHS,
    bare,
)

QUADRUPLES = int(os.environ.get("DRAWINGS", "300"))
"""Linkages near change points that are compared with exact sums; more at night."""
U = 2.0**-53
PRODUCTS = 8.0 * U
"""Relative, of E1 and E2: two such differences, or one and a sum of four, and their
product.
"""
TANGENT = 10.0 * U
"""Relative, of sin^2 h, cos^2 h and sin h cos h from a tangent that a library gives to
2 U: two or three of it, a square, a sum, a quotient and a product; of a factor of
Heron's formula likewise, relative to its terms.
"""
ROUNDED_SUM = 2.0**-51
"""Of the sum of four lengths: what is missing of it where each is rounded by four U."""
SEEN_OF_A_BAR, SEEN_OF_THE_DIAGONAL = 1e-9, 1e-11
"""Of a length and of d - a: what is more than that is stated and no rounding."""


def hard_doubles(seed, count):
    """p, q, r, s > 0 with p + q and r + s equal, or apart by a rounding or a few."""
    rng = np.random.default_rng(seed)
    tight = (1.0, 1.5, 2.0 - 2.0**-52, 1.0 + 2.0**-52)

    def draw():
        significand = rng.choice(tight) if rng.random() < 0.4 else rng.uniform(1.0, 2.0)
        exponent = rng.integers(*((-60, 5) if rng.random() < 0.5 else (-3, 3)))
        return float(significand) * 2.0 ** int(exponent)

    quadruples = []
    while len(quadruples) < count:
        p, q, r = draw(), draw(), draw()
        s = float(Fraction(p) + Fraction(q) - Fraction(r))
        if len(quadruples) % 3 == 0:
            r, s = max(p, q), min(p, q)
        s *= 1.0 + int(rng.integers(-2, 3)) * 2.0**-52
        if s > 0.0:
            quadruples.append((p, q, r, s))
    return quadruples


@mark.slow
@mark.timeout(600)
def test_the_constants_of_the_loop_vanish_within_rounding_alone():
    """Squares in doubles may compare otherwise than exact ones beside a bound."""
    zeros, at_a_bound = [0, 0], 0
    # a + d and b + c, or a + c and b + d, from the same two sums
    for p, q, r, s in hard_doubles(3, QUADRUPLES):
        for stated in ((p, q, r, s), (p, r, q, s), (p, r, s, q)):
            bars = loop(*stated)
            assert bars[:4] == approx(stated, rel=2.0 * ROUNDED_SUM)
            d, a, b, c = lengths = tuple(map(Fraction, bars[:4]))
            sums = b + c - a - d, d + c - a - b, d + b - a - c
            # what a difference of lengths may be and be no more than a rounding
            bound = min(ROUNDED_SUM * sum(lengths), SEEN_OF_A_BAR * min(lengths))
            bounds = bound, min(bound, SEEN_OF_THE_DIAGONAL * abs(d - a))
            missed = abs(sums[0]), min(abs(sums[1]), abs(sums[2]))
            exact = sums[0] * sum(lengths), sums[1] * sums[2]
            for k in (0, 1):
                if abs(missed[k] - bounds[k]) <= 16 * U * bounds[k]:
                    at_a_bound += 1
                    continue
                vanishes = missed[k] <= bounds[k]
                zeros[k] += vanishes
                assert (bars[4 + k] == 0.0) == vanishes, stated
                off = abs(Fraction(bars[4 + k]) - exact[k])
                assert vanishes or off <= PRODUCTS * abs(exact[k])
    assert min(zeros) > QUADRUPLES / 12
    assert at_a_bound < 0.4 * QUADRUPLES


@mark.parametrize(
    "stated, touches",
    read_rows("""
# of a sum of 1.875, where d - a = b - c, those touch that miss by 7.5 U: 6 U and 10 U
0.6875 0.3125 0.6250000000000007 0.25 | yes
0.6875 0.3125 0.6250000000000011 0.25 | no
# d - a = 1e-15 is no rounding of a ground of 3e-15
3e-15 2e-15 1 1 | no
# one pair of equal bars alone makes no other bars equal
0.3 0.1 0.25 0.1 | no
0.3 0.1 0.1 0.25 | no
0.3 0.3 0.2 0.25 | no
3e-6 3.0000001e-6 1 1 | no
# 0.1 + 0.7 = 0.2 + 0.6 of the lengths meant, and not of the doubles
0.6 0.7 0.1 0.2 | yes
0.7 0.6 0.2 0.1 | yes
# within the rounding of their own lengths, 2 U, become equal
0.3 0.30000000000000004 0.2 0.2 | yes
"""),
)
def test_what_touches_is_up_to_the_rounding_of_the_lengths(stated, touches):
    lengths = tuple(map(float, stated.split()))
    bars = loop(*lengths)
    assert (bars.E2 == 0.0) == (touches == "yes")
    assert touches == "yes" or bars[:4] == lengths
    assert bars[:4] == approx(lengths, rel=4.0 * U)


LINKAGES = read_rows("""
0.3 0.1 0.25 0.22
0.25 0.22 0.3 0.1
# a parallelogram, and kites; with the second A lies on O4 at theta_2 = theta_1
0.3 0.1 0.3 0.1
0.1 0.3 0.3 0.1
0.3 0.3 0.2 0.2
0.2 0.2 0.2 0.2
# input longer than the ground
0.08 0.24 0.2 0.26
# 4 a d > 4 b c, and few positions close
0.4 0.35 0.1 0.08
0.4 0.397 0.003 0.002
""")


def five(bars, psi):
    """sin^2 h, cos^2 h, sin h cos h and the factors, from A and O4 in the complex
    plane.
    """
    d, a, b, c = map(mp.mpf, bars.lengths)
    e = abs(d - a * mp.expj(psi))
    return [
        (1 - mp.cos(psi)) / 2,
        (1 + mp.cos(psi)) / 2,
        mp.sin(psi) / 2,
        (b + c) ** 2 - e**2,
        e**2 - (b - c) ** 2,
    ]


@mark.slow
def test_the_half_angle_in_doubles_keeps_the_digits_of_the_angle():
    """From the ground's direction to the opposite, and after many turns.

    Angles are as near to both as doubles come.
    """
    near = 10.0 ** -np.arange(1.0, 17.0)
    few = np.array([1e-9, 0.7, pi + 1e-9])
    turns = [tau * count + few for count in (3.0, 800.0, -800.0)]
    plain = np.append(np.linspace(-7.0, 7.0, 40), pi)
    psi = np.concatenate([near, -near, pi - near, near - pi, plain, *turns])
    with mp.workdps(200):
        for (lengths,) in LINKAGES:
            bars = uniform(*map(float, lengths.split()))
            half = half_angle(loop(*bars.lengths), psi)
            d, a, b, c, E1, E2 = loop(*bars.lengths)
            for i, angle in enumerate(psi):
                ss, kk, sk, outer, inner = five(bars, mp.mpf(float(angle)))
                for ours, exact in ((half.ss, ss), (half.kk, kk), (half.sk, sk)):
                    assert abs(ours[i] - exact) <= TANGENT * abs(exact)
                of_outer, of_inner = abs(E1) + 4 * a * d * kk, abs(E2) + 4 * a * d * ss
                # one is what the other leaves of 4 b c, where that has fewer digits to
                # lose
                for ours, exact, terms, of_other in (
                    (half.outer, outer, of_outer, of_inner),
                    (half.inner, inner, of_inner, of_outer),
                ):
                    assert abs(ours[i] - exact) <= TANGENT * min(
                        terms, 4 * b * c + of_other
                    )


@mark.parametrize("bar", MOVING_BARS)
@mark.parametrize("offset", [None, "1e-3"])
def test_positions_decided_in_many_digits_replace_their_own_alone(offset, bar):
    bars, theta = bare(*CRANK_ROCKER_LENGTHS, 0.4), np.linspace(0.1, 6.0, 7)
    path = prepare_path(bars.lengths, 0.4, bar)
    half = path.half_angle(theta)
    remainder = None if offset is None else mp.mpf(offset)
    decided = decide_half_angles(bars, path, half, [1, 4], theta, remainder)
    assert decided.root_sign == half.root_sign == 1.0
    for n in range(5):
        exact = [
            float(exact_half_angle(bars, path, angle, remainder)[n])
            for angle in theta[[1, 4]].tolist()
        ]
        assert decided[n][[1, 4]].tolist() == exact
        kept = [np.delete(values[n], [1, 4]) for values in (decided, half)]
        assert np.array_equal(*kept)
        assert (abs(decided[n] - half[n]).max() > 1e-6) == (offset is not None)


def test_the_power_of_two_above_a_number():
    assert power_of_two(np.array([0.3, 3.0])).tolist() == [0.5, 4.0]
    assert power_of_two(0.3) == 0.5
