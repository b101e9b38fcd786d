"""MuJoCo's forward dynamics of the generated MJCF without its flywheel.

A released linkage is run through time.
"""

import math
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.mjcf import RECIPE, write_mjcf
from fourbar.quantities import Array
from fourbar.scene import Scene, with_signs
from fourbar.scene import command as command_of
from fourbar_validation.compare.answer import RELEASED_QUANTITIES, Answer
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.closed_loop import FRICTION_ROWS, O2, ClosedLoop
from fourbar_validation.engines.mujoco.runner import Stepper

RELEASED = "mujoco-forward"
"""Name of the engine."""


class MujocoForward:
    """Free motion of the closed loop with a fixed step, s."""

    name = RELEASED
    version = mujoco.__version__

    def __init__(self, step: float = 1e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> Answer:
        """Integrate the motion at the given times, rising from 0 (s)."""
        scene = state_from_pins(scene)
        setting = f"RK4 {self.step:g} s"
        start = with_signs(scene.linkage, command_of(scene))
        interval = float(
            times[1] - times[0]
        )  # the times are evenly spaced; the step divides the interval
        timestep = interval / math.ceil(interval / self.step - 1e-6)
        # time constant of the loop's closure, in timesteps; through change points the
        # closure takes energy out: 1e-6 of it in ten seconds at 1 ms with 2, three
        # hundred times as much with 10
        settings = replace(
            RECIPE,
            flywheel=0.0,
            timestep=timestep,
            time_constant_steps=2.0,
            pad=None,
        )
        bare = replace(scene, motion=scene.motion.replace(free=None, acceleration=0.0))
        try:
            loop = ClosedLoop(write_mjcf(bare, settings, keyframe=False))
        except InputError as error:
            return Answer(RELEASED, setting, refusal=str(error))
        theta_2 = float(start.theta_2[0])
        q_0 = Assembler(loop).find(theta_2, int(start.branch[0]))
        if q_0 is None:
            refusal = "the loop does not close at the start"
            return Answer(RELEASED, setting, refusal=refusal)
        loop.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        loop.set_state(q_0, scene.motion.omega_2 or 0.0)
        rows = []
        stepper = Stepper(loop.model, loop.data, timestep)
        work = _WorkOnBars(loop.model, loop.data, timestep)
        d = loop.data
        for t in times:
            stepper.to(float(t), work.add)
            mujoco.mj_forward(loop.model, d)
            terms = np.array([*d.energy, -work.done])
            rows.append((d.qpos[O2], d.qvel[O2], terms.sum(), np.abs(terms).sum()))
        columns = zip(RELEASED_QUANTITIES, np.array(rows).T, strict=True)
        return Answer(RELEASED, setting, quantities=dict(columns))


class _WorkOnBars:
    """Work of loads, damping and dry friction on the bars, J.

    MuJoCo's own powers at the ends of each step are summed up.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        timestep: float,
    ) -> None:
        self.model = model
        self.data = data
        self.timestep = timestep
        self.done = 0.0
        damped = model.dof_damping.any() or model.tendon_damping.any()
        dry = model.dof_frictionloss.any() or model.tendon_frictionloss.any()
        self.any = bool(model.nu or damped or dry)
        mujoco.mj_forward(model, data)
        self.before = self._compute_power()

    def add(self, _: float) -> None:
        """Add the step just made.

        After a Runge-Kutta step some fields are still of the step before.
        """
        if self.any:
            mujoco.mj_forward(self.model, self.data)
            now = self._compute_power()
            self.done += 0.5 * self.timestep * (self.before + now)
            self.before = now

    def _compute_power(self) -> float:
        d = self.data
        rubbing = np.isin(d.efc_type, FRICTION_ROWS)
        power = float(d.qvel @ (d.qfrc_actuator + d.qfrc_damper))
        return power + float(d.efc_force[rubbing] @ d.efc_vel[rubbing])
