"""Arithmetic over floats, arrays, longer numbers and numbers with slopes.

Sums lose nothing.
"""

import cmath
import math
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

Number = Any
"""A float, or an array that broadcasts over positions and linkages."""
PLAIN_TYPES = (int, np.generic)
"""Types of one truth value or status code; a mask of many is an array."""
U = 2.0**-53
"""Unit round-off of a double."""
PI_LOW = 1.2246467991473532e-16
"""pi less its double: a constant in longer numbers is no double."""


class OfParts(NDArrayOperatorsMixin):
    """Base class of numbers that are kept as two arrays, of the same kind."""

    def _change(self, change: Any) -> Any:
        return type(self)(*map(change, vars(self).values()))

    @property
    def real(self) -> Any:
        """Real part of both arrays."""
        return self._change(np.real)

    @property
    def imag(self) -> Any:
        """Imaginary part of both arrays."""
        return self._change(np.imag)

    def conjugate(self) -> Any:
        """Return the complex conjugate of both arrays."""
        return self._change(np.conjugate)


def make_like(values: Number, model: Number) -> Number:
    """Return plain numbers in the precision of another number: doubles or longer."""
    if hasattr(model, "like"):
        return model.like(values)
    return np.asarray(values, getattr(model, "dtype", float))


def is_any(mask: Number) -> bool:
    """Return True if a mask holds anywhere.

    For one value `np.any` takes fifty times as long, for a few `mask.any` five times
    as long as a count.
    """
    if type(mask) is bool:
        return mask
    if isinstance(mask, PLAIN_TYPES):
        return bool(mask)
    return bool(np.count_nonzero(mask))


def is_zero(x: Number) -> Number:
    """Mark where the value of a number is zero, whatever its slopes are."""
    return (x <= 0.0) & (x >= 0.0)


def without_slopes(x: Number) -> Number:
    """Return the value of a number that may carry slopes."""
    return x.values if hasattr(x, "slopes") else x


def select(mask: Number, x: Number, y: Number) -> Number:
    """Select x where a mask holds and y elsewhere.

    A single truth value returns one of them as it is.
    """
    if isinstance(mask, PLAIN_TYPES):
        return x if mask else y
    return np.where(mask, x, y)


def split_sum(x: Number, y: Number) -> tuple[Number, Number]:
    """Split x + y = s + r exactly, s the rounded sum.

    Source: D. E. Knuth, The Art of Computer Programming, vol. 2, 4.2.2, theorem B.
    """
    s = x + y
    z = s - x
    return s, (x - (s - z)) + (y - z)


def exact_difference(p: Number, q: Number, r: Number, s: Number) -> Number:
    """Compute (p + q) - (r + s), zero only where it is zero."""
    added, lost_1 = split_sum(p, q)
    subtracted, lost_2 = split_sum(r, s)
    gap, lost = split_sum(added, -subtracted)
    both, rest = split_sum(lost_1, -lost_2)
    return (gap + (lost + both)) + rest


def vector(x: Number, y: Number) -> Number:
    """Make x + i y, each part written once.

    Over arrays the sum takes three times as long.
    """
    if type(x) is type(y) is float:
        return complex(x, y)
    if isinstance(x, OfParts) or isinstance(y, OfParts):
        return x + 1j * y
    z = np.empty(np.broadcast(x, y).shape, np.result_type(x, y, np.complex64))
    z.real = x
    z.imag = y
    return z[()]


def polar(r: Number, phi: Number) -> Number:
    """Compute r e^{i phi} by the library's cosine and sine, exact where phi = 0."""
    if type(r) is type(phi) is float:
        return cmath.rect(r, phi)
    return r * np.cos(phi) + 1j * (r * np.sin(phi))


def sine_of(x: Number) -> Number:
    """Compute sin x; a Python float gives a Python float."""
    if type(x) is float:
        return math.sin(x)
    return np.sin(x)


def angle(u: Number) -> Number:
    """Return the angle of a complex number, rad, in [-pi, pi]."""
    if type(u) is complex:
        return cmath.phase(u)
    return np.arctan2(u.imag, u.real)


def wrap_angle(x: Number) -> Number:
    """Wrap an angle into [-pi, pi], rad; one that lies there stays as it is."""
    turns = np.rint(x / math.tau)
    return x - math.tau * turns - 2.0 * PI_LOW * turns


def tangent(x: Number) -> Number:
    """Compute tan x; a Python float gives a Python float."""
    if type(x) is float:
        return np.tan(x).item()
    return np.tan(x)


def square_root(x: Number) -> Number:
    """Compute sqrt(x), NaN where x < 0.

    A Python float gives a Python float where x >= 0.
    """
    if type(x) is float and x >= 0.0:
        return math.sqrt(x)
    return np.sqrt(x)


def power_of_two(x: Number) -> Number:
    """Return the power of two just above a positive number."""
    if type(x) is float:
        return math.ldexp(1.0, math.frexp(x)[1])
    return np.ldexp(1.0, np.frexp(x)[1])


def sine(u: Number, v: Number) -> Number:
    """Return the sine between two unit vectors, exactly zero if they are equal."""
    return u.real * v.imag - u.imag * v.real


def cross(u: Number, v: Number) -> Number:
    """Compute the z-component of u x v, the imaginary part of u* v.

    Over arrays it is quickest if u is one number.
    """
    return (u.conjugate() * v).imag


def dot(u: Number, v: Number) -> Number:
    """Compute the scalar product u . v."""
    return (u.conjugate() * v).real
