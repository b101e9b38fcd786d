"""MuJoCo's forward dynamics at one state: the torque with which the closed loop accelerates as commanded.

At an exactly closed state the only error is the closure's softness, in proportion to (1-d)/d with
d the impedance: the values at several d, extrapolated to (1-d)/d = 0, are free of it.
"""

import math
import time
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.mjcf import Settings, write_mjcf
from fourbar.mjcf.effects import unwind
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Answer, Array
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.loaded import Values
from fourbar_validation.engines.loop import Angles, read_each
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop, solve_couple

NAME = "mujoco-one-state"
RUNGS = (0.9999, 0.9998, 0.9996, 0.9992)
"""Impedances to extrapolate from; MuJoCo clamps at the first."""


@dataclass(slots=True)
class MujocoOneState:
    """Forward dynamics at each position by itself, at one impedance or extrapolated from several."""

    impedances: tuple[float, ...] = RUNGS
    name: str = NAME

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer, or refuse a bar that MuJoCo cannot hold."""
        began = time.perf_counter()
        setting = "extrapolated" if len(self.impedances) > 1 else f"d = {self.impedances[0]:g}"
        try:
            rungs = [_compute_at_impedance(scene, command, d) for d in self.impedances]
        except InputError as error:
            return Answer(NAME, setting, refusal=str(error))
        values, assembled = extrapolate(self.impedances, [rung for rung, _ in rungs]), rungs[0][1]
        return Answer(
            NAME,
            setting,
            command,
            assembled,
            values,
            shared="lengths, masses, inertias, centres, loads and effects as MJCF text; the command",
            own="assembly, velocities, accelerations, drive torque, pin forces",
            seconds=time.perf_counter() - began,
        )


def extrapolate(impedances: tuple[float, ...], rungs: list[dict[str, Array]]) -> dict[str, Array]:
    """Extrapolate to x = 0 the polynomial in x = (1-d)/d through the rungs (Lagrange)."""
    x = np.array([(1.0 - d) / d for d in impedances])
    weights = [float(np.prod([xj / (xj - xi) for j, xj in enumerate(x) if j != i])) for i, xi in enumerate(x)]
    return {name: sum(w * rung[name] for w, rung in zip(weights, rungs, strict=True)) for name in rungs[0]}  # type: ignore[misc]


def _compute_at_impedance(scene: Scene, command: Command, d: float) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Compute torque and pin forces at every position that assembles."""
    # no flywheel: the torque is on the driven bar itself
    settings = Settings(timestep=1e-3, impedance=d, pad=None, flywheel=0.0)
    loop, drive = ClosedLoop(write_mjcf(scene, settings, keyframe=False)), name_driving(scene)

    def read(q: Angles, omega_2: float, alpha_2: float) -> Values:
        loop.set_state(unwind(scene, q), omega_2)
        torque = _solve_torque(loop, scene.drive_bar, alpha_2)
        return {drive: math.nan if torque is None else torque, **loop.forces()}

    return read_each(loop, command, (drive, *PIN_FORCES), read)[:2]


def _solve_torque(loop: ClosedLoop, drive_bar: int | None, alpha: float) -> float | None:
    """Solve for the couple, or the cylinder's force, that gives the crank its acceleration; None at a pole of it."""
    d = loop.data

    def crank_acceleration(couple: float) -> float:
        loop.work(drive_bar, couple)
        mujoco.mj_forward(loop.model, d)
        return float(d.qacc[O2])

    couple = solve_couple(crank_acceleration, alpha, 0.0, 1.0, refinements=1)
    mujoco.mj_rnePostConstraint(loop.model, d)
    return couple
