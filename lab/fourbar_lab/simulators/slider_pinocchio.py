"""A slider-crank in Pinocchio: the tree that is open at B, built in code."""

import numpy as np
import pinocchio as pin

from fourbar.quantities import Array
from fourbar_lab.simulators.slider_engines import SliderBar

VERSION = pin.__version__


class PinocchioSlider:
    """The tree, with frames at the rod's end and the slider."""

    def __init__(
        self,
        bodies: list[SliderBar],
        lengths: tuple[float, float, float],
        field: Array,
        push: Array,
    ) -> None:
        crank, rod, offset = lengths
        self.model = pin.Model()
        self.push = push
        self.model.gravity = pin.Motion(np.array([*field, 0.0, 0.0, 0.0, 0.0]))
        joints = (
            (pin.JointModelRZ(), 0, (0.0, 0.0)),
            (pin.JointModelRZ(), 1, (crank, 0.0)),
            (pin.JointModelPX(), 0, (0.0, offset)),
        )
        for number, body in enumerate(bodies, 1):
            joint, parent, place = joints[number - 1]
            placement = pin.SE3(np.eye(3), np.array([*place, 0.0]))
            self.model.addJoint(parent, joint, placement, f"joint {number}")
            inertia = pin.Inertia(
                body.mass,
                np.array([*body.centre, 0.0]),
                np.diag([body.inertia] * 3),
            )
            self.model.appendBodyToJoint(number, inertia, pin.SE3.Identity())
        end = pin.SE3(np.eye(3), np.array([rod, 0.0, 0.0]))
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

    def gap(self) -> tuple[Array, Array, Array]:
        """Return the rod's end less the slider (2,), its Jacobian and its drift."""
        end, end_slope, end_drift = self._follow(self.frames[0])
        slider, slider_slope, slider_drift = self._follow(self.frames[1])
        return end - slider, end_slope - slider_slope, end_drift - slider_drift

    def _follow(self, frame: int) -> tuple[Array, Array, Array]:
        """Return place, Jacobian and acceleration of a frame in the plane."""
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        place = self.data.oMf[frame].translation
        jacobian = pin.getFrameJacobian(self.model, self.data, frame, axes)
        acceleration = pin.getFrameClassicalAcceleration(
            self.model,
            self.data,
            frame,
            axes,
        )
        return place[:2], jacobian[:2], acceleration.linear[:2]

    def inverse(self, a: Array) -> Array:
        """Return the joint forces of accelerations a, without the closing force."""
        return np.asarray(self._solve(a, np.zeros(2)))

    def borne(self, a: Array, closing: Array) -> tuple[Array, Array, Array]:
        """Return the force on crank, rod and slider by the body before, (2,), N."""
        self._solve(a, closing)
        forces = []
        for joint in (1, 2, 3):
            rotation = self.data.oMi[joint].rotation
            forces.append((rotation @ self.data.f[joint].linear)[:2])
        return forces[0], forces[1], forces[2]

    def _solve(self, a: Array, closing: Array) -> Array:
        """Return the generalized forces (3,) for the acceleration a, by RNEA.

        The closing force acts on the rod's end, its opposite and the load on the
        slider.
        """
        outside = [pin.Force.Zero() for _ in range(4)]
        for joint, force, frame in (
            (2, closing, self.frames[0]),
            (3, self.push - closing, self.frames[1]),
        ):
            turned = self.data.oMi[joint].rotation.T @ np.array([*force, 0.0])
            arm = self.model.frames[frame].placement.translation
            outside[joint] = pin.Force(turned, np.cross(arm, turned))
        return np.array(pin.rnea(self.model, self.data, self.q, self.v, a, outside))
