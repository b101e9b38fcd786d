"""A plain loop over MuJoCo's own calls."""

import mujoco
import numpy as np

from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.inverse import MujocoTree
from fourbar_validation.engines.plain_loop import PlainLoop


class MujocoInverseLoop(PlainLoop):
    """Over MuJoCo's kinematics, mj_jacDot and mj_inverse, with constraints off."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(MujocoTree, scene)
        tree = self.tree
        self.ends = tree.site["end3"], tree.site["end4"]
        self.bodies = tree.body[3], tree.body[4]
        self.at = [self.data.site_xpos[site] for site in self.ends]
        self.jacobians = np.zeros((2, 3, 3))
        self.rates = np.zeros((2, 3, 3))

    def look(self, q: Array) -> tuple[float, float, Array]:
        """Return the gap, m, and its derivative, (2, 3)."""
        model = self.model
        data = self.data
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for site, jacobian in zip(self.ends, self.jacobians, strict=True):
            mujoco.mj_jacSite(model, data, jacobian, None, site)
        x, y, _ = (self.at[0] - self.at[1]).tolist()
        return x, y, self.jacobians[0, :2] - self.jacobians[1, :2]

    def drift(self, q: Array, v: Array) -> tuple[float, float]:
        """Return the acceleration of the gap where the joints do not accelerate."""
        model = self.model
        data = self.data
        data.qvel[:] = v
        mujoco.mj_comVel(model, data)
        for end, rate, body in zip(self.at, self.rates, self.bodies, strict=True):
            mujoco.mj_jacDot(model, data, rate, None, end, body)
        x, y, _ = ((self.rates[0] - self.rates[1]) @ v).tolist()
        return x, y

    def inverse(self, q: Array, v: Array, a: Array) -> list[float]:
        """Return the generalized forces that the motion needs beside what acts."""
        self.data.qacc[:] = a
        self.tree.v = v
        self.tree.a = a
        torques: list[float] = self.tree.torques()
        return torques
