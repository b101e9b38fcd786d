"""A linkage in motion: directions of its bars, speeds and accelerations, and how the points of the bars move.

Positions, velocities and accelerations of a point are sums over the bars that lead to it
(R. L. Norton, Design of Machinery, ch. 4, 6 and 7); what the loop's closure makes of the input's motion
is in `kinematics`. A term that is zero at every position (alpha_2 = 0, a centre on the bar's line) is
not evaluated.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import Bar, FourBar
from fourbar.margins import Diagonal

Array = NDArray[np.float64]
Vector = tuple[Array, Array]
"""A planar vector as its components (x, y), each an array over the positions."""
NO_ROOM: Mapping[str, Any] = {}
"""For results by name, where each is to get an array of its own."""


def cross(u: Vector, v: Vector) -> Array:
    """z-component of u x v."""
    z = u[0] * v[1]
    z -= u[1] * v[0]
    return z


def dot(u: Vector, v: Vector) -> Array:
    """Scalar product u . v."""
    return u[0] * v[0] + u[1] * v[1]


def turned(u: Vector) -> Vector:
    """u turned by +90 deg."""
    return (-u[1], u[0])


@dataclass(slots=True)
class State:
    """Positions of a linkage and, as far as they were asked for, velocities and accelerations.

    Every array has shape (n,). `u2`, `u3`, `u4` are the unit vectors along the bars (O2 to A,
    A to B, O4 to B), `O4` is the fixed pin. Where `assembled` is False everything that follows
    from the loop is NaN; where `singular` is True (sin_mu = 0) velocities and accelerations are.
    """

    linkage: FourBar
    theta_2: Array
    branch: NDArray[np.int8]
    assembled: NDArray[np.bool_]
    u2: Vector
    u3: Vector
    u4: Vector
    O4: tuple[float, float]
    diagonal: Diagonal
    signed_root: Array
    sin_mu: Array
    at_A: Array
    at_O4: Array
    """2 b e cos beta and 2 c e cos gamma, of the angles of the triangle A, B, O4 at A and O4; unit of the diagonal."""
    cos_psi: Array
    """cos(theta_2 - theta_1)."""
    singular: NDArray[np.bool_]
    omega_2: Array | float = 0.0
    omega_3: Array | None = None
    omega_4: Array | None = None
    alpha_2: Array | float = 0.0
    alpha_3: Array | None = None
    alpha_4: Array | None = None
    first: "FirstCoefficients | None" = None
    parallel: tuple[NDArray[np.bool_], Array] | None = None
    """Where two pairs of bars stay parallel or coincide, and there d theta_4/d theta_2."""

    @property
    def cos_mu(self) -> Array:
        """cos(theta_4 - theta_3)."""
        _, _, b, c = self.diagonal.lengths
        cosine: Array = ((b * b + c * c) - self.diagonal.squared) * (0.5 / (b * c))
        if self.parallel is not None:
            return np.where(self.parallel[0], self.cos_psi, cosine)
        return cosine

    def unit(self, bar: int) -> Vector:
        """Unit vector along bar 2, 3 or 4."""
        return {2: self.u2, 3: self.u3, 4: self.u4}[bar]

    def omega(self, bar: int) -> Array | float:
        """Angular velocity of bar 1, 2, 3 or 4, rad/s."""
        value = {1: 0.0, 2: self.omega_2, 3: self.omega_3, 4: self.omega_4}[bar]
        assert value is not None, "velocities were not evaluated"
        return value

    def alpha(self, bar: int) -> Array | float:
        """Angular acceleration of bar 1, 2, 3 or 4, rad/s^2."""
        value = {1: 0.0, 2: self.alpha_2, 3: self.alpha_3, 4: self.alpha_4}[bar]
        assert value is not None, "accelerations were not evaluated"
        return value

    def regular_sine(self) -> Array:
        """sin_mu, NaN where the position is singular."""
        if self.diagonal.least_root == 0.0 and self.singular.any():
            return self.sin_mu + np.where(self.singular, np.nan, 0.0)
        return self.sin_mu

    def regular_root(self) -> Array:
        """sigma root in the unit of the diagonal, NaN where the position is singular."""
        if self.diagonal.least_root == 0.0 and self.singular.any():
            return self.signed_root + np.where(self.singular, np.nan, 0.0)
        return self.signed_root

    def angle(self, bar: int, into: Array | None = None) -> Array:
        """theta_2 as given; theta_3, theta_4 in (-pi, pi]."""
        if bar == 2:
            return self.theta_2
        u = self.unit(bar)
        return np.arctan2(u[1], u[0], out=into)

    def pin(self, name: str) -> Vector:
        """Position of a pin: "O2", "A", "B" or "O4"."""
        if name == "O2":
            return (np.zeros_like(self.theta_2), np.zeros_like(self.theta_2))
        if name == "A":
            return along(self.u2, self.linkage.input.length, 0.0)
        if name == "O4":
            return (np.full_like(self.theta_2, self.O4[0]), np.full_like(self.theta_2, self.O4[1]))
        if name == "B":
            return self.point(4, self.linkage.output.length, 0.0)
        raise KeyError(name)

    def arm(self, bar: int, r_along: float, r_across: float) -> Vector:
        """Vector from the bar's first pin to the point (r_along, r_across) fixed in the bar."""
        return along(self.unit(bar), r_along, r_across)

    def point(self, bar: int, r_along: float, r_across: float) -> Vector:
        """Position of the point (r_along, r_across) of a bar, in the bar's frame at its first pin, m."""
        x, y = self.arm(bar, r_along, r_across)
        if bar == 3:
            a = self.linkage.input.length
            return (a * self.u2[0] + x, a * self.u2[1] + y)
        if bar == 4:
            return (self.O4[0] + x, self.O4[1] + y)
        return (x, y)

    def velocity(self, bar: int, r_along: float, r_across: float) -> Vector:
        """Velocity of a point of a bar, m/s: v = v_pin + omega x arm."""
        vx, vy = turned(self.arm(bar, r_along, r_across))
        w = self.omega(bar)
        if bar == 3:
            ax, ay = turned(along(self.u2, self.linkage.input.length, 0.0))
            return (self.omega_2 * ax + w * vx, self.omega_2 * ay + w * vy)
        return (w * vx, w * vy)

    def acceleration(self, bar: int, r_along: float, r_across: float) -> Vector:
        """Acceleration of a point of a bar, m/s^2: a = a_pin + alpha x arm - omega^2 arm."""
        own = swing(self.arm(bar, r_along, r_across), self.omega(bar), self.alpha(bar))
        if bar == 3:
            pin = swing(along(self.u2, self.linkage.input.length, 0.0), self.omega_2, self.alpha_2)
            return (pin[0] + own[0], pin[1] + own[1])
        return own


def along(u: Vector, r_along: float, r_across: float) -> Vector:
    """r_along u + r_across (u turned by 90 deg); the second term only where there is one."""
    if r_across == 0.0:
        return (r_along * u[0], r_along * u[1])
    return (r_along * u[0] - r_across * u[1], r_along * u[1] + r_across * u[0])


def swing(arm: Vector, omega: Array | float, alpha: Array | float) -> Vector:
    """Acceleration of the end of an arm about its foot: alpha x r - omega^2 r."""
    centripetal = -(omega * omega)
    if is_zero(alpha):
        return (centripetal * arm[0], centripetal * arm[1])
    return (centripetal * arm[0] - alpha * arm[1], centripetal * arm[1] + alpha * arm[0])


def is_zero(value: Array | float) -> bool:
    """Whether a term with this factor does not exist at any position."""
    return isinstance(value, (int, float)) and value == 0.0


def centre_in_bar(bar: Bar) -> tuple[float, float]:
    """The mass centre (r cos phi, r sin phi) in the bar's frame at its first pin, m."""
    r, phi = bar.centre  # type: ignore[misc]
    if phi == 0.0:
        return (r, 0.0)
    return (float(r * np.cos(phi)), float(r * np.sin(phi)))


@dataclass(slots=True)
class FirstCoefficients:
    """d theta_3/d theta_2, d theta_4/d theta_2 and the parts that they are made of, each (n,)."""

    h3: Array
    h4: Array
    growth: Array
    """lambda = (de/d theta_2)/e."""
    cot_beta: Array
    cot_gamma: Array
    """sigma cot of the angles of the triangle at A and O4."""
    with_beta: Array
    with_gamma: Array
    """sigma lambda cot of the same angles: what h4 and h3 differ by from the turning of the diagonal."""
