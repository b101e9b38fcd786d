"""MJCF for each simulator that reads it: what carries the loop best there, and where its numbers stand."""

from dataclasses import replace
from typing import NamedTuple

from fourbar.errors import InputError
from fourbar.mjcf.document import READING, mjcf
from fourbar.mjcf.notes import NOTES
from fourbar.mjcf.settings import RECIPE, Settings
from fourbar.scene import Scene

SINGLE = replace(RECIPE, flywheel=1e3, pad=None)
"""For single precision: there a flywheel of 1e8 and fitted pads lose the closing force entirely."""

FAST = replace(RECIPE, time_constant_steps=2.0)
"""For a closure whose acceleration lacks a term: the quicker it yields, the sooner its error makes up for that."""


class Simulator(NamedTuple):
    """One reader of the file."""

    settings: Settings
    note: str
    """Which numbers hold T2 and the pin force at B, of which instant, and what is known to go wrong."""


SIMULATORS = {
    "mujoco": Simulator(RECIPE, f"{READING} {NOTES['numbers']['mujoco_before_3_7']}"),
    "warp": Simulator(SINGLE, NOTES["numbers"]["warp"]),
    "mjx": Simulator(FAST, NOTES["numbers"]["mjx"]),
    "genesis": Simulator(RECIPE, NOTES["numbers"]["genesis"]),
    "newton": Simulator(SINGLE, NOTES["numbers"]["newton"]),
}


def mjcf_for(scene: Scene, simulator: str = "mujoco") -> str:
    """Write the MJCF text of a scene for one simulator, its comment naming where torque and pin force are read.

    Raises
    ------
    InputError : no such simulator; else as `mjcf`.
    """
    if simulator not in SIMULATORS:
        raise InputError("simulator", simulator, f"must be one of {', '.join(SIMULATORS)}")
    return mjcf(scene, *SIMULATORS[simulator])
