"""Energy method: equivalent inertia, reduced equation of motion, driving torque from virtual work.

A second derivation, which shares nothing with Newton-Euler. One angle q (theta_2, or theta_4
where the input stands still) describes the linkage; the first and second kinematic coefficients
    theta_k' = d theta_k/dq,   theta_k'' = d^2 theta_k/dq^2
come from differentiating the triangle A, B, O4 itself, not from the velocity loop: with
h = (q - theta_1)/2 and Heron's factors in pairs,
    e^2 = (d - a)^2 + 4 a d sin^2 h,
    (b + c)^2 - e^2 = E1 + 4 a d cos^2 h,   E1 = (b + c)^2 - (a + d)^2,
    e^2 - (b - c)^2 = E2 + 4 a d sin^2 h,   E2 = (a - d)^2 - (b - c)^2,
    theta_3' = phi' - 2 a d (1 - (b^2 - c^2)/e^2) S C,   theta_4' = phi' + 2 a d (1 + (b^2 - c^2)/e^2) S C,
    S = sin h/sqrt(E2 + 4 a d sin^2 h),   C = cos h/sqrt(E1 + 4 a d cos^2 h).
At a change point E1 or E2 is zero and C or S is a constant: nothing there is 0/0.

The reduced equation of motion (Eksergian; Norton, Design of Machinery, ch. 11, gives the power balance) is
    J q'' + J'/2 q'^2 = Q,   J = sum of m |dG/dq|^2 + I theta_k'^2.
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

import numpy as np

from fourbar.kinematics import Array, State
from fourbar.linkage import MOVING_BARS, FourBar

Number = Any
"""A float or an array over the positions: the same formulas serve the integrator and a sweep."""


class Power(Protocol):
    """Anything that does work on the moving bars."""

    def power(self, state: State) -> Array | float:
        """The power it puts into the linkage, W."""

    def carried_by(self, linkage: FourBar) -> FourBar:
        """The linkage with the inertia that it adds."""


def carrying(linkage: FourBar, terms: Iterable[Power]) -> FourBar:
    """The linkage with the inertia that effects (a flywheel) add to its bars."""
    for term in terms:
        linkage = term.carried_by(linkage)
    return linkage


class Path(NamedTuple):
    """A position of the linkage and the way it moves with the independent angle q."""

    unit: dict[int, Number]
    """u_2, u_3, u_4 as complex numbers."""
    first: dict[int, Number]
    """theta_k' = d theta_k/dq."""
    second: dict[int, Number]
    """theta_k'' = d^2 theta_k/dq^2."""
    sine: Number
    """Sine between the two bars that do not carry q, signed; 0 where q is at a limit."""


TOUCHING = 2.0**-53
"""A sum of lengths within this times their total counts as zero: each length was itself rounded by that."""


class Triangle(NamedTuple):
    """What the lengths alone decide."""

    d: float
    a: float
    b: float
    c: float
    E1: float
    E2: float


def triangle(d: float, a: float, b: float, c: float) -> Triangle:
    """E1 and E2 as products of exact sums, zero where the lengths touch a change point."""
    total = math.fsum((d, a, b, c))

    def gap(*terms: float) -> float:
        value = math.fsum(terms)
        return 0.0 if abs(value) <= TOUCHING * total else value

    return Triangle(d, a, b, c, gap(b, c, -a, -d) * total, gap(d, -a, -b, c) * gap(d, -a, b, -c))


def trace(shape: Triangle, theta_1: float, q: Number, sign: Number, *, follow: bool = False) -> tuple[Number, ...]:
    """u_3, u_4, theta_3', theta_4', theta_3'', theta_4'' and sin(theta_4 - theta_3) of a bar 2 at angle q.

    Parameters
    ----------
    shape : of the lengths.
    q : angle of the bar of length a, rad.
    sign : +1 or -1, the branch; with `follow` a constant of the path instead.
    follow : run smoothly through change points: the signed factor cos h or sin h is kept where
        its square root would be its magnitude.
    """
    d, a, b, c, E1, E2 = shape
    h = 0.5 * (q - theta_1)
    s, k = np.sin(h), np.cos(h)
    ad = a * d
    e2 = (d - a) * (d - a) + 4.0 * ad * (s * s)
    s_C, C, dC = _leg(E1, ad, k, -s, follow)
    s_S, S, dS = _leg(E2, ad, s, k, follow)
    root = sign * (s_C * s_S)
    excess = (b - c) * (b + c)
    spin = np.exp(1j * (h + theta_1))
    diagonal = (d - a) * np.exp(1j * theta_1) - 2j * a * s * spin
    u_3 = diagonal * ((e2 + excess) + 1j * root) / (2.0 * b * e2)
    u_4 = -diagonal * ((e2 - excess) - 1j * root) / (2.0 * c * e2)
    share = excess / e2 if excess else 0.0
    sin_q = 2.0 * s * k
    phi_1 = (a * (a - d) + 2.0 * ad * (s * s)) / e2
    phi_2 = ad * sin_q * ((d - a) * (d + a)) / (e2 * e2) if d != a else 0.0 * sin_q
    both = 2.0 * ad * sign * S * C
    both_1 = 2.0 * ad * sign * (dS * C + S * dC)
    share_1 = share * 2.0 * ad * sin_q / e2
    return (
        u_3,
        u_4,
        phi_1 - (1.0 - share) * both,
        phi_1 + (1.0 + share) * both,
        phi_2 - (1.0 - share) * both_1 - share_1 * both,
        phi_2 + (1.0 + share) * both_1 - share_1 * both,
        root / (2.0 * b * c),
    )


def _leg(E: float, ad: float, x: Number, dx: Number, follow: bool) -> tuple[Number, Number, Number]:
    """r = sqrt(E + 4 a d x^2), x/r and its derivative E x_h/(2 r^3), for x = cos h or sin h."""
    if E == 0.0:
        side = 1.0 if follow else np.where(x < 0.0, -1.0, 1.0)
        half = 2.0 * math.sqrt(ad)
        return side * half * x, side / half, 0.0
    r = np.sqrt(E + 4.0 * ad * (x * x))
    return r, x / r, 0.5 * E * dx / (r * r * r)


def path(linkage: FourBar, theta_2: Number, branch: Number) -> Path:
    """The path in q = theta_2 on a branch (NaN where the loop does not close, inf at a limit)."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        u_3, u_4, t_3, t_4, tt_3, tt_4, sine = trace(triangle(*linkage.lengths), linkage.ground_angle, theta_2, branch)
    return Path({2: np.exp(1j * theta_2), 3: u_3, 4: u_4}, {2: 1.0, 3: t_3, 4: t_4}, {2: 0.0, 3: tt_3, 4: tt_4}, sine)


def inertia(linkage: FourBar, way: Path) -> tuple[Number, Number]:
    """Equivalent inertia J at q and its derivative dJ/dq, kg m^2 and kg m^2/rad.

    J = sum of m |G'|^2 + I theta_k'^2,   J' = 2 sum of m G'.G'' + I theta_k' theta_k''.
    """
    J: Number = 0.0
    half: Number = 0.0
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        t, tt = way.first[number], way.second[number]
        if bar.mass != 0.0:
            r, phi = bar.centre  # type: ignore[misc]
            arm = r * complex(math.cos(phi), math.sin(phi)) * way.unit[number]
            g_1, g_2 = 1j * t * arm, (1j * tt - t * t) * arm
            if number == 3:
                t_2, tt_2 = way.first[2], way.second[2]
                a_u = linkage.input.length * way.unit[2]
                g_1, g_2 = g_1 + 1j * t_2 * a_u, g_2 + (1j * tt_2 - t_2 * t_2) * a_u
            J = J + bar.mass * (g_1.real * g_1.real + g_1.imag * g_1.imag)
            half = half + bar.mass * (g_1.real * g_2.real + g_1.imag * g_2.imag)
        if bar.inertia != 0.0:
            J = J + bar.inertia * t * t
            half = half + bar.inertia * t * tt
    return J, 2.0 * half


VANISHING = 2.0**-300
"""A rate at which a power of first degree keeps all its digits and one of second degree is nothing."""


def generalised_force(linkage: FourBar, way: Path, rate: Number, terms: Iterable[Power]) -> Number:
    """Q with power = Q dq/dt, N m; at rate 0 (statics) the mean of the limits from both sides.

    Dry friction has two different limits there; Newton-Euler takes sign(0) = 0, their mean.
    """
    terms = tuple(terms)
    if not terms:
        return 0.0
    still = np.equal(rate, 0.0)
    if not np.any(still):
        return _power(linkage, way, rate, terms) / rate
    at_rest = 0.5 * sum(_power(linkage, way, side, terms) / side for side in (VANISHING, -VANISHING))
    if np.all(still):
        return at_rest
    moving = np.where(still, 1.0, rate)
    return np.where(still, at_rest, _power(linkage, way, moving, terms) / moving)


def _power(linkage: FourBar, way: Path, rate: Number, terms: tuple[Power, ...]) -> Number:
    state = State.__new__(State)  # only what a power needs; the rest belongs to the closed formulas
    state.linkage, state.theta_2 = linkage, np.angle(way.unit[2])
    state.u2, state.u3, state.u4 = ((way.unit[number].real, way.unit[number].imag) for number in MOVING_BARS)
    state.omega_2, state.omega_3, state.omega_4 = (way.first[number] * rate for number in MOVING_BARS)
    d, theta_1 = linkage.ground, linkage.ground_angle
    state.O4 = (d * math.cos(theta_1), d * math.sin(theta_1))
    total: Number = 0.0
    for term in terms:
        total = total + term.power(state)
    return total


def driving_torque(
    linkage: FourBar, way: Path, omega: Number, alpha: Number, terms: Iterable[Power], drive_bar: int
) -> Number:
    """Couple of ground on bar 2, 3 or 4 from virtual work: T_k theta_k' = J q'' + J'/2 q'^2 - Q, N m.

    Parameters
    ----------
    omega, alpha : dq/dt and d^2q/dt^2, rad/s and rad/s^2.
    terms : loads and effects.
    """
    terms = tuple(terms)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        J, J_1 = inertia(carrying(linkage, terms), way)
        work = J * alpha + 0.5 * J_1 * omega * omega - generalised_force(linkage, way, omega, terms)
        return work / way.first[drive_bar]


def acceleration(linkage: FourBar, way: Path, rate: Number, Q: Number) -> Number:
    """q'' = (Q - J'/2 q'^2)/J under the generalised force Q and no driving torque, rad/s^2."""
    J, J_1 = inertia(linkage, way)
    return np.divide(Q - 0.5 * J_1 * rate * rate, J)


def kinetic_energy(linkage: FourBar, way: Path, rate: Number) -> Number:
    """J q'^2/2, J."""
    return 0.5 * inertia(linkage, way)[0] * rate * rate
