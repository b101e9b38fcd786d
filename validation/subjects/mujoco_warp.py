"""MuJoCo Warp, in single precision; `forward` once as a user of MuJoCo would, and twice as the file's comment says."""

import time
from typing import Any

import mujoco_warp as mjw
import numpy as np
import warp

from fourbar.scene import Scene
from validation.subjects.motion import Readings, turn
from validation.subjects.mujoco_c import at_rest_of, opened, read, text

VERSION = mjw.__version__ if hasattr(mjw, "__version__") else ""
DEVICE = str(warp.get_preferred_device().name)
"""Its arrays lie on a GPU where there is one."""
STEPS = (78, 157)
CHANGED = "a light flywheel and no pads (--for warp): single precision; midphase may not be switched off"
SETTINGS = {"forward twice": 2, "forward once": 1}


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """A turn in so many steps."""
    model, data = opened(text(scene, steps, "warp"))
    theirs, state = mjw.put_model(model), mjw.put_data(model, data)
    mjw.step(theirs, mjw.put_data(model, data))  # compiled before the clock runs
    found, done = Readings(setting, steps), 0
    for stop in turn(scene, steps)[1]:
        began = time.process_time()
        for _ in range(stop - done):
            mjw.step(theirs, state)
        found.seconds += time.process_time() - began
        done = stop
        _evaluate(found, model, theirs, state, SETTINGS[setting])
    return found


def states(scene: Scene, setting: str) -> Readings:
    """Single states, each set and evaluated by itself."""
    model, data = opened(text(scene, 628, "warp"))
    theirs, state = mjw.put_model(model), mjw.put_data(model, data)
    found = Readings(setting)
    for q, v in at_rest_of(model, data, scene):
        state.qpos.assign(np.array([q], dtype=np.float32))
        state.qvel.assign(np.array([v], dtype=np.float32))
        _evaluate(found, model, theirs, state, SETTINGS[setting])
    return found


def _evaluate(found: Readings, model: Any, theirs: Any, state: Any, times: int) -> None:
    for _ in range(times):
        mjw.forward(theirs, state)
    q, v, a, drive = (x.numpy()[0].astype(float) for x in (state.qpos, state.qvel, state.qacc, state.actuator_force))
    closing = state.efc.force.numpy()[0, :2].astype(float)
    read(found, model, q, v, a, drive[model.actuator("drive").id], closing)
    sites = state.site_xpos.numpy()[0]
    gap = np.linalg.norm(sites[model.site("B3").id] - sites[model.site("B4").id])
    found.gap = max(found.gap, float(gap))
