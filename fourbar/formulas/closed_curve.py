"""The loop as a curve that is regular at every limit: theta_2 and theta_4 need not be told apart on it.

With psi = theta_2 - theta_1 and mu = theta_4 - theta_3 the diagonal from A to O4, squared, is in both triangles
    a^2 + d^2 - 2 a d cos psi = b^2 + c^2 - 2 b c cos mu,
and along the curve, by a parameter s that does not stop where a bar reverses,
    theta_2' = sin(theta_4 - theta_3), theta_3' = (a/b) sin(theta_2 - theta_4), theta_4' = (a/c) sin(theta_2 - theta_3).
All three vanish at change points alone.
"""

import numpy as np

from fourbar.formulas.arithmetic import Number, polar, sine
from fourbar.formulas.motion import Coefficients, State, rates
from fourbar.formulas.position import Loop, Position, half_angle


def closure(lengths: Loop, psi: Number, mu: Number) -> Number:
    """Compute a d cos psi - b c cos mu - (a^2 + d^2 - b^2 - c^2)/2: zero where the loop closes, m^2."""
    d, a, b, c = lengths[:4]
    return a * d * np.cos(psi) - b * c * np.cos(mu) - 0.5 * (a * a + d * d - b * b - c * c)


def on_curve(lengths: Loop, theta_1: Number, psi: Number, mu: Number) -> State:
    """Compute the position, at rest, with the derivatives by s in the place of those by an angle.

        u3 = (d u1 - a u2)/(b - c e^{i mu}),   u4 = u3 e^{i mu}.

    Off the curve the directions of bars 3 and 4 are no unit vectors.

    >>> from math import pi
    >>> from fourbar.formulas.position import loop
    >>> lengths = loop(100, 40, 120, 80)  # mm; Norton, example 4-1, as in `close_loop`
    >>> s = on_curve(lengths, 0.0, 40 * pi / 180, transmission(lengths, 40 * pi / 180))
    >>> [f"{np.angle(u, deg=True):.3f}" for u in (s.at.u3, s.at.u4)]
    ['20.298', '57.325']
    """
    d, a, b, c = lengths[:4]
    u1, u2 = polar(1.0, theta_1), polar(1.0, theta_1) * polar(1.0, psi)
    diagonal = u1 * _less_turned(d, a, psi)
    u3 = diagonal / _less_turned(b, c, mu)
    u4, h2 = u3 * polar(1.0, mu), np.sin(mu)
    h3, h4 = (a / b) * sine(u4, u2), (a / c) * sine(u3, u2)
    k = Coefficients(h2, h3, h4, h2 - h3, (a / b) * (d / c) * np.sin(psi), 0.0, 0.0, 0.0)
    at = Position(u1, u2, u3, u4, h2, diagonal, None, None, None)  # type: ignore[arg-type]  # what nothing here asks for
    return State(lengths, theta_1, theta_1 + psi, at, k, 0.0, rates(k, 0.0, 0.0))


def _less_turned(p: Number, q: Number, angle: Number) -> Number:
    """Compute p - q e^{i angle}, which keeps its digits where it is small."""
    half = 0.5 * angle
    return (p - q) - (2j * q) * (np.sin(half) * polar(1.0, half))


def transmission(lengths: Loop, psi: Number) -> Number:
    """theta_4 - theta_3 on the open branch, in [0, pi]; where the loop does not close, the end that is nearest.

    tan^2(mu/2) = (e^2 - (b - c)^2)/((b + c)^2 - e^2), the factors of Heron's formula.
    """
    half = half_angle(lengths, psi)
    return 2.0 * np.arctan2(np.sqrt(np.maximum(half.inner, 0.0)), np.sqrt(np.maximum(half.outer, 0.0)))
