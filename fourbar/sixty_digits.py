"""The sign of a margin, and a limit position, in 60 digits: for the few positions that doubles cannot decide."""

import decimal
from decimal import Decimal

from fourbar.linkage import FourBar
from fourbar.margins import TOUCHING, unit_of

DIGITS = 60
LAST_DIGITS = Decimal(10) ** (5 - DIGITS)
"""What 60 digits leave of the limit position itself."""


def decide(linkage: FourBar, theta_2: float, offset: Decimal | None) -> tuple[float, float]:
    """outer and inner of one position in 60 digits, each rounded once.

    Parameters
    ----------
    offset : what theta_2 as a double leaves out of the angle meant, rad, where that is known.
    """
    with decimal.localcontext() as context:
        context.prec = DIGITS
        unit = Decimal(unit_of(linkage))
        d, a, b, c = (Decimal(length) / unit for length in linkage.lengths)
        cosine = _cosine(Decimal(theta_2) - Decimal(linkage.ground_angle) + (offset or 0))
        squared = (d - a) ** 2 + 2 * a * d * (1 - cosine)
        whole = (a + b + c + d) * 2 * squared.sqrt()
        if offset is None:
            least, most = -Decimal(TOUCHING) * whole, Decimal(0)
        else:
            # a position beyond the limit does not assemble, however near; of the limit itself a residue is left
            least, most = -LAST_DIGITS * whole, LAST_DIGITS * whole
        factors = ((b + c) ** 2 - squared, squared - (b - c) ** 2)
        outer, inner = (float(Decimal(0) if least <= factor <= most else factor) for factor in factors)
        return outer, inner


def limit_remainder(linkage: FourBar, limit: float, theta_2: float, offset: float) -> Decimal:
    """(limit position + offset) - theta_2 in 60 digits, for the limit position whose double is `limit`.

    The exact limit position is where bars 3, 4 are collinear:
        cos(theta_2 - theta_1) = (a^2 + d^2 - (b +- c)^2)/(2 a d),
    found by Newton's iteration from the double.
    """
    with decimal.localcontext() as context:
        context.prec = DIGITS
        d, a, b, c = (Decimal(length) for length in linkage.lengths)
        theta_1 = Decimal(linkage.ground_angle)
        angle = Decimal(limit)
        at_limit = a * a + d * d - 2 * a * d * _cosine(angle - theta_1)
        target = min(((b + c) ** 2, (b - c) ** 2), key=lambda squared: abs(squared - at_limit))
        half_turn = _pi()
        straight = theta_1 + ((angle - theta_1) / half_turn).to_integral_value() * half_turn
        if a * a + d * d - 2 * a * d * _cosine(straight - theta_1) == target:
            angle = straight  # a change point: the cosine is +-1 there, where Newton has no slope
        else:
            for _ in range(NEWTON_STEPS):
                gap = a * a + d * d - 2 * a * d * _cosine(angle - theta_1) - target
                angle -= gap / (2 * a * d * _cosine(angle - theta_1 - half_turn / 2))
        return angle + Decimal(offset) - Decimal(theta_2)


NEWTON_STEPS = 60
"""The double's 16 digits double with each step; beside a change point they gain one bit each at first."""


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
