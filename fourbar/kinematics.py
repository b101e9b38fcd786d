"""Loop closure on a branch, angular velocities and accelerations, motion of the points of the bars.

    a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}        (Norton, ch. 4)

The position is solved from the triangle A, B, O4 and its four Heron factors, never from the
half-angle quadratic: nothing passes through zero at theta = 180 deg, and near a limit position
the digits that are lost are those that the data themselves do not carry.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import Bar, FourBar
from fourbar.margins import heron_factors

Array = NDArray[np.float64]
Vector = tuple[Array, Array]
"""A planar vector as its components (x, y), each an array over the positions."""


def cross(u: Vector, v: Vector) -> Array:
    """z-component of u x v."""
    return u[0] * v[1] - u[1] * v[0]


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
    branch: Array
    assembled: NDArray[np.bool_]
    u2: Vector
    u3: Vector
    u4: Vector
    O4: tuple[float, float]
    sin_mu: Array
    cos_mu: Array
    singular: NDArray[np.bool_]
    omega_2: Array | float = 0.0
    omega_3: Array | None = None
    omega_4: Array | None = None
    alpha_2: Array | float = 0.0
    alpha_3: Array | None = None
    alpha_4: Array | None = None

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

    def angle(self, bar: int) -> Array:
        """theta_2 as given; theta_3, theta_4 in (-pi, pi]."""
        if bar == 2:
            return self.theta_2
        u = self.unit(bar)
        return np.arctan2(u[1], u[0])

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
    w2 = omega * omega
    return (-alpha * arm[1] - w2 * arm[0], alpha * arm[0] - w2 * arm[1])


def centre_in_bar(bar: Bar) -> tuple[float, float]:
    """The mass centre (r cos phi, r sin phi) in the bar's frame at its first pin, m."""
    r, phi = bar.centre  # type: ignore[misc]
    if phi == 0.0:
        return (r, 0.0)
    return (float(r * np.cos(phi)), float(r * np.sin(phi)))


def close_loop(linkage: FourBar, theta_2: Array, branch: int | NDArray[np.int8]) -> State:
    """Positions on a branch: theta_3 = phi + sigma beta, theta_4 = phi + pi - sigma gamma.

    phi is the direction A to O4, beta and gamma are the angles of the triangle A, B, O4 at A and
    O4, from the cosine rule written in Heron factors:
        cos beta = (p3 p4 - p1 p2)/(4 b e),  sin beta = sqrt(p1 p2 p3 p4)/(2 b e),
        sin(theta_4 - theta_3) = sigma sqrt(p1 p2 p3 p4)/(2 b c).

    Parameters
    ----------
    theta_2 : (n,), rad.
    branch : +1 or -1, or one of them for each position (n,).
    """
    _, _, b, c = linkage.lengths
    sigma = np.broadcast_to(np.asarray(branch, dtype=float), theta_2.shape)
    diagonal = heron_factors(linkage, theta_2)
    e = diagonal.length
    p12, p34 = diagonal.p1 * diagonal.p2, diagonal.p3 * diagonal.p4
    p13, p24 = diagonal.p1 * diagonal.p3, diagonal.p2 * diagonal.p4
    assembled = (diagonal.p1 >= 0.0) & (diagonal.p2 >= 0.0) & (diagonal.p3 >= 0.0)
    if not assembled.all():
        p12 = np.where(assembled, p12, np.nan)
    # two square roots: the product of all four factors could leave the range of doubles
    area = sigma * (np.sqrt(p12) * np.sqrt(p34))
    sin_mu = area / (2.0 * b * c)
    cos_mu = (diagonal.p1 * diagonal.p4 - diagonal.p2 * diagonal.p3) / (4.0 * b * c)
    with np.errstate(divide="ignore", invalid="ignore"):  # e = 0: A on O4, where beta is free
        unit_x, unit_y = diagonal.x / e, diagonal.y / e
        beta = ((p34 - p12) / (4.0 * b * e), area / (2.0 * b * e))
        gamma = ((p24 - p13) / (4.0 * c * e), area / (2.0 * c * e))
    theta_1 = linkage.ground_angle
    if theta_1 != 0.0:
        c1, s1 = np.cos(theta_1), np.sin(theta_1)
        unit_x, unit_y = c1 * unit_x - s1 * unit_y, s1 * unit_x + c1 * unit_y
        d_vector = (float(linkage.ground * c1), float(linkage.ground * s1))
    else:
        d_vector = (linkage.ground, 0.0)
    u3 = (unit_x * beta[0] - unit_y * beta[1], unit_y * beta[0] + unit_x * beta[1])
    u4 = (-(unit_x * gamma[0] + unit_y * gamma[1]), unit_x * gamma[1] - unit_y * gamma[0])
    return State(
        linkage=linkage,
        theta_2=theta_2,
        branch=np.asarray(sigma, dtype=np.int8),
        assembled=assembled,
        u2=(np.cos(theta_2), np.sin(theta_2)),
        u3=u3,
        u4=u4,
        O4=d_vector,
        sin_mu=sin_mu,
        cos_mu=cos_mu,
        singular=assembled & ~(np.abs(sin_mu) > NO_DIGIT_LEFT),
    )


NO_DIGIT_LEFT = 8.0 * 2.0**-52
"""|sin mu| at or below this: the directions of bars 3 and 4 cannot be told apart in doubles."""


def add_velocities(state: State, omega_2: Array | float) -> None:
    """omega_3 = -a omega_2 sin(theta_4 - theta_2)/(b sin mu), omega_4 = -a omega_2 sin(theta_3 - theta_2)/(c sin mu).

    The loop's velocity multiplied by bars 4 and 3 (Norton, eq. 6.18); mu = theta_4 - theta_3.
    """
    _, a, b, c = state.linkage.lengths
    s = np.where(state.singular, np.nan, state.sin_mu) if state.singular.any() else state.sin_mu
    drive = -a * omega_2 / s
    state.omega_2 = omega_2
    state.omega_3 = drive * cross(state.u2, state.u4) / b
    state.omega_4 = drive * cross(state.u2, state.u3) / c


def add_accelerations(state: State, alpha_2: Array | float) -> None:
    """alpha_3, alpha_4 from the loop's acceleration multiplied by bars 4 and 3 (Norton, eq. 7.12).

    b sin mu alpha_3 = a (omega_2^2 cos42 - alpha_2 sin42) + b omega_3^2 cos43 - c omega_4^2
    c sin mu alpha_4 = a (omega_2^2 cos32 - alpha_2 sin32) + b omega_3^2 - c omega_4^2 cos43
    """
    _, a, b, c = state.linkage.lengths
    w2, w3, w4 = state.omega_2, state.omega_3, state.omega_4
    assert w3 is not None and w4 is not None, "velocities come first"
    s = np.where(state.singular, np.nan, state.sin_mu) if state.singular.any() else state.sin_mu
    centripetal = a * (w2 * w2)
    term_4 = centripetal * dot(state.u2, state.u4)
    term_3 = centripetal * dot(state.u2, state.u3)
    if np.any(alpha_2):
        term_4 = term_4 - (a * alpha_2) * cross(state.u2, state.u4)
        term_3 = term_3 - (a * alpha_2) * cross(state.u2, state.u3)
    coupler, output = b * (w3 * w3), c * (w4 * w4)
    state.alpha_2 = alpha_2
    state.alpha_3 = (term_4 + coupler * state.cos_mu - output) / (b * s)
    state.alpha_4 = (term_3 + coupler - output * state.cos_mu) / (c * s)
