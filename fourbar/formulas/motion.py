"""Motion: kinematic coefficients, speeds and accelerations of bars and points.

A coefficient is a derivative by the independent angle q (theta_2 where the input is commanded), so
every motion follows from it:
    omega_k = h_k q',   alpha_k = h_k q'' + h_k' q'^2.

Source: R. L. Norton, Design of Machinery, ch. 6 and 7; B. Paul, Kinematics and Dynamics of Planar Machinery (1979).
"""

from typing import NamedTuple

import numpy as np

from fourbar.formulas.position import Loop, Number, Position


class Coefficients(NamedTuple):
    """h_k = d theta_k/dq, their differences, which keep their digits where bars turn as one, and h_k' = d h_k/dq."""

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


def coefficients(lengths: Loop, at: Position) -> Coefficients:
    """The coefficients by theta_2, from the triangle A, B, O4 whose side e turns by t and whose height changes by g:

        h3 = t - (1 - q) g,   h4 = t + (1 + q) g,
        t = (a (a - d) + 2 a d sin^2 h)/e^2,   g = 2 a d sin h cos h/root,   q = (b^2 - c^2)/e^2.

    >>> from fourbar.formulas.position import close_loop, direction, half_angle, loop
    >>> lengths, theta_2 = loop(100, 40, 120, 80), np.radians(40)  # mm; Norton, examples 6-7 and 7-1
    >>> at = close_loop(lengths, 1.0, direction(theta_2), half_angle(lengths, theta_2), 1)
    >>> found = rates(coefficients(lengths, at), 25.0, 15.0)
    >>> f"{found.omega_4:.3f} {found.alpha_4:.3f}"
    '6.998 470.134'
    """
    d, a, b, c, E1, E2 = lengths
    ss, kk, sk, outer, inner = at.half
    ad, per_e2, per_root = a * d, 1.0 / at.e2, 1.0 / at.root
    q = ((b - c) * (b + c)) * per_e2
    s = (2.0 * ad) * sk
    g = s * per_root
    less, more = 1.0 - q, 1.0 + q
    grown = (2.0 * ad) * ss
    t = (grown + a * (a - d)) * per_e2
    growth = s * per_e2
    dt = growth * (((d - a) * (d + a)) * per_e2)
    dg = ((ad * E2) * kk / inner - (ad * E1) * ss / outer) * per_root
    shared = dt - (2.0 * q * growth) * g
    return Coefficients(
        1.0,
        t - less * g,
        t + more * g,
        (grown + d * (d - a)) * per_e2 + less * g,
        2.0 * g,
        0.0,
        shared - less * dg,
        shared + more * dg,
    )


def with_parallel_pairs(k: Coefficients, first: Number, second: Number) -> Coefficients:
    """The exact coefficients of bars that stay parallel: h3, h4 = 0, 1 where `first`, 1, 0 where `second`."""
    either = first | second
    h3, h4 = np.where(either, 1.0 * second, k.h3), np.where(either, 1.0 * first, k.h4)
    h23, h43 = np.where(either, 1.0 * first, k.h23), np.where(either, 1.0 * first - 1.0 * second, k.h43)
    return Coefficients(k.h2, h3, h4, h23, h43, k.dh2, np.where(either, 0.0, k.dh3), np.where(either, 0.0, k.dh4))


class Rates(NamedTuple):
    """Angular velocities (rad/s) and accelerations (rad/s^2) of bars 2, 3, 4."""

    omega_2: Number
    omega_3: Number
    omega_4: Number
    alpha_2: Number
    alpha_3: Number
    alpha_4: Number


def rates(k: Coefficients, speed: Number, acceleration: Number) -> Rates:
    """omega_k = h_k q', alpha_k = h_k q'' + h_k' q'^2.

    Parameters
    ----------
    speed, acceleration : q' and q'' of the independent angle, rad/s and rad/s^2.
    """
    square = speed * speed
    return Rates(
        k.h2 * speed,
        k.h3 * speed,
        k.h4 * speed,
        k.h2 * acceleration + k.dh2 * square,
        k.h3 * acceleration + k.dh3 * square,
        k.h4 * acceleration + k.dh4 * square,
    )


def swing(arm: Number, omega: Number, alpha: Number) -> Number:
    """Acceleration of the end of an arm (complex, m) about its foot: (i alpha - omega^2) r."""
    return (1j * alpha - omega * omega) * arm


class State(NamedTuple):
    """One position of a linkage, or many that broadcast, and how it moves: what loads and effects act on."""

    lengths: Loop
    theta_1: Number
    theta_2: Number
    at: Position
    k: Coefficients
    speed: Number
    """q' of the independent angle, rad/s."""
    moving: Rates

    def direction(self, bar: int) -> Number:
        """e^{i theta} of bar 1 (from O2 to O4), 2, 3 or 4."""
        return self.at[bar - 1]

    def coefficient(self, bar: int) -> Number:
        """h of bar 1, 2, 3 or 4."""
        return 0.0 if bar == 1 else self.k[bar - 2]

    def omega(self, bar: int) -> Number:
        """Angular velocity of bar 1, 2, 3 or 4, rad/s."""
        return 0.0 if bar == 1 else self.moving[bar - 2]

    def alpha(self, bar: int) -> Number:
        """Angular acceleration of bar 1, 2, 3 or 4, rad/s^2."""
        return 0.0 if bar == 1 else self.moving[bar + 1]

    def foot(self, bar: int) -> Number:
        """First pin of a bar, complex, m: O2 of bars 1 and 2, A of bar 3, O4 of bar 4."""
        if bar == 3:
            return self.lengths.a * self.at.u2
        return self.lengths.d * self.at.u1 if bar == 4 else 0.0

    def point(self, bar: int, z: Number) -> Number:
        """The point z of a bar's frame at its first pin (complex: along + i across), m."""
        return self.foot(bar) + z * self.direction(bar)

    def point_coefficient(self, bar: int, z: Number) -> Number:
        """Its derivative by the independent angle, m/rad."""
        own = (1j * self.coefficient(bar)) * (z * self.direction(bar))
        return own + (1j * self.k.h2) * self.foot(3) if bar == 3 else own

    def velocity(self, bar: int, z: Number) -> Number:
        """Its velocity, m/s: v_pin + i omega r."""
        own = (1j * self.omega(bar)) * (z * self.direction(bar))
        return own + (1j * self.omega(2)) * self.foot(3) if bar == 3 else own

    def acceleration(self, bar: int, z: Number) -> Number:
        """Its acceleration, m/s^2: a_pin + (i alpha - omega^2) r."""
        own = swing(z * self.direction(bar), self.omega(bar), self.alpha(bar))
        return own + swing(self.foot(3), self.omega(2), self.alpha(2)) if bar == 3 else own

    def slip(self, pin: str) -> tuple[Number, Number]:
        """Of the bars i, j that meet at a pin: h_j - h_i and its derivative by the independent angle."""
        k = self.k
        return {
            "O2": (k.h2, k.dh2),
            "A": (-k.h23, k.dh3 - k.dh2),
            "B": (k.h43, k.dh4 - k.dh3),
            "O4": (k.h4, k.dh4),
        }[pin]
