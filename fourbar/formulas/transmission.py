"""Extremes of the transmission angle."""

import math
from typing import NamedTuple

from fourbar.formulas.mobility import Reach, reach_of
from fourbar.linkage import FourBar


class TransmissionExtremes(NamedTuple):
    """Extremes of the angle A-B-O4 over all positions that assemble, rad."""

    least: float
    """rad, in [0, pi]; 0 where bars 3, 4 fold."""
    greatest: float
    """rad, in [0, pi]; pi where bars 3, 4 are stretched."""
    theta_2_least: float
    """rad, in [theta_1, theta_1 + pi]. If the input has limits, the mirror position has
    the same angle.
    """
    theta_2_greatest: float
    """rad; likewise."""

    @property
    def worst(self) -> float:
        """The smallest transmission angle, taken as acute, rad."""
        return min(self.least, math.pi - self.greatest)


def transmission_extremes(linkage: FourBar) -> TransmissionExtremes:
    """Find the extremes of the angle at B, which are the same on both branches.

    Extremes lie where bars 1, 2 are collinear, or at a limit of the input:

        tan^2(mu/2) = (e + b - c)(e - b + c)/((b + c - e)(b + c + e))

    at e = |d - a| and e = d + a.
    """
    reach = reach_of(linkage)
    theta_1 = linkage.ground_angle
    sign = 1 if reach.d >= reach.own else -1
    least = _angle_at_B(reach, sign, -sign)
    at_least = theta_1
    greatest = _angle_at_B(reach, 1, 1)
    at_greatest = theta_1 + math.pi
    if reach.beyond_folded > 0.0:
        least = 0.0
        at_least = theta_1 + reach.triangle(False)[0]
    if reach.beyond_stretched > 0.0:
        greatest = math.pi
        at_greatest = theta_1 + reach.triangle(True)[0]
    return TransmissionExtremes(least, greatest, at_least, at_greatest)


def _angle_at_B(reach: Reach, d: int, a: int) -> float:
    """Compute the signed angle between b and c in the triangle b, c, e, rad.

    The third side is e = d (ground) + own (input).
    """
    opposite = (
        max(reach.sum(d, a, 1, -1), 0.0) ** 0.5
        * max(reach.sum(d, a, -1, 1), 0.0) ** 0.5
    )
    return 2.0 * math.atan2(
        opposite,
        max(reach.sum(-d, -a, 1, 1), 0.0) ** 0.5 * reach.sum(d, a, 1, 1) ** 0.5,
    )
