"""Pinocchio's forward dynamics of the closed loop through time: RK4, Baumgarte's stabilisation, a flywheel."""

import time
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from fourbar.errors import LimitError
from fourbar.mjcf import Settings, flywheel, run_through
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene
from validation.compare.answer import Array
from validation.engines.loop import Position
from validation.engines.pinocchio import PinocchioTree

PROXIMAL = (1e-14, 1e-8, 10)
"""Accuracy, mu, iterations. With the default mu = 0 every acceleration is NaN: of the three rows of
the closure only two are independent in the plane."""


@dataclass(slots=True, eq=False)
class Forward:
    """What one run gave."""

    at: Command
    quantities: dict[str, Array]
    steps: int
    steps_per_revolution: float
    stepping: float
    """CPU seconds in steps."""


class PinocchioForward:
    """One scene, driven at omega_2 by a flywheel, stepped with the classical Runge-Kutta method.

    Parameters
    ----------
    time_constant_steps : Kp = 1/tc^2 and Kd = 2/tc of the stabilisation, tc in steps.
    """

    def __init__(self, scene: Scene, command: Command, steps_per_revolution: float, time_constant_steps: float) -> None:
        self.omega, self.alpha = float(np.max(command.omega_2)), float(np.max(command.alpha_2))  # type: ignore[arg-type]
        self.scene, self.command = scene, command
        self.run = run_through(command.theta_2, self.omega, self.alpha)
        settings = Settings(steps_per_revolution=steps_per_revolution, steps_per_window=1)
        self.h = self.run.timestep(settings)
        self.tree = PinocchioTree(scene)
        model = self.tree.model
        self.armature = flywheel(scene, settings)
        model.armature = np.array([self.armature, 0.0, 0.0])
        ends = [model.frames[self.tree.frame[name]] for name in ("end3", "end4")]
        closure = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            model,
            *(part for end in ends for part in (end.parentJoint, end.placement)),
            pin.ReferenceFrame.LOCAL,
        )
        tc = time_constant_steps * self.h
        closure.m_baumgarte_parameters.Kp, closure.m_baumgarte_parameters.Kd = 1.0 / tc**2, 2.0 / tc
        self.closures = pin.StdVec_RigidConstraintModel()
        self.closures.append(closure)
        self.found = pin.StdVec_RigidConstraintData()
        self.found.append(closure.createData())
        self.data = model.createData()
        pin.initConstraintDynamics(model, self.data, self.closures, self.found)
        self.proximal = pin.ProximalSettings(*PROXIMAL)

    def acceleration(self, q: Array, v: Array) -> Array:
        """Of the closed loop under loads, effects and the flywheel's motor."""
        tree = self.tree
        tau = np.array([self.armature * self.alpha, 0.0, 0.0])
        if tree.acting:
            zero = np.zeros(3)
            tree.place(q)  # type: ignore[arg-type]
            # what acts, as generalised forces: the difference it makes to inverse dynamics
            acted = np.array(tree.torques(v, zero))
            tau += np.array(pin.rnea(tree.model, tree.data, q, v, zero)) - acted
        a = pin.constraintDynamics(tree.model, self.data, q, v, tau, self.closures, self.found, self.proximal)
        return np.array(a)

    def step(self, q: Array, v: Array) -> tuple[Array, Array]:
        """One step of the classical Runge-Kutta method."""
        h, a1 = self.h, self.acceleration(q, v)
        v2 = v + h / 2 * a1
        a2 = self.acceleration(q + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = self.acceleration(q + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = self.acceleration(q + h * v3, v4)
        return q + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def forward(self) -> Forward:
        """Run through the positions; each is read at the step nearest to it."""
        order = np.argsort(self.command.theta_2 if self.omega > 0.0 else -self.command.theta_2, kind="stable")
        first = int(order[0])
        start = Position(self.tree).find(float(self.command.theta_2[first]), int(self.command.branch[first]))
        if start is None:
            raise LimitError("the loop does not close at the first position")
        q = np.array(start)
        jacobian = self.tree.jacobian()
        v = np.array([self.omega, *np.linalg.solve(jacobian[:, 1:], -jacobian[:, 0] * self.omega)])
        n, done, stepping = len(order), 0, 0.0
        motion = {name: np.full(n, np.nan) for name in ("theta_2", "omega_2", "alpha_2", "torque")}
        forces = {name: np.full((n, 2), np.nan) for name in PIN_FORCES}
        for row, index in enumerate(order):
            target = round(self.run.time(float(self.command.theta_2[index])) / self.h)
            began = time.process_time()
            while done < target:
                q, v = self.step(q, v)
                done += 1
            stepping += time.process_time() - began
            if not np.isfinite(q).all():
                break
            a = self.acceleration(q, v)
            motion["theta_2"][row], motion["omega_2"][row], motion["alpha_2"][row] = q[0], v[0], a[0]
            motion["torque"][row], read = self._read(q, v, a)
            for name, force in read.items():
                forces[name][row] = force
        at = Command(motion["theta_2"], self.command.branch[order], motion["omega_2"], motion["alpha_2"])
        revolution = 2.0 * np.pi / self.run.fastest / self.h
        return Forward(at, {"torque": motion["torque"], **forces}, done, revolution, stepping)

    def _read(self, q: Array, v: Array, a: Array) -> tuple[float, dict[str, Array]]:
        """Torque and pin forces at a state, with the multiplier of the closure that the engine found."""
        tree = self.tree
        tree.place(q)  # type: ignore[arg-type]
        tree.model.armature = np.zeros(3)
        needed = tree.torques(v, a)
        if self.scene.drive_bar == 2:
            end = tree.data.oMi[self.closures[0].joint1_id] * self.closures[0].joint1_placement
            loop_force = np.array(end.rotation @ self.found[0].contact_force.linear)[:2]
            torque = -self.armature * (a[0] - self.alpha)
        else:
            e_drive = tree.turn(self.scene.drive_bar)
            unknowns = np.linalg.solve(np.column_stack((tree.jacobian().T, e_drive)), needed)
            loop_force, torque = unknowns[:2], float(unknowns[2])
        read = {**tree.forces(loop_force), "F43": loop_force}
        tree.model.armature = np.array([self.armature, 0.0, 0.0])
        return torque, read
