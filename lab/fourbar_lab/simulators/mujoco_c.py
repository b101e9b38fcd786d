"""MuJoCo itself (the C library), which simulates the generated MJCF file.

Runs are made with the file's settings and with MuJoCo's defaults.
"""

from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import mujoco
import numpy as np

from fourbar.mjcf import SIMULATORS, write_mjcf
from fourbar.quantities import Array
from fourbar.scene import Scene, command, with_signs
from fourbar_lab.simulators.motion import (
    DEFAULT_STEPS_OF_A_TURN,
    Course,
    Floats,
    Instant,
    Readings,
    Simulator,
    Worlds,
    find_timestep,
    run_through,
    start,
)
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.closed_loop import ClosedLoop, open_model
from fourbar_validation.engines.mujoco.defaults import remove_attributes

_BY_DEFAULT = {
    "option": ("integrator", "solver", "tolerance", "iterations"),
    "equality/connect": ("solref", "solimp"),
}
"""Attributes that "its defaults" leaves to MuJoCo."""


def write_opened_mjcf(
    scene: Scene, steps: int, simulator: str | None, **settings: Any
) -> str:
    """Return the MJCF of a scene that opens at the simulators' common start.

    Parameters
    ----------
    steps : timesteps in a turn.
    simulator : whose settings are written; None for MuJoCo's defaults.
    settings : values in place of the simulator's.
    """
    reader = simulator or "warp"  # without pads
    changed = replace(
        SIMULATORS[reader],
        timestep=find_timestep(scene, steps),
        **settings,
    )
    written = write_mjcf(scene, changed, reader, start=start(scene))
    if simulator is not None:
        return written
    return remove_attributes(written, _BY_DEFAULT)


def reading(
    model: Any,
    q: Any,
    v: Any,
    a: Any,
    drive: float,
    closing: Any,
    borne: Any,
) -> Instant:
    """Read as the comment in the file says; q, v, a in the joints' coordinates.

    `borne`: cfrc_int of input, coupler and output, whose last three numbers are the
    force of the parent on the body.
    """
    torque = drive - model.dof_armature[0] * a[0]
    F12, F23, F14 = (wrench[3:5] for wrench in borne)
    return Instant(
        (q[0], q[0] + q[1], q[2]),
        v[0],
        a[0],
        torque,
        {"F12": F12, "F32": -F23, "F43": closing, "F14": F14},
    )


def find_bar_bodies(model: Any) -> list[int]:
    """Find the bodies of input, coupler and output."""
    return [model.body(bar).id for bar in ("input", "coupler", "output")]


def states_of(written: str, scene: Scene) -> list[tuple[Array, Array]]:
    """Return (qpos, qvel) at the scene's positions, assembled by MuJoCo's kinematics.

    Newton's method closes the gap, and speeds are by the gap's Jacobian.
    """
    loop = ClosedLoop(written)
    states = []
    position = Assembler(loop)
    told = with_signs(scene.linkage, command(scene))
    for theta_2, sign in zip(told.theta_2.tolist(), told.branch.tolist(), strict=True):
        if (q := position.find(theta_2, sign)) is not None:
            loop.set_state(q, scene.motion.omega_2 or 0.0)
            states.append((loop.data.qpos.copy(), loop.data.qvel.copy()))
    return states


def repeat_states(
    written: str,
    scene: Scene,
    worlds: int,
) -> tuple[Array, Array]:
    """Repeat the scene's assembled positions over many worlds.

    Returns qpos and qvel, a row a world; the last world has the last position.
    """
    q, v = map(np.array, zip(*states_of(written, scene), strict=True))
    return np.resize(q, (worlds, q.shape[1])), np.resize(v, (worlds, v.shape[1]))


def read_last(
    scene: Scene,
    model: Any,
    results: tuple[Floats, ...],
) -> Readings:
    """Read the last worlds, one for each position of the scene.

    Raises ArithmeticError if a number of any world is not finite.
    """
    if not all(np.isfinite(array).all() for array in results):
        raise ArithmeticError("a world diverged")
    drive = model.actuator("drive").id
    bars = find_bar_bodies(model)
    count = len(command(scene).theta_2)
    last = [array[-count:].astype(float) for array in results]
    readings = Readings()
    for q, v, a, forces, closing, borne in zip(*last, strict=True):
        readings.read(
            scene, reading(model, q, v, a, forces[drive], closing, borne[bars])
        )
    return readings


class MujocoFile(Simulator):
    """MuJoCo with the generated file."""

    name = "MuJoCo"
    version = mujoco.__version__
    changed = (
        "nothing; the softness of its default constraints is deliberate, and documented"
    )
    settings: ClassVar[dict[str, str | None]] = {
        "generated file": "mujoco",
        "its defaults": None,
    }
    single_states = True

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(
            write_opened_mjcf(scene, course.steps, self.settings[self.setting])
        )
        advance = partial(mujoco.mj_step, model, data)
        return run_through(
            scene,
            course,
            advance,
            lambda _: _evaluate_mujoco(model, data),
        )

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states, each set by itself."""
        written = write_opened_mjcf(
            scene, DEFAULT_STEPS_OF_A_TURN, self.settings[self.setting]
        )
        model, data = open_model(written)
        readings = Readings()
        for q, v in states_of(written, scene):
            data.qpos[:], data.qvel[:] = q, v
            readings.read(scene, _evaluate_mujoco(model, data))
        return readings

    def in_worlds(self, scene: Scene, worlds: int) -> Worlds:
        """Prepare single states of many worlds, one after the other on one core."""
        written = write_opened_mjcf(
            scene, DEFAULT_STEPS_OF_A_TURN, self.settings[self.setting]
        )
        model, data = open_model(written)
        q, v = repeat_states(written, scene, worlds)
        shapes = ((model.nv,), (model.nu,), (2,), (model.nbody, 6))
        results = tuple(np.empty((worlds, *shape)) for shape in shapes)

        def evaluate() -> tuple[Floats, ...]:
            for world in range(worlds):
                data.qpos[:] = q[world]
                data.qvel[:] = v[world]
                mujoco.mj_forward(model, data)
                mujoco.mj_rnePostConstraint(model, data)
                evaluated = (
                    data.qacc,
                    data.actuator_force,
                    data.efc_force[:2],
                    data.cfrc_int,
                )
                for array, value in zip(results, evaluated, strict=True):
                    array[world] = value
            return q, v, *results

        return Worlds(evaluate, evaluate, partial(read_last, scene, model))


def _evaluate_mujoco(model: Any, data: Any) -> Instant:
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    drive = data.actuator_force[model.actuator("drive").id]
    return reading(
        model,
        data.qpos,
        data.qvel,
        data.qacc,
        drive,
        data.efc_force[:2],
        data.cfrc_int[find_bar_bodies(model)],
    )
