"""MuJoCo's forward dynamics of the generated MJCF without its flywheel.

Run are a released linkage through time, and single states.

At one state the torque is that with which the closed loop accelerates as commanded. At
an exactly closed state the only error is the closure's softness, in proportion to
(1-d)/d with d the impedance: the values at several d, extrapolated to (1-d)/d = 0, are
free of it.
"""

import math
import time
from dataclasses import dataclass, replace
from functools import partial

import mujoco
import numpy as np
from numpy.typing import NDArray

from fourbar.effects import PointDrive
from fourbar.errors import InputError
from fourbar.mjcf import RECIPE, Settings, write_mjcf
from fourbar.mjcf.model import unwind
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene import command as command_of
from fourbar_validation.compare.answer import Answer, ReleasedAnswer
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.limits import NO_PUSH
from fourbar_validation.engines.loaded import BarValues
from fourbar_validation.engines.loop import Assembler, JointAngles, read_each
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop
from fourbar_validation.engines.mujoco.runner import Stepper

RELEASED, ONE_STATE_NAME = "mujoco-forward", "mujoco-one-state"
"""Names of the engines."""
CLOSURE_TIMESTEPS = 2.0
"""Time constant of the loop's closure, in timesteps. Through change points the closure
takes energy out: 1e-6 of it in ten seconds at 1 ms with 2, three hundred times as much
with 10.
"""
FRICTION_ROWS = (
    mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF,
    mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON,
)


class MujocoForward:
    """Free motion of the closed loop with a fixed step, s."""

    name = RELEASED
    version = mujoco.__version__

    def __init__(self, step: float = 1e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> ReleasedAnswer:
        """Integrate the motion at the given times, rising from 0 (s)."""
        scene = state_from_pins(scene)
        setting = f"RK4 {self.step:g} s"
        refuse = partial(ReleasedAnswer.refused, RELEASED, setting)
        start = with_signs(scene.linkage, command_of(scene))
        interval = float(
            times[1] - times[0]
        )  # the times are evenly spaced; the step divides the interval
        timestep = interval / math.ceil(interval / self.step - 1e-6)
        settings = replace(
            RECIPE,
            flywheel=0.0,
            timestep=timestep,
            time_constant_steps=CLOSURE_TIMESTEPS,
            pad=None,
        )
        bare = replace(scene, motion=scene.motion.replace(free=None, acceleration=0.0))
        try:
            loop = ClosedLoop(write_mjcf(bare, settings, keyframe=False))
        except InputError as error:
            return refuse(str(error))
        theta_2 = float(start.theta_2[0])
        q_0 = Assembler(loop).find(theta_2, int(start.branch[0]))
        if q_0 is None:
            return refuse("the loop does not close at the start")
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
        return ReleasedAnswer(RELEASED, setting, *np.array(rows).T)


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


_RUNGS = (0.9999, 0.9998, 0.9996, 0.9992)
"""Impedances to extrapolate from; MuJoCo clamps at the first."""


@dataclass(slots=True)
class MujocoOneState:
    """Forward dynamics at each position by itself.

    The impedance is one, or the answer is extrapolated from several.
    """

    impedances: tuple[float, ...] = _RUNGS
    name: str = ONE_STATE_NAME

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse a bar that MuJoCo cannot hold."""
        scene = state_from_pins(scene)
        if isinstance(scene.drive, PointDrive):
            return Answer(self.name, "", refusal=NO_PUSH)
        began = time.perf_counter()
        several = len(self.impedances) > 1
        setting = "extrapolated" if several else f"d = {self.impedances[0]:g}"
        try:
            rungs = [_compute_at_impedance(scene, command, d) for d in self.impedances]
        except InputError as error:
            return Answer(ONE_STATE_NAME, setting, refusal=str(error))
        return Answer(
            ONE_STATE_NAME,
            setting,
            command,
            rungs[0][1],
            extrapolate(self.impedances, [rung for rung, _ in rungs]),
            shared=(
                "lengths, masses, inertias, centres, loads and effects as MJCF text;"
                " the command"
            ),
            own="assembly, velocities, accelerations, drive torque, pin forces",
            seconds=time.perf_counter() - began,
        )


def extrapolate(
    impedances: tuple[float, ...],
    rungs: list[dict[str, Array]],
) -> dict[str, Array]:
    """Extrapolate to x = (1-d)/d = 0 the polynomial through the rungs (Lagrange)."""
    x = np.array([(1.0 - d) / d for d in impedances])
    weights = []
    for i, xi in enumerate(x):
        factors = [xj / (xj - xi) for j, xj in enumerate(x) if j != i]
        weights.append(float(np.prod(factors)))
    return {
        name: sum(w * rung[name] for w, rung in zip(weights, rungs, strict=True))  # type: ignore[misc]
        for name in rungs[0]
    }


def _compute_at_impedance(
    scene: Scene,
    command: Command,
    d: float,
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Compute torque and pin forces at every position that assembles."""
    # no flywheel: the torque is on the driven bar itself
    settings = Settings(timestep=1e-3, impedance=d, pad=None, flywheel=0.0)
    loop = ClosedLoop(write_mjcf(scene, settings, keyframe=False))
    drive = name_driving(scene)

    def read(
        q: JointAngles,
        omega_2: float,
        alpha_2: float,
    ) -> BarValues:
        loop.set_state(unwind(scene, q), omega_2)
        torque = loop.solve_drive(scene.drive_bar, alpha_2, (0.0, 1.0), refinements=1)
        return {drive: math.nan if torque is None else torque, **loop.forces()}

    return read_each(loop, command, (drive, *PIN_FORCES), read)[:2]
