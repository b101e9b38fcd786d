"""MuJoCo itself (the C library), with the settings of the generated file and with its own defaults."""

import time
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.mjcf import SIMULATORS, mjcf
from fourbar.scene import Scene
from validation.subjects.motion import Readings, start, turn

VERSION = mujoco.__version__
STEPS = (157, 314, 628, 1256)
CHANGED = "nothing"
SETTINGS = {"generated file": "mujoco", "its defaults": None}


def text(scene: Scene, steps: int, simulator: str | None) -> str:
    """The generated MJCF, opening in the subjects' start, with so many steps a turn.

    Without a simulator's name all that the solver is set to goes.
    """
    timestep, _ = turn(scene, steps)
    settings, note = SIMULATORS[simulator or "warp"]  # without pads
    written = mjcf(scene, replace(settings, timestep=timestep), note, start=start(scene))
    if simulator is not None:
        return written
    root = ET.fromstring(written)
    for path, names in {
        "option": ("integrator", "solver", "tolerance", "iterations"),
        "equality/connect": ("solref", "solimp"),
    }.items():
        element = root.find(path)
        assert element is not None
        for name in names:
            element.attrib.pop(name, None)
    return ET.tostring(root, encoding="unicode")


def opened(written: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Compiled, at keyframe 0, evaluated there."""
    model = mujoco.MjModel.from_xml_string(written)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def read(into: Readings, model: Any, q: Any, v: Any, a: Any, drive: float, closing: Any, **pins: Any) -> None:
    """As the comment in the file says; q, v, a in the joints' coordinates."""
    torque = drive - model.dof_armature[0] * a[0]
    into.read((q[0], q[0] + q[1], q[2]), v[0], a[0], torque, {"F43": closing, **pins})


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """A turn in so many steps."""
    model, data = opened(text(scene, steps, SETTINGS[setting]))
    found = Readings(setting, steps)
    done = 0
    for stop in turn(scene, steps)[1]:
        began = time.process_time()
        mujoco.mj_step(model, data, stop - done)
        found.seconds += time.process_time() - began
        done = stop
        _evaluate(found, model, data)
    return found


def states(scene: Scene, setting: str) -> Readings:
    """Single states, each set and evaluated by itself."""
    model, data = opened(text(scene, 628, SETTINGS[setting]))
    found = Readings(setting)
    for q, v in at_rest_of(model, data, scene):
        data.qpos[:], data.qvel[:] = q, v
        _evaluate(found, model, data)
    return found


def at_rest_of(model: Any, data: Any, scene: Scene) -> list[tuple[Any, Any]]:
    """Assembled states of a turn, by MuJoCo's own kinematics: Newton on the gap, speeds by its Jacobian."""
    sites = [model.site(name).id for name in ("B3", "B4")]
    jacobian, other, made = np.zeros((3, model.nv)), np.zeros((3, model.nv)), []
    q, speed = data.qpos.copy(), float(scene.motion.omega_2 or 0.0)
    for theta_2 in q[0] + np.linspace(0.0, 2.0 * np.pi, 25):
        q[0] = theta_2
        for _ in range(20):
            data.qpos[:] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_jacSite(model, data, jacobian, None, sites[0])
            mujoco.mj_jacSite(model, data, other, None, sites[1])
            by_angle = (jacobian - other)[:2]
            gap = (data.site_xpos[sites[0]] - data.site_xpos[sites[1]])[:2]
            q[1:] -= np.linalg.solve(by_angle[:, 1:], gap)
        made.append((q.copy(), np.array([speed, *np.linalg.solve(by_angle[:, 1:], -by_angle[:, 0] * speed)])))
    return made


def _evaluate(found: Readings, model: Any, data: Any) -> None:
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    forces = {f"{name}": data.cfrc_int[model.body(body).id][3:5] for name, body in PINS.items()}
    forces["F32"] = -forces["F32"]
    drive = data.actuator_force[model.actuator("drive").id]
    read(found, model, data.qpos, data.qvel, data.qacc, drive, data.efc_force[:2], **forces)
    found.gap = max(found.gap, float(np.linalg.norm(data.site("B3").xpos - data.site("B4").xpos)))


PINS = {"F12": "input", "F32": "coupler", "F14": "output"}
"""The bodies whose parent bears the force; without loads on sites cfrc_int is that force alone."""
