"""Numbers that carry their slopes.

The formulas as they stand, evaluated with these, give both.

    z = f(x, y):   dz = f_x dx + f_y dy

Source: A. Griewank, A. Walther, Evaluating Derivatives, ch. 3 (forward mode).
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import LimitError
from fourbar.formulas.arithmetic import OfParts

_Rule = Callable[..., tuple[Any, ...]]
"""Partial derivatives of a function by its arguments, from its value and them."""
_RULES: dict[Any, _Rule] = {
    np.add: lambda z, x, y: (1.0, 1.0),
    np.subtract: lambda z, x, y: (1.0, -1.0),
    np.multiply: lambda z, x, y: (y, x),
    np.divide: lambda z, x, y: (1.0 / y, -z / y),
    np.negative: lambda z, x: (-1.0,),
    np.sqrt: lambda z, x: (0.5 / z,),
    np.hypot: lambda z, x, y: (x / z, y / z),
    np.tan: lambda z, x: (1.0 + z * z,),
    np.sin: lambda z, x: (np.cos(x),),
    np.cos: lambda z, x: (-np.sin(x),),
    np.arctan2: lambda z, y, x: (x / (x * x + y * y), -y / (x * x + y * y)),
    np.copysign: lambda z, x, y: (np.copysign(1.0, x) * np.copysign(1.0, y), 0.0),
    np.remainder: lambda z, x, y: (1.0, (z - x) / y),
    np.fmod: lambda z, x, y: (1.0, (z - x) / y),
}
STEP_FUNCTIONS = (
    np.sign,
    np.floor,
    np.rint,
    np.isnan,
    np.isfinite,
    np.less,
    np.less_equal,
    np.greater,
    np.greater_equal,
)
"""Functions that are constant between their jumps: they return plain values."""


class Sloped(OfParts):
    """Values (n,) with their slopes by p variables, (p, n) or (p, 1).

    A number is equal to a constant only where its slopes vanish too, so that no term is
    left out for being zero. A function without a rule raises LimitError.
    """

    def __init__(self, values: Any, slopes: Any) -> None:
        self.values: NDArray[Any] = np.atleast_1d(values)
        self.slopes: NDArray[Any] = slopes

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values."""
        return self.values.shape

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise LimitError("a number with slopes cannot become a plain array")

    def __float__(self) -> float:
        raise LimitError("a number with slopes cannot become a float")

    def __bool__(self) -> bool:
        raise LimitError("a number with slopes has no truth value")

    def __array_ufunc__(
        self,
        function: Any,
        method: str,
        *inputs: Any,
        **options: Any,
    ) -> Any:
        if method != "__call__" or options:
            raise _refuse(f"{function.__name__} with options")
        if function in (np.equal, np.not_equal):
            # no slope differs either
            gap = np.subtract(*inputs)
            same = (gap.values == 0.0) & (gap.slopes == 0.0).all(axis=0)
            return same if function is np.equal else ~same
        if function is np.conjugate:
            return self.conjugate()
        if function is np.absolute:  # of a complex number too
            size = np.absolute(self.values)
            along = self.values.conjugate() / size
            return Sloped(size, (along * self.slopes).real)
        if function is np.frexp:
            mantissa, exponent = np.frexp(self.values)
            return Sloped(mantissa, np.ldexp(self.slopes, -exponent)), exponent
        plain = [take_values(number) for number in inputs]
        if function in STEP_FUNCTIONS:
            return function(*plain)
        if function not in _RULES:
            raise _refuse(function.__name__)
        values = function(*plain)
        slopes = None
        for by, number in zip(_RULES[function](values, *plain), inputs, strict=True):
            if isinstance(number, Sloped):
                unchanged = isinstance(by, float) and by == 1.0
                term = number.slopes if unchanged else by * number.slopes
                slopes = term if slopes is None else slopes + term
        return Sloped(values, slopes)

    def __array_function__(
        self,
        function: Any,
        types: Any,
        args: Sequence[Any],
        options: Any,
    ) -> Any:
        if function not in SLOPED_FUNCTIONS or options:
            raise _refuse(function.__name__)
        return SLOPED_FUNCTIONS[function](*args)


def _refuse(name: str) -> LimitError:
    """Return the error for a function that has no rule."""
    followed = ", ".join(rule.__name__ for rule in (*_RULES, *STEP_FUNCTIONS))
    return LimitError(
        f"derivatives cannot follow numpy.{name}; an effect may use "
        f"absolute, angle, where, {followed}"
    )


def take_values(number: Any) -> Any:
    """Return the values without their slopes."""
    if isinstance(number, Sloped):
        return number.values
    return number


def take_slopes(number: Any) -> Any:
    """Return the slopes; of a constant 0."""
    if isinstance(number, Sloped):
        return number.slopes
    return 0.0


SLOPED_FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: lambda mask, x, y: Sloped(
        np.where(mask, take_values(x), take_values(y)),
        np.where(mask, take_slopes(x), take_slopes(y)),
    ),
    np.angle: lambda z: np.arctan2(z.imag, z.real),
    np.searchsorted: lambda points, x, side: np.searchsorted(points, x.values, side),
    np.any: lambda x: bool((x != 0.0).any()),
    np.shape: lambda x: x.shape,
    np.ndim: lambda x: 1,
}
