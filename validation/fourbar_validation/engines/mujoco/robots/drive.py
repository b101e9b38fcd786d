"""The drive of a scene, as what it exerts on the bodies of a loop."""

import cmath
from typing import Any, NamedTuple

import mujoco
import numpy as np

from fourbar.effects import LinearDrive, PointDrive
from fourbar.effects.place import Place
from fourbar.linkage import FIRST_PIN
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.robots.ancestry import list_wraps
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotLoop
from fourbar_validation.engines.mujoco.robots.seen import LoopFrame


class _Wrench(NamedTuple):
    """Force at a point of a body, N, and couple, N m, world axes, (3,) each."""

    body: int
    force: Array
    couple: Array
    point: Array


class Cylinder(NamedTuple):
    """Actuator of a file along a tendon between two sites."""

    actuator: int
    sites: list[int]


def find_cylinder(model: mujoco.MjModel) -> Cylinder | None:
    """Return the cylinder of a file if it has exactly one."""
    on_tendons = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    controlled = model.actuator_gainprm.any(axis=1)
    cylinders = np.flatnonzero(on_tendons & controlled).tolist()
    if len(cylinders) != 1:
        return None
    wraps = [*list_wraps(model, model.actuator_trnid[cylinders[0], 0])]
    sites = [index for kind, index, _ in wraps if kind == mujoco.mjtWrap.mjWRAP_SITE]
    return Cylinder(cylinders[0], sites) if len(sites) == len(wraps) == 2 else None


class LoopDrive:
    """Wrenches of a scene's drive on the bars of a loop, per N m or N that it exerts.

    The ground bears the opposite of each. The file's own cylinder acts where the file
    has it, in the place of that of the scene.
    """

    def __init__(self, model: mujoco.MjModel, loop: RobotLoop, scene: Scene) -> None:
        self.model = model
        self.loop = loop
        self.drive = scene.settled_drive()
        self.couple_bar = None if scene.drive is not None else scene.drive_bar
        """Bar on which a couple acts, if that is the drive."""
        self.cylinder = None
        if isinstance(scene.drive, LinearDrive):
            self.cylinder = find_cylinder(model)

    def _list_wrenches(self, data: mujoco.MjData) -> list[_Wrench]:
        frame = LoopFrame(self.loop, data)
        none = np.zeros(3)
        bodies = self.loop.bodies
        if self.couple_bar is not None:
            first = _Wrench(bodies[self.couple_bar][0], none, frame.normal, none)
            return [first, _Wrench(bodies[1][0], none, -frame.normal, none)]

        def locate(place: Place) -> tuple[Array, complex]:
            """Return a place in world axes, (3,), m, and its bar's direction."""
            line = frame.line(place.bar)
            unit = line / abs(line)
            arm: Any = unit * complex(place.in_bar)
            pin = frame.locate(place.bar, FIRST_PIN[place.bar])
            return pin + np.array([arm.real, arm.imag]) @ frame.axes, unit

        if isinstance(self.drive, PointDrive):
            place, unit = locate(self.drive.place)
            direction = cmath.rect(1.0, self.drive.direction)
            if self.drive.frame == "bar":
                direction *= unit
            force = np.array([direction.real, direction.imag]) @ frame.axes
            bar = self.drive.place.bar
            return [
                _Wrench(bodies[bar][0], force, none, place),
                _Wrench(bodies[1][0], -force, none, place),
            ]
        if self.cylinder is not None:
            start, end = data.site_xpos[self.cylinder.sites]
            pushed = self.model.site_bodyid[self.cylinder.sites].tolist()
            line = end - start
        else:
            assert isinstance(self.drive, LinearDrive)
            ends = (self.drive.start, self.drive.end)
            (start, _), (end, _) = map(locate, ends)
            pushed = [bodies[one.bar][0] for one in ends]
            line = frame.in_plane(end - start) @ frame.axes
        force = line / np.linalg.norm(line)
        return [
            _Wrench(pushed[0], -force, none, start),
            _Wrench(pushed[1], force, none, end),
        ]

    def exert(self, data: mujoco.MjData, size: float) -> None:
        """Apply the drive with a size, N m or N, in the state that is placed."""
        data.xfrc_applied[:] = 0.0
        for body, force, couple, point in self._list_wrenches(data):
            arm = point - data.xipos[body]
            data.xfrc_applied[body, :3] += size * force
            data.xfrc_applied[body, 3:] += size * (couple + np.cross(arm, force))

    def find_pull(self, data: mujoco.MjData) -> Array:
        """Return the generalized forces per N m or N, (nv,), in the state placed."""
        pull = np.zeros(self.model.nv)
        for body, force, couple, point in self._list_wrenches(data):
            mujoco.mj_applyFT(self.model, data, force, couple, point, body, pull)
        return pull

    def find_speed(self, data: mujoco.MjData) -> float:
        """Return the speed that the drive's N m or N does work at, rad/s or m/s."""
        return float(self.find_pull(data) @ data.qvel)
