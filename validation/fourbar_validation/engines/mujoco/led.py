"""The input led so that another bar, or the cylinder, moves as commanded: from MuJoCo's own state at each stage.

With J the derivative of the gap by the joint angles and c that of the commanded bar's direction or of the stroke,

    J a + (dJ/dt) v = 0,   c a + (dc/dt) v = the commanded acceleration

are solved for the acceleration of the input, which its flywheel's motor is given.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.mjcf import RECIPE, Settings, write_mjcf
from fourbar.mjcf.settings import FULL_TURN
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from fourbar_validation.engines.free_body_closure import find_angle
from fourbar_validation.engines.limits import compute_least_sine
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.called_back import take_full_size
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop
from fourbar_validation.engines.mujoco.motions import Steady
from fourbar_validation.engines.mujoco.runner import find_assembled
from fourbar_validation.engines.tree import solve_closed

MOST_UNEVEN = 20.0
"""Greatest speed of the input over its mean: near a limit of what is commanded it grows without bound, and with it the
steps of a window, which are those of the fastest throughout; here they are 40 000."""


class Lead:
    """Command of another bar or of the stroke, and how the input then moves at each position."""

    def __init__(self, scene: Scene, command: Command) -> None:
        motion = scene.motion
        if motion.law is not None:
            raise LimitError("a motion law of another bar than the input is not run through time here")
        still = replace(take_full_size(scene), motion=Motion(0.0, 1.0))
        self.loop = loop = ClosedLoop(write_mjcf(still, replace(RECIPE, timestep=1e-3), keyframe=False))
        self.bar = None if command.stroke is not None else command.bar
        """Number of the commanded bar; None if the stroke is commanded."""
        if command.stroke is not None:
            command = find_angle(command, motion, *loop.cylinder(command.bar))
        self.command, self.values = command, command.angle if command.stroke is None else command.stroke
        self.speed, self.acceleration = float(np.max(motion.speed or 0.0)), float(np.max(motion.acceleration))
        found = find_assembled(Assembler(loop, command.bar), command, range(len(self.values)))
        self.closes = np.array([q is not None for q in found])
        if not self.closes.any():
            raise LimitError("the loop closes at none of the positions")
        self.input, branch = np.full((3, len(found)), np.nan), command.branch.copy()
        """theta_2, omega_2, alpha_2."""
        for index, q in enumerate(found):
            if q is not None:
                try:
                    loop.set_state(q, self.speed, self.bar)
                except np.linalg.LinAlgError:
                    raise LimitError("the commanded motion stands at a limit of its own") from None
                mujoco.mj_forward(loop.model, loop.data)
                self.input[:, index] = q[O2], loop.data.qvel[O2], self.alpha_2(loop.model, loop.data)
                branch[index] = loop.branch()
        self.input[0, self.closes] = np.unwrap(self.input[0, self.closes])
        theta_2, omega_2, alpha_2 = self.input[:, self.closes]
        # greatest speed and acceleration, as for a law: flywheel and closure are sized by them
        most = float(np.abs(omega_2).max()), float(np.abs(alpha_2).max()) or np.finfo(float).tiny
        self.scene, self.of_input = (
            replace(scene, motion=Motion(theta_2, *most)),
            Command(theta_2, branch[self.closes], *most),
        )

    def alpha_2(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Solve for the acceleration of the input at a state that MuJoCo is evaluating, rad/s^2."""
        loop = copy(self.loop)
        loop.model, loop.data = model, data
        drift = (loop.rate_at("B3") - loop.rate_at("B4")) @ data.qvel
        due = self.acceleration - loop.drive_drift(self.bar)
        return float(solve_closed(loop.jacobian(), due, loop.drive_column(self.bar), *drift.tolist())[O2])

    def least_sine(self) -> float:
        """Compute the least |sin(theta_4 - theta_3)| on the way; 0 where it changes its sign."""
        if np.ptp(self.of_input.branch):
            return 0.0
        return compute_least_sine(
            self.scene.linkage, self.of_input.theta_2, np.ones(len(self.of_input.theta_2), dtype=bool)
        )


class Led(Steady):
    """A segment of positions in the order of what is commanded."""

    def __init__(self, lead: Lead, segment: Sequence[int]) -> None:
        super().__init__(lead.values, segment, lead.speed, lead.acceleration)
        self.bar = lead.bar
        theta_2, omega_2, _ = lead.input[:, list(segment)]
        self.turning, self.turned = float(np.abs(omega_2).max()), float(np.ptp(theta_2))

    def timestep(self, settings: Settings) -> float:
        """Divide the time by what the input turns."""
        if not self.width or not self.turned:
            return 1e-3
        duration = self.run.time(self.run.stop)
        if (uneven := duration * self.turning / self.turned) > MOST_UNEVEN:
            raise LimitError(
                f"the input is at most {uneven:.0f} times as fast as on the mean; up to {MOST_UNEVEN:g} it is led"
            )
        steps = duration * self.turning / (2.0 * np.pi) * settings.steps_per_revolution
        if 0.0 < self.turned < FULL_TURN:
            steps = max(steps, settings.steps_per_window * uneven)
        return float(duration / max(np.ceil(steps), self.width) * settings.timestep_scale)
