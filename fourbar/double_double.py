"""Double-double arithmetic: arrays of unevaluated sums hi + lo, 32 digits, for the few positions that need them.

An array of this kind takes the place of a NumPy array in the formulas themselves; the algorithms
are Dekker's and Knuth's (Hida, Li, Bailey, "Library for double-double and quad-double arithmetic",
2007).
"""

import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPLITTER = 2.0**27 + 1.0
"""Cuts the 53 bits of a double in two halves whose products are exact."""
HALF_PI = (math.pi / 2, 6.123233995736766e-17, -1.4973849048591833e-33)
"""pi/2 as a sum of three doubles."""
TERMS = 10
"""Of the series of sine and cosine: at pi/32 the next one is below 1e-32 of the sum."""
HALVINGS = 3


def _two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    s = a + b
    v = s - a
    return s, (a - (s - v)) + (b - v)


def _two_product(a: Array, b: Array) -> tuple[Array, Array]:
    p = a * b
    t, u = SPLITTER * a, SPLITTER * b
    a1, b1 = t - (t - a), u - (u - b)
    a2, b2 = a - a1, b - b1
    return p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2


class DoubleDouble(NDArrayOperatorsMixin):
    """hi + lo with |lo| at most half a last digit of hi; NumPy's arithmetic works on it."""

    __slots__ = ("hi", "lo")

    def __init__(self, hi: Any, lo: Any = 0.0) -> None:
        self.hi, self.lo = _two_sum(np.asarray(hi, dtype=float), np.asarray(lo, dtype=float))

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        operation = OPERATIONS.get(ufunc)
        into = options.pop("out", (None,))[0]
        if operation is None or method != "__call__" or options:
            return NotImplemented
        result = operation(*(value if isinstance(value, DoubleDouble) else DoubleDouble(value) for value in inputs))
        if not isinstance(into, DoubleDouble):  # after x += y with an array x, the name holds more digits
            return result
        into.hi, into.lo = result.hi, result.lo
        return into

    def __getitem__(self, index: Any) -> "DoubleDouble":
        return DoubleDouble(self.hi[index], self.lo[index])

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array."""
        return self.hi.shape


def _add(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    s, e = _two_sum(x.hi, y.hi)
    t, f = _two_sum(x.lo, y.lo)
    s, e = _two_sum(s, e + t)
    return DoubleDouble(s, e + f)


def _negative(x: DoubleDouble) -> DoubleDouble:
    return DoubleDouble(-x.hi, -x.lo)


def _subtract(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    return _add(x, _negative(y))


def _multiply(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    p, e = _two_product(x.hi, y.hi)
    return DoubleDouble(p, e + (x.hi * y.lo + x.lo * y.hi))


def _divide(x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    quotient = DoubleDouble(x.hi / y.hi)
    for _ in range(2):
        rest = x - quotient * y
        quotient = quotient + rest.hi / y.hi
    return quotient


def _sqrt(x: DoubleDouble) -> DoubleDouble:
    root = DoubleDouble(np.sqrt(x.hi))
    safe = np.where(root.hi == 0.0, 1.0, root.hi)
    for _ in range(2):
        root = root + (x - root * root).hi / (2.0 * safe)
    return root


def _tan(x: DoubleDouble) -> DoubleDouble:
    turns = np.rint(x.hi / HALF_PI[0])
    for part in HALF_PI:
        x = x - DoubleDouble(turns) * part
    x = x * 2.0**-HALVINGS
    square = x * x
    sine, cosine = DoubleDouble(0.0), DoubleDouble(0.0)
    for k in range(TERMS, -1, -1):
        sine = sine * square + _exact(Fraction((-1) ** k, math.factorial(2 * k + 1)))
        cosine = cosine * square + _exact(Fraction((-1) ** k, math.factorial(2 * k)))
    tangent = sine * x / cosine
    for _ in range(HALVINGS):
        tangent = 2.0 * tangent / (1.0 - tangent * tangent)
    odd = turns % 2.0 == 1.0
    # tan(x + pi/2) = -1/tan x
    return _choose(odd, -1.0 / _choose(odd, tangent, DoubleDouble(1.0)), tangent)


def _choose(where: Array, x: DoubleDouble, y: DoubleDouble) -> DoubleDouble:
    return DoubleDouble(np.where(where, x.hi, y.hi), np.where(where, x.lo, y.lo))


def _exact(value: Fraction) -> DoubleDouble:
    hi = float(value)
    return DoubleDouble(hi, float(value - Fraction(hi)))


def _arctan2(y: DoubleDouble, x: DoubleDouble) -> Array:
    """To double: the rounded angle, corrected by one step of Newton's iteration."""
    angle = np.arctan2(y.hi, x.hi)
    half = _tan(DoubleDouble(0.5 * angle))
    cosine, sine = 1.0 - half * half, 2.0 * half
    across, along = y * cosine - x * sine, x * cosine + y * sine
    return np.asarray(angle + across.hi / along.hi)


OPERATIONS: dict[Any, Callable[..., Any]] = {
    np.add: _add,
    np.subtract: _subtract,
    np.negative: _negative,
    np.multiply: _multiply,
    np.true_divide: _divide,
    np.sqrt: _sqrt,
    np.tan: _tan,
    np.arctan2: _arctan2,
    np.absolute: lambda x: x * np.sign(x.hi),
    np.sign: lambda x: np.sign(x.hi),
    np.equal: lambda x, y: (x - y).hi == 0.0,
    np.greater: lambda x, y: (x - y).hi > 0.0,
    np.less: lambda x, y: (x - y).hi < 0.0,
    np.less_equal: lambda x, y: (x - y).hi <= 0.0,
}
