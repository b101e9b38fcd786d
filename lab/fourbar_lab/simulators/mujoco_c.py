"""MuJoCo itself (the C library), which simulates the generated MJCF file.

Runs are made with the file's settings and with MuJoCo's defaults.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import mujoco
import numpy as np

from fourbar.mjcf import SIMULATORS, write_mjcf
from fourbar.quantities import Array
from fourbar.scene import Scene, command, with_signs
from fourbar_lab.simulators.protocol_engines import (
    DEFAULT_STEPS_OF_A_TURN,
    Course,
    Floats,
    Instant,
    Readings,
    Simulator,
    Worlds,
    bar_directions,
    find_timestep,
    start,
)
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.closed_loop import ClosedLoop, open_model
from fourbar_validation.engines.mujoco.trial import remove_attributes

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


def reading(model: Any, results: Sequence[Any]) -> Instant:
    """Read torque and pin forces as the comment in the file says.

    Parameters
    ----------
    results : qpos, qvel, qacc, actuator_force, closing force and cfrc_int; of each
        body the last three numbers of cfrc_int are the force of its parent.
    """
    q, v, a, driving, closing, borne = results
    torque = driving[0] - model.dof_armature[0] * a[0]
    F12, F23, F14 = (borne[body, 3:5] for body in model.jnt_bodyid[:3])
    forces = {"F12": F12, "F32": -F23, "F43": closing[:2], "F14": F14}
    return Instant(bar_directions(q), v[0], a[0], torque, forces)


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


class FileSimulator(Simulator):
    """A simulator of MuJoCo's family, which reads the generated file.

    States of many worlds are evaluated at once; single states are as many worlds.
    """

    single_states = True

    def write(self, scene: Scene, steps: int = DEFAULT_STEPS_OF_A_TURN) -> str:
        """Write the file for the setting."""
        return write_opened_mjcf(scene, steps, self.settings[self.setting])

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states, each set by itself."""
        worlds = self.in_worlds(scene)
        return worlds.read(worlds.exchange())

    def in_worlds(self, scene: Scene, worlds: int | None = None) -> Worlds:
        """Prepare single states of many worlds, without a number one of each state."""
        written = self.write(scene)
        model, data = open_model(written)
        states = states_of(written, scene)
        q, v = map(np.array, zip(*states, strict=True))
        # the last world has the last position
        count = worlds or len(states)
        placed = np.resize(q, (count, q.shape[1])), np.resize(v, (count, v.shape[1]))
        read = partial(_read_last, scene, model, len(states))
        return Worlds(*self.prepare(model, data, *placed), read)

    def prepare(
        self, model: Any, data: Any, q: Array, v: Array
    ) -> tuple[Callable[[], Any], Callable[[], tuple[Floats, ...]]]:
        """Return `evaluate` and `exchange` of worlds with these states, a row each."""
        raise NotImplementedError


def _read_last(
    scene: Scene,
    model: Any,
    count: int,
    results: tuple[Floats, ...],
) -> Readings:
    """Read so many last worlds, one for each position of the scene.

    Raises ArithmeticError if a number of any world is not finite.
    """
    if not all(np.isfinite(array).all() for array in results):
        raise ArithmeticError("a world diverged")
    readings = Readings()
    for world in zip(*(array[-count:].astype(float) for array in results), strict=True):
        readings.read(scene, reading(model, world))
    return readings


class MujocoFile(FileSimulator):
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

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(self.write(scene, course.steps))
        advance = partial(mujoco.mj_step, model, data)
        return self.run(
            scene, course, advance, lambda _: reading(model, evaluate(model, data))
        )

    def prepare(self, model: Any, data: Any, q: Array, v: Array) -> Any:
        """Evaluate the worlds one after the other on one core."""
        shapes = [array.shape for array in evaluate(model, data)]
        results = tuple(np.empty((len(q), *shape)) for shape in shapes)

        def evaluate_all() -> tuple[Floats, ...]:
            for world in range(len(q)):
                data.qpos[:] = q[world]
                data.qvel[:] = v[world]
                for array, value in zip(results, evaluate(model, data), strict=True):
                    array[world] = value
            return results

        return evaluate_all, evaluate_all


def evaluate(model: Any, data: Any) -> tuple[Floats, ...]:
    """Evaluate a state of MuJoCo, and return what `reading` takes."""
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    return (
        data.qpos,
        data.qvel,
        data.qacc,
        data.actuator_force,
        data.efc_force[:2],
        data.cfrc_int,
    )
