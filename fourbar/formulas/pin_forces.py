"""Pin forces: the equations of the free bodies, eliminated to one 2x2 system.

F_ij is the force of bar i on bar j. The moments of the two bars that are not driven,
about their outer pins, give the force between them; sums of forces give the rest:
    bar 2:  F12 + F32 + R2 = 0,            a u2 x F32 + M2 + T2 = 0   (about O2),
    bar 3:  F43 - F32 + R3 = 0,            b u3 x F43 + M3 - C + T3 = 0   (about A),
    bar 4:  F14 - F43 + R4 = 0,           -c u4 x F43 + M4 + C + T4 = 0   (about O4),
with R, M the resultant and the moment of everything else on the bar: loads, effects and
-m a_G, -I alpha.

Source: Linares Mendoza, section 5.7 (the thirteen equations); R. L. Norton, Design of
Machinery, ch. 11.
"""

from typing import NamedTuple

from fourbar.formulas.arithmetic import Number, cross, dot, is_any, select, vector
from fourbar.formulas.motion import Rates
from fourbar.formulas.position import Loop, Position


class Body(NamedTuple):
    """Mass, kg; moment of inertia about G, kg m^2; and the place of G.

    G is complex, m, from the first pin in the bar's frame (along + i across).
    """

    m: Number
    I: Number  # noqa: E741 - the literature's letter
    z: Number


MovingBodies = tuple[Body, Body, Body]
"""Inertial properties of bars 2, 3, 4."""


class Wrenches(NamedTuple):
    """Resultant forces (complex, N) and moments (N m) on bars 2, 3, 4.

    The moments are about the first pins O2, A, O4.
    """

    R2: Number = 0j
    R3: Number = 0j
    R4: Number = 0j
    M2: Number = 0.0
    M3: Number = 0.0
    M4: Number = 0.0
    C: Number = 0.0
    """Couple at pin B on bar 4, its opposite on bar 3, N m. It is in neither M3 nor M4,
    so that the small sum M3 + M4 keeps its digits.
    """

    def on(self, bar: int) -> tuple[Number, Number]:
        """Return the force and the moment on bar 2, 3 or 4."""
        if bar == 2:
            moment = self.M2
        elif bar == 3:
            moment = self.M3 - self.C
        else:
            moment = self.M4 + self.C
        return self[bar - 2], moment


class PinForces(NamedTuple):
    """Force of bar i on bar j as x + i y in world axes, N."""

    F12: Number
    F32: Number
    F43: Number
    F14: Number


def about_first_pin(body: Body) -> Number:
    """Compute I + m r^2, kg m^2."""
    return (
        body.I + body.m * body.z.real * body.z.real + body.m * body.z.imag * body.z.imag
    )


def inertia_wrenches(
    a: Number,
    bodies: MovingBodies,
    position: Position,
    moving: Rates,
) -> tuple[Wrenches, Number]:
    """Compute d'Alembert's force -m a_G and moment on each bar.

    About its first pin the moment is -(I + m r^2) alpha - m r_G x a_pin. The force -m
    a_A of the coupler's mass at pin A is no part of R3; it is returned apart, in the
    frame of bar 2: m_3 a (omega_2^2 - i alpha_2).

    `a`: length of the input, m.
    """
    two, three, four = bodies
    w2, w3, w4, alpha_2, alpha_3, alpha_4 = moving
    of_2 = vector(w2 * w2, -alpha_2)
    turned = of_2 * position.u2
    to_G = (three.m * three.z) * position.u3  # m (G - A)
    return (
        Wrenches(
            (two.m * two.z) * turned,
            vector(w3 * w3, -alpha_3) * to_G,
            vector(w4 * w4, -alpha_4) * ((four.m * four.z) * position.u4),
            -about_first_pin(two) * alpha_2,
            cross(to_G, a * turned) - about_first_pin(three) * alpha_3,
            -about_first_pin(four) * alpha_4,
        ),
        (three.m * a) * of_2,
    )


def coupler_about_B(
    lengths: Loop,
    three: Body,
    position: Position,
    moving: Rates,
    sine: Number,
) -> Number:
    """Compute d'Alembert's moment of the coupler about B, small where G lies near B.

    The moment is -I alpha_3 - m (G - B) x a_G, N m.

    `sine`: of theta_3 - theta_2.
    """
    w2, w3, _, alpha_2, alpha_3, _ = moving
    x = three.z.real - lengths.b
    y = three.z.imag
    cosine = dot(position.u2, position.u3)
    of_A = lengths.a * (
        w2 * w2 * (x * sine + y * cosine) + alpha_2 * (x * cosine - y * sine)
    )
    of_G = w3 * w3 * (lengths.b * y) + alpha_3 * (x * three.z.real + y * y)
    return -three.m * (of_A + of_G) - three.I * alpha_3


def solve_between(
    M_u: Number,
    M_v: Number,
    u: Number,
    v: Number,
    sine: Number,
) -> Number:
    """Solve u x F = M_u and v x F = M_v for F.

    With unit vectors and u x v = sine, F = (M_u v - M_v u)/sine.
    """
    return (M_u * v - M_v * u) * (1.0 / sine)


def pin_forces(
    lengths: Loop,
    position: Position,
    drive_bar: int,
    sine: Number,
    w: Wrenches,
    mass_at_A: Number,
    moment_of_F32: Number,
) -> PinForces:
    """Compute the four pin forces, complex, N.

    Forces are inf or NaN where the two bars that are not driven are collinear.

    With the drive on bar 2 the force at B is written with the diagonal D from A to O4,
    which closes the triangle of bars 3 and 4, so that a couple between them keeps its
    digits:
        F43 = ((M3 - C) D - (M3 + M4) b u3)/(b c sin(theta_4 - theta_3)).
    Where c is much shorter than b, D is nearly b u3 and M3 would cancel; there
        F43 = -(M3 c u4 + M4 b u3 + C D)/(b c sin(theta_4 - theta_3)).

    Parameters
    ----------
    drive_bar : 2, 3 or 4.
    sine : between the two bars that are not driven, of theta_4 - theta_3,
        theta_4 - theta_2, theta_3 - theta_2.
    w, mass_at_A : everything that acts, as from `inertia_wrenches`.
    moment_of_F32 : with the drive on bar 2: a u2 x F32 (N m), which the virtual work of
        bars 3 and 4 knows; on bar 4: b u3 x F32, the opposite of the coupler's moment
        about B.

    >>> from math import pi
    >>> from fourbar.formulas.path import compute_state
    >>> from fourbar.formulas.arithmetic import polar
    >>> from fourbar.linkage import uniform  # below, Norton, example 11-3: in, lbf, s
    >>> s, deg = compute_state(uniform(19, 5, 15, 10), pi / 3, 1, 25.0, -40.0), pi / 180
    >>> G3, P = polar(9, 45 * deg), polar(80, 330 * deg)  # a force on the coupler
    >>> two, four = Body(0.004, 0.4, polar(3, 30 * deg)), Body(0.015, 0.8, 5 + 0j)
    >>> bars = two, Body(0.020, 1.5, G3), four
    >>> w, mass_at_A = inertia_wrenches(5, bars, s.position, s.moving)
    >>> moment = cross((G3 + polar(3, 100 * deg)) * s.position.u3, P)
    >>> # and a couple on the output
    >>> w = w._replace(R3=w.R3 + P, M3=w.M3 + moment, M4=w.M4 + 120)
    >>> sine = s.position.sin_mu
    >>> f"{pin_forces(s.lengths, s.position, 2, sine, w, mass_at_A, 0.0).F12:.2f}"
    '-117.65-107.84j'
    """
    d, a, b, c, _, _ = lengths
    R2, R3, R4, M2, M3, M4, C = w
    of_3 = M3 - C
    # in the frame of bar 2; the sum with R3 would lose the digits of the smaller one
    along = mass_at_A.real
    across = mass_at_A.imag
    if drive_bar == 4:
        F32 = solve_between(-M2 / a, moment_of_F32 / b, position.u2, position.u3, sine)
        F43 = solve_between(
            -of_3 / b,
            -M2 / a - cross(position.u2, R3) - across,
            position.u3,
            position.u2,
            -sine,
        )
    elif drive_bar == 3:
        of_4 = M4 + C
        F43 = solve_between(
            -M2 / a - cross(position.u2, R3) - across,
            of_4 / c,
            position.u2,
            position.u4,
            sine,
        )
        F32 = solve_between(
            -M2 / a - across,
            of_4 / c + cross(position.u4, R3),
            position.u2,
            position.u4,
            sine,
        )
        # the moment on bar 2 gives the component across it
        F32 = (dot(position.u2, F32) + along - 1j * (M2 / a)) * position.u2
    else:
        k = 1.0 / (c * sine)
        F43 = (of_3 * k * (1.0 / b)) * position.diagonal - ((M3 + M4) * k) * position.u3
        small = 2.0 * c < b
        if is_any(small):
            of_bars = M3 * (c / b) * position.u4 + M4 * position.u3
            F43 = select(small, -k * (of_bars + (C / b) * position.diagonal), F43)
        F32 = R3 + F43 + mass_at_A * position.u2
        short = d < a
        # the bars turn together; the sum loses the small component across bar 2
        if is_any(short):
            F32 = (
                F32
                + select(short, moment_of_F32 / a - cross(position.u2, F32), 0.0)
                * 1j
                * position.u2
            )
    # NumPy negates complex numbers slowly
    return PinForces(-1.0 * (R2 + F32), F32, F43, F43 - R4)
