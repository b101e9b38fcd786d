"""Driving torque by virtual work: the couple T_k of ground on bar k = 2, 3 or 4.

    T_k h_k = J q'' + J'/2 q'^2 - Q

J is the equivalent inertia, sum of m |dG/dq|^2 + I h_k^2, J' its derivative by the
independent angle q (theta_2 where the input is commanded) and Q the generalized force
of loads and effects, their power over q'. Nothing is lost here where the moments about
a pin are differences of large numbers. T3 has poles where h3 = 0, T4 where h4 = 0.

Source: R. L. Norton, Design of Machinery, ch. 11 (virtual work); M. Eksergian,
Dynamical analysis of machines (1930).
"""

from fourbar.formulas.arithmetic import Number, dot, is_any
from fourbar.formulas.motion import Coefficients
from fourbar.formulas.pin_forces import MovingBodies, about_first_pin
from fourbar.formulas.position import Position


def inertia(
    a: Number,
    bodies: MovingBodies,
    position: Position,
    k: Coefficients,
) -> tuple[Number, Number]:
    """Compute the equivalent inertia J = sum of m |dG/dq|^2 + I h_k^2, kg m^2.

    The first part returned is that of bar 2, the second that of bars 3 and 4.

    `a`: length of the input, m.
    """
    two, three, four = bodies
    G = (a * k.h2) * position.u2 + (three.z * k.h3) * position.u3
    others = (
        about_first_pin(four) * (k.h4 * k.h4)
        + three.I * (k.h3 * k.h3)
        + dot(three.m * G, G)
    )
    return about_first_pin(two) * (k.h2 * k.h2), others


def half_slope(
    a: Number,
    bodies: MovingBodies,
    position: Position,
    k: Coefficients,
) -> Number:
    """Compute J'/2 = sum of m G'.G'' + I h_k h_k', kg m^2/rad.

    Bar 2 has no part of it where q = theta_2.

    About the pins O2, O4 of bars 2, 4 that is (I + m r^2) h_k h_k'; of the coupler,
    with G = A + R,
        G'.G'' = a^2 h2 h2' + r^2 h3 h3' + (h2 h3' + h3 h2') A.R
            + h2 h3 (h2 - h3) A x R.
    """
    two, three, four = bodies
    # m h2 (A.R + i A x R)
    AR = ((a * k.h2 * three.m * three.z) * position.u3) * position.u2.conjugate()
    half = about_first_pin(three) * (k.h3 * k.dh3) + about_first_pin(four) * (
        k.h4 * k.dh4
    )
    half = half + k.dh3 * AR.real + (k.h3 * k.h23) * AR.imag
    if is_any(k.dh2 != 0.0):  # q is not theta_2
        half = half + (k.h3 * k.dh2) * dot(
            (a * three.m) * position.u2,
            three.z * position.u3,
        )
        half = half + (about_first_pin(two) + three.m * a * a) * (k.h2 * k.dh2)
    return half


def driving_torque(gain: Number, inertial: Number, Q: Number) -> Number:
    """Compute T_k = (J q'' + J'/2 q'^2 - Q)/h_k, N m.

    With ds/dq for h_k it is the force of a drive, N.

    Parameters
    ----------
    gain : h_k of the driven bar, or ds/dq of the drive that exerts a force, m.
    inertial : J q'' + J'/2 q'^2, N m.
    Q : generalized force of loads and effects, N m.

    >>> from math import pi
    >>> from fourbar.formulas.path import compute_state
    >>> from fourbar.formulas.pin_forces import Body
    >>> from fourbar.formulas.arithmetic import polar
    >>> from fourbar.linkage import uniform  # below, Norton, example 11-3: in, lbf, s
    >>> s, deg = compute_state(uniform(19, 5, 15, 10), pi / 3, 1, 25.0, -40.0), pi / 180
    >>> G3, P = polar(9, 45 * deg), polar(80, 330 * deg)
    >>> two, four = Body(0.004, 0.4, polar(3, 30 * deg)), Body(0.015, 0.8, 5 + 0j)
    >>> bars = two, Body(0.020, 1.5, G3), four
    >>> inertial = sum(inertia(5, bars, s.position, s.k)) * -40
    >>> inertial += half_slope(5, bars, s.position, s.k) * 25**2
    >>> v = s.velocity(3, G3 + polar(3, 100 * deg))
    >>> Q = dot(P, v) / 25 + 120 * s.k.h4
    >>> f"{driving_torque(s.k.h2, inertial, Q):.2f}"
    '243.23'
    """
    return (inertial - Q) / gain
