"""Pinocchio: recursive Newton-Euler on the open tree, its own kinematics, the loop closed by multipliers."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from fourbar.errors import LimitError
from fourbar.scene import Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.description import FIRST_PIN, find_unknown, list_parts, rotate_by
from fourbar_validation.engines.effects import TERM_OF, list_acting
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.tree import Tree

WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioTree(Tree):
    """The open tree, built from the description."""

    def __init__(self, scene: Scene) -> None:
        if reason := find_unknown(scene, TERM_OF, linear=True):
            raise LimitError(reason)
        self.model = model = pin.Model()
        self.joint, self.frame = {1: 0}, dict[str, int]()
        for part in list_parts(scene.linkage):
            joint = model.addJoint(
                self.joint[part.bearer], pin.JointModelRZ(), _place_at(*part.first_pin), FIRST_PIN[part.bar]
            )
            self.joint[part.bar] = joint
            # nothing is appended, no frame either: below 2.2e-16 kg the sum of two inertias has another mass centre
            about_g = np.diag([0.0, 0.0, part.inertia])
            model.inertias[joint] = pin.Inertia(part.mass, np.array([*part.centre, 0.0]), about_g)
            for name, at in part.points.items():
                self.frame[name] = model.addFrame(
                    pin.Frame(name, joint, 0, _place_at(*at), pin.FrameType.OP_FRAME), False
                )
        self.data = data = model.createData()
        self.q = np.zeros(3)
        self.external = pin.StdVec_Force([pin.Force.Zero()] * model.njoints)
        # the engine's own memory, read and written in place: to look it up again costs more than a pass of the engine
        self.at = {name: data.oMf[frame].translation[:2] for name, frame in self.frame.items()}
        self.turned_to = {bar: data.oMi[joint].rotation[:2, :2] for bar, joint in self.joint.items()}
        self.joint_force = {bar: data.f[joint].linear[:2] for bar, joint in self.joint.items()}
        self.external_force = {
            bar: (self.external[joint].linear, self.external[joint].angular) for bar, joint in self.joint.items()
        }
        self.ready(scene, list_acting(scene, self))
        self._weigh(self.field)

    def _weigh(self, field: tuple[float, float]) -> None:
        self.model.gravity = pin.Motion(np.array([*field, 0.0]), np.zeros(3))

    def place(self, q: Sequence[float]) -> None:
        """Joint frames, Jacobian columns and points at q."""
        self.q[:] = q
        pin.computeJointJacobians(self.model, self.data, self.q)
        pin.updateFramePlacements(self.model, self.data)

    def point(self, name: str) -> Array:
        """Place of a frame."""
        return np.asarray(self.at[name])

    def rotation(self, bar: int) -> Array:
        """Return that of the joint."""
        return np.asarray(self.turned_to[bar])

    def point_jacobian(self, name: str) -> Array:
        """Return that of a frame."""
        return np.array(pin.getFrameJacobian(self.model, self.data, self.frame[name], WORLD)[:2])

    def turn(self, bar: int) -> Array:
        """Last row of the bar's frame Jacobian."""
        return np.array(pin.getFrameJacobian(self.model, self.data, self.frame[f"G{bar}"], WORLD)[5])

    def set_motion(self, v: Array, a: Array) -> None:
        """Forward kinematics."""
        pin.forwardKinematics(self.model, self.data, self.q, v, a)

    def acceleration(self, name: str) -> Array:
        """Return that of a frame."""
        motion = pin.getFrameClassicalAcceleration(self.model, self.data, self.frame[name], WORLD)
        return np.array(motion.linear[:2])

    def needed(self, field: tuple[float, float], wrenches: dict[int, list[float]]) -> Array:
        """Recursive Newton-Euler with what acts on the bars as external forces."""
        self._weigh(field)
        for bar, (x, y, moment) in wrenches.items():
            force, couple = self.external_force[bar]
            force[:2] = rotate_by(self.rotation(bar).T.tolist(), x, y)
            couple[2] = moment
        return np.array(pin.rnea(self.model, self.data, self.q, self.v, self.a, self.external))

    def carried(self) -> dict[int, Array]:
        """Compute what each joint transmits in one more pass."""
        self.needed(self.field, self.wrenches)
        return {bar: self.rotation(bar) @ self.joint_force[bar] for bar in self.wrenches}


PinocchioInverse = partial(Exact, "pinocchio-inverse", PinocchioTree)


def _place_at(x: float, y: float) -> Any:
    return pin.SE3(np.eye(3), np.array([x, y, 0.0]))
