"""theta_3 and theta_4 alone, from the tangents of half angles, where the input turns fully.

With t = tan(theta_2/2), each of the two angles solves A tau^2 - 2 y tau + C = 0 for tau = tan(theta/2)
(Freudenstein; Norton, ch. 4), where A, C and (1 + t^2) root are known from t alone:
    tan(theta/2) = (sigma root + y)/A   or   cot(theta/2) = (y - sigma root)/C.
Near a zero of A or C digits are lost, so this serves only linkages in which A, or C, stays away from
zero at every theta_2: no position then needs a test of its own. All others go by `close_loop`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import FourBar
from fourbar.margins import UNDECIDED, scaled, unit_of
from fourbar.more_digits import NEAR

Array = NDArray[np.float64]
AMPLIFIED = 2.0
"""At most this times a rounding of the numerator, relative to its terms, comes into an angle (rad)."""


class Half(NamedTuple):
    """theta = offset + 2 arctan((R + across t)/(at_0 + at_pi t^2)), R = (1 + t^2) root."""

    across: float
    at_0: float
    at_pi: float
    offset: float


class HalfAngles(NamedTuple):
    """theta_3 and theta_4 of one branch as functions of tan(theta_2/2); lengths in `unit_of` the linkage."""

    outer: tuple[float, float]
    inner: tuple[float, float]
    """The Heron factors times 1 + t^2: value at t = 0, and the coefficient of t^2."""
    halves: dict[str, Half]

    def write(self, theta_2: Array, out: dict[str, Array]) -> None:
        """Both angles, or one of them, in (-pi, pi) into the arrays given."""
        t = np.multiply(theta_2, 0.5)
        np.tan(t, out=t)
        s = t * t
        root = s * self.outer[1]
        root += self.outer[0]
        part = s * self.inner[1]
        part += self.inner[0]
        root *= part
        np.sqrt(root, out=root)
        for name, room in out.items():
            across, at_0, at_pi, offset = self.halves[name]
            np.multiply(s, at_pi, out=part)
            part += at_0
            quotient = t * across
            quotient += root
            quotient /= part
            angle = np.arctan(quotient, out=room)
            angle *= 2.0
            if offset != 0.0:
                angle += offset


def half_angles(linkage: FourBar, branch: int) -> HalfAngles | None:
    """The angles as functions of tan(theta_2/2), each on one side of the ground: 0 < |theta| < pi.

    None for a linkage in which an angle leaves its side, or with positions near a limit, where only
    `close_loop` gives all digits.
    """
    d, a, b, c = scaled(linkage, unit_of(linkage))
    outer = math.fsum((b, c, a, -d)) * math.fsum((b, c, d, -a)), math.fsum((b, c, -a, -d)) * (a + b + c + d)
    inner = math.fsum((d, b, -a, -c)) * math.fsum((d, c, -a, -b)), math.fsum((d, a, b, -c)) * math.fsum((d, a, c, -b))
    if linkage.ground_angle != 0.0:
        return None
    least = min(outer[1], inner[0]), min(outer[0] * inner[0], outer[1] * inner[1])
    if least[0] <= UNDECIDED * 4.0 * (b * c + a * d) or least[1] <= (NEAR[0] * 2.0 * b * c) ** 2:
        return None  # limit positions, or positions near one
    # e along a bar of length p: A = (x + p)^2 + y^2 - q^2 and C = (x - p)^2 + y^2 - q^2, signs turned for bar 4
    halves = {"theta_3": _half(d, a, b, c, branch), "theta_4": _half(d, a, -c, b, branch)}
    if None in halves.values():
        return None
    return HalfAngles(outer, inner, halves)  # type: ignore[arg-type]


def _half(d: float, a: float, p: float, q: float, branch: int) -> Half | None:
    """For bar 3 of length p = b, where q = c; for bar 4 p = -c, q = b."""
    sign = math.copysign(1.0, p)
    A, C = (
        tuple(sign * math.fsum((d, side * a, p, -q)) * math.fsum((d, side * a, p, q)) for side in (-1.0, 1.0))
        for p in (p, -p)
    )
    size = abs(p) * (a + q)
    if not (A[0] * A[1] > 0.0 and C[0] * C[1] > 0.0):
        return None  # the angle passes pi or 0
    for (at_0, at_pi), turned, offset in ((A, -1.0, 0.0), (C, 1.0, math.copysign(math.pi, branch * A[0]))):
        if AMPLIFIED * min(abs(at_0), abs(at_pi)) >= 2.0 * size:
            return Half(turned * branch * 4.0 * a * abs(p), branch * at_0, branch * at_pi, offset)
    return None
