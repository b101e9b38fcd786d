"""Numbers that carry their derivatives: the formulas as they stand, evaluated with these, give both.

    z = f(x, y):   dz = f_x dx + f_y dy

Source: A. Griewank, A. Walther, Evaluating Derivatives, ch. 3 (forward mode).
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

Rule = Callable[..., tuple[Any, ...]]
"""The partial derivatives of a function by its arguments, from its value and them."""
RULES: dict[Any, Rule] = {
    np.add: lambda z, x, y: (1.0, 1.0),
    np.subtract: lambda z, x, y: (1.0, -1.0),
    np.multiply: lambda z, x, y: (y, x),
    np.divide: lambda z, x, y: (1.0 / y, -z / y),
    np.negative: lambda z, x: (-1.0,),
    np.sqrt: lambda z, x: (0.5 / z,),
    np.tan: lambda z, x: (1.0 + z * z,),
    np.sin: lambda z, x: (np.cos(x),),
    np.cos: lambda z, x: (-np.sin(x),),
    np.arctan2: lambda z, y, x: (x / (x * x + y * y), -y / (x * x + y * y)),
    np.remainder: lambda z, x, y: (1.0, 0.0),  # by a constant
}
PIECEWISE = (
    *(np.sign, np.copysign, np.floor, np.frexp, np.isnan, np.isfinite),
    *(np.less, np.less_equal, np.greater, np.greater_equal),
)
"""Functions of the values alone."""


class Sloped(NDArrayOperatorsMixin):
    """Values (n,) with their derivatives by p variables, slopes (p, n) or (p, 1): of doubles, or of balls as objects.

    A number is equal to a constant only where its derivatives vanish too, so that no term is left out for being zero.
    """

    def __init__(self, values: Any, slopes: Any) -> None:
        self.values: NDArray[Any] = np.atleast_1d(values)
        self.slopes: NDArray[Any] = slopes

    @property
    def shape(self) -> tuple[int, ...]:
        """Of the values."""
        return self.values.shape

    @property
    def real(self) -> "Sloped":
        """Of both."""
        return Sloped(real(self.values), real(self.slopes))

    @property
    def imag(self) -> "Sloped":
        """Of both."""
        return Sloped(imag(self.values), imag(self.slopes))

    def conjugate(self) -> "Sloped":
        """Of both."""
        return Sloped(conjugate(self.values), conjugate(self.slopes))

    def differs(self, other: Any) -> NDArray[np.bool_]:
        """Where the value or a derivative is not that of the other, (n,)."""
        gap = self - other
        return np.asarray(gap.values != 0.0) | np.asarray(gap.slopes != 0.0).any(axis=0)

    def __array_ufunc__(self, function: Any, method: str, *inputs: Any, **options: Any) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        given = [x.item() if isinstance(x, np.ndarray) and x.dtype == object and not x.ndim else x for x in inputs]
        if function in (np.equal, np.not_equal):
            sloped, other = given if isinstance(given[0], Sloped) else given[::-1]
            return sloped.differs(other) == (function is np.not_equal)
        if function is np.conjugate:
            return self.conjugate()
        plain = [values(x) for x in given]
        if self.values.dtype == object:
            plain = [_complex_ball(x) if isinstance(x, complex) else x for x in plain]
        if function is np.absolute:
            size = np.absolute(plain[0])
            along = conjugate(plain[0]) / size
            return Sloped(size, real(along * self.slopes))
        found = function(*plain)
        if function in PIECEWISE:
            return found
        if function not in RULES:
            return NotImplemented
        partial = RULES[function](found, *plain)
        return Sloped(found, sum(by * x.slopes for by, x in zip(partial, given, strict=True) if isinstance(x, Sloped)))

    def __array_function__(self, function: Any, types: Any, args: Sequence[Any], options: Any) -> Any:
        if function not in FUNCTIONS or options:
            return NotImplemented
        return FUNCTIONS[function](*args)


def _complex_ball(z: complex) -> Any:
    """A complex constant for numbers that are balls, which know none of Python's."""
    from flint import acb

    return acb(z)


def values(number: Any) -> Any:
    """Without the derivatives."""
    return number.values if isinstance(number, Sloped) else number


def slopes(number: Any) -> Any:
    """The derivatives; of a constant 0."""
    return number.slopes if isinstance(number, Sloped) else 0.0


def _by_entry(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Of an array; of one of objects, entry by entry."""
    each = np.frompyfunc(function, 1, 1)
    return lambda z: each(z) if z.dtype == object else function(z)


real, imag = _by_entry(lambda z: z.real), _by_entry(lambda z: z.imag)
conjugate = _by_entry(lambda z: z.conjugate() if hasattr(z, "conjugate") else z)


def _where(mask: Any, x: Any, y: Any) -> Sloped:
    return Sloped(np.where(mask, values(x), values(y)), np.where(mask, slopes(x), slopes(y)))


def _angle(z: Any) -> Any:
    return np.arctan2(z.imag, z.real)


def _interp(x: Any, xs: Any, ys: Any) -> Sloped:
    """Of a table; at one of its points the slope that follows."""
    xs, ys = np.asarray(xs), np.asarray(ys)
    at = np.clip(np.searchsorted(xs, x.values, side="right") - 1, 0, len(xs) - 2)
    rise = (np.diff(ys) / np.diff(xs))[at]
    return Sloped(np.interp(x.values, xs, ys), rise * x.slopes)


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where,
    np.angle: _angle,
    np.interp: _interp,
    np.any: lambda x: bool(x.differs(0.0).any()),
    np.shape: lambda x: x.shape,
    np.ndim: lambda x: 1,
}
