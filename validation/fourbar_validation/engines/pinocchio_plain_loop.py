"""A plain loop over Pinocchio's own calls."""

import pinocchio as pin

from fourbar.effects import Gravity
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.pinocchio import WORLD, PinocchioTree
from fourbar_validation.engines.plain_loop import PlainLoop
from fourbar_validation.engines.tree import NO_RATES


class PinocchioLoop(PlainLoop):
    """Over Pinocchio's joint Jacobians, frame accelerations and rnea."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(PinocchioTree, scene)
        tree = self.tree
        self.ends = tree.frame["end3"], tree.frame["end4"]
        self.at = [self.data.oMf[frame].translation for frame in self.ends]
        # what only weighs needs no forces from outside, and its field stays
        self.loaded = bool(scene.loads) or any(
            not isinstance(effect, Gravity) for effect in scene.effects
        )
        tree.act()
        tree.model_gravity[:2] = tree.field

    def look(self, q: Array) -> tuple[float, float, Array]:
        """Return the gap, m, and its derivative, (2, 3)."""
        model = self.model
        data = self.data
        one, two = self.ends
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
        model = self.model
        data = self.data
        one, two = self.ends
        pin.forwardKinematics(model, data, q, v, NO_RATES)
        x, y, _ = (
            pin.getFrameClassicalAcceleration(model, data, one, WORLD).linear
            - pin.getFrameClassicalAcceleration(model, data, two, WORLD).linear
        ).tolist()
        return x, y

    def inverse(self, q: Array, v: Array, a: Array) -> list[float]:
        """Return the generalized forces that the motion needs beside what acts."""
        tree = self.tree
        torques: list[float]
        if not self.loaded:
            torques = pin.rnea(self.model, self.data, q, v, a).tolist()
            return torques
        tree.v = v
        tree.a = a
        tree.act()
        for bar, (x, y, moment) in tree.wrenches.items():
            force, couple = tree.external_force[bar]
            (cosine, minus_sine), _ = tree.turned_to[bar].tolist()
            force[0] = cosine * x - minus_sine * y
            force[1] = minus_sine * x + cosine * y
            couple[2] = moment
        torques = pin.rnea(self.model, self.data, q, v, a, tree.external).tolist()
        return torques
