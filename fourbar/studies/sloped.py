"""Numbers that carry their derivatives: the formulas as they stand, evaluated with these, give both.

    z = f(x, y):   dz = f_x dx + f_y dy

Source: A. Griewank, A. Walther, Evaluating Derivatives, ch. 3 (forward mode).
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from fourbar.errors import LimitError

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
    **dict.fromkeys(
        (np.remainder, np.fmod), lambda z, x, y: (1.0, 0.0)
    ),  # by a constant
}
COMPLEMENT = {
    np.less: np.greater_equal,
    np.less_equal: np.greater,
    np.greater: np.less_equal,
    np.greater_equal: np.less,
}
PIECEWISE = (
    np.sign,
    np.copysign,
    np.floor,
    np.rint,
    np.frexp,
    np.isnan,
    np.isfinite,
    *COMPLEMENT,
)
"""Functions of the values alone; of balls the comparisons, each decided where all that the balls hold agrees."""


class Undecided:
    """A comparison of balls that some of them leave open, (n,).

    What selects by it takes both sides there, `any` says that it may hold; it is no truth value.
    """

    __array_ufunc__ = None

    def __init__(self, holds: Any, fails: Any) -> None:
        self.holds, self.fails = holds, fails

    def __and__(self, other: Any) -> "Undecided":
        holds, fails = (
            (other.holds, other.fails)
            if isinstance(other, Undecided)
            else (other, np.logical_not(other))
        )
        return Undecided(self.holds & holds, self.fails | fails)

    __rand__ = __and__

    def __bool__(self) -> bool:
        raise LimitError("a comparison of balls is undecided: there is no bound")

    def any(self) -> bool:
        """Return True if the comparison may hold anywhere."""
        return not self.fails.all()

    def of_one(self, x: Any, y: Any) -> "Sloped":
        """Select between two forms of one number; the slopes are those of either where the mask is undecided."""
        return self._choose(x, y, _hull(take_slopes(x), take_slopes(y)))

    def _choose(self, x: Any, y: Any, unknown: Any) -> "Sloped":
        """Select between two values and slopes; undecided entries get the hull of both values and the given slopes."""
        pairs = (
            (take_values(x), take_values(y), _hull(take_values(x), take_values(y))),
            (take_slopes(x), take_slopes(y), unknown),
        )
        return Sloped(
            *(
                np.where(self.holds, one, np.where(self.fails, other, both))
                for one, other, both in pairs
            )
        )

    def __array_function__(
        self, function: Any, types: Any, args: Sequence[Any], options: Any
    ) -> Any:
        return _find_by_name(function, args, options)


def decided(holds: Any, fails: Any) -> Any:
    """Return where a comparison holds if every entry is decided, else an `Undecided`."""
    return holds if (holds | fails).all() else Undecided(holds, fails)


class Sloped(NDArrayOperatorsMixin):
    """Values (n,) with their derivatives by p variables, slopes (p, n) or (p, 1): of doubles, or of balls as objects.

    A number is equal to a constant only where its derivatives vanish too, so that no term is left out for being zero.
    """

    def __init__(self, values: Any, slopes: Any) -> None:
        self.values: NDArray[Any] = np.atleast_1d(values)
        self.slopes: NDArray[Any] = slopes

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the values."""
        return self.values.shape

    @property
    def real(self) -> "Sloped":
        """Real part of values and slopes."""
        return Sloped(real(self.values), real(self.slopes))

    @property
    def imag(self) -> "Sloped":
        """Imaginary part of values and slopes."""
        return Sloped(imag(self.values), imag(self.slopes))

    def conjugate(self) -> "Sloped":
        """Return the complex conjugate of values and slopes."""
        return Sloped(conjugate(self.values), conjugate(self.slopes))

    def _compared(self, other: Any, function: Any) -> Any:
        """Mark where the value and the derivatives are those of the other, or where one of them is not, (n,)."""
        gap = self - other
        same = np.asarray(gap.values == 0.0) & np.asarray(gap.slopes == 0.0).all(axis=0)
        unlike = np.asarray(gap.values != 0.0) if self.values.dtype == object else ~same
        return decided(
            *((unlike, same) if function is np.not_equal else (same, unlike))
        )

    def __bool__(self) -> bool:
        raise TypeError("numbers with derivatives are no truth value")

    def __array_ufunc__(
        self, function: Any, method: str, *inputs: Any, **options: Any
    ) -> Any:
        if method != "__call__" or options:
            return NotImplemented
        operands = [
            x.item()
            if isinstance(x, np.ndarray) and x.dtype == object and not x.ndim
            else x
            for x in inputs
        ]
        if function in (np.equal, np.not_equal):
            sloped, constant = (
                operands if isinstance(operands[0], Sloped) else operands[::-1]
            )
            return sloped._compared(constant, function)
        if function is np.conjugate:
            return self.conjugate()
        plain = [take_values(x) for x in operands]
        if self.values.dtype == object and any(isinstance(x, complex) for x in plain):
            from flint import acb  # balls accept no complex number of Python's

            plain = [acb(x) if isinstance(x, complex) else x for x in plain]
        if function is np.absolute:
            size = np.absolute(plain[0])
            along = conjugate(plain[0]) / size
            return Sloped(size, real(along * self.slopes))
        if self.values.dtype == object and function in COMPLEMENT:
            return decided(function(*plain), COMPLEMENT[function](*plain))
        if function not in RULES and (
            function not in PIECEWISE or self.values.dtype == object
        ):
            return NotImplemented
        values = function(*plain)
        if function in PIECEWISE:
            return values
        partial = RULES[function](values, *plain)
        slopes = None
        for by, x in zip(partial, operands, strict=True):
            if isinstance(x, Sloped):
                term = (
                    x.slopes if isinstance(by, float) and by == 1.0 else by * x.slopes
                )
                slopes = term if slopes is None else slopes + term
        return Sloped(values, slopes)

    def __array_function__(
        self, function: Any, types: Any, args: Sequence[Any], options: Any
    ) -> Any:
        return _find_by_name(function, args, options)


def make_balls(centre: Any, radius: Any = 0.0) -> NDArray[Any]:
    """Return balls (n,) of centres and radii."""
    from flint import arb

    return np.atleast_1d(np.frompyfunc(arb, 2, 1)(centre, radius))


def _find_by_name(function: Any, args: Sequence[Any], options: Any) -> Any:
    return (
        NotImplemented
        if function not in FUNCTIONS or options
        else FUNCTIONS[function](*args)
    )


def take_values(number: Any) -> Any:
    """Return the values without their derivatives."""
    return number.values if isinstance(number, Sloped) else number


def take_slopes(number: Any) -> Any:
    """Return the derivatives; of a constant 0."""
    return number.slopes if isinstance(number, Sloped) else 0.0


def _apply_by_entry(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Make a function that applies to a whole array, or entry by entry to an array of objects."""
    by_entry = np.frompyfunc(function, 1, 1)
    return lambda z: by_entry(z) if z.dtype == object else function(z)


real, imag = _apply_by_entry(lambda z: z.real), _apply_by_entry(lambda z: z.imag)
conjugate = _apply_by_entry(lambda z: z.conjugate() if hasattr(z, "conjugate") else z)


def _unite(x: Any, y: Any) -> Any:
    """Return the least ball that holds two."""
    from flint import acb, arb

    kind: Any = acb if any(isinstance(z, (acb, complex)) for z in (x, y)) else arb
    return kind(x).union(kind(y))


_hull = np.frompyfunc(_unite, 2, 1)


def _choose_where(mask: Any, x: Any, y: Any) -> Sloped:
    if isinstance(mask, Undecided):  # the function may jump
        return mask._choose(x, y, math.nan)
    return Sloped(
        np.where(mask, take_values(x), take_values(y)),
        np.where(mask, take_slopes(x), take_slopes(y)),
    )


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _choose_where,
    np.angle: lambda z: np.arctan2(z.imag, z.real),
    np.searchsorted: lambda points, x, side: np.searchsorted(points, x.values, side),
    np.any: lambda x: bool((x != 0.0).any()),
    np.shape: lambda x: x.shape,
    np.ndim: lambda x: 1,
}
