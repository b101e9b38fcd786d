"""MuJoCo MJX (JAX), in double precision."""

import time
from importlib.metadata import version
from typing import Any

import jax
import numpy as np
from mujoco import mjx

from fourbar.scene import Scene
from validation.subjects.motion import Readings, turn
from validation.subjects.mujoco_c import at_rest_of, opened, read, text

VERSION = version("mujoco-mjx")
DEVICE = "CPU" if jax.default_backend() == "cpu" else str(jax.devices()[0].device_kind)
"""JAX takes a GPU where it has one."""
STEPS = (157, 314, 628)
CHANGED = "a closure of two timesteps (--for mjx), and jax_enable_x64"
SETTINGS = {"written for MJX": "mjx", "as for MuJoCo": "mujoco"}
jax.config.update("jax_enable_x64", True)
forward = jax.jit(mjx.forward)


@jax.jit  # type: ignore[untyped-decorator]
def advance(model: Any, state: Any, steps: int) -> Any:
    """So many steps, the number left open so that it compiles once."""
    return jax.lax.fori_loop(0, steps, lambda _, now: mjx.step(model, now), state)


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """A turn in so many steps."""
    model, data = opened(text(scene, steps, SETTINGS[setting]))
    theirs, state = mjx.put_model(model), mjx.put_data(model, data)
    jax.block_until_ready(advance(theirs, state, 1))  # compiled before the clock runs
    found, done = Readings(setting, steps), 0
    for stop in turn(scene, steps)[1]:
        began = time.process_time()
        state = jax.block_until_ready(advance(theirs, state, stop - done))
        found.seconds += time.process_time() - began
        done = stop
        _evaluate(found, model, forward(theirs, state))
    return found


def states(scene: Scene, setting: str) -> Readings:
    """Single states, each set and evaluated by itself."""
    model, data = opened(text(scene, 628, SETTINGS[setting]))
    theirs, state = mjx.put_model(model), mjx.put_data(model, data)
    found = Readings(setting)
    for q, v in at_rest_of(model, data, scene):
        _evaluate(found, model, forward(theirs, state.replace(qpos=jax.numpy.array(q), qvel=jax.numpy.array(v))))
    return found


def _evaluate(found: Readings, model: Any, state: Any) -> None:
    q, v, a, drive = (np.array(x) for x in (state.qpos, state.qvel, state.qacc, state.actuator_force))
    closing = np.array(getattr(state, "_impl", state).efc_force)[:2]
    read(found, model, q, v, a, drive[model.actuator("drive").id], closing)
    gap = np.linalg.norm(state.site_xpos[model.site("B3").id] - state.site_xpos[model.site("B4").id])
    found.gap = max(found.gap, float(gap))
