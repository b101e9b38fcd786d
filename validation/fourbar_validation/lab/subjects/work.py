"""`python -m fourbar_validation.lab.subjects.work MODULE SCENE`: one simulator in its own environment; prints JSON.

It needs numpy, mpmath, pint and the simulator.
"""

import json
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import TextIO

import fourbar


def main(module: str, file: str, answers: TextIO) -> None:
    """Try every setting: a turn at each number of steps, and single states where the simulator takes them."""
    simulator, scene = import_module(f"fourbar_validation.lab.subjects.{module}"), fourbar.load(Path(file))
    found = []
    for setting in simulator.SETTINGS:
        if hasattr(simulator, "states"):
            found.append(simulator.states(scene, setting))
        found += [simulator.through(scene, steps, setting) for steps in simulator.STEPS]
    answer = {"version": simulator.VERSION, "changed": simulator.CHANGED, "readings": [each.plain() for each in found]}
    answer["device"] = getattr(simulator, "DEVICE", "CPU")
    answers.write(json.dumps(answer))


if __name__ == "__main__":
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as stdout:
        os.dup2(2, 1)  # what a simulator prints is no answer
        main(sys.argv[1], sys.argv[2], stdout)
