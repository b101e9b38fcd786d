"""Supply MuJoCo at each stage of a step with what MJCF cannot express: loads over theta_2, the acceleration of a law.

Both come from the description alone, at MuJoCo's own angle and time; nothing of the formulas is passed.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from fourbar.effects import Load
from fourbar.errors import LimitError
from fourbar.scene import Scene
from fourbar_validation.compare.answer import Array
from fourbar_validation.engines.effects import look_up
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop

OVERRUN = 1e-7
"""rad; by so little a simulated crank may turn too far, 1e-9 in healthy runs, and 1e-5 is what it is judged by."""
ActuatorForce = Callable[[mujoco.MjModel, mujoco.MjData], float]
"""The force of an actuator, in units of its gear."""


def take_full_size(scene: Scene) -> Scene:
    """Give the scene with loads over theta_2 at the largest size that they ever have: what MJCF can say of them."""
    loads = []
    for load in scene.loads:
        peak = _find_peak(load)
        force = None if load.force is None else (load.force[0] * peak, load.force[1])
        loads.append(replace(load, force=force, moment=load.moment * peak, table=None))
    return replace(scene, loads=tuple(loads))


def _find_peak(load: Load) -> float:
    return 1.0 if load.table is None else max(map(abs, load.table.factor)) or 1.0


def evaluate_loads(scene: Scene) -> dict[str, ActuatorForce]:
    """Evaluate each load over theta_2, by the actuator's name: its factor at MuJoCo's own theta_2, by the largest."""

    def force_of(load: Load) -> ActuatorForce:
        table, peak = load.table, _find_peak(load)
        assert table is not None
        first, last = table.theta_2[0], table.theta_2[-1]

        def factor(_: mujoco.MjModel, d: mujoco.MjData) -> float:
            angle = first + (float(d.qpos[O2]) - first) % math.tau
            if angle > last:  # the stages of a step may look beyond the end of a table
                angle = last if angle - last < first + math.tau - angle else first
            return look_up(table, angle) / peak

        return factor

    return {f"load_{index}": force_of(load) for index, load in enumerate(scene.loads, 1) if load.table is not None}


def clip_angles(scene: Scene, theta_2: Array) -> Array:
    """Put angles that overran the end of a table by a rounding of the motion back on it; LimitError beyond that."""
    inside = theta_2.copy()
    for load in scene.loads:
        if load.table is None:
            continue
        first, last = load.table.theta_2[0], load.table.theta_2[-1]
        angle = first + np.remainder(inside - first, math.tau)
        over, under = angle - last, first + math.tau - angle
        outside = over > 0.0
        if not (~outside | (np.minimum(over, under) < OVERRUN)).all():
            raise LimitError(f"the motion leaves the table of a load, which covers {first:g} to {last:g} rad")
        inside = inside + np.where(outside, np.where(over < under, -over, under), 0.0)
    return inside


def receive_forces(loop: ClosedLoop, supplied: dict[str, ActuatorForce]) -> ClosedLoop:
    """Let the actuators of these names in a loop take their force from `supply_forces`."""
    for number in range(loop.model.nu):
        if loop.model.actuator(number).name in supplied:
            loop.model.actuator_biastype[number] = mujoco.mjtBias.mjBIAS_USER
    return loop


@contextmanager
def supply_forces(supplied: dict[str, ActuatorForce]) -> Iterator[None]:
    """MuJoCo takes these forces as long as this lasts; its callbacks are of the whole process."""
    if not supplied:
        yield
        return
    before = mujoco.get_mjcb_act_bias()
    mujoco.set_mjcb_act_bias(lambda m, d, number: supplied[m.actuator(number).name](m, d))
    try:
        yield
    finally:
        mujoco.set_mjcb_act_bias(before)
