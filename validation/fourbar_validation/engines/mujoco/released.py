"""MuJoCo's forward dynamics of a released linkage: the generated MJCF without its flywheel."""

import math
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.mjcf import RECIPE, write_mjcf
from fourbar.scene import Scene, command
from fourbar_validation.compare.answer import Array, ReleasedAnswer
from fourbar_validation.engines.loop import Assembler, LimitDetector
from fourbar_validation.engines.mujoco.closed_loop import O2, O4, A, ClosedLoop
from fourbar_validation.engines.mujoco.runner import Stepper

NAME = "mujoco-forward"
TIME_CONSTANT_STEPS = 2.0
"""Time constant of the loop's closure, in timesteps. Through change points the closure takes energy out: 1e-6 of it in
ten seconds at 1 ms with 2, three hundred times as much with 10."""
FRICTION = (mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF, mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON)


class MujocoForward:
    """Free motion of the closed loop with a fixed step, s."""

    name, version = NAME, mujoco.__version__

    def __init__(self, step: float = 1e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> ReleasedAnswer:
        """Integrate the motion at the given times, rising from 0 (s)."""
        setting, start = f"RK4 {self.step:g} s", command(scene)
        interval = float(times[1] - times[0])  # the times are evenly spaced; the step divides the interval
        timestep = interval / math.ceil(interval / self.step - 1e-6)
        settings = replace(RECIPE, flywheel=0.0, timestep=timestep, time_constant_steps=TIME_CONSTANT_STEPS, pad=None)
        bare = replace(scene, motion=scene.motion.replace(free=None, acceleration=0.0))
        try:
            loop = ClosedLoop(write_mjcf(bare, settings, keyframe=False))
        except InputError as error:
            return ReleasedAnswer.refused(NAME, setting, str(error))
        q_0 = Assembler(loop).find(float(start.theta_2[0]), int(start.branch[0]))
        if q_0 is None:
            return ReleasedAnswer.refused(NAME, setting, "the loop does not close at the start")
        loop.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        loop.set_state(q_0, scene.motion.omega_2 or 0.0)
        rows, q, detector = [], loop.data.qpos, LimitDetector(int(start.branch[0]))
        stepper, work = Stepper(loop.model, loop.data, timestep), _Work(loop.model, loop.data, timestep)

        def look(time: float) -> None:
            detector.look(time, q[O2] + q[A], q[O4])
            work.add()

        for t in times:
            stepper.to(float(t), look)
            mujoco.mj_forward(loop.model, loop.data)
            terms = np.array([*loop.data.energy, -work.done])
            rows.append((loop.data.qpos[O2], loop.data.qvel[O2], terms.sum(), np.abs(terms).sum()))
        theta_2, omega, energy, terms = np.array(rows).T
        return ReleasedAnswer(NAME, setting, theta_2, omega, energy, terms, detector.stopped_at)


class _Work:
    """Work of loads, damping and dry friction on the bars, by MuJoCo's own powers at the ends of each step, J."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, timestep: float) -> None:
        self.model, self.data, self.timestep, self.done = model, data, timestep, 0.0
        damped = model.dof_damping.any() or model.tendon_damping.any()
        dry = model.dof_frictionloss.any() or model.tendon_frictionloss.any()
        self.any = bool(model.nu or damped or dry)
        mujoco.mj_forward(model, data)
        self.before = self._compute_power()

    def add(self) -> None:
        """Add the step just made; after a Runge-Kutta step some fields are still of the step before."""
        if self.any:
            mujoco.mj_forward(self.model, self.data)
            now = self._compute_power()
            self.done += 0.5 * self.timestep * (self.before + now)
            self.before = now

    def _compute_power(self) -> float:
        d = self.data
        rubbing = np.isin(d.efc_type, FRICTION)
        power = float(d.qvel @ (d.qfrc_actuator + d.qfrc_damper))
        return power + float(d.efc_force[rubbing] @ d.efc_vel[rubbing])
