"""`python -m fourbar_lab.simulators.states MODULE SETTING`: serve a simulator's single states.

Each position is a state that is set by itself; it is answered at the motion that the simulator then has.
"""

import os
import sys
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np

from fourbar.errors import InputError, LimitError
from fourbar.quantities import PIN_FORCES
from fourbar_lab.simulators.slider_engines import serve
from fourbar_validation.engines import protocol

ANSWERS = ("theta_3", "theta_4", "torque", *PIN_FORCES)


def answer(module: Any, setting: str, question: dict[str, Any]) -> dict[str, Any]:
    """Answer the positions of a question."""
    scene, command = protocol.command_from_json(protocol.scene_from_json(question["scene"]), question["command"])
    if scene.motion.through != "sign":
        raise LimitError("a simulator that assembles by one branch does not change it")
    try:
        readings = module.states(scene, setting)
    except InputError as error:  # a scene that no file for this simulator can hold
        raise LimitError(str(error)) from None
    theta = np.array(readings.theta)
    if len(theta) != len(command.angle):
        raise LimitError(f"{len(theta)} of {len(command.angle)} positions are assembled")
    values = {"theta_3": theta[:, 1], "theta_4": theta[:, 2], "torque": readings.torque, **readings.forces}
    omega, alpha = np.array(readings.omega_2), np.array(readings.alpha_2)
    at = command._replace(angle=theta[:, 0], speed=omega, acceleration=alpha)
    answers = {name: np.asarray(values[name], dtype=float).tolist() for name in ANSWERS if name in values}
    return {
        "answers": answers,
        "at": protocol.command_to_json(scene, at),
        "setting": f"{setting}, single states",
    }


if __name__ == "__main__":
    with os.fdopen(os.dup(1), "wb") as stdout:
        os.dup2(2, 1)  # a simulator's prints are no answer
        module = import_module(f"fourbar_lab.simulators.{sys.argv[1]}")
        hello = {"engine": sys.argv[1], "version": module.VERSION, "answers": list(ANSWERS), "effects": ["gravity"]}
        serve(hello, partial(answer, module, sys.argv[2]), sys.stdin.buffer, stdout)
