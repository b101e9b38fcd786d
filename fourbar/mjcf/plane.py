"""The plane of the linkage in the world of a model file.

It is tilted about an axis and moved to an origin.
"""

import math
from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import require
from fourbar.mjcf.model import write_exactly
from fourbar.quantities import Array

Vector = tuple[float, float, float]
_OPPOSITE = 1e-12
"""Sum of 1 and the tilt's cosine below which the axis points down; x stays x there."""


@dataclass(frozen=True, slots=True)
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
        axis, origin = (
            tuple(require(name, number) for number in _require_three(name, value))
            for name, value in (("axis", self.axis), ("origin", self.origin))
        )
        length = math.hypot(*axis)
        if not 0.0 < length < math.inf:
            raise InputError("axis", self.axis, "must have a length")
        object.__setattr__(self, "axis", tuple(part / length for part in axis))
        object.__setattr__(self, "origin", origin)

    @property
    def is_moved(self) -> bool:
        """Return True if the frame is not that of the world."""
        return self != LEVEL

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Return the turn from world axes to the frame: (w, x, y, z), of length 1."""
        x, y, z = self.axis
        if 1.0 + z < _OPPOSITE:
            return 0.0, 1.0, 0.0, 0.0
        size = math.sqrt(2.0 * (1.0 + z))
        return 0.5 * size, 0.0 - y / size, x / size, 0.0

    @property
    def rotation(self) -> Array:
        """Return the axes of the frame as columns in world axes, (3, 3)."""
        w, x, y, z = self.quaternion
        return np.array(
            [
                [
                    1.0 - 2.0 * (y * y + z * z),
                    2.0 * (x * y - w * z),
                    2.0 * (x * z + w * y),
                ],
                [
                    2.0 * (x * y + w * z),
                    1.0 - 2.0 * (x * x + z * z),
                    2.0 * (y * z - w * x),
                ],
                [
                    2.0 * (x * z - w * y),
                    2.0 * (y * z + w * x),
                    1.0 - 2.0 * (x * x + y * y),
                ],
            ]
        )

    @property
    def roll_pitch_yaw(self) -> Vector:
        """Return the angles about x, y and z, rad.

        They are applied in this order about fixed axes.
        """
        turn = self.rotation
        pitch = math.atan2(-turn[2, 0], math.hypot(turn[0, 0], turn[1, 0]))
        roll = math.atan2(turn[2, 1], turn[2, 2])
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        return roll, pitch, yaw

    def turn(self, x: float, y: float, z: float = 0.0) -> Vector:
        """Turn a vector of the frame into world axes."""
        vector = self.rotation @ (x, y, z)
        return float(vector[0]), float(vector[1]), float(vector[2])

    def place(self, x: float, y: float, z: float = 0.0) -> Vector:
        """Return a point of the frame in world axes, m."""
        dx, dy, dz = self.turn(x, y, z)
        return self.origin[0] + dx, self.origin[1] + dy, self.origin[2] + dz

    def moved(self, x: float, y: float) -> "Plane":
        """Return the frame with its origin at a point of this one, m.

        A drawing has O2 there.
        """
        if x or y:
            return Plane(self.axis, self.place(x, y))
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
        """Move an MJCF that was written for the plane x-y.

        Ground, gravity, light and camera move.
        """
        option = root.find("option")
        statistic = root.find("statistic")
        assert option is not None
        assert statistic is not None
        gravity = _read_vector(option.get("gravity", "0 0 0"))
        option.set("gravity", write_exactly(*self.turn(*gravity)))
        statistic.set(
            "center",
            write_exactly(*self.place(*_read_vector(statistic.attrib["center"]))),
        )
        turned = write_exactly(*self.quaternion)
        for body in root.iterfind("worldbody/body"):
            body.set(
                "pos",
                write_exactly(*self.place(*_read_vector(body.get("pos", "0 0 0")))),
            )
            body.set("quat", turned)
        for tag in ("light", "camera"):
            for element in root.iterfind(f"worldbody/{tag}"):
                place = _read_vector(element.attrib["pos"])
                element.set("pos", write_exactly(*self.place(*place)))
        for light in root.iterfind("worldbody/light"):
            light.set(
                "dir",
                write_exactly(*self.turn(*_read_vector(light.attrib["dir"]))),
            )
        for camera in root.iterfind("worldbody/camera"):
            camera.set("quat", turned)


def _require_three(name: str, value: object) -> tuple[float, ...]:
    if not isinstance(value, (tuple, list)) or len(value) != 3:
        raise InputError(name, value, "must be three numbers")
    return tuple(value)


def _read_vector(text: str) -> Vector:
    x, y, z = map(float, text.split())
    return x, y, z


LEVEL = Plane()
"""The plane x-y, pin O2 in the origin."""
