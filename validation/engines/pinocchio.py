"""Pinocchio: recursive Newton-Euler on the open tree, its own kinematics, the loop closed by multipliers."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from fourbar.linkage import MOVING_BARS
from fourbar.scene import Command, Scene
from validation.compare.answer import Answer, Array
from validation.engines import description
from validation.engines.effects import Pushed, acting, unknown_effect
from validation.engines.loop import answer_exactly, turned_by, turned_ground

NAME = "pinocchio-inverse"
WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioInverse:
    """Inverse dynamics with loop multipliers."""

    name = NAME

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its answer, or the refusal that names an effect it does not know."""
        if (reason := unknown_effect(scene)) is not None:
            return Answer(NAME, "exact", refusal=reason)
        return answer_exactly(NAME, PinocchioTree, scene, command)


class PinocchioTree(Pushed):
    """The open tree, built from the description."""

    def __init__(self, scene: Scene) -> None:
        linkage = scene.linkage
        self.model = model = pin.Model()
        model.gravity = pin.Motion.Zero()
        theta_1, d = linkage.ground_angle, linkage.ground
        foot = {2: (0.0, 0.0), 3: (linkage.input.length, 0.0), 4: (d * math.cos(theta_1), d * math.sin(theta_1))}
        self.joint = {1: 0}
        self.frame: dict[str, int] = {}
        for bar in MOVING_BARS:
            parent = self.joint[2] if bar == 3 else 0
            joint = model.addJoint(parent, pin.JointModelRZ(), _at(*foot[bar]), description.FIRST_PIN[bar])
            self.joint[bar] = joint
            part = linkage.bar(bar)
            r, phi = description.centre(part)
            centre = _at(r * math.cos(phi), r * math.sin(phi))
            inertia = pin.Inertia(part.mass, centre.translation, np.diag([0.0, 0.0, description.inertia(part)]))
            model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
            self._add_frame(f"G{bar}", joint, centre)
            self._add_frame(f"end{bar}", joint, _at(part.length, 0.0))
        self.data = data = model.createData()
        self.q = np.zeros(3)
        self.v = np.zeros(3)
        self.a = np.zeros(3)
        self.external = pin.StdVec_Force([pin.Force.Zero()] * model.njoints)
        # the engine's own memory, read and written in place: to look it up again costs more than a pass of the engine
        self.at = {name: data.oMf[frame].translation[:2] for name, frame in self.frame.items()}
        self.first_pin = {bar: data.oMi[joint].translation[:2] for bar, joint in self.joint.items()}
        self.rotation = {bar: data.oMi[joint].rotation[:2, :2] for bar, joint in self.joint.items()}
        self.spin = {bar: (data.v[joint].angular, data.a[joint].angular) for bar, joint in self.joint.items()}
        self.joint_force = {bar: data.f[joint].linear[:2] for bar, joint in self.joint.items()}
        self.external_force = {
            bar: (self.external[j].linear, self.external[j].angular) for bar, j in self.joint.items()
        }
        self.ground_angle = theta_1
        self.pin_loads: dict[str, float] = {}
        self.acting = acting(scene, self)

    def _add_frame(self, name: str, joint: int, placement: Any) -> None:
        frame = pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME)
        self.frame[name] = self.model.addFrame(frame)

    def place(self, q: Sequence[float]) -> None:
        """Joint frames, Jacobian columns and points at q."""
        self.q[:] = q
        pin.computeJointJacobians(self.model, self.data, self.q)
        pin.updateFramePlacements(self.model, self.data)

    def point(self, name: str) -> Array:
        """A point fixed in a bar, world axes, (2,)."""
        return np.array(self.at[name])

    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4."""
        x, y = (self.at["end3"] - self.at["end4"]).tolist()
        return x, y

    def jacobian(self) -> Array:
        """Difference of the two frame Jacobians."""
        ends = (self.frame["end3"], self.frame["end4"])
        on_3, on_4 = (pin.getFrameJacobian(self.model, self.data, end, WORLD) for end in ends)
        return np.asarray((on_3 - on_4)[:2])

    def turn(self, bar: int) -> Array:
        """Last row of the bar's frame Jacobian."""
        return np.array(pin.getFrameJacobian(self.model, self.data, self.frame[f"G{bar}"], WORLD)[5])

    def positions(self) -> dict[str, Array]:
        """Points of the bars."""
        where = {name: self.point(name) for name in ("G2", "G3", "G4")}
        where.update(A=self.foot(3), O4=self.foot(4), B=self.point("end3"), B4=self.point("end4"))
        return where

    def gravity(self, vector: tuple[float, float]) -> None:
        """The model's own gravity."""
        self.model.gravity = pin.Motion(np.array([*vector, 0.0]), np.zeros(3))

    def centre(self, bar: int) -> Array:
        """Mass centre of a bar, from its frame."""
        return self.point(f"G{bar}")

    def turned(self, bar: int, x: float, y: float) -> Array:
        """A vector of a bar in world axes, by the joint's rotation."""
        if bar == 1:
            return turned_ground(self.ground_angle, x, y)
        return turned_by(self.rotation[bar].tolist(), x, y)

    def pin_load(self, pin: str) -> float:
        """Pin force of the last pass; none before the first."""
        return self.pin_loads.get(pin, 0.0)

    def foot(self, bar: int) -> Array:
        """First pin of a bar, (2,)."""
        return np.array(self.first_pin[bar])

    def angle(self, bar: int) -> float:
        """From the rotation matrix; the ground's line as described."""
        if bar == 1:
            return self.ground_angle
        rotation = self.rotation[bar]
        return math.atan2(rotation[1, 0], rotation[0, 0])

    def drift(self, v: Array) -> Array:
        """Difference of the two frames' accelerations where a = 0."""
        pin.forwardKinematics(self.model, self.data, self.q, v, np.zeros(3))
        return self._acceleration("end3") - self._acceleration("end4")

    def _acceleration(self, name: str) -> Array:
        motion = pin.getFrameClassicalAcceleration(self.model, self.data, self.frame[name], WORLD)
        return np.array(motion.linear[:2])

    def velocity(self, bar: int) -> float:
        """Spin of the joint frame; the ground has none."""
        return float(self.spin[bar][0][2])

    def alpha(self, bar: int) -> float:
        """Angular acceleration of the joint frame; the ground has none."""
        return float(self.spin[bar][1][2])

    def torques(self, v: Array, a: Array) -> Array:
        """Recursive Newton-Euler with what acts on the bars as external forces."""
        self.v, self.a = v, a
        pin.forwardKinematics(self.model, self.data, self.q, v, a)
        self.act(self.acting)
        return np.array(self._newton_euler())

    def inertial(self, v: Array, a: Array) -> Array:
        """Recursive Newton-Euler without gravity."""
        gravity = pin.Motion(self.model.gravity)
        self.model.gravity = pin.Motion.Zero()
        needed = np.array(pin.rnea(self.model, self.data, self.q, v, a))
        self.model.gravity = gravity
        return needed

    def _newton_euler(self) -> Any:
        for bar, (x, y, moment) in self.wrenches.items():
            force, couple = self.external_force[bar]
            force[:2] = turned_by(self.rotation[bar].T.tolist(), x, y)
            couple[2] = moment
        return pin.rnea(self.model, self.data, self.q, self.v, self.a, self.external)

    def accelerations(self) -> dict[str, Array]:
        """Accelerations of the points, from the frames."""
        ends = {"A": "end2", "B": "end4", "G2": "G2", "G3": "G3", "G4": "G4"}
        return {name: self._acceleration(frame) for name, frame in ends.items()}

    def forces(self, loop_force: Array) -> dict[str, Array]:
        """What each joint transmits in a second pass with the loop force put back."""
        self.push(3, loop_force, self.point("end3"))
        self.push(4, -loop_force, self.point("end4"))
        self._newton_euler()
        on = {bar: self.rotation[bar] @ self.joint_force[bar] for bar in MOVING_BARS}
        return {"F12": on[2], "F32": -on[3], "F14": on[4]}


def _at(x: float, y: float) -> Any:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))
