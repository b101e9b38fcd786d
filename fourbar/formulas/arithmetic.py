"""Arithmetic over plain floats, arrays of any library and numbers that carry derivatives; sums that lose nothing."""

import cmath
import math
from typing import Any

import numpy as np

Number = Any
"""A float, or an array that broadcasts over positions and linkages."""
PLAIN = (int, np.generic)
"""One truth value or code."""
NUMPY = (np.ndarray, np.generic)
DOUBLES = {float, np.float64}
U = 2.0**-53
"""Unit round-off of a double."""
PI_LOW = 1.2246467991473532e-16
"""pi less its double: a constant in longer numbers is no double."""
_LIBRARY_OF: dict[type, Any] = {float: np, int: np, complex: np, np.ndarray: np}


def namespace(*numbers: Number) -> Any:
    """Return the functions of the library that numbers are of: NumPy's own unless one is an array of another.

    Raises TypeError where they are of two other libraries.
    """
    library: Any = np
    for number in numbers:
        functions = _LIBRARY_OF.get(type(number)) or _find_namespace(number)
        if functions is not np and library not in (np, functions):
            raise TypeError("arrays of two libraries")
        library = library if functions is np else functions
    return library


def _find_namespace(number: Number) -> Any:
    """Find the functions for a type seen for the first time: NumPy's for its own operands and for what is no array."""
    functions: Any = np
    array = hasattr(number, "__array_namespace__") or hasattr(number, "__dlpack__")
    if (
        array
        and not isinstance(number, np.generic)
        and not hasattr(number, "__array_ufunc__")
    ):
        from array_api_compat import array_namespace

        functions = array_namespace(number)
    _LIBRARY_OF[type(number)] = functions
    return functions


def make_like(values: Number, model: Number) -> Number:
    """Make plain numbers an array of another's library, kind and device."""
    if (
        xp := namespace(model)
    ) is np:  # Python's own numbers and those with derivatives have no dtype
        return (
            model.like(values)
            if hasattr(model, "like")
            else np.asarray(values, getattr(model, "dtype", float))
        )
    from array_api_compat import is_jax_array

    device = (
        {} if is_jax_array(model) else {"device": model.device}
    )  # JAX brings plain numbers to the others
    return xp.asarray(values, dtype=model.dtype, **device)


def is_any(mask: Number) -> bool:
    """Return True if a mask may hold at any entry; for a plain number `np.any` takes fifty times as long."""
    if isinstance(mask, PLAIN):
        return bool(mask)
    if isinstance(mask, np.ndarray) or namespace(mask) is np:
        return bool(mask.any())
    return True  # arrays of another library may be traced


def is_differentiated(x: Number) -> bool:
    """Return True for numbers whose derivatives may be taken: arrays of other libraries, and those that carry them."""
    return type(x) is not float and (namespace(x) is not np or hasattr(x, "slopes"))


def is_zero(x: Number) -> Number:
    """Mark zeros, none in numbers whose derivatives may be taken."""
    return not is_differentiated(x) and x == 0.0


def select(mask: Number, x: Number, y: Number) -> Number:
    """Select x where a mask holds and y elsewhere, two forms of one number; a plain mask returns one of them."""
    if isinstance(mask, PLAIN):
        return x if mask else y
    if isinstance(mask, np.ndarray):
        return np.where(mask, x, y)
    return (
        mask.of_one(x, y)
        if hasattr(mask, "of_one")
        else namespace(mask).where(mask, x, y)
    )


def divisor(x: Number, mask: Number) -> Number:
    """Return what divides where a mask holds; elsewhere 0 would leave no number in the derivatives of what it divides.

    Numbers of NumPy stay as they are: their derivatives are taken of what is selected alone.
    """
    return x if (xp := namespace(x, mask)) is np else xp.where(mask, x, 1.0)


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
    """Make x + i y, each part written once: over arrays the sum takes three times as long."""
    if type(x) is type(y) is float:
        return complex(x, y)
    if not (
        (type(x) is float or isinstance(x, NUMPY))
        and (type(y) is float or isinstance(y, NUMPY))
    ):
        return x + 1j * y
    kinds = {
        number.dtype.type if hasattr(number, "dtype") else float for number in (x, y)
    }
    if (
        not isinstance(x, np.ndarray)
        and not isinstance(y, np.ndarray)
        and kinds <= DOUBLES
    ):
        return np.complex128(complex(x, y))
    z = np.empty(
        np.broadcast(x, y).shape,
        dtype=complex if kinds <= DOUBLES else np.result_type(x, y, np.complex64),
    )
    z.real, z.imag = x, y
    return z[()]


def polar(r: Number, phi: Number) -> Number:
    """Compute r e^{i phi} with the cosine and the sine of the library, exact where phi = 0."""
    if type(r) is type(phi) is float:
        return cmath.rect(r, phi)
    functions = namespace(r, phi)
    if functions is not np and type(phi) is float:
        functions = math
    return r * functions.cos(phi) + 1j * (r * functions.sin(phi))


def sine_of(x: Number) -> Number:
    """Compute sin x, of Python's own floats as such."""
    return math.sin(x) if type(x) is float else namespace(x).sin(x)


def angle(u: Number) -> Number:
    """Return the angle of a complex number, rad, in [-pi, pi]."""
    return cmath.phase(u) if type(u) is complex else namespace(u).atan2(u.imag, u.real)


def conjugate(u: Number) -> Number:
    """Return u* of a complex number, by its parts in PyTorch, which maps no conjugate over many numbers at once."""
    try:
        return u.conjugate()
    except AttributeError:
        return vector(u.real, -u.imag)


def sign(x: Number) -> Number:
    """Return -1, 0 or 1; NaN gives 0 in other libraries, because PyTorch does not map NumPy's rule."""
    xp = namespace(x)
    return (
        np.sign(x)
        if xp is np
        else xp.astype(x > 0.0, x.dtype) - xp.astype(x < 0.0, x.dtype)
    )


def nearest(x: Number) -> Number:
    """Return the nearest whole number, the even one of two."""
    return np.rint(x) if (xp := namespace(x)) is np else xp.round(x)


def wrap_angle(x: Number) -> Number:
    """Wrap an angle into [-pi, pi], rad; one that lies there stays as it is."""
    turns = nearest(x / math.tau)
    return x - math.tau * turns - 2.0 * PI_LOW * turns


def tangent(x: Number) -> Number:
    """Compute tan x, of Python's own floats as such."""
    return np.tan(x).item() if type(x) is float else namespace(x).tan(x)


def square_root(x: Number) -> Number:
    """Compute sqrt(x), NaN where x < 0, of Python's own floats as such."""
    return math.sqrt(x) if type(x) is float and x >= 0.0 else namespace(x).sqrt(x)


def power_of_two(x: Number) -> Number:
    """Return the power of two just above a positive number; 1 for arrays of libraries that do not tell exponents."""
    if type(x) is float:
        return math.ldexp(1.0, math.frexp(x)[1])
    return np.ldexp(1.0, np.frexp(x)[1]) if namespace(x) is np else 1.0


def sine(u: Number, v: Number) -> Number:
    """Return the sine of the angle between two directions; exactly zero if they are equal."""
    return u.real * v.imag - u.imag * v.real


def cross(u: Number, v: Number) -> Number:
    """Compute the z-component of u x v, the imaginary part of u* v; over arrays least work where u is one number."""
    return (conjugate(u) * v).imag


def dot(u: Number, v: Number) -> Number:
    """Compute the scalar product u . v."""
    return (conjugate(u) * v).real
