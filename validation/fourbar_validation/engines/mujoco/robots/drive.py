"""The drive of a scene, as what it exerts on the bodies of a loop."""

import cmath

import mujoco
import numpy as np

from fourbar.effects import LinearDrive, PointDrive
from fourbar.effects.place import Place
from fourbar.linkage import FIRST_PIN
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.robots.ancestry import list_wraps, take_control
from fourbar_validation.engines.mujoco.robots.loop_facts import RobotLoop
from fourbar_validation.engines.mujoco.robots.seen import LoopFrame

_SITE = mujoco.mjtWrap.mjWRAP_SITE


def find_cylinder(model: mujoco.MjModel, loop: RobotLoop) -> list[int]:
    """Return the motor between two sites of two bars, if a loop has exactly one."""
    cylinders = []
    on_tendons = model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
    for number in np.flatnonzero(on_tendons & take_control(model)).tolist():
        wraps = [*list_wraps(model, model.actuator_trnid[number, 0])]
        sites = [site for kind, site, _ in wraps if kind == _SITE]
        bars = {loop.bars[body] for body in model.site_bodyid[sites]} - {None}
        if len(wraps) == len(bars) == 2:
            cylinders.append(number)
    return cylinders if len(cylinders) == 1 else []


class LoopDrive:
    """What a scene's drive exerts on the bars of a loop, per N m or N.

    The ground bears the opposite. The file's own cylinder acts where the file has it,
    in the place of that of the scene.
    """

    def __init__(
        self, model: mujoco.MjModel, loop: RobotLoop, scene: Scene | None
    ) -> None:
        """Take the drive of a scene; None: a couple on bar 2."""
        self.model = model
        self.loop = loop
        self.force = None if scene is None else scene.settled_drive()
        """None: the drive is a couple."""
        self.couple_bar = 2 if scene is None else scene.drive_bar
        self.cylinders: list[int] = []
        """Actuator of the file between two sites that drives, if it has exactly one."""
        if isinstance(self.force, LinearDrive):
            self.cylinders = find_cylinder(model, loop)
        self.sites = [
            site
            for number in self.cylinders
            for _, site, _ in list_wraps(model, model.actuator_trnid[number, 0])
        ]

    def _find_loads(self, data: mujoco.MjData) -> Array:
        """Return force and couple on each body, world axes, (nbody, 6), per N m or N.

        As MuJoCo has it, a force acts at the mass centre.
        """
        frame = LoopFrame(self.loop, data)
        loads = np.zeros((self.model.nbody, 6))
        ground, *_ = self.loop.bodies[1]
        if self.force is None:
            loads[self.loop.bodies[self.couple_bar][0], 3:] = frame.normal
            loads[ground, 3:] = -frame.normal
            return loads

        def locate(place: Place) -> tuple[int, Array]:
            """Return the body of a place, and the place in world axes, (3,), m."""
            line = frame.line(place.bar)
            pin = frame.locate(place.bar, FIRST_PIN[place.bar])
            arm = frame.to_world(line / abs(line) * complex(place.in_bar))
            return self.loop.bodies[place.bar][0], pin + arm

        if isinstance(self.force, PointDrive):
            second, end = locate(self.force.place)
            first = ground
            start = end
            direction = self.force.direction
            if self.force.frame == "bar":
                direction += frame.angle(self.force.place.bar)
            line = frame.to_world(cmath.rect(1.0, direction))
        elif self.cylinders:
            start, end = data.site_xpos[self.sites]
            first, second = self.model.site_bodyid[self.sites].tolist()
            line = end - start
        else:
            assert isinstance(self.force, LinearDrive)
            first, start = locate(self.force.start)
            second, end = locate(self.force.end)
            line = frame.in_plane(end - start) @ frame.axes
        force = line / np.linalg.norm(line)
        for body, point, one in ((first, start, -force), (second, end, force)):
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
