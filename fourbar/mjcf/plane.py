"""The plane of the linkage in the world of a model file.

The plane is tilted about an axis and moved to an origin.
"""

import math
from operator import add
from xml.etree import ElementTree as ET

import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import record, require
from fourbar.mjcf.model import write_exactly
from fourbar.quantities import Array

Vector = tuple[float, float, float]
_OPPOSITE = 1e-12
"""Sum of 1 and the tilt's cosine below which the axis points down; x stays x there."""
_ROUNDING = 2.0**-50
"""Part of a vector's length below which a turned component is rounding of zero."""


@record
class Plane:
    """Frame in which a linkage stands: x and y in its plane, z along its axes.

    The frame is turned by the shortest way from the world's z to the axis.

    Parameters
    ----------
    axis : direction of the axes of all pins in world axes, of any length but 0.
    origin : place of pin O2, m.
    """

    axis: Vector = (0.0, 0.0, 1.0)
    origin: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        axis = _require_three("axis", self.axis)
        origin = _require_three("origin", self.origin)
        length = math.hypot(*axis)
        if not 0.0 < length < math.inf:
            raise InputError("axis", self.axis, "must have a length")
        unit_vector = tuple(part / length for part in axis)
        object.__setattr__(self, "axis", unit_vector)
        object.__setattr__(self, "origin", origin)

    @property
    def is_moved(self) -> bool:
        """Return True if the frame is not that of the world."""
        return self != LEVEL

    @property
    def is_tilted(self) -> bool:
        """Return True if the axes of the frame are not those of the world."""
        return self.axis != LEVEL.axis

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Return the turn from world axes to the frame: (w, x, y, z), of length 1."""
        x, y, z = self.axis
        if 1.0 + z < _OPPOSITE:
            return 0.0, 1.0, 0.0, 0.0
        size = math.sqrt(2.0 * self._one_plus_z)
        return 0.5 * size, 0.0 - y / size, x / size, 0.0

    @property
    def _one_plus_z(self) -> float:
        """Return 1 + z of the axis, without cancellation where it points down."""
        x, y, z = self.axis
        return 1.0 + z if z > 0.0 else (x * x + y * y) / (1.0 - z)

    @property
    def rotation(self) -> Array:
        """Return the axes of the frame as columns in world axes, (3, 3)."""
        x, y, z = self.axis
        if 1.0 + z < _OPPOSITE:
            return np.diag([1.0, -1.0, -1.0])
        # by the quaternion, zeros of a turn by 90 deg would be rounding
        f = 1.0 / self._one_plus_z
        mixed = -x * y * f
        rows = [[1.0 - x * x * f, mixed, x], [mixed, 1.0 - y * y * f, y], [-x, -y, z]]
        return np.array(rows) + 0.0  # no zero has a sign

    @property
    def roll_pitch_yaw(self) -> Vector:
        """Return the angles about x, y and z, rad, in this order about fixed axes."""
        (xx, _, _), (yx, _, _), (zx, zy, zz) = self.rotation
        pitch = math.atan2(-zx, math.hypot(xx, yx))
        roll = math.atan2(zy, zz)
        yaw = math.atan2(yx, xx)
        return roll, pitch, yaw

    def turn(self, x: float, y: float, z: float = 0.0) -> list[float]:
        """Turn a vector of the frame into world axes.

        A component that is rounding of zero is zero.
        """
        turned = self.rotation @ (x, y, z)
        lost = np.abs(turned) <= _ROUNDING * math.hypot(x, y, z)
        return np.where(lost, 0.0, turned).tolist()  # type: ignore[no-any-return]

    def place(self, x: float, y: float, z: float = 0.0) -> list[float]:
        """Return a point of the frame in world axes, m."""
        return [*map(add, self.origin, self.turn(x, y, z))]

    def moved(self, x: float, y: float) -> "Plane":
        """Return the frame with its origin at a point of this one, m.

        A drawing has O2 there.
        """
        if x or y:
            x, y, z = self.place(x, y)
            return Plane(self.axis, (x, y, z))
        return self

    def turn_on(self, angle: float) -> tuple[float, float, float, float]:
        """Return the quaternion of a body that is turned in the plane (rad)."""
        w, x, y, z = self.quaternion
        cos = math.cos(0.5 * angle)
        sin = math.sin(0.5 * angle)
        return (
            w * cos - z * sin,
            x * cos + y * sin,
            y * cos - x * sin,
            z * cos + w * sin,
        )

    def move_mjcf(self, root: ET.Element) -> None:
        """Move an MJCF that was written for the plane x-y, O2 in the origin.

        The ground moves, and turns as gravity does if the plane is tilted.
        """
        for ground in root.iterfind("worldbody/body"):
            ground.set("pos", write_exactly(*self.origin))
            if self.is_tilted:
                ground.set("quat", write_exactly(*self.quaternion))
        if self.is_tilted:
            for option in root.iterfind("option"):
                gravity = map(float, option.get("gravity", "").split())
                option.set("gravity", write_exactly(*self.turn(*gravity)))


def _require_three(name: str, value: object) -> tuple[float, ...]:
    if not isinstance(value, (tuple, list)) or len(value) != 3:
        raise InputError(name, value, "must be three numbers")
    return tuple(require(name, number) for number in value)


LEVEL = Plane()
"""The plane x-y, pin O2 in the origin."""
