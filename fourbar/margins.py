"""The four Heron factors of the triangle A, B, O4: how far a position is from not closing.

With e the diagonal from A to O4, the loop closes where all of
    p1 = b + c - e,   p2 = e + c - b,   p3 = e + b - c,   p4 = e + b + c
are >= 0; p1 = 0 is bars 3, 4 stretched, p2 = 0 or p3 = 0 is bars 3, 4 folded.
"""

import decimal
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import FourBar

Array = NDArray[np.float64]

U = 2.0**-53
"""Unit round-off of a double."""
UNDECIDED = 32.0 * U
"""Margins smaller than this times the sum of the lengths are decided in 60 digits: the double
evaluation (one sine, eight roundings) is wrong by at most about 12 U times that sum."""
TOUCHING = U
"""A negative margin up to this times the sum of the lengths counts as zero: each length was
itself rounded by up to U, so the linkage meant closes there as well as not."""
DIGITS = 60


@dataclass(slots=True)
class Diagonal:
    """The diagonal A to O4 in the ground's frame and the Heron factors, each of shape (n,)."""

    x: Array
    y: Array
    length: Array
    p1: Array
    p2: Array
    p3: Array
    p4: Array


def heron_factors(linkage: FourBar, theta_2: Array) -> Diagonal:
    """The diagonal and its margins: e^2 = (d - a)^2 + 4 a d sin^2((theta_2 - theta_1)/2).

    Every term is positive, so e keeps full relative accuracy where it is small; margins near
    zero are evaluated again in 60 digits, so their sign is right.
    """
    d, a, b, c = linkage.lengths
    half = 0.5 * (theta_2 - linkage.ground_angle)
    sine = np.sin(half)
    step = 2.0 * a * sine
    x = (d - a) + step * sine
    y = -step * np.cos(half)
    e = np.sqrt((d - a) * (d - a) + (2.0 * d) * sine * step)
    diagonal = Diagonal(x, y, e, (b + c) - e, (c - b) + e, (b - c) + e, (b + c) + e)
    limit = UNDECIDED * (a + b + c + d)
    smallest = np.minimum(np.minimum(diagonal.p1, diagonal.p2), diagonal.p3)
    for index in np.flatnonzero(np.abs(smallest) < limit):
        _decide(linkage, diagonal, int(index), float(theta_2[index]))
    return diagonal


def _decide(linkage: FourBar, diagonal: Diagonal, index: int, theta_2: float, offset: float = 0.0) -> None:
    """Replace the margins of one position by their 60-digit values, rounded once."""
    with decimal.localcontext() as context:
        context.prec = DIGITS
        d, a, b, c = (Decimal(length) for length in linkage.lengths)
        cosine = _cosine(Decimal(theta_2) - Decimal(linkage.ground_angle) + Decimal(offset))
        e = ((d - a) ** 2 + 2 * a * d * (1 - cosine)).sqrt()
        touching = Decimal(TOUCHING) * (a + b + c + d)
        for name, margin in (("p1", b + c - e), ("p2", e + c - b), ("p3", e + b - c), ("p4", e + b + c)):
            value = Decimal(0) if -touching <= margin < 0 else margin
            getattr(diagonal, name)[index] = float(value)
        diagonal.length[index] = float(e)


def _cosine(angle: Decimal) -> Decimal:
    """cos of an angle in the digits of the current context."""
    with decimal.localcontext() as context:
        context.prec += 10
        angle = angle % (2 * _pi())
        square, term, total, k = angle * angle, Decimal(1), Decimal(1), 0
        while abs(term) > Decimal(10) ** -context.prec:
            k += 2
            term = -term * square / (k * (k - 1))
            total += term
    return +total


def _pi() -> Decimal:
    """pi in the digits of the current context (the recipe of the decimal module's documentation)."""
    last, t, total, n, na, d, da = Decimal(0), Decimal(3), Decimal(3), 1, 0, 0, 24
    while total != last:
        last = total
        n, na = n + na, na + 8
        d, da = d + da, da + 32
        t = (t * n) / d
        total += t
    return +total
