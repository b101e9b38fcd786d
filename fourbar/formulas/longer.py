"""Numbers with more digits than doubles have, in which the formulas run as they stand.

Long doubles of the C library are taken where these are longer than doubles, as on
Linux, and pairs of doubles elsewhere, as on Windows and on Apple's processors. A pair
is a sum that is not evaluated, some 32 digits:

Source: T. J. Dekker, A floating-point technique for extending the available precision,
Numerische Mathematik 18 (1971).
"""

from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from fourbar.formulas.arithmetic import (
    PI_LOW,
    Number,
    OfParts,
    split_sum,
    without_slopes,
)
from fourbar.linkage import copy_with, list_fields

HAS_LONG_DOUBLES = np.finfo(np.longdouble).nmant > np.finfo(np.float64).nmant
_HALF_PI_LOWEST = -1.4973849048591833e-33
"""pi/2 less the two doubles nearest to it."""
_SPLITTER = 2.0**27 + 1.0
"""Splits the 53 bits of a double into two halves."""
SERIES_TERMS = 27
"""Terms of the series of sine and cosine up to an eighth of a turn. The next ones are
below 1e-32.
"""


def lengthen(number: Number) -> Number:
    """Return a double, or an array of them, as a longer number."""
    if not HAS_LONG_DOUBLES:
        return Pair(np.asarray(number, dtype=float), 0.0)
    if isinstance(number, np.ndarray):
        return number.astype(np.longdouble)
    return np.longdouble(number)


def shorten(number: Number) -> Number:
    """Return a longer number as doubles; any other one as it is."""
    if isinstance(number, Pair):
        return number.high
    if not isinstance(number, (np.ndarray, np.generic)):
        return number
    if number.dtype == np.longdouble:
        return number.astype(float)
    if number.dtype == np.clongdouble:
        return number.astype(complex)
    return number


def take_doubles(number: Number) -> Number:
    """Return a number as doubles, without further digits and without slopes."""
    return shorten(without_slopes(number))


def change_numbers(value: Any, change: Callable[[Any], Any]) -> Any:
    """Change each float and array of a value, in tuples and dataclasses too.

    All else stays.
    """
    if isinstance(value, (float, np.ndarray)):
        return change(value)
    if isinstance(value, tuple):
        parts = [change_numbers(part, change) for part in value]
        if hasattr(value, "_fields"):
            return type(value)(*parts)
        return tuple(parts)
    kind: Any = value.__class__
    if not is_dataclass(kind) or getattr(kind, "as_given", False):
        return value
    names = list_fields(value.__class__)
    changed = {name: change_numbers(getattr(value, name), change) for name in names}
    return copy_with(value, **changed)


class Pair(OfParts):
    """Unevaluated sums of two arrays of doubles, or of complex ones part by part.

    high is the sum as a double.
    """

    def __init__(self, high: Any, low: Any) -> None:
        self.high = high
        self.low = np.where(np.isfinite(high), low, 0.0)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the arrays."""
        return np.shape(self.high)

    def like(self, values: Any) -> "Pair":
        """Return doubles as pairs."""
        return Pair(np.asarray(values, dtype=float), 0.0)

    def __getitem__(self, index: Any) -> "Pair":
        return Pair(self.high[index], self.low[index])

    def __array_ufunc__(
        self,
        function: Any,
        method: str,
        *inputs: Any,
        **options: Any,
    ) -> Any:
        pairs = [*map(_as_pair, inputs)]
        if method == "__call__" and not options:
            if function in LONGER_FUNCTIONS:
                return LONGER_FUNCTIONS[function](*pairs)
            if function in COMPARISONS:
                return function((pairs[0] - pairs[1]).high, 0.0)
            if function in OF_DOUBLES:
                return function(*(pair.high for pair in pairs))
        return NotImplemented

    def __array_function__(
        self,
        function: Any,
        types: Any,
        args: Sequence[Any],
        options: Any,
    ) -> Any:
        if function is np.where:
            return _choose(*args)
        if function in (np.shape, np.ndim, np.iscomplexobj):
            return function(args[0].high)
        return NotImplemented


def _as_pair(number: Any) -> Pair:
    if isinstance(number, Pair):
        return number
    return Pair(np.asarray(number), 0.0)


def _choose(mask: Any, x: Any, y: Any) -> Any:
    x = _as_pair(x)
    y = _as_pair(y)
    return Pair(np.where(mask, x.high, y.high), np.where(mask, x.low, y.low))


def _renew(high: Any, low: Any) -> Pair:
    """Return the pair of a double and a smaller one."""
    total = high + low
    return Pair(total, low - (total - high))


def _add_longer(x: Any, y: Any) -> Any:
    high, lost = split_sum(x.high, y.high)
    low, lost_again = split_sum(x.low, y.low)
    first = _renew(high, lost + low)
    return _renew(first.high, first.low + lost_again)


def _halve(x: Any) -> tuple[Any, Any]:
    """Split a double into two of half its bits."""
    large = _SPLITTER * x
    high = large - (large - x)
    return high, x - high


def _multiply_real(x: Any, y: Any) -> Any:
    product = x.high * y.high
    a, b = _halve(x.high)
    c, d = _halve(y.high)
    lost = ((a * c - product) + a * d + b * c) + b * d
    mixed = x.high * y.low + x.low * y.high
    return _renew(product, lost + mixed)


def _multiply(x: Any, y: Any) -> Any:
    if np.isrealobj(x.high) and np.isrealobj(y.high):
        return _multiply_real(x, y)
    real = _multiply_real(x.real, y.real) - _multiply_real(x.imag, y.imag)
    imag = _multiply_real(x.real, y.imag) + _multiply_real(x.imag, y.real)
    return _join_parts(real, imag)


def _join_parts(x: Any, y: Any) -> Any:
    return Pair(x.high + 1j * y.high, x.low + 1j * y.low)


def _divide_longer(x: Any, y: Any) -> Any:
    if np.iscomplexobj(y.high):
        square = _multiply_real(y.real, y.real) + _multiply_real(y.imag, y.imag)
        return _multiply(x, y.conjugate()) / square
    if np.iscomplexobj(x.high):
        return _join_parts(_divide_longer(x.real, y), _divide_longer(x.imag, y))
    near = x.high / y.high
    remainder = x - _multiply_real(Pair(near, 0.0), y)
    return _renew(near, remainder.high / y.high)


def _root(x: Any) -> Any:
    near = np.sqrt(x.high)
    square = _multiply_real(Pair(near, 0.0), Pair(near, 0.0))
    correction = (x - square).high / (2.0 * near)
    return _renew(near, np.where(near == 0.0, 0.0, correction))


def _sine_and_cosine(x: Any) -> tuple[Any, Any]:
    """Compute sine and cosine by their series, of what quarter turns leave."""
    quarters = np.rint(x.high / (0.5 * np.pi))
    rest = x
    for part in (0.5 * np.pi, 0.5 * PI_LOW, _HALF_PI_LOWEST):
        rest = rest - _multiply_real(Pair(quarters, 0.0), Pair(np.asarray(part), 0.0))
    square = _multiply_real(rest, rest)
    sine_of_rest = rest * _sum_series(square, SERIES_TERMS)
    cosine_of_rest = _sum_series(square, SERIES_TERMS - 1)
    odd = quarters % 2.0 == 1.0
    sine = _choose(odd, cosine_of_rest, sine_of_rest)
    cosine = _choose(odd, sine_of_rest, cosine_of_rest)
    sine_is_negative = quarters % 4.0 >= 2.0
    cosine_is_negative = (quarters + 1.0) % 4.0 >= 2.0
    sine = _choose(sine_is_negative, -sine, sine)
    cosine = _choose(cosine_is_negative, -cosine, cosine)
    return sine, cosine


def _sum_series(square: Pair, last: int) -> Any:
    """Sum 1 - x^2/(k (k - 1)) (1 - ...) from k = `last` down by steps of 2."""
    total: Any = Pair(np.ones_like(square.high), np.zeros_like(square.high))
    for k in range(last, 1, -2):
        total = 1.0 - square * total / float(k * (k - 1))
    return total


def _arctangent(y: Any, x: Any) -> Any:
    near = Pair(np.arctan2(y.high, x.high), 0.0)
    sine, cosine = _sine_and_cosine(near)
    across = y * cosine - x * sine
    along = x * cosine + y * sine
    correction = across / along
    return _choose(np.isfinite(correction.high), near + correction, near)


def _size_of_longer(x: Any) -> Any:
    if not np.iscomplexobj(x.high):
        return _choose(x.high < 0.0, -x, x)
    # the squares of numbers in this unit stay in the range of doubles
    _, exponent = np.frexp(np.abs(x.high))
    unit = np.ldexp(1.0, exponent)
    along = x.real / unit
    across = x.imag / unit
    return _root(along * along + across * across) * unit


COMPARISONS = (
    np.less,
    np.less_equal,
    np.greater,
    np.greater_equal,
    np.equal,
    np.not_equal,
)
OF_DOUBLES = (np.sign, np.isnan, np.isfinite, np.frexp, np.copysign)
"""Functions of the doubles alone."""
LONGER_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.add: _add_longer,
    np.subtract: lambda x, y: _add_longer(x, -y),
    np.multiply: _multiply,
    np.divide: _divide_longer,
    np.negative: lambda x: Pair(-x.high, -x.low),
    np.sqrt: _root,
    np.sin: lambda x: _sine_and_cosine(x)[0],
    np.cos: lambda x: _sine_and_cosine(x)[1],
    np.tan: lambda x: _divide_longer(*_sine_and_cosine(x)),
    np.arctan2: _arctangent,
    np.absolute: _size_of_longer,
    np.conjugate: lambda x: x.conjugate(),
    np.remainder: lambda x, y: x - y * np.floor(x.high / y.high),
    np.fmod: lambda x, y: x - y * np.trunc(x.high / y.high),
    np.rint: lambda x: Pair(np.rint(x.high), 0.0),
}
