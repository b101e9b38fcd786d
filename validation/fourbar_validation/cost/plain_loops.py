"""Ask Pinocchio and MuJoCo as a user would: a plain loop over their own calls, for torque and pin forces alone.

Each position is assembled from the one before. With g(q) the gap at pin B and J = dg/dq, one
position takes Newton's steps on g, the speeds and accelerations of J v = 0 and
J a + (dJ/dt) v = 0, one inverse dynamics tau(q, v, a), and the multipliers of

    [J^T e_drive] [lambda; T] = tau.
"""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from fourbar.effects import Gravity
from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.description import list_speeds
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.inverse import MujocoTree
from fourbar_validation.engines.pinocchio import WORLD, PinocchioTree
from fourbar_validation.engines.tree import solve_closed, solve_multipliers

MOST_STEPS = 20
"""Newton's steps of one position; from its neighbour two or three are enough."""
SQUARES_AWAY = 1e-7
"""A step (rad) after which Newton's method, which squares it, is at round-off."""
AT_REST = np.zeros(3)


class PlainLoop:
    """The loop of one engine; a subclass asks the engine.

    Raises LimitError for a cylinder, and for friction that depends on the pin forces.
    """

    def __init__(self, tree: Any, scene: Scene) -> None:
        if scene.drive is not None:
            raise LimitError("the plain loop has a couple on a bar, no cylinder")
        if tree.loaded:
            raise LimitError("the plain loop does not iterate over loads of pins")
        self.tree, self.model, self.data = tree, tree.model, tree.data
        self.drive = tree.turns[scene.drive_bar]

    def answer(self, command: Command) -> dict[str, Array]:
        """Return the torque, (n,), and the pin forces, (n, 2)."""
        n = len(command.theta_2)
        torque = np.empty(n)
        forces = {name: np.empty((n, 2)) for name in PIN_FORCES}
        speeds, accelerations = (values.tolist() for values in list_speeds(command))
        start = Assembler(self.tree).find(
            float(command.theta_2[0]), int(command.branch[0])
        )
        if start is None:
            raise LimitError("the loop does not close at the first position")
        q = np.array(start)
        rates = np.zeros(3)
        for row, theta in enumerate(command.theta_2.tolist()):
            # along the motion from the position before
            q = q + rates * (theta - q[0])
            q[0] = theta
            jacobian = self.close(q)
            v = solve_closed(jacobian, speeds[row])
            rates = v / speeds[row]
            x, y = self.drift(q, v)
            a = solve_closed(jacobian, accelerations[row], x=x, y=y)
            needed = self.inverse(q, v, a)
            unknowns = solve_multipliers(jacobian, self.drive, needed)
            torque[row] = unknowns[2]
            self.read(unknowns[:2], {name: at[row] for name, at in forces.items()})
        return {"torque": torque, **forces}

    def close(self, q: Array) -> Array:
        """Close the gap by bars 3 and 4, in place; return the derivative of the gap there."""
        converged = False
        for _ in range(MOST_STEPS):
            x, y, jacobian = self.look(q)
            if converged:
                return jacobian
            (_, a, b), (_, c, d) = jacobian.tolist()
            determinant = a * d - b * c
            first = (b * y - d * x) / determinant
            second = (c * x - a * y) / determinant
            q[1] += first
            q[2] += second
            converged = abs(first) + abs(second) < SQUARES_AWAY
        raise LimitError("Newton's method did not close the loop")

    def look(self, q: Array) -> tuple[float, float, Array]:
        """Return the gap, m, and its derivative, (2, 3)."""
        raise NotImplementedError

    def drift(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the acceleration of the gap where the joints do not accelerate."""
        raise NotImplementedError

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Return the generalized forces that the motion needs beside loads and weights."""
        raise NotImplementedError

    def read(self, loop_force: Array, forces: dict[str, Array]) -> None:
        """Write the pin forces: those of the open tree, and the loop's force carried on to the ground."""
        raise NotImplementedError


class PinocchioLoop(PlainLoop):
    """Over Pinocchio's joint Jacobians, frame accelerations and rnea."""

    def __init__(self, scene: Scene) -> None:
        tree = PinocchioTree(scene)
        super().__init__(tree, scene)
        self.ends = tree.frame["end3"], tree.frame["end4"]
        self.at = [self.data.oMf[frame].translation for frame in self.ends]
        # what only weighs needs no forces from outside, and its field stays
        self.loaded = bool(scene.loads) or any(
            not isinstance(effect, Gravity) for effect in scene.effects
        )
        tree.act()
        self.model.gravity = pin.Motion(np.array([*tree.field, 0.0]), AT_REST)
        self.on = [
            (self.data.oMi[joint].rotation, self.data.f[joint].linear)
            for joint in (tree.joint[bar] for bar in MOVING_BARS)
        ]

    def look(self, q: Array) -> tuple[float, float, Array]:
        """Return the gap, m, and its derivative, (2, 3)."""
        model, data, (one, two) = self.model, self.data, self.ends
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        jacobian = (
            pin.getFrameJacobian(model, data, one, WORLD)[:2]
            - pin.getFrameJacobian(model, data, two, WORLD)[:2]
        )
        x, y, _ = (self.at[0] - self.at[1]).tolist()
        return x, y, jacobian

    def drift(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the acceleration of the gap where the joints do not accelerate."""
        model, data, (one, two) = self.model, self.data, self.ends
        pin.forwardKinematics(model, data, q, v, AT_REST)
        x, y, _ = (
            pin.getFrameClassicalAcceleration(model, data, one, WORLD).linear
            - pin.getFrameClassicalAcceleration(model, data, two, WORLD).linear
        ).tolist()
        return x, y

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Return the generalized forces that the motion needs beside what acts."""
        tree = self.tree
        if not self.loaded:
            return np.asarray(pin.rnea(self.model, self.data, q, v, a))
        tree.v, tree.a = v, a
        tree.act()
        for bar, (x, y, moment) in tree.wrenches.items():
            force, couple = tree.external_force[bar]
            (cosine, minus_sine), _ = tree.turned_to[bar].tolist()
            force[0] = cosine * x - minus_sine * y
            force[1] = minus_sine * x + cosine * y
            couple[2] = moment
        return np.asarray(pin.rnea(self.model, self.data, q, v, a, tree.external))

    def read(self, loop_force: Array, forces: dict[str, Array]) -> None:
        """Write the pin forces, the loop's force carried on to the ground."""
        on = [(rotation @ force)[:2] for rotation, force in self.on]
        _carry(loop_force, on, forces)


class MujocoInverseLoop(PlainLoop):
    """Over MuJoCo's kinematics, mj_jacDot and mj_inverse, with constraints off."""

    def __init__(self, scene: Scene) -> None:
        tree = MujocoTree(scene)
        super().__init__(tree, scene)
        self.ends = tree.site["end3"], tree.site["end4"]
        self.bodies = tree.body[3], tree.body[4]
        self.at = [self.data.site_xpos[site] for site in self.ends]
        self.jacobians = np.zeros((2, 3, 3))
        self.rates = np.zeros((2, 3, 3))

    def look(self, q: Array) -> tuple[float, float, Array]:
        """Return the gap, m, and its derivative, (2, 3)."""
        model, data = self.model, self.data
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for site, jacobian in zip(self.ends, self.jacobians, strict=True):
            mujoco.mj_jacSite(model, data, jacobian, None, site)
        x, y, _ = (self.at[0] - self.at[1]).tolist()
        return x, y, self.jacobians[0, :2] - self.jacobians[1, :2]

    def drift(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the acceleration of the gap where the joints do not accelerate."""
        model, data = self.model, self.data
        data.qvel[:] = v
        mujoco.mj_comVel(model, data)
        for end, rate, body in zip(self.at, self.rates, self.bodies, strict=True):
            mujoco.mj_jacDot(model, data, rate, None, end, body)
        x, y, _ = ((self.rates[0] - self.rates[1]) @ v).tolist()
        return x, y

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        """Return the generalized forces that the motion needs beside what acts."""
        self.data.qacc[:], self.tree.v, self.tree.a = a, v, a
        return np.asarray(self.tree.torques())

    def read(self, loop_force: Array, forces: dict[str, Array]) -> None:
        """Write the pin forces, the loop's force carried on to the ground."""
        _carry(loop_force, list(self.tree.carried().values()), forces)


PLAIN_LOOPS: dict[str, Callable[[Scene], PlainLoop]] = {
    "Pinocchio, rnea and multipliers": PinocchioLoop,
    "MuJoCo, mj_inverse and multipliers": MujocoInverseLoop,
}
"""The loops by the names that tables and pictures give them."""


def _carry(loop_force: Array, on: list[Array], forces: dict[str, Array]) -> None:
    """Put the loop's force into the forces on bars 2, 3 and 4 at their first pins."""
    forces["F43"][:] = loop_force
    forces["F12"][:] = on[0] - loop_force
    forces["F32"][:] = loop_force - on[1]
    forces["F14"][:] = on[2] + loop_force
