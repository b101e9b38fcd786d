"""The diagonal A to O4 of the linkage, and how far a position is from not closing.

With e the length of the diagonal, the triangle A, B, O4 closes where both factors of Heron's formula
    outer = (b + c)^2 - e^2 = (b + c - a - d)(a + b + c + d) + 4 a d cos^2(psi/2),
    inner = e^2 - (b - c)^2 = (d - a + b - c)(d - a - b + c) + 4 a d sin^2(psi/2)
are >= 0, psi = theta_2 - theta_1; outer = 0 is bars 3, 4 stretched, inner = 0 is bars 3, 4 folded.
At a change point the product of lengths is zero exactly, and nothing cancels beside it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import FourBar

if TYPE_CHECKING:
    from decimal import Decimal

Array = NDArray[np.float64]

U = 2.0**-53
"""Unit round-off of a double."""
UNDECIDED = 32.0 * U
"""A factor smaller than this times the sum of its terms is evaluated in 60 digits: in doubles
(one tangent, eight roundings) it is wrong by at most about 12 U times that sum."""
TOUCHING = U
"""Bars that miss each other by up to this times the sum of the lengths count as touching: each length
was itself rounded by up to U, so the linkage meant closes there as well as not."""
NO_DIGIT_LEFT = 8.0 * 2.0**-52
"""|sin mu| at or below this: the directions of bars 3 and 4 cannot be told apart in doubles, unless
the position is described by its offset from the limit."""
MANY_TURNS = 8.0
"""rad. Beyond, what the rounding of theta_2 - theta_1 takes away is put back: it is more than that of a turn."""
NONE = np.empty(0, dtype=np.intp)


@dataclass(slots=True)
class Diagonal:
    """The diagonal A to O4 and what it decides; lengths in units of `unit` (m), arrays of shape (n,)."""

    unit: float
    """A power of two near the longest bar: no product of lengths in it leaves the range of doubles."""
    lengths: tuple[Any, Any, Any, Any]
    """(d, a, b, c) in that unit, as numbers of the precision of the arrays."""
    x: Array
    y: Array
    """Components from A to O4 in the ground's frame."""
    squared: Array
    """e^2."""
    inner: Array
    """e^2 - (b - c)^2."""
    root: Array
    """sqrt(outer inner), four times the area of the triangle A, B, O4; NaN where it does not close."""
    w: Array
    v: Array
    h: Array
    """cos^2, sin^2 and sin cos of (theta_2 - theta_1)/2."""
    assembled: NDArray[np.bool_]
    decided: NDArray[np.intp]
    """Indices of the positions whose margins were evaluated in 60 digits."""
    offset: "Decimal | None"
    """What theta_2 as a double leaves out of the angle meant, rad, where that is known."""
    least_root: float = 0.0
    """A bound that the root does not go below at any theta_2; 0 where the linkage has limits or may come near one."""


def scaled(linkage: FourBar, unit: float) -> tuple[float, float, float, float]:
    """(d, a, b, c) in a unit."""
    d, a, b, c = linkage.lengths
    return d / unit, a / unit, b / unit, c / unit


def unit_of(linkage: FourBar) -> float:
    """A power of two near the longest bar, m."""
    return math.ldexp(1.0, math.frexp(max(linkage.lengths))[1])


def in_precision_of(array: Array, number: float) -> Any:
    """A number that carries on as many digits as an array does: a float, or a `DoubleDouble`."""
    return number if isinstance(array, np.ndarray) else type(array)(number)


def diagonal_to_O4(
    linkage: FourBar,
    theta_2: Array,
    offset: "Decimal | None" = None,
    *,
    growths: Iterator[float] | None = None,
    turned: tuple[Array, Array] | None = None,
) -> Diagonal:
    """The diagonal from the half angle: e^2 = (d - a)^2 w + (d + a)^2 v, w and v its squared cosine and sine.

    Every term of e^2 is positive, so it keeps its relative accuracy where it is small. Margins
    near zero are evaluated again in 60 digits, so their sign is right.

    Parameters
    ----------
    theta_2 : (n,), rad.
    offset : what theta_2 as a double leaves out of the angle meant, rad; then all margins are
        evaluated in 60 digits.
    growths : relative changes of the parts, for the error bars; factors near zero then stay as doubles give them.
    turned : what `lost_by_turning` gives, where pairs of bars stay parallel.
    """
    unit = unit_of(linkage)
    lengths = scaled(linkage, unit)
    x, y, squared, (w, v, h), (constant_1, constant_2, product) = _triangle(linkage, lengths, theta_2, growths, turned)
    outer, inner = product * w, product * v
    outer += constant_1
    inner += constant_2
    _, _, b, c = lengths
    if product > 4.0 * b * c:
        # b, c short beside the others: of the two factors the one whose change over psi is small has the digits
        whole = 4.0 * b * c
        outer, inner = np.where(v < w, whole - inner, outer), np.where(v < w, inner, whole - outer)
    least_1, least_2 = UNDECIDED * (abs(constant_1) + product), UNDECIDED * (abs(constant_2) + product)
    decided, least_root = NONE, 0.0
    if offset is None and growths is None and constant_1 > least_1 and constant_2 > least_2:
        least_root = _least_root(constant_1, constant_2, product)
        if least_root <= NO_DIGIT_LEFT * (2.0 * b * c):  # ground and input a billiardth of the other bars
            least_root = 0.0
        assembled = np.ones(outer.shape, dtype=bool)
    elif offset is None and outer.min() > least_1 and inner.min() > least_2:
        assembled = np.ones(outer.shape, dtype=bool)
    else:
        assembled = (outer >= 0.0) & (inner >= 0.0)
        if offset is not None:
            decided = np.arange(outer.size)
        elif growths is None:
            decided = np.flatnonzero(
                ((np.abs(outer) < least_1) & (constant_1 < 0.0)) | ((np.abs(inner) < least_2) & (constant_2 < 0.0))
            )
        if decided.size:
            from fourbar.sixty_digits import decide
        for index in decided:
            outer[index], inner[index] = decide(linkage, float(theta_2[index]), offset)
            assembled[index] = outer[index] >= 0.0 and inner[index] >= 0.0
        if not assembled.all():
            outer = np.where(assembled, outer, np.nan)
    outer *= inner
    root = np.sqrt(outer, outer)
    return Diagonal(unit, lengths, x, y, squared, inner, root, w, v, h, assembled, decided, offset, least_root)


def _least_root(constant_1: float, constant_2: float, product: float) -> float:
    """The least root over a turn: outer + inner is constant, so their product is least at one of its ends.

    A millionth less, which no rounding reaches.
    """
    ends = (constant_1 + product) * constant_2, constant_1 * (constant_2 + product)
    return (1.0 - 1e-6) * math.sqrt(min(ends))


def in_double_double(linkage: FourBar, theta_2: Array) -> Diagonal:
    """The same in 32 digits, for positions that are known to assemble; theta_2 is a `DoubleDouble`."""
    unit = unit_of(linkage)
    d, a, b, c = (in_precision_of(theta_2, length) for length in scaled(linkage, unit))
    x, y, squared, (w, v, h), (constant_1, constant_2, product) = _triangle(linkage, (d, a, b, c), theta_2)
    inner = constant_2 + product * v
    root = np.sqrt((constant_1 + product * w) * inner)
    assembled = np.ones(theta_2.shape, dtype=bool)
    return Diagonal(unit, (d, a, b, c), x, y, squared, inner, root, w, v, h, assembled, NONE, None)


def _triangle(
    linkage: FourBar,
    lengths: tuple[Any, Any, Any, Any],
    theta_2: Array,
    growths: Iterator[float] | None = None,
    turned: tuple[Array, Array] | None = None,
) -> tuple[Array, Array, Array, tuple[Array, Array, Array], tuple[Any, Any, Any]]:
    """x, y, e^2 and w, v, h of `Diagonal`, the constants of outer and inner and 4 a d, in the precision of theta_2."""
    d, a, b, c = lengths
    theta_1 = linkage.ground_angle
    psi = theta_2
    if theta_1 != 0.0:
        psi = theta_2 - theta_1
        if growths is not None:  # psi is rounded at its own size, however near to a whole turn it is
            growth = next(growths)
            psi = psi + growth * (np.clip(psi, -MANY_TURNS, MANY_TURNS) if turned is None else turned[0])
    t = np.tan(0.5 * psi)
    if growths is not None and turned is not None:  # half a last digit of psi would be rounded away again
        t = t + growth * ((0.5 + 0.5 * (t * t)) * turned[1])
    if psi is not theta_2 and isinstance(psi, np.ndarray) and np.abs(psi).max() > MANY_TURNS:
        t = t + (0.5 + 0.5 * (t * t)) * _rounded_away(theta_2, theta_1, psi)
    if growths is not None:
        t = t + next(growths) * t
    v = t * t
    w = 1.0 / (1.0 + v)
    v *= w
    h = t * w
    x, squared = (d + a) * v, ((d + a) * (d + a)) * v
    x += (d - a) * w
    squared += ((d - a) * (d - a)) * w
    y = (-2.0 * a) * h
    constants = (
        _sum(b, c, -a, -d) * (a + b + c + d),
        _sum(d, b, -a, -c) * _sum(d, c, -a, -b),
        4.0 * a * d,
    )
    if growths is not None:
        x, y, squared, w, v, h = (part + next(growths) * part for part in (x, y, squared, w, v, h))
        constants = tuple(part + next(growths) * part for part in constants)
    return x, y, squared, (w, v, h), constants


def lost_by_turning(
    linkage: FourBar, theta_2: Array, parallel: NDArray[np.bool_], growth: float
) -> tuple[Array, Array]:
    """What a growth adds, per unit, to theta_2 - theta_1 before and after its tangent is taken, rad, each (n,).

    Where bars stay parallel sin(theta_4 - theta_3) loses what the subtraction rounded away, often nothing, and no
    more; in the other branch roundings of the margins come in, and the angle counts as rounded at its own size.
    """
    psi = theta_2 - linkage.ground_angle
    lost = np.where(parallel & (np.abs(psi) <= MANY_TURNS), _rounded_away(theta_2, linkage.ground_angle, psi), 0.0)
    return np.where(parallel, 0.0, np.clip(psi, -MANY_TURNS, MANY_TURNS)), lost / growth


def _rounded_away(theta_2: Array, theta_1: float, psi: Array) -> Array:
    """theta_2 - theta_1 - psi, exactly (Knuth's sum)."""
    taken = theta_2 - psi
    return (theta_2 - (psi + taken)) + (taken - theta_1)


def _sum(*lengths: Any) -> Any:
    """Their sum, rounded once; in more digits than a double has it is exact anyway."""
    if isinstance(lengths[0], float):
        return math.fsum(lengths)
    return (lengths[0] + lengths[2]) + (lengths[1] + lengths[3])
