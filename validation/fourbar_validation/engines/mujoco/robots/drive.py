"""The drive of a scene, as what it exerts on the bodies of a loop."""

import cmath
from typing import NamedTuple

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
    """What a scene's drive exerts on the bars of a loop, per N m or N.

    The ground bears the opposite. The file's own cylinder acts where the file has it,
    in the place of that of the scene.
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

    def _find_loads(self, data: mujoco.MjData) -> Array:
        """Return force and couple on each body, world axes, (nbody, 6), per N m or N.

        As MuJoCo has it, a force acts at the mass centre.
        """
        frame = LoopFrame(self.loop, data)
        loads = np.zeros((self.model.nbody, 6))
        ground, *_ = self.loop.bodies[1]
        if self.couple_bar is not None:
            loads[self.loop.bodies[self.couple_bar][0], 3:] = frame.normal
            loads[ground, 3:] = -frame.normal
            return loads

        def locate(place: Place) -> tuple[int, Array, complex]:
            """Return body and place in world axes, (3,), m, and its bar's direction."""
            line = frame.line(place.bar)
            unit = line / abs(line)
            pin = frame.locate(place.bar, FIRST_PIN[place.bar])
            body, *_ = self.loop.bodies[place.bar]
            return body, pin + frame.to_world(unit * complex(place.in_bar)), unit

        if isinstance(self.drive, PointDrive):
            body, start, unit = locate(self.drive.place)
            direction = cmath.rect(1.0, self.drive.direction)
            if self.drive.frame == "bar":
                direction *= unit
            force = frame.to_world(direction)
            pushed = ((body, start, force), (ground, start, -force))
        else:
            if self.cylinder is not None:
                start, end = data.site_xpos[self.cylinder.sites]
                first, second = self.model.site_bodyid[self.cylinder.sites].tolist()
                line = end - start
            else:
                assert isinstance(self.drive, LinearDrive)
                first, start, _ = locate(self.drive.start)
                second, end, _ = locate(self.drive.end)
                line = frame.in_plane(end - start) @ frame.axes
            force = line / np.linalg.norm(line)
            pushed = ((first, start, -force), (second, end, force))
        for body, point, one in pushed:
            arm = point - data.xipos[body]
            loads[body] += [*one, *np.cross(arm, one)]
        return loads

    def exert(self, data: mujoco.MjData, size: float) -> None:
        """Apply the drive with a size, N m or N, in the state that is placed."""
        data.xfrc_applied[:] = size * self._find_loads(data)

    def find_pull(self, data: mujoco.MjData) -> Array:
        """Return the generalized forces per N m or N, (nv,), in the state placed."""
        pull = np.zeros(self.model.nv)
        loads = self._find_loads(data)
        for body in np.flatnonzero(loads.any(axis=1)):
            force, couple = np.split(loads[body], 2)
            place = data.xipos[body]
            mujoco.mj_applyFT(self.model, data, force, couple, place, body, pull)
        return pull

    def find_speed(self, data: mujoco.MjData) -> float:
        """Return the speed that the drive's N m or N does work at, rad/s or m/s."""
        return float(self.find_pull(data) @ data.qvel)
