"""Differentiate the driving torque at a state by three numbers.

The simulator is one that can be differentiated. Assembling the loop and compiling a
model are no part of what it differentiates: how its state and the numbers of its model
change with a number of the scene is taken from two scenes to either side, each
assembled by MuJoCo.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar.studies.keys import command_key, list_entries, read_number, replace_numbers
from fourbar_lab.simulators.mujoco_c import states_of, write_opened_mjcf
from fourbar_lab.simulators.protocol_engines import start
from fourbar_validation.engines.mujoco.closed_loop import open_model

STEPS_OF_A_TURN = 156
"""Steps in a turn; a quarter of them is run through."""
DIFFERENCE = 1e-6
"""Step to either side, SI: differences of doubles keep ten digits."""


class ClosedState(NamedTuple):
    """A compiled model, and a state that closes its loop."""

    model: Any
    data: Any
    qpos: Array
    qvel: Array


def compile_and_assemble(
    scene: Scene,
    theta_2: float,
    reader: str,
) -> ClosedState:
    """Return a scene's compiled model and state, assembled at theta_2 (rad).

    The state has the scene's speed.
    """
    written = write_opened_mjcf(scene, STEPS_OF_A_TURN, reader)
    placed = replace(scene, motion=scene.motion.replace(angle=theta_2))
    ((q, v),) = states_of(written, placed)
    return ClosedState(*open_model(written), q, v)


def list_keys(scene: Scene) -> tuple[str, ...]:
    """List the numbers by which is differentiated."""
    return ("lengths.coupler", "bars.coupler.mass", command_key(scene))


def assemble_either_side(
    scene: Scene,
    theta_2: float,
    key: str,
    reader: str,
) -> list[ClosedState]:
    """Assemble the scene with a number a little greater, and a little less."""
    sides = []
    for step in (DIFFERENCE, -DIFFERENCE):
        changed = scene
        angle = theta_2
        if key == command_key(scene):
            angle += step
        else:
            number = float(read_number(scene, list_entries(scene)[key]))
            changed = replace_numbers(scene, {key: number + step})
        sides.append(compile_and_assemble(changed, angle, reader))
    return sides


def change(more: Any, less: Any) -> Any:
    """Differentiate numbers by what the two sides differ in."""
    return (np.asarray(more, dtype=float) - np.asarray(less, dtype=float)) / (
        2.0 * DIFFERENCE
    )


def choose_quarter(scene: Scene) -> tuple[float, float]:
    """Return theta_2 of the common start, and a quarter turn on, rad."""
    begin = float(start(scene).qpos[0])
    return begin, begin + 0.5 * np.pi * float(np.sign(scene.motion.omega_2 or 1.0))


def collect_answer(
    scene: Scene,
    how: str,
    state: tuple[Any, Any, Any, Any],
    by: dict[str, Any],
) -> dict[str, Any]:
    """Return theta_2, omega_2, alpha_2 and torque of a state, as floats by name.

    `by` holds the derivatives of the torque by each key, and `how` names the method.
    """
    names = (*scene.motion.names, "torque")
    return {"how": how, "by": {key: float(x) for key, x in by.items()}} | {
        name: float(x) for name, x in zip(names, state, strict=True)
    }
