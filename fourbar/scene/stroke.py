"""A stroke that is commanded: the cylinder and the pivot of its bar make a triangle, which is the bar's angle.

With l from the pivot to the end on the bar, r to the end on the ground, beta the angle between them, and s the stroke,
    s^2 = l^2 + r^2 - 2 l r cos beta,   ds/dbeta = l r sin beta/s = the lever from the pivot to the line.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fourbar.errors import InputError
from fourbar.formulas.arithmetic import polar
from fourbar.linkage import FourBar
from fourbar.solution import Array

if TYPE_CHECKING:
    from fourbar.effects.linear_drive import LinearDrive

SIDES = {"left": 1.0, "right": -1.0}
"""On which side of the line from the bar's pivot to the end on the ground, seen towards that, the other end lies."""


class Triangle(NamedTuple):
    """Pivot, end on the bar, end on the ground."""

    bar: int
    length: float
    """l, m."""
    reach: float
    """r, m."""
    angle: float
    """theta of the bar where both ends are in one direction from the pivot, rad."""

    def turned(
        self, stroke: Array, speed: float | None, acceleration: float, side: str
    ) -> tuple[Array, Array | None, Array, Array]:
        """Compute angle, speed and acceleration of the bar, and the lever as a part of the longer of l and r, (n,)."""
        longer, shorter = max(self.length, self.reach), min(self.length, self.reach)
        least, most = longer - shorter, longer + shorter
        if not ((stroke >= least) & (stroke <= most)).all():
            bad = float(stroke[np.argmax(~((stroke >= least) & (stroke <= most)))])
            raise InputError("motion.stroke", bad, f"this cylinder can have {least:.6g} to {most:.6g} m")
        sign, product = SIDES[side], self.length * self.reach
        near, far = (stroke - least) * (stroke + least), (most - stroke) * (most + stroke)
        beta = 2.0 * np.arctan2(np.sqrt(near), np.sqrt(far))
        lever = np.sqrt(near) * np.sqrt(far) / (2.0 * stroke)
        theta = self.angle + sign * beta
        if speed is None:
            return theta, None, np.zeros_like(theta), lever / longer
        with np.errstate(all="ignore"):
            rate = speed / lever
            growth = (speed * speed + stroke * acceleration - product * np.cos(beta) * rate * rate) / (lever * stroke)
        return theta, sign * rate, sign * growth, lever / longer


def triangle(linkage: FourBar, drive: "LinearDrive | None") -> Triangle:
    """Return the triangle of a cylinder between the ground and bar 2 or 4; InputError for any other drive."""
    if drive is None or {drive.start.bar, drive.end.bar} not in ({1, 2}, {1, 4}):
        drives = "no cylinder" if drive is None else f"one from bar {drive.start.bar} to bar {drive.end.bar}"
        raise InputError("motion.stroke", drives, "is of a cylinder ([drive]) between the ground and bar 2 or 4")
    own, other = (drive.end, drive.start) if drive.start.bar == 1 else (drive.start, drive.end)
    pivot = 0.0 if own.bar == 2 else polar(linkage.ground, linkage.ground_angle)
    to_ground = complex(polar(other.distance, other.angle + linkage.ground_angle) - pivot)
    along = 0.0 if own.distance >= 0.0 else np.pi
    return Triangle(own.bar, abs(own.distance), abs(to_ground), float(np.angle(to_ground)) - own.angle - along)
