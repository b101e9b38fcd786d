"""Position: the directions of the bars on a branch, from the triangle A, B, O4.

    a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}

With h = (theta_2 - theta_1)/2 and e the diagonal from A to O4, the loop closes where both factors of
Heron's formula are >= 0; their product is the square of four times the area of the triangle:
    outer = (b + c)^2 - e^2 = E1 + 4 a d cos^2 h,   E1 = (b + c - a - d)(a + b + c + d),
    inner = e^2 - (b - c)^2 = E2 + 4 a d sin^2 h,   E2 = (d - a - b + c)(d - a + b - c).
outer = 0 is bars 3, 4 stretched, inner = 0 is bars 3, 4 folded. At a change point E1 or E2 is zero
exactly and nothing cancels near it; nothing passes through zero at theta = 180 deg.

Source: R. L. Norton, Design of Machinery, ch. 4 (the loop and its two branches).
"""

from typing import Any, NamedTuple

import numpy as np

from fourbar.formulas.arithmetic import (
    Number,
    U,
    exact_difference,
    is_any,
    select,
    square_root,
    tangent,
    vector,
)

TOUCHING = U
"""Bars that miss each other, or a change point, by up to this times the sum of the lengths count as touching: each
length was itself rounded by up to that, so the linkage meant touches as well as not."""
TINY_TANGENT = 1e-100
"""Added to the size of tan h: with A on O4 bars 3, 4 get the directions to which they tend from theta_2 > theta_1."""


class Loop(NamedTuple):
    """The lengths (m) of ground, input, coupler and output, and what they decide together (m^2)."""

    d: Number
    a: Number
    b: Number
    c: Number
    E1: Number
    E2: Number


class HalfAngle(NamedTuple):
    """sin^2 h, cos^2 h, sin h cos h and the two factors: all of a position that may need more digits than doubles."""

    ss: Number
    kk: Number
    sk: Number
    outer: Number
    inner: Number


class Position(NamedTuple):
    """Directions of the bars as complex numbers, and the triangle A, B, O4."""

    u1: Number  # e^{i theta_1}, from O2 to O4
    u2: Number  # from O2 to A
    u3: Number  # from A to B
    u4: Number  # from O4 to B
    sin_mu: Number
    """sin(theta_4 - theta_3), signed like the branch."""
    diagonal: Number
    """Vector from A to O4, complex, m."""
    e2: Number
    """Square e^2 of the diagonal; like the root, in the unit of the lengths that the loop was closed with."""
    root: Number
    """sigma sqrt(outer inner); NaN where the loop does not close."""
    half: HalfAngle


def reorder_lengths(
    bar: int, lengths: tuple[Number, Number, Number, Number]
) -> tuple[Any, Any, Any, Any]:
    """Return the lengths of ground, the bar itself, coupler and output, as the loop is read from bar 2, 3 or 4."""
    d, a, b, c = lengths
    return (d, b, a, c) if bar == 3 else (d, c, b, a) if bar == 4 else (d, a, b, c)


def loop(d: Number, a: Number, b: Number, c: Number) -> Loop:
    """Return the lengths with E1 = (b + c - a - d)(a + b + c + d) and E2 = (d - a - b + c)(d - a + b - c).

    >>> loop(0.3, 0.1, 0.3, 0.1).E1  # a parallelogram, whose bars come to lie in one line
    0.0
    """
    E1 = exact_difference(b, c, a, d) * (a + b + c + d)
    E2 = exact_difference(d, c, a, b) * exact_difference(d, b, a, c)
    return Loop(d, a, b, c, E1, E2)


def direction(theta: Number) -> Number:
    """Compute e^{i theta} = ((1 - t^2) + 2 i t)/(1 + t^2), t = tan(theta/2)."""
    t = tangent(0.5 * theta)
    kk = 1.0 / (1.0 + t * t)
    return vector((1.0 - t * t) * kk, 2.0 * t * kk)


def half_angle(lengths: Loop, psi: Number, *, opposite: bool = False) -> HalfAngle:
    """Compute the half angle h of psi = theta_2 - theta_1 (rad), and the factors of Heron's formula.

    `opposite`: h of psi - pi, from the same tangent: there the ground is read from O4 to O2.
    """
    E = lengths.E1 if opposite else lengths.E2
    t, meets = tangent(0.5 * psi), E == 0.0
    if is_any(meets):
        t = select(meets, t + np.copysign(TINY_TANGENT, t), t)
    kk = 1.0 / (1.0 + t * t)
    sk = t * kk
    ss = t * sk
    return (
        compute_factors(lengths, kk, ss, -sk)
        if opposite
        else compute_factors(lengths, ss, kk, sk)
    )


def compute_factors(lengths: Loop, ss: Number, kk: Number, sk: Number) -> HalfAngle:
    """Compute the factors of Heron's formula from sin^2 h, cos^2 h and sin h cos h."""
    four_ad, four_bc = 4.0 * lengths.a * lengths.d, 4.0 * lengths.b * lengths.c
    outer, inner = lengths.E1 + four_ad * kk, lengths.E2 + four_ad * ss
    short = four_ad > four_bc
    if is_any(
        short
    ):  # outer + inner = 4 b c: the smaller change over psi keeps the digits
        outer, inner = (
            select(short & (ss < kk), four_bc - inner, outer),
            select(short & (kk <= ss), four_bc - outer, inner),
        )
    return HalfAngle(ss, kk, sk, outer, inner)


def close_loop(
    lengths: Loop,
    u1: Number,
    u2: Number,
    half: HalfAngle,
    branch: Number,
    unit: Number = 1.0,
) -> Position:
    """Compute the directions of coupler and output.

        u3 = (O4 - A) ((e^2 + b^2 - c^2) + i root)/(2 b e^2),   e^2 = (d - a)^2 + 4 a d sin^2 h,
        u4 = (O4 - A) ((b^2 - e^2 - c^2) + i root)/(2 c e^2),   sin(theta_4 - theta_3) = root/(2 b c).

    Parameters
    ----------
    lengths : of the loop, m.
    u1, u2 : e^{i theta_1} and e^{i theta_2}.
    half : of theta_2 - theta_1.
    branch : +1 (B lies left of the diagonal from A to O4) or -1.
    unit : of the lengths, m; the diagonal is found in m.

    >>> lengths, theta_2 = loop(100, 40, 120, 80), np.radians(40)  # mm; Norton, example 4-1
    >>> position = close_loop(lengths, 1.0, direction(theta_2), half_angle(lengths, theta_2), 1)
    >>> [f"{np.angle(u, deg=True):.3f}" for u in (position.u3, position.u4)]
    ['20.298', '57.325']
    """
    d, a, b, c, _, _ = lengths
    e2 = half.inner + (b - c) * (b - c)
    root = branch * square_root(half.outer * half.inner)
    twice_a = 2.0 * a * unit
    diagonal = vector((d - a) * unit + twice_a * half.ss, -twice_a * half.sk) * u1
    # e^2 + b^2 - c^2 and b^2 - e^2 - c^2 use the factor in the root, so that u3 and u4 keep their length
    at_A, at_O4 = half.inner + 2.0 * b * (b - c), 2.0 * c * (b - c) - half.inner
    part = (0.5 / unit) / e2
    to_3, to_4 = (1.0 / b) * part, (1.0 / c) * part
    u3 = diagonal * vector(at_A * to_3, root * to_3)
    u4 = diagonal * vector(at_O4 * to_4, root * to_4)
    return Position(u1, u2, u3, u4, root * (0.5 / (b * c)), diagonal, e2, root, half)


def find_parallel_pairs(
    lengths: Loop, half: HalfAngle, branch: Number
) -> tuple[Number, Number]:
    """Mark where two pairs of bars stay parallel: E1 = E2 = 0, and the root is 4 a d sin h cos h or its opposite.

    First: the coupler keeps the ground's direction and bars 2, 4 turn together (a = c, b = d).
    Second: B stays on O2, bars 2, 3 turn together and bar 4 rests (a = b, c = d).
    """
    d, a, b, c, _, _ = lengths
    side = branch * np.sign(half.sk)
    return (a == c) & (b == d) & (side > 0), (a == b) & (c == d) & (side < 0)


def put_parallel_pairs(position: Position, first: Number, second: Number) -> Position:
    """Put in the exact directions u3 = u1, u4 = u2 where `first`, u3 = -u2, u4 = -u1 where `second`."""
    u3 = np.where(first, position.u1, np.where(second, -position.u2, position.u3))
    u4 = np.where(first, position.u2, np.where(second, -position.u1, position.u4))
    sine = np.where(
        first | second,
        np.sign(position.root) * 2.0 * abs(position.half.sk),
        position.sin_mu,
    )
    return position._replace(u3=u3, u4=u4, sin_mu=sine)
