"""Pinocchio's forward dynamics of a driven loop through time: a flywheel keeps the speed."""

import time

import numpy as np

from fourbar.errors import LimitError
from fourbar.mjcf import Settings, flywheel, run_through
from fourbar.scene import Command, Scene
from validation.compare.answer import Array
from validation.engines.loop import Trial, as_made, blank
from validation.engines.pinocchio import PinocchioTree
from validation.engines.pinocchio_closed import ClosedTree, step
from validation.engines.tree import multipliers


class PinocchioForward:
    """One scene, driven at omega_2 by a flywheel, stepped with the classical Runge-Kutta method.

    Parameters
    ----------
    time_constant_steps : of the closure's stabilisation, in steps.
    """

    def __init__(self, scene: Scene, command: Command, steps_per_revolution: float, time_constant_steps: float) -> None:
        self.omega, self.alpha = float(np.max(command.omega_2)), float(np.max(command.alpha_2))  # type: ignore[arg-type]
        self.scene, self.command = scene, command
        self.run = run_through(command.theta_2, self.omega, self.alpha)
        settings = Settings(steps_per_revolution=steps_per_revolution, steps_per_window=1)
        self.h = self.run.timestep(settings)
        self.tree = PinocchioTree(scene)
        self.armature = self.tree.model.armature = np.array([flywheel(scene, settings), 0.0, 0.0])
        self.loop = ClosedTree(self.tree, time_constant_steps * self.h)

    def acceleration(self, q: Array, v: Array) -> Array:
        """Of the closed loop under loads, effects and the flywheel's motor."""
        tree, tau = self.tree, self.armature * self.alpha
        if tree.terms:
            tree.place(q)  # type: ignore[arg-type]
            # what acts, as generalised forces: the difference it makes to inverse dynamics
            tree.moving(v, np.zeros(3))
            acted = tree.torques()
            tau = tau + tree.needed(tree.field, {bar: [0.0, 0.0, 0.0] for bar in tree.wrenches}) - acted
        return np.array(self.loop.acceleration(q, v, tau))

    def forward(self) -> Trial:
        """Run through the positions; each is read at the step nearest to it."""
        order = np.argsort(self.command.theta_2 if self.omega > 0.0 else -self.command.theta_2, kind="stable")
        first = int(order[0])
        state = self.loop.start(float(self.command.theta_2[first]), int(self.command.branch[first]), self.omega)
        if state is None:
            raise LimitError("the loop does not close at the first position")
        (q, v), done, stepping = state, 0, 0.0
        out = blank(len(order))
        for row, index in enumerate(order):
            target = round(self.run.time(float(self.command.theta_2[index])) / self.h)
            began = time.process_time()
            while done < target:
                q, v = step(self.acceleration, q, v, self.h)
                done += 1
            stepping += time.process_time() - began
            if not np.isfinite(q).all():
                break
            for name, value in self._read(q, v, self.acceleration(q, v)).items():
                out[name][row] = value
        at, quantities = as_made(out, self.command.branch[order])
        return Trial(at, quantities, done, 2.0 * np.pi / self.run.fastest / self.h, stepping)

    def _read(self, q: Array, v: Array, a: Array) -> dict[str, Array | float]:
        """Torque and pin forces at a state, with the multiplier of the closure that the engine found."""
        tree = self.tree
        tree.place(q)  # type: ignore[arg-type]
        tree.model.armature = np.zeros(3)
        tree.moving(v, a)
        needed = tree.torques()
        if self.scene.drive_bar == 2:
            loop_force, torque = self.loop.loop_force(), -self.armature[0] * (a[0] - self.alpha)
        else:
            unknowns = multipliers(tree.jacobian(), tree.turns[self.scene.drive_bar], needed)
            loop_force, torque = unknowns[:2], float(unknowns[2])
        forces = tree.forces(loop_force, torque)
        tree.model.armature = self.armature
        made = {"theta_2": q[0], "omega_2": v[0], "alpha_2": a[0]}
        return {**made, "torque": torque, "F43": loop_force, **forces}
