"""A loop in a state of its model, in the axes of its scene, and what is seen of it."""

import cmath
from typing import NamedTuple

import mujoco
import numpy as np

from fourbar.linkage import ENDS, FIRST_PIN, PINS
from fourbar.quantities import Array
from fourbar_validation.engines.mujoco.robots.ancestry import (
    EQUALITY_KINDS,
    find_ends,
    is_enabled,
    list_actuators,
    list_joints_of_tendon,
)
from fourbar_validation.engines.mujoco.robots.loop_facts import DRIVEN_PINS, RobotLoop
from fourbar_validation.engines.mujoco.robots.pose import evaluate_kinematics

_PLANES = {2: "x-y", 1: "x-z", 0: "y-z"}
"""Plane of the world by the axis that is normal to it."""
_UPRIGHT = 1e-9
"""Sine of the angle to an axis of the world from which a plane is named by its normal.
"""


_AT_A_PIN = 1e-9
"""Part of a bar's length below which a place is its first pin, but for round-off."""


class LoopFrame:
    """Plane of a loop in a state whose kinematics are evaluated."""

    def __init__(self, loop: RobotLoop, data: mujoco.MjData) -> None:
        self.loop = loop
        self.data = data
        ground = data.xmat[loop.bodies[1][0]].reshape(3, 3)
        *in_plane, self.normal = loop.axes @ ground.T
        self.axes: Array = np.array(in_plane)
        """x and y of the scene in world axes, (2, 3)."""

    def in_plane(self, vector: Array) -> Array:
        """Project a vector of the world on the plane, (2,)."""
        return self.axes @ vector

    def to_world(self, vector: complex) -> Array:
        """Return a vector of the plane in world axes, (3,)."""
        return np.asarray([vector.real, vector.imag] @ self.axes)

    def locate(self, bar: int, pin: str) -> Array:
        """Locate a pin of a bar in world axes, (3,), m."""
        loop = self.loop
        if pin in loop.hinges:
            return np.asarray(self.data.xanchor[loop.hinges[pin]])
        ends = find_ends(self.data.model, self.data, loop.equality)
        return np.asarray(ends[loop.cut_bars.index(bar)])

    def line(self, bar: int) -> complex:
        """Return a bar's line in the plane, from its first pin to the second, m."""
        first, second = (self.locate(bar, pin) for pin in ENDS[bar])
        return complex(*self.in_plane(second - first))

    def angle(self, bar: int) -> float:
        """Return the angle of a bar's line, rad."""
        return cmath.phase(self.line(bar))

    def measure_bars(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return lengths, m, and angles, rad, of bars 1 to 4."""
        lines = [*map(self.line, ENDS)]
        return tuple(map(abs, lines)), tuple(map(cmath.phase, lines))

    def resolve(self, bar: int, vector: Array) -> tuple[float, float]:
        """Resolve a vector of the world along a bar's line and to its left."""
        line = self.line(bar)
        along = complex(*self.in_plane(vector)) * line.conjugate() / abs(line)
        return along.real, along.imag

    def along_bar(self, bar: int, place: Array) -> tuple[float, float]:
        """Return (along, to the left) of a place from a bar's first pin, m."""
        return self.resolve(bar, place - self.locate(bar, FIRST_PIN[bar]))


class Lump(NamedTuple):
    """Bodies that a bar carries, as one rigid body in the plane."""

    mass: float
    centre: tuple[float, float]
    """Distance (m) from the bar's first pin, and angle (rad) from its line."""
    inertia: float
    """About the mass centre and the plane's normal, kg m^2."""


class SeenLoop(LoopFrame):
    """Bars, pins and closure of a loop in its pose; everything else is held."""

    def __init__(self, model: mujoco.MjModel, loop: RobotLoop, bar: int = 2) -> None:
        """Take a loop.

        `bar`: the commanded one, whose motors are the drive.
        """
        self.model = model
        super().__init__(loop, evaluate_kinematics(model, loop.qpos))
        driven = loop.hinges.get(DRIVEN_PINS.get(bar, ""))
        self.drives = list_actuators(model, driven)
        self.hinge = loop.hinges
        self.pins = {joint: pin for pin, joint in loop.hinges.items()}
        self.sense = loop.senses
        self.closure = loop.equality

    @property
    def plane(self) -> str:
        """Name of the plane: that of two axes of the world, or its normal."""
        nearest = int(np.argmax(np.abs(self.normal)))
        if np.abs(np.delete(self.normal, nearest)).max() <= _UPRIGHT:
            return _PLANES[nearest]
        normal = self.normal * np.sign(self.normal[nearest])
        return "normal to " + " ".join(f"{part:.6g}" for part in normal)

    @property
    def closed_by(self) -> str:
        """Kind of the closure and of its ends, or what closes the loop in its place."""
        model = self.model
        kinds = model.eq_type[model.eq_active0 != 0]
        if not model.eq_active0[self.closure]:
            tied = (kinds == mujoco.mjtEq.mjEQ_TENDON).any()
            return "tendon" if tied else "nothing"
        kind = EQUALITY_KINDS[model.eq_type[self.closure]]
        by_sites = model.eq_objtype[self.closure] == mujoco.mjtObj.mjOBJ_SITE
        return f"{kind} of {'sites' if by_sites else 'body anchors'}"

    @property
    def is_alone(self) -> bool:
        """Tell whether the file holds nothing but the loop.

        In a robot contacts, joint limits and motors are off, and so no entries.
        """
        return not self.loop.held

    def touches_tendon(self, tendon: int) -> bool:
        """Tell whether the length of a tendon depends on a hinge of the loop."""
        joints = list_joints_of_tendon(self.model, tendon)
        return not joints.isdisjoint(self.hinge.values())

    def list_parts(self, bar: int) -> list[int]:
        """List the bodies of a bar."""
        return [body for body, of in enumerate(self.loop.bars) if of == bar]

    def polar(self, bar: int, place: Array) -> tuple[float, float]:
        """Return a place from the first pin of a bar: distance, m, and angle, rad.

        The angle is from the bar's line.
        """
        arm = complex(*self.along_bar(bar, place))
        if abs(arm) <= _AT_A_PIN * self.loop.lengths[bar - 1]:
            return 0.0, 0.0
        return cmath.polar(arm)

    def lump(self, bar: int) -> Lump:
        """Sum what a bar carries."""
        bodies = self.list_parts(bar)
        masses = self.model.body_mass[bodies]
        mass = float(masses.sum())
        if not mass:
            return Lump(0.0, (0.0, 0.0), 0.0)
        places = self.data.xipos[bodies]
        centre = masses @ places / mass
        arms = (places - centre) @ self.axes.T
        turns = self.data.ximat[bodies].reshape(-1, 3, 3)
        across = (self.normal @ turns) ** 2
        inertia = (across * self.model.body_inertia[bodies]).sum()
        inertia += masses @ (arms**2).sum(axis=1)
        return Lump(mass, self.polar(bar, centre), float(inertia))

    def stops(self, pin: str) -> tuple[float, float] | None:
        """Return the range of a pin, rad, or None without stops.

        Angles are from the line of the first bar of the pin to that of the second.
        """
        model = self.model
        joint = self.hinge[pin]
        if not model.jnt_limited[joint] or not is_enabled(model, "limit", "constraint"):
            return None
        ends = [self.angle_at(pin, end) for end in model.jnt_range[joint]]
        return min(ends), max(ends)

    def angle_at(self, pin: str, position: float) -> float:
        """Return the angle between the bars of a pin at a position of its hinge."""
        first, second = PINS[pin]
        angles = self.loop.angles
        now = self.loop.qpos[self.model.jnt_qposadr[self.hinge[pin]]]
        turned = self.sense[pin] * (position - now)
        return float(angles[second - 1] - angles[first - 1] + turned)

    def rest_angle(self, pin: str, spring: bool = False) -> float:
        """Return the angle between the bars of a pin in the rest state, rad.

        `spring`: where the spring of its hinge exerts nothing.
        """
        rest = self.model.qpos_spring if spring else self.model.qpos0
        return self.angle_at(pin, rest[self.model.jnt_qposadr[self.hinge[pin]]])

    def measure_offset(self) -> float:
        """Return how far the ends of the closure are apart along the axes, m."""
        cut = self.loop.cut
        if cut is None:
            return 0.0
        first, second = (self.locate(bar, cut) for bar in PINS[cut])
        return abs(float((first - second) @ self.normal))
