"""The error of an answer: how far two numbers are apart, in parts of what they are measured by, and of what is allowed.

Every comparison, study and picture of the harness forms its errors here.
"""

import numpy as np

from fourbar_validation.compare.tolerance import Array


def magnitude(values: Array) -> Array:
    """Absolute value of a scalar, Euclidean norm of a vector, (n,)."""
    return np.asarray(np.hypot(values[:, 0], values[:, 1]) if values.ndim == 2 else np.abs(values))


def difference(quantity: str, ours: Array, theirs: Array) -> Array:
    """Angles modulo 2 pi, vectors by Euclidean norm, (n,); NaN where the shapes are not the same."""
    if theirs.shape != ours.shape:
        return np.full(len(ours), np.nan)
    apart = ours - theirs
    if quantity.startswith("theta"):
        apart = np.remainder(apart + np.pi, 2.0 * np.pi) - np.pi
    return magnitude(apart)


def relative(apart: Array | float, size: Array | float) -> Array:
    """Divide a difference by a size; a size of 0 demands exactly 0: over the least double any other is huge."""
    with np.errstate(over="ignore"):
        return np.asarray(apart / np.where(size == 0.0, np.nextafter(0.0, 1.0), size))


def relative_error(quantity: str, ours: Array, theirs: Array, size: Array) -> Array:
    """Compute the error of an answer in parts of the size of the quantity, (n,)."""
    return relative(difference(quantity, ours, theirs), size)


def in_own_unit(size: Array) -> Array:
    """Replace a size by 1 of its unit where there is nothing to be relative to."""
    return np.where(size == 0.0, 1.0, size)


def used(error: Array | float, allowed: Array | float) -> Array:
    """error/allowed: how much of its allowance an error uses; infinite where it is no number, 0 where it is 0."""
    error, allowed = np.asarray(error, dtype=float), np.asarray(allowed, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        share = np.where(error == 0.0, 0.0, error / allowed)
    return np.where(np.isfinite(error) & ~np.isnan(share), share, np.inf)


def worst(errors: Array) -> int:
    """Index of the largest error; what is no number is beyond all."""
    return int(np.argmax(np.where(np.isnan(errors), np.inf, errors)))
