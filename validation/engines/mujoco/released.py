"""MuJoCo's forward dynamics of a released linkage: the generated MJCF without its flywheel."""

import math
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.errors import InputError
from fourbar.mjcf import RECIPE, mjcf
from fourbar.scene import Scene, command
from validation.compare.answer import Array, Released
from validation.engines.loop import LimitWatch
from validation.engines.mujoco.closed_loop import O2, O4, A, ClosedLoop
from validation.engines.mujoco.runner import Stepper

NAME = "mujoco-forward"
TIME_CONSTANT_STEPS = 2.0
"""Of the loop's closure, in timesteps. Through change points the closure takes energy out: 1e-6 of it in ten seconds at
1 ms with 2, three hundred times as much with 10."""


class MujocoForward:
    """Free motion of the closed loop with a fixed step, s."""

    name = NAME

    def __init__(self, step: float = 1e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> Released:
        """The motion at the given times, rising from 0 (s)."""
        setting, start = f"RK4 {self.step:g} s", command(scene)
        interval = float(times[1] - times[0])  # the times are evenly spaced; the step divides the interval
        timestep = interval / math.ceil(interval / self.step - 1e-6)
        settings = replace(RECIPE, flywheel=0.0, timestep=timestep, time_constant_steps=TIME_CONSTANT_STEPS, pad=None)
        bare = replace(scene, motion=replace(scene.motion, free=None, alpha_2=0.0))
        try:
            loop = ClosedLoop(mjcf(bare, settings, keyframe=False))
        except InputError as error:
            return Released.refused(NAME, setting, str(error))
        q_0 = loop.position().find(float(start.theta_2[0]), int(start.branch[0]))
        if q_0 is None:
            return Released.refused(NAME, setting, "the loop does not close at the start")
        loop.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        loop.set_state(q_0, scene.motion.omega_2 or 0.0)
        rows, q, watch = [], loop.data.qpos, LimitWatch(int(start.branch[0]))
        stepper = Stepper(loop.model, loop.data, timestep)
        for t in times:
            stepper.to(float(t), lambda time: watch.look(time, q[O2] + q[A], q[O4]))
            mujoco.mj_forward(loop.model, loop.data)
            rows.append((loop.data.qpos[O2], loop.data.qvel[O2], loop.data.energy.sum()))
        theta_2, omega, energy = np.array(rows).T
        return Released(NAME, setting, theta_2, omega, energy, watch.stopped_at)
