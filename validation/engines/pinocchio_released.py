"""Pinocchio's forward dynamics of a released linkage, with a fixed step."""

import math

import numpy as np
import pinocchio as pin

from fourbar.effects import Gravity
from fourbar.scene import Scene, command
from validation.compare.answer import Array, Released
from validation.engines.loop import LimitWatch
from validation.engines.pinocchio import PinocchioTree
from validation.engines.pinocchio_closed import ClosedTree, step

NAME = "pinocchio-forward"
TIME_CONSTANT_STEPS = 10.0
"""Of Baumgarte's stabilisation, in timesteps: with 30 the loop is lost at a change point from h = 5 ms on."""


class PinocchioReleased:
    """Free motion of the closed loop with a fixed step, s."""

    name = NAME

    def __init__(self, step: float = 2e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> Released:
        """The motion at the given times, rising from 0 (s)."""
        setting = f"RK4 {self.step:g} s"
        if scene.loads or any(not isinstance(effect, Gravity) for effect in scene.effects):
            return Released.refused(NAME, setting, "in forward dynamics only gravity has a model here")
        tree, start, none = PinocchioTree(scene), command(scene), np.zeros(3)
        loop, watch = ClosedTree(tree, TIME_CONSTANT_STEPS * self.step), LimitWatch(int(start.branch[0]))
        state = loop.start(float(start.theta_2[0]), int(start.branch[0]), scene.motion.omega_2 or 0.0)
        if state is None:
            return Released.refused(NAME, setting, "the loop does not close at the start")
        (q, v), rows, now = state, [], 0.0
        for t in times:
            steps = math.ceil((t - now) / self.step - 1e-6)
            for taken in range(1, steps + 1):
                q, v = step(lambda q, v: loop.acceleration(q, v, none), q, v, (t - now) / steps)
                watch.look(now + taken * (t - now) / steps, q[0] + q[1], q[2])
            now = float(t)
            energy, data = pin.computeMechanicalEnergy(tree.model, tree.data, q, v), tree.data
            rows.append((q[0], v[0], energy, data.kinetic_energy + abs(data.potential_energy)))
        theta_2, omega, energy, terms = np.array(rows).T
        return Released(NAME, setting, theta_2, omega, energy, terms, watch.stopped_at)
