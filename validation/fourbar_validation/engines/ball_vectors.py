"""Vectors of the plane in ball arithmetic."""

from typing import Any, TypeAlias

from flint import acb

Ball: TypeAlias = Any
Complex: TypeAlias = Any
"""A vector of the plane, x + i y, of two balls."""
Values: TypeAlias = dict[str, Ball]


def polar(r: Ball, angle: Ball) -> Complex:
    """Return r e^{i angle}."""
    return acb(r * angle.cos(), r * angle.sin())


def wedge(u: Complex, v: Complex) -> Ball:
    """Return u_x v_y - u_y v_x."""
    return (u.conjugate() * v).imag


def dot(u: Complex, v: Complex) -> Ball:
    """Return u_x v_x + u_y v_y."""
    return (u.conjugate() * v).real
