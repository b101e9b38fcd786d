"""MuJoCo MJX (JAX), in double precision."""

from importlib.metadata import version
from typing import Any

import jax
import numpy as np
from mujoco import mjx

from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.stepping import opened
from fourbar_validation.lab.subjects.motion import Instant, Readings, run_through
from fourbar_validation.lab.subjects.mujoco_c import reading, states_of, text

VERSION = version("mujoco-mjx")
DEVICE = "CPU" if jax.default_backend() == "cpu" else str(jax.devices()[0].device_kind)
"""JAX takes a GPU where it has one."""
STEPS = (157, 314, 628)
CHANGED = "a closure of two timesteps (--for mjx), and jax_enable_x64"
SETTINGS = {"written for MJX": "mjx", "as for MuJoCo": "mujoco"}
APART = {"as for MuJoCo": "a closure of ten timesteps, not meant for MJX"}
"""The one written for MJX yields within two timesteps and so makes up for the term that MJX leaves out."""
jax.config.update("jax_enable_x64", True)
forward = jax.jit(mjx.forward)


@jax.jit  # type: ignore[untyped-decorator]
def advance(model: Any, state: Any, steps: int) -> Any:
    """Step on, with the number left open so that it compiles once."""
    return jax.lax.fori_loop(0, steps, lambda _, now: mjx.step(model, now), state)


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """Simulate a turn in so many steps."""
    model, data = opened(text(scene, steps, SETTINGS[setting]))
    theirs, state = mjx.put_model(model), mjx.put_data(model, data)
    jax.block_until_ready(advance(theirs, state, 1))  # compiled before the clock runs

    def further(n: int) -> Any:
        nonlocal state
        state = jax.block_until_ready(advance(theirs, state, n))
        return state

    return run_through(scene, steps, setting, further, lambda now: _evaluated(model, forward(theirs, now)))


def states(scene: Scene, setting: str) -> Readings:
    """Evaluate single states, each set by itself."""
    written = text(scene, 628, SETTINGS[setting])
    model, data = opened(written)
    theirs, state, found = mjx.put_model(model), mjx.put_data(model, data), Readings(setting)
    for q, v in states_of(written, scene):
        given = state.replace(qpos=jax.numpy.array(q), qvel=jax.numpy.array(v))
        found.read(scene, _evaluated(model, forward(theirs, given)))
    return found


def _evaluated(model: Any, state: Any) -> Instant:
    q, v, a, drive = (np.array(x) for x in (state.qpos, state.qvel, state.qacc, state.actuator_force))
    closing = np.array(getattr(state, "_impl", state).efc_force)[:2]
    return reading(model, q, v, a, drive[model.actuator("drive").id], closing)
