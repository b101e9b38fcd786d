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

The reduced equation of motion (Eksergian; R. L. Norton, Design of Machinery, ch. 11, has the virtual work) is
    J q'' + J'/2 q'^2 = Q,   J = sum of m |dG/dq|^2 + I theta_k'^2.
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol

import numpy as np

from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.state import Array, State

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
    slip: Number
    """theta_2' - theta_3', which keeps its digits where all bars turn nearly as one."""
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


def triangle(d: float, a: float, b: float, c: float, *, touching: bool = False) -> Triangle:
    """E1 and E2 as products of exact sums; with `touching` zero where the lengths miss a change point by rounding."""
    total = math.fsum((d, a, b, c))

    def gap(*terms: float) -> float:
        value = math.fsum(terms)
        return 0.0 if touching and abs(value) <= TOUCHING * total else value

    return Triangle(d, a, b, c, gap(b, c, -a, -d) * total, gap(d, -a, -b, c) * gap(d, -a, b, -c))


class Half(NamedTuple):
    """sin h, cos h and the two factors of Heron, which vanish at the limit positions of q."""

    s: Number
    k: Number
    outer: Number
    inner: Number


def half_angle(shape: Triangle, theta_1: float, q: Number) -> Half:
    """In doubles: beside a limit position the factors keep the digits that q has of its distance."""
    psi = q - theta_1
    taken = q - psi
    lost = 0.5 * ((q - (psi + taken)) + (taken - theta_1))  # many turns away the rounding of psi is more than that of h
    sine, cosine = np.sin(0.5 * psi), np.cos(0.5 * psi)
    s, k = sine + lost * cosine, cosine - lost * sine
    four_ad = 4.0 * shape.a * shape.d
    return Half(s, k, shape.E1 + four_ad * (k * k), shape.E2 + four_ad * (s * s))


def trace(
    shape: Triangle, theta_1: float, q: Number, sign: Number, *, follow: bool, at: Half | None = None
) -> tuple[Number, ...]:
    """u_3, u_4, theta_3', theta_4', theta_3'', theta_4'', 1 - theta_3', theta_4' - theta_3' and
    sin(theta_4 - theta_3) of a bar 2 at angle q.

    Parameters
    ----------
    shape : of the lengths.
    q : angle of the bar of length a, rad.
    sign : +1 or -1, the branch; with `follow` a constant of the path instead.
    follow : run smoothly through change points: the signed factor cos h or sin h is kept where
        its square root would be its magnitude.
    at : sin h, cos h and the factors where they are known better than from q.
    """
    d, a, b, c, E1, E2 = shape
    s, k, outer, inner = half_angle(shape, theta_1, q) if at is None else at
    ad = a * d
    e2 = (d - a) * (d - a) + 4.0 * ad * (s * s)
    s_C, C, dC = _leg(E1, ad, k, -s, outer, follow)
    s_S, S, dS = _leg(E2, ad, s, k, inner, follow)
    root = sign * (s_C * s_S)
    excess = (b - c) * (b + c)
    spin = np.exp(0.5j * q) * np.exp(0.5j * theta_1)
    diagonal = (d - a) * np.exp(1j * theta_1) - 2j * a * s * spin
    u_3 = diagonal * ((e2 + excess) + 1j * root) / (2.0 * b * e2)
    u_4 = -diagonal * ((e2 - excess) - 1j * root) / (2.0 * c * e2)
    # the rounding of unequal lengths turns a short bar, and must not stretch it
    u_3, u_4 = u_3 / np.abs(u_3), u_4 / np.abs(u_4)
    share = excess / e2 if excess else 0.0
    sin_q = 2.0 * s * k
    phi_1 = (a * (a - d) + 2.0 * ad * (s * s)) / e2
    phi_2 = ad * sin_q * ((d - a) * (d + a)) / (e2 * e2) if d != a else 0.0 * sin_q
    both = 2.0 * ad * sign * S * C
    both_1 = 2.0 * ad * sign * (dS * C + S * dC)
    share_1 = share * 2.0 * ad * sin_q / e2
    behind = (2.0 * ad * (s * s) - d * (a - d)) / e2  # 1 - phi'
    return (
        u_3,
        u_4,
        phi_1 - (1.0 - share) * both,
        phi_1 + (1.0 + share) * both,
        phi_2 - (1.0 - share) * both_1 - share_1 * both,
        phi_2 + (1.0 + share) * both_1 - share_1 * both,
        behind + (1.0 - share) * both,
        2.0 * both,
        root / (2.0 * b * c),
    )


def _leg(E: float, ad: float, x: Number, dx: Number, factor: Number, follow: bool) -> tuple[Number, Number, Number]:
    """r = sqrt(factor), x/r and its derivative E x_h/(2 r^3), factor = E + 4 a d x^2, for x = cos h or sin h."""
    if E == 0.0:
        side = 1.0 if follow else np.where(x < 0.0, -1.0, 1.0)
        half = 2.0 * math.sqrt(ad)
        return side * half * x, side / half, 0.0
    r = np.sqrt(factor)
    return r, x / r, 0.5 * E * dx / (r * r * r)


def path(linkage: FourBar, theta_2: Number, branch: Number, at: Half | None = None) -> Path:
    """The path in q = theta_2 on a branch (NaN where the loop does not close, inf at a limit)."""
    with np.errstate(all="ignore"):
        return along_input(linkage, triangle(*linkage.lengths), theta_2, branch, at=at)


def along_input(
    linkage: FourBar, shape: Triangle, q: Number, sign: Number, *, follow: bool = False, at: Half | None = None
) -> Path:
    """The path in q = theta_2."""
    theta_1 = linkage.ground_angle
    u_3, u_4, t_3, t_4, tt_3, tt_4, slip, _, sine = trace(shape, theta_1, q, sign, follow=follow, at=at)
    return Path({2: np.exp(1j * q), 3: u_3, 4: u_4}, {2: 1.0, 3: t_3, 4: t_4}, {2: 0.0, 3: tt_3, 4: tt_4}, slip, sine)


def inertia(linkage: FourBar, way: Path) -> tuple[Number, Number]:
    """Equivalent inertia J at q and its derivative dJ/dq, kg m^2 and kg m^2/rad.

    J = sum of m |G'|^2 + I theta_k'^2,   J' = 2 sum of m G'.G'' + I theta_k' theta_k''.

    About the pin O2, O4 of bars 2, 4 that is (I + m r^2) theta_k' theta_k''; of the coupler, G = A + R,
        G'.G'' = a^2 theta_2' theta_2'' + r^2 theta_3' theta_3'' + (theta_2' theta_3'' + theta_3' theta_2'') A.R
                 + theta_2' theta_3' (theta_2' - theta_3') A x R.
    """
    J: Number = 0.0
    half: Number = 0.0
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        t, tt = way.first[number], way.second[number]
        r, phi = bar.centre  # type: ignore[misc]
        about_pin = bar.inertia + bar.mass * (r * r)  # type: ignore[operator]
        if about_pin != 0.0:
            half = half + about_pin * t * tt
        if number == 3 and bar.mass != 0.0:
            t_2, tt_2, a = way.first[2], way.second[2], linkage.input.length
            A, R = a * way.unit[2], r * complex(math.cos(phi), math.sin(phi)) * way.unit[3]
            velocity, turned = t_2 * A + t * R, A.conjugate() * R
            J = J + bar.mass * (velocity.real * velocity.real + velocity.imag * velocity.imag) + bar.inertia * t * t
            sideways = t_2 * t * way.slip * turned.imag
            half = half + bar.mass * (a * a * t_2 * tt_2 + (t_2 * tt + t * tt_2) * turned.real + sideways)
        elif about_pin != 0.0:
            J = J + about_pin * t * t
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
    with np.errstate(all="ignore"):
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
