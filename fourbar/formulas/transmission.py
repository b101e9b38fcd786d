"""Transmission: transmission angle, speed ratio, mechanical advantage.

The distance to the nearest singular position belongs to it.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.formulas.arithmetic import dot
from fourbar.formulas.mobility import (
    TURN,
    Array,
    Reach,
    change_points,
    limit_positions,
    reach_of,
)
from fourbar.formulas.motion import State
from fourbar.formulas.path import prepare_path
from fourbar.linkage import FourBar


def transmission_angle(state: State) -> Array:
    """Compute mu, the acute angle between coupler and output, rad, in [0, pi/2], (n,).

    Positions that do not assemble have NaN. The tangent is

        tan mu = |sin(theta_4 - theta_3)| / |cos(theta_4 - theta_3)|,

    so mu keeps eps-accuracy near 0 and pi/2 as far as the position itself does: |error|
    about eps/|sin mu|.

    Source: R. L. Norton, Design of Machinery.
    """
    return np.asarray(
        np.arctan2(
            np.abs(state.position.sin_mu),
            np.abs(dot(state.position.u3, state.position.u4)),
        )
    )


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


def speed_ratio(state: State) -> Array:
    """Return omega_4/omega_2, (n,); NaN at singular positions.

    The ratio is a sin(theta_2 - theta_3)/(c sin(theta_4 - theta_3)).
    """
    return np.asarray(state.k.h4)


def mechanical_advantage(
    state: State,
    radius_in: float = 1.0,
    radius_out: float = 1.0,
) -> Array:
    """Compute F_out/F_in = (omega_2/omega_4)(r_in/r_out), (n,).

    The linkage has no losses. The signed ratio of torques where the radii are equal;
    +-inf where the output stands still (bars 2, 3 collinear), NaN at a singular
    position.

    Parameters
    ----------
    radius_in, radius_out : distances of the forces from O2 and O4, m.

    Source: R. L. Norton, Design of Machinery.
    """
    with np.errstate(divide="ignore"):
        return np.divide(radius_in / radius_out, speed_ratio(state))


def distance_to_singular(
    linkage: FourBar,
    theta_2: Array,
    drive_bar: int = 2,
    branch: int | NDArray[Any] | None = None,
) -> Array:
    """Compute the angle of the input to the nearest singular position, rad, (n,).

    The angle lies in [0, pi], and is inf if there is no such position. Singular are the
    limits of theta_2 and the change points (speeds are 0/0), and for a drive on bar 3
    or 4 its dead centres, where no torque on it holds the linkage. The error is at most
    about eps (|theta_2| + |theta_1| + 2 pi). A kite whose input and coupler coincide is
    not counted: there a drive on bar 4 is dead at every position of that motion.

    Parameters
    ----------
    theta_2 : (n,), rad.
    drive_bar : 2, 3 or 4.
    branch : assembly, +1 or -1, or one for each position; left out: dead centres of
        both count.
    """
    theta_2 = np.asarray(theta_2, dtype=float)
    path = prepare_path(linkage.lengths, linkage.ground_angle)
    points = [(limit.theta_2, 0) for limit in limit_positions(linkage)]
    points += [(point, 0) for point in change_points(linkage)]
    if drive_bar != 2:
        points += [
            (limit.theta_2, limit.branch)
            for limit in limit_positions(linkage, drive_bar)
        ]
    nearest = np.full(theta_2.shape, np.inf)
    for point, point_branch in points:
        there = point + TURN * np.rint((theta_2 - point) / TURN)
        counts: Any = True
        if branch is not None and point_branch != 0:
            counts = path.sign(there, np.asarray(branch)) == point_branch
        distance = np.abs(theta_2 - there)
        nearest = np.where(counts, np.minimum(nearest, distance), nearest)
    return nearest
