"""Motion: kinematic coefficients, speeds and accelerations of bars and points.

A coefficient is a derivative by the independent angle q (theta_2 where the input is
commanded), so every motion follows from it:
    omega_k = h_k q',   alpha_k = h_k q'' + h_k' q'^2.

Source: R. L. Norton, Design of Machinery, ch. 6 and 7; B. Paul, Kinematics and Dynamics
of Planar Machinery (1979).
"""

from typing import NamedTuple

import numpy as np

from fourbar.formulas.arithmetic import Number, is_any, select, vector
from fourbar.formulas.position import Loop, Passing, Position

TURNS_FAST = 4.0
"""Value of |d^2 - a^2|/e^2, twice |1/2 - t|, from which the triangle turns fast.
Its side e then turns fast against the bars.
"""


class Coefficients(NamedTuple):
    """h_k = d theta_k/dq, their differences, and h_k' = d h_k/dq.

    The differences keep their digits where bars turn as one.
    """

    h2: Number
    h3: Number
    h4: Number
    h23: Number
    """h2 - h3."""
    h43: Number
    """h4 - h3."""
    dh2: Number
    """1/rad."""
    dh3: Number
    dh4: Number


def coefficients(lengths: Loop, position: Position) -> Coefficients:
    """Compute the coefficients by theta_2 from the triangle A, B, O4.

    The side e of this triangle turns by t, and its angle at B opens by 2 g:

        h3 = n - g,   h4 = n + g,   n = t + (x/e^2) g = 1/2 + w,
        t = (a (a - d) + 2 a d sin^2 h)/e^2,
        g = 2 a d sin h cos h/root,   x = b^2 - c^2.

    Where e is short its sides turn fast and the bars do not; there w comes without e,
    from Heron's formula for both triangles on e:
        S = 4 a d sin h cos h,   y = d^2 - a^2,
        w = -(E2 (d + a)^2 outer + E1 (b - c)^2 4 a d sin^2 h)/(2 root (x S + y root)).

    >>> from math import radians
    >>> from fourbar.formulas.position import close_loop, direction, half_angle, loop
    >>> lengths = loop(100, 40, 120, 80)  # mm; Norton, examples 6-7 and 7-1
    >>> theta_2 = radians(40)
    >>> half = half_angle(lengths, theta_2)
    >>> position = close_loop(lengths, 1.0, direction(theta_2), half, 1)
    >>> found = rates(coefficients(lengths, position), 25.0, 15.0)
    >>> f"{found.omega_4:.3f} {found.alpha_4:.3f}"
    '6.998 470.134'
    """
    d, a, b, c, E1, E2 = lengths
    ss, kk, sk, outer, inner, _ = position.half
    ad = a * d
    per_e2 = 1.0 / position.e2
    per_root = 0.5 / position.root
    x = (b - c) * (b + c)
    y = (d - a) * (d + a)
    S = (4.0 * ad) * sk
    grown = (2.0 * ad) * ss
    g = S * per_root
    xg = x * g
    leaning = xg * per_e2
    n = (grown + a * (a - d)) * per_e2 + leaning
    one_less_n = (grown + d * (d - a)) * per_e2 - leaning
    w = (xg - 0.5 * y) * per_e2
    if is_any(_may_turn_fast(lengths)):
        fast = _find_fast_turns(lengths, position)
        of_input = E2 * (d + a) * (d + a) * outer
        of_output = E1 * (b - c) * (b - c) * (2.0 * grown)
        heron = of_input + of_output
        w = select(fast, -heron * per_root / (x * S + y * position.root), w)
        n = select(fast, 0.5 + w, n)
        one_less_n = select(fast, 0.5 - w, one_less_n)
    by_inner = (2.0 * ad * E2) * kk / inner
    by_outer = (2.0 * ad * E1) * ss / outer
    dg = (by_inner - by_outer) * per_root
    dn = (x * dg - S * w) * per_e2
    h23 = one_less_n + g
    return Coefficients(1.0, n - g, n + g, h23, 2.0 * g, 0.0, dn - dg, dn + dg)


def _may_turn_fast(lengths: Loop) -> Number:
    """Return True if |d^2 - a^2| > TURNS_FAST e^2 where e is shortest."""
    return lengths.d + lengths.a > TURNS_FAST * abs(lengths.d - lengths.a)


def _find_fast_turns(lengths: Loop, position: Position) -> Number:
    """Mark positions where t and x g/e^2 are large and cancel.

    The condition is |d^2 - a^2| > TURNS_FAST e^2, with x S and y root of the same sign.
    """
    d, a, b, c, _, _ = lengths
    y = (d - a) * (d + a)
    same_sign = (y * position.root) * ((b - c) * position.half.sk) > 0.0
    return (abs(y) > TURNS_FAST * position.e2) & same_sign


def take_sines_of_rates(lengths: Loop, position: Position, k: Coefficients) -> Position:
    """Take u3 and u4 from the instant centres where the side turns fast.

    Small sines keep their digits so.

    d sin(theta_4 - theta_1) = b sin(theta_4 - theta_3) (1 - h3),
    d sin(theta_3 - theta_1) = c sin(theta_4 - theta_3) (1 - h4).
    """
    d, _, b, c, _, _ = lengths
    if not is_any(_may_turn_fast(lengths)):
        return position
    fast = _find_fast_turns(lengths, position)
    scale = position.sin_mu / d
    sine_3 = c * scale * (k.h23 - k.h43)
    sine_4 = b * scale * k.h23
    cosine_3 = (position.u3 * position.u1.conjugate()).real
    cosine_4 = (position.u4 * position.u1.conjugate()).real
    u3 = vector(cosine_3, sine_3) * position.u1
    u4 = vector(cosine_4, sine_4) * position.u1
    return position._replace(
        u3=select(fast, u3, position.u3),
        u4=select(fast, u4, position.u4),
    )


def put_parallel_speeds(k: Coefficients, first: Number, second: Number) -> Coefficients:
    """Put in the exact coefficients of bars that stay parallel.

    h3, h4 = 0, 1 where `first`; 1, 0 where `second`.
    """
    either = first | second
    one_if_first = 1.0 * first
    one_if_second = 1.0 * second
    return Coefficients(
        k.h2,
        np.where(either, one_if_second, k.h3),
        np.where(either, one_if_first, k.h4),
        np.where(either, one_if_first, k.h23),
        np.where(either, one_if_first - one_if_second, k.h43),
        k.dh2,
        np.where(either, 0.0, k.dh3),
        np.where(either, 0.0, k.dh4),
    )


class Rates(NamedTuple):
    """Angular velocities (rad/s) and accelerations (rad/s^2) of bars 2, 3, 4."""

    omega_2: Number
    omega_3: Number
    omega_4: Number
    alpha_2: Number
    alpha_3: Number
    alpha_4: Number


def rates(k: Coefficients, speed: Number, acceleration: Number) -> Rates:
    """Compute omega_k = h_k q' and alpha_k = h_k q'' + h_k' q'^2.

    The speed q' is in rad/s, the acceleration q'' in rad/s^2.
    """
    square = speed * speed
    alpha_2 = k.dh2 * square
    alpha_3 = k.dh3 * square
    alpha_4 = k.dh4 * square
    if is_any(acceleration != 0.0):
        alpha_2 = alpha_2 + k.h2 * acceleration
        alpha_3 = alpha_3 + k.h3 * acceleration
        alpha_4 = alpha_4 + k.h4 * acceleration
    return Rates(k.h2 * speed, k.h3 * speed, k.h4 * speed, alpha_2, alpha_3, alpha_4)


class Frame(NamedTuple):
    """A moving bar's frame at its first pin.

    Arms r from that pin are complex, m, in world axes.
    """

    u: Number
    """e^{i theta}, which turns an arm of the frame into the world's axes."""
    pin: Number
    """Place of the first pin, complex, m."""
    v_pin: Number
    """Velocity of the first pin, complex, m/s."""
    a_pin: Number
    """Acceleration of the first pin, complex, m/s^2."""
    i_omega: Number
    """1/s."""
    turn: Number
    """i alpha - omega^2, 1/s^2."""

    def velocity(self, r: Number) -> Number:
        """Compute the velocity of the end of an arm r, m/s: v_pin + i omega r."""
        return self.v_pin + self.i_omega * r

    def acceleration(self, r: Number) -> Number:
        """Compute a_pin + (i alpha - omega^2) r of the end of an arm r, m/s^2."""
        return self.a_pin + self.turn * r


class State(NamedTuple):
    """Position of a linkage, or many that broadcast, and its motion.

    Loads and effects act on it.
    """

    lengths: Loop
    theta_1: Number
    theta_2: Number
    position: Position
    k: Coefficients
    speed: Number
    """q' of the independent angle, rad/s."""
    moving: Rates
    bar: int = 2
    """Number of the bar whose angle is the independent one."""
    q: Number = None
    """Independent angle, rad; None: theta_2."""
    sine: Number = None
    """Sine between the two other moving bars, zero at the limits of the bar. None: it
    is sin(theta_4 - theta_3).
    """
    passing: Passing = Passing(False, False)
    """Roots of the path that pass through zero at a change point."""
    q_acceleration: Number = 0.0
    """q'' of the independent angle, rad/s^2."""

    def direction(self, bar: int) -> Number:
        """Return e^{i theta} of bar 1 (from O2 to O4), 2, 3 or 4."""
        return self.position[bar - 1]

    def coefficient(self, bar: int) -> Number:
        """Return h of bar 1, 2, 3 or 4."""
        return 0.0 if bar == 1 else self.k[bar - 2]

    def omega(self, bar: int) -> Number:
        """Return the angular velocity of bar 1, 2, 3 or 4, rad/s."""
        return 0.0 if bar == 1 else self.moving[bar - 2]

    def alpha(self, bar: int) -> Number:
        """Return the angular acceleration of bar 1, 2, 3 or 4, rad/s^2."""
        return 0.0 if bar == 1 else self.moving[bar + 1]

    def foot(self, bar: int) -> Number:
        """Return the first pin of a bar (1, 2: O2; 3: A; 4: O4), complex, m."""
        if bar == 3:
            return self.lengths.a * self.position.u2
        if bar == 4:
            return self.lengths.d * self.position.u1
        return 0.0

    def frame(self, bar: int) -> Frame:
        """Return the frame of bar 1, 2, 3 or 4, with the motion of its first pin."""
        pin = self.foot(bar)
        v_pin = 0.0
        a_pin = 0.0
        if bar == 3:
            of_2 = self.frame(2)
            v_pin = of_2.velocity(pin)
            a_pin = of_2.acceleration(pin)
        omega = self.omega(bar)
        return Frame(
            self.direction(bar),
            pin,
            v_pin,
            a_pin,
            1j * omega,
            vector(-omega * omega, self.alpha(bar)),
        )

    def point(self, bar: int, z: Number) -> Number:
        """Compute where the point z of a bar's frame lies, complex, m.

        z is along + i across.
        """
        return self.foot(bar) + z * self.direction(bar)

    def velocity(self, bar: int, z: Number) -> Number:
        """Compute the velocity of a bar's point z, m/s."""
        frame = self.frame(bar)
        return frame.velocity(z * frame.u)

    def acceleration(self, bar: int, z: Number) -> Number:
        """Compute the acceleration of a bar's point z, m/s^2."""
        frame = self.frame(bar)
        return frame.acceleration(z * frame.u)

    def slip(self, pin: str) -> Number:
        """Return h_j - h_i of the bars i, j that meet at a pin."""
        slips = {"O2": self.k.h2, "A": -self.k.h23, "B": self.k.h43, "O4": self.k.h4}
        return slips[pin]
