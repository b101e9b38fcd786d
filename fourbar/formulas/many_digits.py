"""Numbers of mpmath, in which the formulas run as they stand.

In them it is decided whether the loop closes beside a limit position, and error bars
are found where long doubles are no longer than doubles.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from mpmath import MPContext, mp, mpf

from fourbar.formulas.arithmetic import OfParts, make_like
from fourbar.formulas.position import (
    TOUCHING,
    HalfAngle,
    half_angle,
    loop,
    reorder_lengths,
)
from fourbar.linkage import FourBar

WORKING_DIGITS = 120
"""The angle of a limit position near a change point keeps half of them."""
_RESIDUE = 1e-55
"""Relative part that so many digits leave of a factor which is zero at the limit.
"""
_DIGITS: Any = MPContext()
_DIGITS.dps = WORKING_DIGITS
_convert = np.frompyfunc(_DIGITS.convert, 1, 1)


class ManyDigits(OfParts):
    """Array of numbers of mpmath, made of these or of doubles, complex ones too."""

    def __init__(self, numbers: Any) -> None:
        self.numbers: Any = np.asarray(_convert(numbers))

    def _change(self, change: Any) -> "ManyDigits":
        return ManyDigits(_FUNCTIONS[change](self.numbers))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array."""
        return np.shape(self.numbers)

    def like(self, values: Any) -> "ManyDigits":
        """Return doubles as such numbers."""
        return ManyDigits(values)

    def as_doubles(self) -> Any:
        """Return the nearest doubles, complex if a number is."""
        is_complex = any(isinstance(one, _DIGITS.mpc) for one in self.numbers.flat)
        return self.numbers.astype(complex if is_complex else float)

    def __getitem__(self, index: Any) -> "ManyDigits":
        return ManyDigits(self.numbers[index])

    def __array_ufunc__(
        self,
        function: Any,
        method: str,
        *inputs: Any,
        **options: Any,
    ) -> Any:
        if function in _OF_DOUBLES:
            return function(*map(_take_doubles, inputs))
        numbers = map(_take_numbers, inputs)
        result = np.asarray(_FUNCTIONS.get(function, function)(*numbers))
        return ManyDigits(result) if result.dtype == object else result

    def __array_function__(
        self,
        function: Any,
        types: Any,
        args: Sequence[Any],
        options: Any,
    ) -> Any:
        if function is np.where:
            mask, x, y = args
            return ManyDigits(np.where(mask, _take_numbers(x), _take_numbers(y)))
        return function(*map(_take_doubles, args))


def _take_numbers(number: Any) -> Any:
    if isinstance(number, ManyDigits):
        return number.numbers
    return _convert(number)


def _take_doubles(number: Any) -> Any:
    if isinstance(number, ManyDigits):
        return number.as_doubles()
    return number


def _divide(x: Any, y: Any) -> Any:
    return x / y if y else x * _DIGITS.inf


def _take_root(x: Any) -> Any:
    return _DIGITS.sqrt(x) if x >= 0 else _DIGITS.nan


_OF_DOUBLES = (np.sign, np.isnan, np.isfinite, np.frexp, np.copysign)
"""Functions of the doubles alone."""
_FUNCTIONS: dict[Any, Any] = {
    np.divide: np.frompyfunc(_divide, 2, 1),
    np.sqrt: np.frompyfunc(_take_root, 1, 1),
    np.sin: np.frompyfunc(_DIGITS.sin, 1, 1),
    np.cos: np.frompyfunc(_DIGITS.cos, 1, 1),
    np.tan: np.frompyfunc(_DIGITS.tan, 1, 1),
    np.arctan2: np.frompyfunc(_DIGITS.atan2, 2, 1),
    np.rint: np.frompyfunc(_DIGITS.nint, 1, 1),
    np.fmod: np.frompyfunc(lambda x, y: x - y * int(x / y), 2, 1),
    np.real: np.frompyfunc(lambda x: x.real, 1, 1),
    np.imag: np.frompyfunc(lambda x: x.imag, 1, 1),
    np.conjugate: np.conjugate,
}
"""Functions that NumPy does not have of such numbers, and those of `OfParts`."""


def decide_half_angles(
    linkage: FourBar,
    unit: float,
    half: HalfAngle,
    index: Any,
    theta_2: Any,
    remainder: Any = None,
    bar: int = 2,
    lost: Any = 0.0,
) -> HalfAngle:
    """Return the half angles with those at an index recomputed in many digits.

    Each number is rounded once, to the kind of number that it replaces. The field
    `root_sign` stays: doubles decide it.

    Parameters
    ----------
    unit : of the lengths, m.
    half : half angles of `formulas.position.half_angle`.
    theta_2 : angles of the bar from which the loop is read, rad.
    remainder : what theta_2 as a double leaves out of the angle meant (rad, mpmath),
        where that is known (`Command.remainder`). A position beyond the limit then does
        not assemble, however near.
    lost : what a theta_2 that was computed leaves out as a double, rad.
    """
    shape = np.shape(theta_2)

    def take(number: Any) -> ManyDigits:
        return ManyDigits(np.broadcast_to(number, shape).ravel()[index])

    own_unit = take(unit)
    reordered = reorder_lengths(bar, linkage.lengths)
    lengths = loop(*(take(length) / own_unit for length in reordered))
    psi = take(theta_2) + take(lost) - take(linkage.ground_angle)
    if remainder is not None:
        psi = psi + ManyDigits(remainder)
    exact = half_angle(lengths, psi, opposite=bar == 4)
    d, a, b, c, _, _ = lengths
    size = 2.0 * (a + b + c + d) * np.sqrt(exact.inner + (b - c) * (b - c))
    least = -TOUCHING * size
    most = 0.0 * size
    if remainder is not None:
        most = _RESIDUE * size
        least = -most
    mask = np.zeros(np.size(theta_2), dtype=bool)
    mask[index] = True
    mask = mask.reshape(shape)

    def spread(doubles: Any) -> Any:
        full = np.zeros(np.size(theta_2))
        full[index] = doubles
        return full.reshape(shape)

    decided = []
    for name, number in half._asdict().items():
        if name == "root_sign":
            decided.append(number)
            continue
        value = getattr(exact, name)
        if name in ("outer", "inner"):
            value = np.where((least <= value) & (value <= most), 0.0, value)
        rounded = _take_doubles(value)
        rest = spread(_take_doubles(value - rounded))
        new = make_like(spread(rounded), number) + rest
        decided.append(np.where(mask, new, number)[()])
    return HalfAngle(*decided)


def limit_remainder(
    linkage: FourBar,
    limit: float,
    theta_2: float,
    offset: float,
    bar: int,
) -> Any:
    """Compute (limit position + offset) - theta_2 in many digits.

    `limit`: the double of the limit position.

    Where bars 3, 4 are collinear,
        cos(theta_2 - theta_1) = (a^2 + d^2 - (b +- c)^2)/(2 a d);
    likewise as the loop is read from another bar, whose angle theta_2 then is.
    """
    with mp.workdps(WORKING_DIGITS):
        d, a, b, c = map(mpf, reorder_lengths(bar, linkage.lengths))
        theta_1 = mpf(linkage.ground_angle) + (mp.pi if bar == 4 else 0)
        exact = []
        for span in (b + c, b - c):
            cosine = (a * a + d * d - span * span) / (2 * a * d)
            psi = mp.acos(min(max(cosine, mpf(-1)), mpf(1)))
            exact += [theta_1 + sign * psi for sign in (1, -1)]
        turn = 2 * mp.pi
        nearest = min(
            (angle + turn * mp.nint((limit - angle) / turn) for angle in exact),
            key=lambda angle: abs(angle - limit),
        )
        return nearest + mpf(offset) - mpf(theta_2)
