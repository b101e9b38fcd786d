"""`python -m fourbar_lab.simulators.work MODULE SCENE`: one simulator in its own environment; prints JSON.

It needs numpy, mpmath, pint and the simulator.
"""

import json
import os
import platform
import sys
from importlib import import_module
from pathlib import Path
from typing import TextIO

import fourbar

FURTHER = ("APART", "MADE_FOR", "NOT_RUN")
"""Names that a simulator's module may define: settings that stand apart, its purpose, and what did not run."""


def main(module: str, file: str, answers: TextIO) -> None:
    """Try every setting: a turn at each number of steps, and single states where the simulator takes them."""
    simulator, scene = import_module(f"fourbar_lab.simulators.{module}"), fourbar.load(Path(file))
    found = []
    for setting in simulator.SETTINGS:
        at_states = simulator.states(scene, setting) if hasattr(simulator, "states") else None
        if at_states is not None:  # a setting may have none
            found.append(at_states)
        found += [simulator.through(scene, steps, setting) for steps in simulator.STEPS]
    answer = {"version": simulator.VERSION, "changed": simulator.CHANGED, "readings": [each.plain() for each in found]}
    if hasattr(simulator, "slopes"):
        answer["slopes"] = simulator.slopes(scene)
    answer |= {"device": getattr(simulator, "DEVICE", "CPU"), "python": platform.python_version()}
    answer |= {name.lower(): getattr(simulator, name) for name in FURTHER if hasattr(simulator, name)}
    answers.write(json.dumps(answer))


if __name__ == "__main__":
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as stdout:
        os.dup2(2, 1)  # a simulator's prints are no answer
        main(sys.argv[1], sys.argv[2], stdout)
