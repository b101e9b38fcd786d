"""A stroke that is commanded: the cylinder and the pivot of its bar make a triangle, which is the bar's angle.

With l from the pivot to the end on the bar, r to the end on the ground, beta the angle between them, and s the stroke,
    s^2 = l^2 + r^2 - 2 l r cos beta,   ds/dbeta = l r sin beta/s = the lever from the pivot to the line.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fourbar.errors import InputError
from fourbar.formulas.arithmetic import PI_LOW, Number, angle, divisor, exact_difference, namespace, polar, select
from fourbar.formulas.longer import change_numbers, lengthen, shorten
from fourbar.linkage import FourBar
from fourbar.quantities import Array

if TYPE_CHECKING:
    from fourbar.effects.linear_drive import LinearDrive
    from fourbar.effects.spring import SpringEnd

SIDES = {"left": 1.0, "right": -1.0}
"""Signs of the moving end's side of the line from the bar's pivot to the end on the ground, seen towards the latter."""


class Triangle(NamedTuple):
    """Pivot, end on the bar, end on the ground."""

    bar: int
    length: Number
    """l, m."""
    reach: Number
    """r, m."""
    angle: Number
    """theta of the bar where both ends are in one direction from the pivot, rad."""

    def strokes(self, beta: Array) -> Array:
        """Compute the stroke at angles between the two ends, (n,)."""
        across: Array = np.hypot(self.length - self.reach, 2.0 * np.sqrt(self.length * self.reach) * np.sin(0.5 * beta))
        return across

    def require(self, stroke: Array) -> None:
        """Raise InputError for a stroke that the cylinder cannot have."""
        least, most = abs(self.length - self.reach), self.length + self.reach
        inside = (stroke >= least) & (stroke <= most)
        if not inside.all():
            bad = float(stroke[np.argmin(inside)])
            raise InputError("motion.stroke", bad, f"this cylinder can have {least:.6g} to {most:.6g} m")

    def turn_bar(self, stroke: Any, speed: Any, acceleration: Any, side: str | None) -> tuple[Any, Any, Any, Any]:
        """Compute angle, speed and acceleration of the bar, and the condition: the lever over the longer of l and r.

        NaN where the cylinder cannot have the stroke; in libraries other than NumPy the condition alone says so, by 0.
        All may be arrays, and numbers that carry their derivatives.
        """
        assert side is not None
        length, reach, zero = self.length, self.reach, 0.0 * self.length
        sign, xp = SIDES[side], namespace(stroke, length, reach)
        near = exact_difference(stroke, reach, length, zero) * exact_difference(stroke, length, reach, zero)
        far = exact_difference(length, reach, stroke, zero) * (length + reach + stroke)
        inside = xp is np or (near > 0.0) & (far > 0.0)
        near, far, stroke = (divisor(x, inside) for x in (near, far, stroke))
        with np.errstate(all="ignore"):
            near, far = xp.sqrt(near), xp.sqrt(far)
            beta = 2.0 * xp.atan2(near, far)
            lever = near * far / (2.0 * stroke)
            longer = 0.5 * (length + reach + abs(length - reach))
            theta, condition = self.angle + sign * beta, select(inside, lever / longer, 0.0)
            if speed is None:
                return theta, None, np.zeros(np.shape(theta)), condition
            rate = speed / lever
            growth = speed * speed + stroke * acceleration - length * reach * xp.cos(beta) * rate * rate
            growth = growth / (lever * stroke)
        return theta, sign * rate, sign * growth, condition


def find_triangle(linkage: FourBar, drive: "LinearDrive | None") -> Triangle:
    """Return the triangle of a cylinder between the ground and bar 2 or 4; InputError for any other drive."""
    if drive is None or {drive.start.bar, drive.end.bar} not in ({1, 2}, {1, 4}):
        drives = "no cylinder" if drive is None else f"one from bar {drive.start.bar} to bar {drive.end.bar}"
        raise InputError("motion.stroke", drives, "is of a cylinder ([drive]) between the ground and bar 2 or 4")
    moving, fixed = (drive.end, drive.start) if drive.start.bar == 1 else (drive.start, drive.end)
    if moving.bar == 2:  # points of the ground are polar about O2
        reach, towards = abs(fixed.distance), fixed.angle + linkage.ground_angle + _reverse(fixed)
    else:
        end = polar(fixed.distance, fixed.angle + linkage.ground_angle)
        across = end - polar(linkage.ground, linkage.ground_angle)
        reach, towards = abs(across), angle(across)
    return Triangle(moving.bar, abs(moving.distance), reach, towards - moving.angle - _reverse(moving))


def find_round_off(
    linkage: FourBar, drive: "LinearDrive | None", side: str | None, command: tuple[Any, ...], turned: tuple[Any, ...]
) -> Any:
    """Compute what angle, speed and acceleration leave out as doubles, (..., 3), where a stroke is commanded."""
    with np.errstate(all="ignore"):
        triangle = find_triangle(*change_numbers((linkage, drive), lengthen))
        stroke, speed, acceleration = (lengthen(number) for number in command)
        longer = triangle.turn_bar(stroke, speed, acceleration, side)
        gaps = [shorten(after - before) for before, after in zip(turned, longer[:3], strict=True)]
    return np.stack(np.broadcast_arrays(*gaps), axis=-1)


def _reverse(point: "SpringEnd") -> Any:
    """Return half a turn for a point at a distance that is negative."""
    forwards = 0.0 * point.distance  # zero of the same kind of number
    return select(point.distance >= 0.0, forwards, np.pi + forwards + PI_LOW)
