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
from fourbar_validation.engines.mujoco.robots.frame import LoopFrame
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotLoop


class _Wrench(NamedTuple):
    """Force at a point of a body, N, and couple, N m, world axes, (3,) each."""

    body: int
    force: Array
    couple: Array
    point: Array


class FileCylinder:
    """Actuator of a file along a tendon that exerts what it is told to, N."""

    couple_bar = None

    def __init__(self, model: mujoco.MjModel, scene: Scene, actuator: int) -> None:
        self.model = model
        self.drive = scene.drive
        self.actuator = actuator

    def take_over(self, model: mujoco.MjModel) -> None:
        """Make the actuator of a model exert its control, without any limit."""
        i = self.actuator
        model.actuator_gaintype[i] = mujoco.mjtGain.mjGAIN_FIXED
        model.actuator_biastype[i] = mujoco.mjtBias.mjBIAS_NONE
        model.actuator_dyntype[i] = mujoco.mjtDyn.mjDYN_NONE
        model.actuator_gainprm[i] = 0.0
        model.actuator_gainprm[i, 0] = 1.0 / model.actuator_gear[i, 0]
        model.actuator_ctrllimited[i] = model.actuator_forcelimited[i] = False
        self.model = model

    def exert(self, data: mujoco.MjData, size: float) -> None:
        """Apply a force, N, in the state that is placed."""
        data.ctrl[self.actuator] = size

    def find_pull(self, data: mujoco.MjData) -> Array:
        """Return the generalized forces per N, (nv,), in the state that is placed."""
        forces = []
        for size in (0.0, 1.0):
            data.ctrl[self.actuator] = size
            mujoco.mj_fwdActuation(self.model, data)
            forces.append(data.qfrc_actuator.copy())
        data.ctrl[self.actuator] = 0.0
        return np.asarray(forces[1] - forces[0])

    def find_speed(self, data: mujoco.MjData) -> float:
        """Return the speed of the tendon, m/s."""
        gear = self.model.actuator_gear[self.actuator, 0]
        return float(data.actuator_velocity[self.actuator] / gear)


def find_cylinder(model: mujoco.MjModel, scene: Scene) -> FileCylinder | None:
    """Return the file's own cylinder if it has one and the scene is driven by one."""
    if not isinstance(scene.drive, LinearDrive):
        return None
    on_tendons = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    controlled = model.actuator_gainprm.any(axis=1)
    cylinders = np.flatnonzero(on_tendons & controlled)
    if len(cylinders) != 1:
        return None
    return FileCylinder(model, scene, int(cylinders[0]))


class LoopDrive:
    """Wrenches of a scene's drive on the bars of a loop, per N m or N that it exerts.

    The ground bears the opposite of each.
    """

    def __init__(self, model: mujoco.MjModel, loop: RobotLoop, scene: Scene) -> None:
        self.model = model
        self.loop = loop
        self.drive = scene.settled_drive()
        self.couple_bar = None if scene.drive is not None else scene.drive_bar
        """Bar on which a couple acts, if that is the drive."""

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
            pushed = [(self.drive.place.bar, force, place), (1, -force, place)]
        else:
            assert isinstance(self.drive, LinearDrive)
            ends = (self.drive.start, self.drive.end)
            (start, _), (end, _) = map(locate, ends)
            line = frame.in_plane(end - start) @ frame.axes
            force = line / np.linalg.norm(line)
            pushed = [(ends[0].bar, -force, start), (ends[1].bar, force, end)]
        return [
            _Wrench(bodies[bar][0], force, none, point) for bar, force, point in pushed
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
