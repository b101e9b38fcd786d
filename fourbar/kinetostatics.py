"""Inverse dynamics (Newton-Euler): pin forces and the driving torque on bar 2, 3 or 4.

F_ij is the force of bar i on bar j in world axes, T_k the pure couple that ground exerts on the
driven bar k. The thirteen equations of the free bodies (Norton, ch. 11) are eliminated by hand to
one 2x2 system whose determinant is the sine between the two bars that are not driven.
"""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.wrenches import Wrenches
from fourbar.kinematics import Array, State, Vector, centre_in_bar, cross, is_zero, swing
from fourbar.linkage import MOVING_BARS, PINS


class Term(Protocol):
    """Anything that acts on the moving bars."""

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """Add forces and couples on the bars."""


class PinForces(NamedTuple):
    """Pin forces (N, world axes, components of shape (n,)), driving torque (N m) and its condition."""

    F12: Vector
    F32: Vector
    F43: Vector
    F14: Vector
    torque: Array
    drive_sine: Array
    """sin(theta_4-theta_3), sin(theta_4-theta_2), sin(theta_3-theta_2) for the drive on bar 2, 3, 4."""
    residual: Array | None = None
    """What friction that depends on these forces was solved to, N m; None without it."""
    unsettled: NDArray[np.uint8] | None = None
    """Status of that friction at each position, None without it."""


def add_inertia(wrenches: Wrenches, state: State) -> None:
    """d'Alembert: the force -m a_G and, about the bar's first pin, the moment -(I + m r^2) alpha - m r_G x a_pin.

    The first pin moves on bar 3 alone; written about the pin, every term is positive where the
    moment of -m a_G and -I alpha would cancel part of it.
    """
    for number in MOVING_BARS:
        bar = state.linkage.bar(number)
        centre = centre_in_bar(bar)
        m, r2 = bar.mass, centre[0] * centre[0] + centre[1] * centre[1]
        alpha = state.alpha(number)
        if (inertia := bar.inertia + m * r2) != 0.0 and not is_zero(alpha):  # type: ignore[operator]
            wrenches.add_moment(number, -inertia * alpha)
        if m == 0.0:
            continue
        if number == 3:
            arm = state.arm(3, *centre)
            pin_x, pin_y = state.acceleration(2, state.linkage.input.length, 0.0)
            own_x, own_y = swing(arm, state.omega(3), alpha)
            wrenches.add_force(3, (-m * (pin_x + own_x), -m * (pin_y + own_y)))
            wrenches.add_moment(3, -m * cross(arm, (pin_x, pin_y)))
        else:
            ax, ay = state.acceleration(number, *centre)
            wrenches.add_force(number, (-m * ax, -m * ay))


def between(m_u: Array, m_v: Array, u: Vector, v: Vector, sine: Array) -> Vector:
    """The force F with u x F = m_u and v x F = m_v, for unit vectors with u x v = sine."""
    zero = sine == 0.0
    if zero.any():
        sine = sine + np.where(zero, np.nan, 0.0)  # no force balances the moments there
    k_u, k_v = m_u / sine, m_v / sine
    return (k_u * v[0] - k_v * u[0], k_u * v[1] - k_v * u[1])


def solve_pins(
    state: State, terms: Iterable[Term], drive_bar: int, *, inertia: bool = True, growths: Iterator[float] | None = None
) -> PinForces:
    """Pin forces and driving torque for the terms that act.

    The moments of the two bars that are not driven, about their outer pins, give the force
    between them; sums of forces give the rest, and the moment of the driven bar the torque.

    Parameters
    ----------
    state : positions, velocities and accelerations, (n,).
    terms : loads and effects.
    drive_bar : 2, 3 or 4.
    inertia : False leaves out -m a and -I alpha (statics).
    growths : relative changes of the terms, for the error bars.
    """
    wrenches = Wrenches(state, growths)
    if inertia:
        add_inertia(wrenches, state)
    implicit = []
    for term in terms:
        term.add_wrenches(wrenches, state)
        if getattr(term, "loaded_pins", ()):
            implicit.append(term)
    pins = eliminate(state, wrenches, drive_bar)
    for each in implicit:  # a scene holds one effect of a kind, and one kind depends on the forces
        pins = each.settle(state, wrenches, pins, lambda wrenches: eliminate(state, wrenches, drive_bar))  # type: ignore[attr-defined]
    return pins


def torque_interval(state: State, terms: Iterable[Term], drive_bar: int, torque: Array) -> tuple[Array, Array]:
    """Least and greatest driving torque where dry friction holds a pin at rest, elsewhere the torque twice, N m.

    The ends are the torques at which the linkage would begin to move either way, or, where only a
    pin comes to rest while the linkage moves, the torques just before and after its reversal.
    """
    terms = tuple(terms)
    pins = {pin for term in terms for pin in getattr(term, "dry_pins", ())}
    if not any(np.any(np.equal(state.omega(PINS[pin][1]), state.omega(PINS[pin][0]))) for pin in pins):
        return torque, torque
    ways = []
    for side in (1, -1):
        leaning: list[Any] = [term.leaning(side) if getattr(term, "dry", False) else term for term in terms]  # type: ignore[attr-defined]
        ways.append(solve_pins(state, leaning, drive_bar).torque)
    ahead, back = (getattr(way, "hi", way) for way in ways)
    return np.minimum(ahead, back), np.maximum(ahead, back)


def eliminate(state: State, wrenches: Wrenches, drive_bar: int) -> PinForces:
    """Pin forces and driving torque under the wrenches: the 2x2 system and the sums around it."""
    _, a, b, c = state.linkage.lengths
    R2, R3, R4 = (wrenches.force(bar) for bar in MOVING_BARS)
    M2, M3, M4 = (wrenches.moment(bar) for bar in MOVING_BARS)
    u2, u3, u4 = state.u2, state.u3, state.u4
    with np.errstate(divide="ignore", invalid="ignore"):
        if drive_bar == 2:
            sine = state.regular_sine()
            F43 = between(-M3 / b, M4 / c, u3, u4, sine)
            F32 = (R3[0] + F43[0], R3[1] + F43[1])
            torque = -(M2 + a * cross(u2, F32))
        elif drive_bar == 4:
            sine = cross(u2, u3)
            M3_about_B = M3 - b * cross(u3, R3)
            F32 = between(-M2 / a, -M3_about_B / b, u2, u3, sine)
            # not F32 - R3: what the mass near A carries to O2 would cancel again
            F43 = between(-M3 / b, -(M2 / a + cross(u2, R3)), u3, u2, -sine)
            torque = c * cross(u4, F43) - M4
        else:
            sine = cross(u2, u4)
            F43 = between(-M2 / a - cross(u2, R3), M4 / c, u2, u4, sine)
            F32 = (R3[0] + F43[0], R3[1] + F43[1])
            torque = -(M3 + b * cross(u3, F43))
    F14 = (F43[0] - R4[0], F43[1] - R4[1])
    F12 = (-R2[0] - F32[0], -R2[1] - F32[1])
    return PinForces(F12, F32, F43, F14, torque, sine)
