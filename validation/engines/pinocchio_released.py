"""Pinocchio's forward dynamics of a released linkage: constrained accelerations, stabilised, stepped by RK4."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from fourbar.effects import Gravity
from fourbar.scene import Scene, command
from validation.compare.answer import Array, Released
from validation.engines.loop import LimitWatch, Position
from validation.engines.pinocchio import PinocchioTree

NAME = "pinocchio-forward"
TIME_CONSTANT_STEPS = 10.0
"""Of Baumgarte's stabilisation, in timesteps: with 30 the loop is lost at a change point from h = 5 ms on."""
PROXIMAL = (1e-14, 1e-8, 10)
"""Accuracy, mu, iterations. With Pinocchio's default settings the planar loop, whose third row is redundant, is NaN."""
Acceleration = Callable[[Array, Array], Array]


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
        tree, start = PinocchioTree(scene), command(scene)
        q_0 = Position(tree).find(float(start.theta_2[0]), int(start.branch[0]))
        if q_0 is None:
            return Released.refused(NAME, setting, "the loop does not close at the start")
        jacobian, omega_2 = tree.jacobian(), scene.motion.omega_2 or 0.0
        q, v = np.array(q_0), np.array([omega_2, *np.linalg.solve(jacobian[:, 1:], -jacobian[:, 0] * omega_2)])
        acceleration = constrained(tree, self.step)
        rows, now, watch = [], 0.0, LimitWatch(int(start.branch[0]))
        for t in times:
            steps = math.ceil((t - now) / self.step - 1e-6)
            for taken in range(1, steps + 1):
                q, v = step(acceleration, q, v, (t - now) / steps)
                watch.look(now + taken * (t - now) / steps, q[0] + q[1], q[2])
            now = float(t)
            rows.append((q[0], v[0], pin.computeMechanicalEnergy(tree.model, tree.data, q, v)))
        theta_2, omega, energy = np.array(rows).T
        return Released(NAME, setting, theta_2, omega, energy, watch.stopped_at)


def constrained(tree: PinocchioTree, h: float) -> Acceleration:
    """Accelerations of the tree with its loop closed at B, stabilised for steps of h (s)."""
    ends = [(tree.joint[bar], tree.model.frames[tree.frame[f"end{bar}"]].placement) for bar in (3, 4)]
    loop = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D, tree.model, *ends[0], *ends[1], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    )
    tau = TIME_CONSTANT_STEPS * h
    loop.setBaumgarteCorrectorParameters(pin.BaumgarteCorrectorParameters(1.0 / tau**2, 2.0 / tau))
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    models.append(loop)
    datas.append(loop.createData())
    pin.initConstraintDynamics(tree.model, tree.data, models, datas)
    settings, none = pin.ProximalSettings(*PROXIMAL), np.zeros(3)

    def acceleration(q: Array, v: Array) -> Any:
        return pin.constraintDynamics(tree.model, tree.data, q, v, none, models, datas, settings).copy()

    return acceleration


def step(f: Acceleration, q: Array, v: Array, h: float) -> tuple[Array, Array]:
    """One step of the classical Runge-Kutta method."""
    a1 = f(q, v)
    v2 = v + 0.5 * h * a1
    a2 = f(q + 0.5 * h * v, v2)
    v3 = v + 0.5 * h * a2
    a3 = f(q + 0.5 * h * v2, v3)
    v4 = v + h * a3
    a4 = f(q + h * v3, v4)
    return q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
