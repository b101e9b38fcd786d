"""Inverse dynamics (Newton-Euler): pin forces and the driving torque on bar 2, 3 or 4.

F_ij is the force of bar i on bar j in world axes, T_k the pure couple that ground exerts on the
driven bar k. The thirteen equations of the free bodies (Linares Mendoza, section 5.7; R. L. Norton,
Design of Machinery, ch. 11) are eliminated by hand to one 2x2 system whose determinant is the sine
between the two bars that are not driven.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.pins import resting
from fourbar.effects.wrenches import Wrenches
from fourbar.linkage import MOVING_BARS
from fourbar.margins import in_precision_of
from fourbar.solution import JAMMED
from fourbar.state import NO_ROOM, Array, State, Vector, centre_in_bar, cross, dot, is_zero

Room = tuple[Array | None, Array | None]
NEW: Room = (None, None)
"""No arrays to write a vector into."""


class Term(Protocol):
    """Anything that acts on the moving bars; what the effects are."""

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """Pins whose forces it depends on itself."""

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """Pins at which its couples jump."""

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """Add forces and couples on the bars."""

    def leaning(self, side: int) -> Self:
        """The same with every pin at rest about to turn."""

    def rounded_anew(self, beside: Callable[[float], float], *, all_of_it: bool) -> Self:
        """The same with its numbers moved in their last digits."""


class PinForces(NamedTuple):
    """Pin forces (N, world axes, components of shape (n,)), driving torque (N m)."""

    F12: Vector
    F32: Vector
    F43: Vector
    F14: Vector
    torque: Array
    from_jamming: Array | None = None
    """How far the friction that depends on these forces is from jamming, in (0, 1]; None without it."""
    residual: Array | None = None
    """What friction that depends on these forces was solved to, N m; None without it."""
    unsettled: NDArray[np.uint8] | None = None
    """Status of that friction at each position, None without it."""


def add_inertia(wrenches: Wrenches, state: State) -> None:
    """d'Alembert: the force -m a_G and, about the bar's first pin, the moment -(I + m r^2) alpha - m r_G x a_pin.

    The first pin moves on bar 3 alone; written about the pin, every term is positive where the
    moment of -m a_G and -I alpha would cancel part of it. The force -m a_A of the coupler's mass is
    carried by bar 2: its moment about O2 is -m a^2 alpha_2, where O2 A x (-m a_A) would be a
    difference of large numbers.
    """
    for number in MOVING_BARS:
        bar = state.linkage.bar(number)
        p, q = centre_in_bar(bar)
        # products of constants are rounded once for all positions, in the digits of the state
        m, alpha = in_precision_of(state.theta_2, bar.mass), state.alpha(number)
        if (bar.inertia != 0.0 or bar.mass != 0.0) and not is_zero(alpha):
            wrenches.add_moment(number, -(bar.inertia + (m * p * p + m * q * q)) * alpha)
        if bar.mass == 0.0:
            continue
        u = state.unit(number)
        wrenches.add_force(number, _pull(u, m * p, m * q if q else None, state.omega(number), alpha))
        if number == 3:
            a, alpha_2 = state.linkage.input.length, state.alpha(2)
            at_A = _pull(state.u2, m * a, None, state.omega(2), alpha_2)
            wrenches.carry_at_A(at_A, 0.0 if is_zero(alpha_2) else (-m * a * a) * alpha_2)
            wrenches.add_moment(3, p * cross(u, at_A) if q == 0.0 else cross(state.arm(3, p, q), at_A))


def _pull(u: Vector, m_along: Any, m_across: Any, omega: Array | float, alpha: Array | float) -> Vector:
    """-m a of a mass at (along, across) in a bar that turns about its first pin: m (omega^2 r - alpha x r)."""
    square = omega * omega
    if m_across is None:
        inward = m_along * square
        if is_zero(alpha):
            return (inward * u[0], inward * u[1])
        sideways = m_along * alpha
    else:
        inward, sideways = m_along * square + m_across * alpha, m_along * alpha - m_across * square
    x, y = inward * u[0], inward * u[1]
    x += sideways * u[1]
    y -= sideways * u[0]
    return (x, y)


def between(m_u: Array, m_v: Array, u: Vector, v: Vector, sine: Array, room: Room = NEW) -> Vector:
    """The force F with u x F = m_u and v x F = m_v, for unit vectors with u x v = sine."""
    k_u, k_v = m_u / sine, m_v / sine
    x, y = np.multiply(k_u, v[0], out=room[0]), np.multiply(k_u, v[1], out=room[1])
    x -= k_v * u[0]
    y -= k_v * u[1]
    return (x, y)


def sine_between(u: Vector, v: Vector) -> Array:
    """u x v, NaN where it is zero: no force balances the moments there."""
    sine = cross(u, v)
    zero = sine == 0.0
    return sine + np.where(zero, np.nan, 0.0) if zero.any() else sine


def drive_sine(state: State, drive_bar: int) -> Array:
    """sin(theta_4-theta_3), sin(theta_4-theta_2), sin(theta_3-theta_2) for the drive on bar 2, 3, 4."""
    if drive_bar == 2:
        return state.sin_mu
    v = state.unit(7 - drive_bar)
    # a short bar beside a long diagonal: its vector keeps its direction better than its length 1
    return cross(state.u2, v) / np.sqrt(dot(v, v))


def solve_pins(
    state: State,
    terms: Iterable[Term],
    drive_bar: int,
    *,
    growths: Iterator[float] | None = None,
    room: Mapping[str, Any] = NO_ROOM,
) -> PinForces:
    """Pin forces and driving torque for the terms that act.

    The moments of the two bars that are not driven, about their outer pins, give the force
    between them; sums of forces give the rest, and the moment of the driven bar the torque.

    Parameters
    ----------
    state : positions, velocities and accelerations, (n,).
    terms : loads and effects.
    drive_bar : 2, 3 or 4.
    growths : relative changes of the terms, for the error bars.
    room : arrays that results may be written into, by name: (n,), or both components of a vector.
    """
    wrenches = Wrenches(state, growths)
    add_inertia(wrenches, state)
    implicit = []
    for term in terms:
        term.add_wrenches(wrenches, state)
        if term.loaded_pins:
            implicit.append(term)
    pins = eliminate(state, wrenches, drive_bar, room)
    for each in implicit:  # a scene holds one effect of a kind, and one kind depends on the forces
        pins = each.settle(state, wrenches, pins, lambda wrenches: eliminate(state, wrenches, drive_bar))  # type: ignore[attr-defined]
    return pins


def torque_interval(
    state: State, terms: Iterable[Term], drive_bar: int, torque: Array
) -> tuple[Array, Array, NDArray[np.bool_] | None]:
    """Least and greatest driving torque where dry friction holds a pin at rest, elsewhere the torque twice, N m.

    The third is where one of them is NaN because friction jams the motion that would begin; None: nowhere.

    The ends are the torques at which the linkage would begin to move either way, or, where only a
    pin comes to rest while the linkage moves, the torques just before and after its reversal.
    """
    terms = tuple(terms)
    pins = {pin for term in terms for pin in term.dry_pins}
    if not any(np.any(resting(state, pin)) for pin in pins):
        return torque, torque, None
    ways = [solve_pins(state, [term.leaning(side) for term in terms], drive_bar) for side in (1, -1)]
    ahead, back = (getattr(way.torque, "hi", way.torque) for way in ways)
    jammed = [way.unsettled == JAMMED for way in ways if way.unsettled is not None]
    return np.minimum(ahead, back), np.maximum(ahead, back), np.any(jammed, axis=0) if jammed else None


def eliminate(state: State, wrenches: Wrenches, drive_bar: int, room: Mapping[str, Any] = NO_ROOM) -> PinForces:
    """Pin forces and driving torque under the wrenches: the 2x2 system and the sums around it."""
    _, a, b, c = state.linkage.lengths
    R2, R3, R4 = (wrenches.force(bar) for bar in MOVING_BARS)
    M2, M3, M4 = (wrenches.moment(bar) for bar in MOVING_BARS)
    u2, u3, u4 = state.u2, state.u3, state.u4
    for_F32, for_F43 = room.get("F32", NEW), room.get("F43", NEW)
    if drive_bar == 2:
        F43 = between(M3 / -b, M4 / c, u3, u4, state.regular_sine(), for_F43)
        F32 = plus(R3, F43, for_F32)
        torque = a * cross(F32, u2)
        torque = np.subtract(torque, M2, out=room.get("torque"))
    elif drive_bar == 4:
        sine = sine_between(u2, u3)
        M3_about_B = M3 - b * cross(u3, R3)
        F32 = between(-M2 / a, -M3_about_B / b, u2, u3, sine, for_F32)
        # not F32 - R3: what the mass near A carries to O2 would cancel again
        F43 = between(M3 / -b, -(M2 / a + cross(u2, R3)), u3, u2, -sine, for_F43)
        torque = c * cross(u4, F43) - M4
    else:
        F43 = between(-M2 / a - cross(u2, R3), M4 / c, u2, u4, sine_between(u2, u4), for_F43)
        F32 = plus(R3, F43, for_F32)
        torque = -(M3 + b * cross(u3, F43))
    F32_x, F32_y = F32
    if wrenches.at_A is not None:
        F32_x += wrenches.at_A[0]
        F32_y += wrenches.at_A[1]
    for_F12, for_F14 = room.get("F12", NEW), room.get("F14", NEW)
    F12_x, F12_y = np.negative(R2[0], out=for_F12[0]), np.negative(R2[1], out=for_F12[1])
    F12_x -= F32_x
    F12_y -= F32_y
    F14 = (np.subtract(F43[0], R4[0], out=for_F14[0]), np.subtract(F43[1], R4[1], out=for_F14[1]))
    return PinForces((F12_x, F12_y), F32, F43, F14, torque)


def plus(u: Vector, v: Vector, room: Room) -> Vector:
    """u + v."""
    return (np.add(u[0], v[0], out=room[0]), np.add(u[1], v[1], out=room[1]))
