"""MuJoCo moving a generated model, with the loop or with joints that follow in its place, through its range."""

import mujoco
import numpy as np

from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.mujoco.closed_loop import O2, O4, ClosedLoop

READINGS = 2000
"""Instants of a range that are read."""
SETTLING = 10
"""Steps after which joints that follow have the lag that they keep: five time constants."""
MOST = 200_000
"""Steps: a drive that does not get through its range in these is stopped."""


def step_through(mjcf: str, scene: Scene, low: float, high: float) -> tuple[Command, dict[str, Array]]:
    """Step a model from its keyframe until theta_2 leaves the range: the motion that happened, and what it read.

    Angle of the output, torque on the input, the forces of bars 1, 2 and 1 on bars 2, 3 and 4 that their joints carry
    (F12, F32, F14), that of the closure (F43) where there is one, and the gap at B (m).
    """
    loop = ClosedLoop(mjcf)
    data, rows = loop.data, list[list[float]]()
    mujoco.mj_resetDataKeyframe(loop.model, data, 0)
    steps = abs(high - low) / (max(abs(float(data.qvel[O2])), 1e-9) * loop.model.opt.timestep)
    every = max(1, int(steps / READINGS))
    for step in range(MOST):
        if not low - 1e-9 <= data.qpos[O2] <= high + 1e-9:
            break
        if step >= SETTLING and step % every == 0:
            loop.forward()
            forces = np.concatenate([*loop.forces().values()])
            motion = [data.qpos[O2], data.qvel[O2], data.qacc[O2]]
            rows.append([*motion, data.qpos[O4], loop.crank_torque(), *forces.tolist(), np.hypot(*loop.gap())])
        mujoco.mj_step(loop.model, data)
    theta_2, omega_2, alpha_2, theta_4, torque, *rest = np.array(rows).T
    found = {name: np.stack(rest[2 * i : 2 * i + 2], axis=1) for i, name in enumerate(loop.forces())}
    if loop.model.eq_type[0] != mujoco.mjtEq.mjEQ_CONNECT:
        del found["F43"]
    branch = np.full(theta_2.shape, scene.motion.branch, dtype=np.int8)
    at = Command(theta_2, branch, omega_2, alpha_2)
    return at, {"theta_4": theta_4, "torque": torque, **found, "gap": rest[-1]}
