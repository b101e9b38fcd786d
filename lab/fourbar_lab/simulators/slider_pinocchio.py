"""A slider-crank in Pinocchio: the tree that is open at B, built in code."""

import numpy as np
import pinocchio as pin

from fourbar.quantities import Array
from fourbar_lab.simulators.slider_engines import SliderCrank

VERSION = pin.__version__


class PinocchioSlider:
    """The tree, with frames at the rod's end and the slider."""

    def __init__(self, linkage: SliderCrank) -> None:
        self.model = pin.Model()
        gravity = np.array([*linkage.gravity, 0.0, 0.0, 0.0, 0.0])
        self.model.gravity = pin.Motion(gravity)
        joints = (
            (pin.JointModelRZ(), 0, (0.0, 0.0)),
            (pin.JointModelRZ(), 1, (linkage.crank, 0.0)),
            (pin.JointModelPX(), 0, (0.0, linkage.offset)),
        )
        stated = zip(joints, linkage.bars, strict=True)
        for number, ((joint, parent, place), body) in enumerate(stated, 1):
            placement = pin.SE3(np.eye(3), np.array([*place, 0.0]))
            self.model.addJoint(parent, joint, placement, f"joint {number}")
            inertia = pin.Inertia(
                body.mass,
                np.array([*body.centre, 0.0]),
                np.diag([body.inertia] * 3),
            )
            self.model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
        end = pin.SE3(np.eye(3), np.array([linkage.rod, 0.0, 0.0]))
        self.frames = []
        for joint, place in ((2, end), (3, pin.SE3.Identity())):
            frame = pin.Frame(f"B{joint}", joint, 0, place, pin.FrameType.OP_FRAME)
            self.frames.append(self.model.addFrame(frame))
        self.data = self.model.createData()

    def set(self, q: Array, v: Array) -> None:
        """Set positions and speeds of crank, rod and slider, (3,), rad and m."""
        self.q = q.copy()
        self.v = v.copy()
        pin.forwardKinematics(self.model, self.data, self.q, self.v, np.zeros(3))
        pin.computeJointJacobians(self.model, self.data, self.q)
        pin.updateFramePlacements(self.model, self.data)

    def follow(self, end: int) -> tuple[Array, Array, Array]:
        """Return place, Jacobian and drift of an end of the cut."""
        at = (self.model, self.data, self.frames[end])
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        place = self.data.oMf[self.frames[end]].translation
        jacobian = pin.getFrameJacobian(*at, axes)
        acceleration = pin.getFrameClassicalAcceleration(*at, axes)
        return place[:2].copy(), jacobian[:2], acceleration.linear[:2]

    def inverse(self, a: Array) -> Array:
        """Return the joint forces of accelerations a, with no force at the cut."""
        return np.array(pin.rnea(self.model, self.data, self.q, self.v, a))

    def borne(self, a: Array, on_ends: tuple[Array, Array]) -> list[Array]:
        """Return the force on crank, rod and slider by the body before, (2,), N."""
        outside = [pin.Force.Zero() for _ in range(4)]
        for joint, force, frame in zip((2, 3), on_ends, self.frames, strict=True):
            turned = self.data.oMi[joint].rotation.T @ np.array([*force, 0.0])
            arm = self.model.frames[frame].placement.translation
            outside[joint] = pin.Force(turned, np.cross(arm, turned))
        pin.rnea(self.model, self.data, self.q, self.v, a, outside)
        return [
            (self.data.oMi[joint].rotation @ self.data.f[joint].linear)[:2]
            for joint in (1, 2, 3)
        ]
