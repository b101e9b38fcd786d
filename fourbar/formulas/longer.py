"""Numbers with more digits than doubles have, in which the formulas run as they stand.

Long doubles of the C library are taken where these are longer than doubles, as on
Linux, and `ManyDigits` elsewhere, as on Windows and on Apple's processors.
"""

from collections.abc import Callable
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from fourbar.formulas.arithmetic import Number, without_slopes
from fourbar.linkage import copy_with, list_fields

HAS_LONG_DOUBLES = np.finfo(np.longdouble).nmant > np.finfo(np.float64).nmant


def lengthen(number: Number) -> Number:
    """Return a double, or an array of them, as a longer number."""
    if not HAS_LONG_DOUBLES:
        from fourbar.formulas.many_digits import ManyDigits

        return ManyDigits(np.asarray(number, dtype=float))
    if isinstance(number, np.ndarray):
        return number.astype(np.longdouble)
    return np.longdouble(number)


def shorten(number: Number) -> Number:
    """Return a longer number as doubles; any other one as it is."""
    if hasattr(number, "as_doubles"):
        return number.as_doubles()
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
    if not _has_numbers(value.__class__):
        return value
    names = list_fields(value.__class__)
    changed = {name: change_numbers(getattr(value, name), change) for name in names}
    return copy_with(value, **changed)


def _has_numbers(kind: type) -> bool:
    """Return True for a dataclass whose numbers may be changed."""
    return is_dataclass(kind) and not getattr(kind, "as_given", False)
