"""A loop in a state of its model: axes of its plane, pins and lines of its bars."""

import cmath
import math

import mujoco
import numpy as np

from fourbar.linkage import ENDS, FIRST_PIN
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.robots.ancestry import find_roots
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotLoop


def list_bars(model: mujoco.MjModel, loop: RobotLoop) -> list[int | None]:
    """List the bar, 1 to 4, that each body belongs to; None: it belongs to none.

    What hangs on a bar by joints that are held belongs to it.
    """
    roots = find_roots(model, {*loop.held})
    bars = {roots[body]: bar for bar, bodies in loop.bodies.items() for body in bodies}
    return [bars.get(root) for root in roots]


class LoopFrame:
    """Plane of a loop in a state whose kinematics are evaluated."""

    def __init__(self, loop: RobotLoop, data: mujoco.MjData) -> None:
        self.loop = loop
        self.data = data
        ground = data.xmat[loop.bodies[1][0]].reshape(3, 3)
        self.normal = ground @ loop.axis
        along = ground @ loop.along
        across = np.cross(self.normal, along)
        cos = math.cos(loop.turned)
        sin = math.sin(loop.turned)
        self.axes = np.array([cos * along + sin * across, cos * across - sin * along])
        """x and y of the scene in world axes, (2, 3)."""

    def in_plane(self, vector: Array) -> Array:
        """Project a vector of the world on the plane, (2,)."""
        return self.axes @ vector

    def locate(self, bar: int, pin: str) -> Array:
        """Locate a pin of a bar in world axes, (3,), m."""
        body = self.loop.bodies[bar][0]
        turn = self.data.xmat[body].reshape(3, 3)
        return np.asarray(self.data.xpos[body] + turn @ self.loop.points[bar, pin])

    def line(self, bar: int) -> complex:
        """Return a bar's line in the plane, from its first pin to the second, m."""
        first, second = (self.locate(bar, pin) for pin in ENDS[bar])
        return complex(*self.in_plane(second - first))

    def angle(self, bar: int) -> float:
        """Return the angle of a bar's line, rad."""
        return cmath.phase(self.line(bar))

    def resolve(self, bar: int, vector: Array) -> tuple[float, float]:
        """Resolve a vector of the world along a bar's line and to its left."""
        x, y = self.in_plane(vector)
        line = self.line(bar)
        size = abs(line)
        return (
            float(line.real * x + line.imag * y) / size,
            float(line.real * y - line.imag * x) / size,
        )

    def along_bar(self, bar: int, place: Array) -> tuple[float, float]:
        """Return (along, to the left) of a place from a bar's first pin, m."""
        return self.resolve(bar, place - self.locate(bar, FIRST_PIN[bar]))
