"""Pinocchio's forward dynamics of the closed loop: constrained accelerations, Baumgarte's stabilisation, RK4."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from validation.compare.answer import Array
from validation.engines.loop import Position
from validation.engines.pinocchio import PinocchioTree
from validation.engines.tree import closed

PROXIMAL = (1e-14, 1e-8, 10)
"""Accuracy, mu, iterations. With the default mu = 0 every acceleration is NaN: of the three rows of the closure only
two are independent in the plane."""
Acceleration = Callable[[Array, Array], Array]


class ClosedTree:
    """A tree with its loop closed at B.

    Parameters
    ----------
    time_constant : of the stabilisation, s: Kp = 1/tc^2 and Kd = 2/tc.
    """

    def __init__(self, tree: PinocchioTree, time_constant: float) -> None:
        self.tree = tree
        ends = [(tree.joint[bar], tree.model.frames[tree.frame[f"end{bar}"]].placement) for bar in (3, 4)]
        closure = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, tree.model, *ends[0], *ends[1], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        gains = pin.BaumgarteCorrectorParameters(1.0 / time_constant**2, 2.0 / time_constant)
        closure.setBaumgarteCorrectorParameters(gains)
        self.models, self.found = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        self.models.append(closure)
        self.found.append(closure.createData())
        self.data = tree.model.createData()
        pin.initConstraintDynamics(tree.model, self.data, self.models, self.found)
        self.proximal = pin.ProximalSettings(*PROXIMAL)

    def start(self, theta_2: float, branch: int, omega_2: float) -> tuple[Array, Array] | None:
        """Assembled, at the speeds that keep the loop closed; None where it does not close."""
        q = Position(self.tree).find(theta_2, branch)
        return None if q is None else (np.array(q), closed(self.tree.jacobian(), omega_2))

    def acceleration(self, q: Array, v: Array, tau: Array) -> Any:
        """Under gravity and generalised forces."""
        model, data = self.tree.model, self.data
        return pin.constraintDynamics(model, data, q, v, tau, self.models, self.found, self.proximal).copy()

    def loop_force(self) -> Array:
        """F43 of the acceleration last found, (2,), N."""
        return np.array(self.found[0].contact_force.linear[:2])


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
