"""Position: the directions of the bars on a branch, from the triangle A, B, O4.

    a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}

With h = (theta_2 - theta_1)/2 and e the diagonal from A to O4, the loop closes where
neither factor of Heron's formula is negative; their product is the square of four times
the area of the triangle:
    outer = (b + c)^2 - e^2 = E1 + 4 a d cos^2 h,   E1 = (b + c - a - d)(a + b + c + d),
    inner = e^2 - (b - c)^2 = E2 + 4 a d sin^2 h,   E2 = (d - a - b + c)(d - a + b - c).
outer = 0 is bars 3, 4 stretched, inner = 0 is bars 3, 4 folded.

A linkage with E1 = 0 or E2 = 0 has a change point at h = 90 deg or h = 0, where a
factor is a square and its root passes through zero:
    sqrt(outer) = 2 sqrt(a d) cos h if E1 = 0,
    sqrt(inner) = 2 sqrt(a d) sin h if E2 = 0,
with their signs. With these roots a branch is an assembly, which moves smoothly through
change points.

Source: R. L. Norton, Design of Machinery, ch. 4 (the loop and its two branches).
"""

from typing import Any, NamedTuple

import numpy as np

from fourbar.formulas.arithmetic import (
    Number,
    U,
    exact_difference,
    is_any,
    is_zero,
    select,
    square_root,
    tangent,
    vector,
    without_slopes,
)

ROLES_OF_BARS = {2: (2, 3, 4), 3: (3, 2, 4), 4: (4, 3, 2)}
"""The bars that are input, coupler and output of the loop read from a bar; and back."""
TOUCHING = 4.0 * U
"""Bars that miss each other, or a change point, by up to this times the sum of the
lengths count as touching: lengths that are computed, as distances of points are, are
rounded by a few U each.
"""
_VISIBLE = 1e-9
"""Part of a length that is no rounding of it."""
_VISIBLE_AT_A = 1e-11
"""The same of d - a: bars 3 and 4 are as much too long or short where A passes O4."""
_TINY_TANGENT = 1e-100
"""Added to the size of tan h. On a change point everything takes the limit to which it
tends along the assembly.
"""


class Loop(NamedTuple):
    """The lengths (m) of ground, input, coupler and output, and two sums (m^2).

    The sums E1 and E2 decide where the loop closes.
    """

    d: Number
    a: Number
    b: Number
    c: Number
    E1: Number
    E2: Number


class HalfAngle(NamedTuple):
    """sin^2 h, cos^2 h, sin h cos h and the two factors of Heron's formula.

    No other numbers of a position may need more digits than doubles have.
    """

    ss: Number
    kk: Number
    sk: Number
    outer: Number
    inner: Number
    root_sign: Number = 1.0
    """Sign of the product of both roots: +1 or -1, always +1 without a change point."""


class Passing(NamedTuple):
    """The roots that pass through zero at a change point, with their sign."""

    outer: Number
    """True if E1 = 0: bars 3, 4 are stretched there, and theta_2 - theta_1 is 180 deg.
    """
    inner: Number
    """True if E2 = 0: bars 3, 4 are folded there, and theta_2 - theta_1 is 0."""


class Position(NamedTuple):
    """Directions of the bars as complex numbers, and the triangle A, B, O4."""

    u1: Number  # e^{i theta_1}, from O2 to O4
    u2: Number  # from O2 to A
    u3: Number  # from A to B
    u4: Number  # from O4 to B
    sin_mu: Number
    """sin(theta_4 - theta_3), with the sign of the root."""
    diagonal: Number
    """Vector from A to O4, complex, m."""
    e2: Number
    """Square e^2 of the diagonal, in the unit of the lengths of the loop. The root has
    the same unit.
    """
    root: Number
    """sigma sqrt(outer) sqrt(inner), as `signed_root`; NaN where the loop does not
    close.
    """
    half: HalfAngle


def reorder_lengths(
    bar: int,
    lengths: tuple[Number, Number, Number, Number],
) -> tuple[Any, Any, Any, Any]:
    """Return the four lengths as the loop is read from bar 2, 3 or 4.

    The order is ground, the bar itself, coupler and output.
    """
    a, b, c = (lengths[role - 1] for role in ROLES_OF_BARS[bar])
    return lengths[0], a, b, c


def loop(d: Number, a: Number, b: Number, c: Number) -> Loop:
    """Return the lengths with E1 and E2.

    E1 = (b + c - a - d)(a + b + c + d) and E2 = (d - a - b + c)(d - a + b - c). A
    difference within the rounding of the lengths is zero. Where two of them vanish the
    lengths are equal in pairs, and are returned so.

    >>> loop(0.3, 0.1, 0.3, 0.1).E1  # a parallelogram, which has change points
    0.0
    """
    as_c = _are_equal(c, a)
    as_b = _are_equal(b, a)
    as_d = _are_equal(a, d)
    if is_any(as_c | as_b | as_d):  # the input is as long as another bar
        parallelogram = as_c & _are_equal(b, d)
        kite_at_B = as_b & _are_equal(c, d)
        kite_at_A = as_d & _are_equal(c, b)
        b = _replace(b, d, parallelogram)
        c = _replace(c, a, parallelogram)
        b = _replace(b, a, kite_at_B)
        c = _replace(c, d, kite_at_B)
        a = _replace(a, d, kite_at_A)
        c = _replace(c, b, kite_at_A)
    lengths = d, a, b, c
    stretched = vanish(exact_difference(b, c, a, d), lengths)
    with_c = vanish(exact_difference(d, c, a, b), lengths, d - a)
    with_b = vanish(exact_difference(d, b, a, c), lengths, d - a)
    return Loop(d, a, b, c, stretched * (a + b + c + d), with_c * with_b)


def _are_equal(length: Number, other: Number) -> Number:
    """Mark lengths that are equal within their rounding."""
    difference = length - other
    rounding = 2.0 * TOUCHING * other
    return difference * difference <= rounding * rounding


def _replace(length: Number, other: Number, mask: Number) -> Number:
    """Return a length, where a mask holds with another's value but its own slopes."""
    return length - select(mask, without_slopes(length - other), 0.0)


def vanish(
    difference: Number,
    lengths: tuple[Number, ...],
    diagonal: Number | None = None,
) -> Number:
    """Return a difference of lengths, or zero if it is within their rounding.

    The rounding is that of their sum; the slopes stay. It stays where it is a visible
    part of a length, or of the least length of the diagonal, d - a.
    """
    square = difference * difference
    rounding = TOUCHING * sum(lengths)
    touching = square <= rounding * rounding
    if not is_any(touching):
        return difference
    for length in lengths:
        touching = touching & (square <= (_VISIBLE * _VISIBLE) * (length * length))
    if diagonal is not None:
        visible = _VISIBLE_AT_A * diagonal
        touching = touching & (square <= visible * visible)
    return difference - select(touching, without_slopes(difference), 0.0)


def find_passing(lengths: Loop) -> Passing:
    """Find the roots that pass through zero: E1 = 0 or E2 = 0."""
    return Passing(is_zero(lengths.E1), is_zero(lengths.E2))


def direction(theta: Number) -> Number:
    """Compute e^{i theta} = ((1 - t^2) + 2 i t)/(1 + t^2), t = tan(theta/2)."""
    t = tangent(0.5 * theta)
    kk = 1.0 / (1.0 + t * t)
    return vector((1.0 - t * t) * kk, 2.0 * t * kk)


def half_angle(
    lengths: Loop,
    psi: Number,
    *,
    opposite: bool = False,
    passing: Passing | None = None,
) -> HalfAngle:
    """Compute the half angle h of psi = theta_2 - theta_1, and Heron's factors.

    psi is in rad and not reduced.

    `opposite`: h of psi - pi, from the same tangent: there the ground is read from O4
    to O2. `passing`: roots that pass through zero with their sign; left out: those of
    the lengths.
    """
    if passing is None:
        passing = find_passing(lengths)
    t = tangent(0.5 * psi)
    # tan h is zero at this change point: a tiny step off it gives the limits there
    passes_at_zero = passing.outer if opposite else passing.inner
    if is_any(passes_at_zero):
        t = select(passes_at_zero, t + np.copysign(_TINY_TANGENT, t), t)
    kk = 1.0 / (1.0 + t * t)
    sk = t * kk
    ss = t * sk
    squares = (kk, ss, -sk) if opposite else (ss, kk, sk)
    root_sign = find_root_sign(psi, passing, opposite=opposite)
    return compute_factors(lengths, *squares, root_sign)


def find_root_sign(psi: Number, passing: Passing, *, opposite: bool) -> Number:
    """Return the sign of the roots' product at psi (rad, not reduced).

    The sign is 1 unless a root passes through zero. `opposite`: as in `half_angle`.
    """
    if not is_any(passing.outer | passing.inner):
        return 1.0
    sign_k = np.copysign(1.0, np.cos(0.5 * psi))
    sign_s = np.copysign(1.0, np.sin(0.5 * psi))
    if opposite:
        sign_k, sign_s = sign_s, -sign_k
    return select(passing.outer, sign_k, 1.0) * select(passing.inner, sign_s, 1.0)


def signed_root(half: HalfAngle, branch: Number) -> Number:
    """Compute sigma sqrt(outer) sqrt(inner), NaN where the loop does not close.

    Each root has its sign at a change point.

    `branch`: sigma, +1 or -1, the assembly.
    """
    return branch * half.root_sign * square_root(half.outer * half.inner)


def compute_factors(
    lengths: Loop,
    ss: Number,
    kk: Number,
    sk: Number,
    root_sign: Number = 1.0,
) -> HalfAngle:
    """Compute the factors of Heron's formula from sin^2 h, cos^2 h and sin h cos h."""
    four_ad = 4.0 * lengths.a * lengths.d
    four_bc = 4.0 * lengths.b * lengths.c
    outer = lengths.E1 + four_ad * kk
    inner = lengths.E2 + four_ad * ss
    short = four_ad > four_bc
    # outer + inner = 4 b c: the smaller change over psi keeps the digits
    if is_any(short):
        outer_by_inner = four_bc - inner
        inner_by_outer = four_bc - outer
        outer = select(short & (ss < kk), outer_by_inner, outer)
        inner = select(short & (kk <= ss), inner_by_outer, inner)
    return HalfAngle(ss, kk, sk, outer, inner, root_sign)


def close_loop(
    lengths: Loop,
    u1: Number,
    u2: Number,
    half: HalfAngle,
    branch: Number,
    unit: Number = 1.0,
) -> Position:
    """Compute the directions of coupler and output.

        u3 = (O4 - A) ((e^2 + b^2 - c^2) + i root)/(2 b e^2),
        u4 = (O4 - A) ((b^2 - e^2 - c^2) + i root)/(2 c e^2),
        e^2 = (d - a)^2 + 4 a d sin^2 h,   sin(theta_4 - theta_3) = root/(2 b c).

    Parameters
    ----------
    lengths : of the loop, m.
    u1, u2 : e^{i theta_1} and e^{i theta_2}.
    half : of theta_2 - theta_1.
    branch : assembly, +1 (B lies left of the diagonal from A to O4 for
        0 < theta_2 - theta_1 < 180 deg) or -1.
    unit : of the lengths, m; the diagonal is found in m.

    >>> lengths = loop(100, 40, 120, 80)  # mm; Norton, example 4-1
    >>> theta_2 = np.radians(40)
    >>> half = half_angle(lengths, theta_2)
    >>> position = close_loop(lengths, 1.0, direction(theta_2), half, 1)
    >>> [f"{np.angle(u, deg=True):.3f}" for u in (position.u3, position.u4)]
    ['20.298', '57.325']
    """
    d, a, b, c, _, _ = lengths
    e2 = half.inner + (b - c) * (b - c)
    root = signed_root(half, branch)
    twice_a = 2.0 * a * unit
    diagonal = vector((d - a) * unit + twice_a * half.ss, -twice_a * half.sk) * u1
    # e^2 + b^2 - c^2 and b^2 - e^2 - c^2 use the factor in the root, so that u3 and u4
    # keep their length
    at_A = half.inner + 2.0 * b * (b - c)
    at_O4 = 2.0 * c * (b - c) - half.inner
    part = (0.5 / unit) / e2
    to_3 = (1.0 / b) * part
    to_4 = (1.0 / c) * part
    u3 = diagonal * vector(at_A * to_3, root * to_3)
    u4 = diagonal * vector(at_O4 * to_4, root * to_4)
    return Position(u1, u2, u3, u4, root * (0.5 / (b * c)), diagonal, e2, root, half)


def find_parallel_pairs(lengths: Loop, branch: Number) -> tuple[Number, Number]:
    """Mark assemblies in which two pairs of bars stay parallel.

    Parallel pairs have E1 = E2 = 0 and root = +- 4 a d sin h cos h.

    First: the coupler keeps the ground's direction and bars 2, 4 turn together
    (a = c, b = d).
    Second: B stays on O2, bars 2, 3 turn together and bar 4 rests (a = b, c = d).
    """
    d, a, b, c, _, _ = lengths
    first = (a == c) & (b == d) & (branch > 0)
    second = (a == b) & (c == d) & (branch < 0)
    return first, second


def put_parallel_pairs(position: Position, first: Number, second: Number) -> Position:
    """Put in the exact directions of bars that stay parallel.

    u3 = u1, u4 = u2 where `first`; u3 = -u2, u4 = -u1 where `second`.
    """
    sine = 2.0 * position.half.sk
    u3 = np.where(second, -position.u2, position.u3)
    u4 = np.where(second, -position.u1, position.u4)
    sin_mu = np.where(second, -sine, position.sin_mu)
    return position._replace(
        u3=np.where(first, position.u1, u3),
        u4=np.where(first, position.u2, u4),
        sin_mu=np.where(first, sine, sin_mu),
    )
