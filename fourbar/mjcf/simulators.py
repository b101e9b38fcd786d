"""MJCF for each simulator that reads it, with what carries the loop best there."""

from dataclasses import replace
from typing import get_args

from fourbar.errors import InputError
from fourbar.mjcf.document import Drive, write_mjcf
from fourbar.mjcf.settings import RECIPE
from fourbar.scene import Scene

SINGLE = replace(RECIPE, flywheel=1e3, pad=None)
"""For single precision: there a flywheel of 1e8 and fitted pads lose the closing force entirely."""
FAST = replace(RECIPE, time_constant_steps=2.0)
"""For a closure whose acceleration lacks a term: the quicker it yields, the sooner its error makes up for that."""
SIMULATORS = {"mujoco": RECIPE, "warp": SINGLE, "mjx": FAST, "genesis": RECIPE, "newton": SINGLE}
"""Who reads the file, and the settings that carry the loop best there."""
OWN_MOTORS = ("genesis", "newton")
"""Who puts couples on joints itself, and takes none from the controls of a file; Genesis takes no actuator at all."""


def write_mjcf_for(scene: Scene, simulator: str = "mujoco", drive: Drive = "flywheel") -> str:
    """Write the MJCF text of a scene for one simulator, its comments naming where torque and pin force are read.

    Raises InputError for no such simulator, or a motor for one that does not take it, and as `write_mjcf` does.
    """
    if simulator not in SIMULATORS:
        raise InputError("simulator", simulator, f"must be one of {', '.join(SIMULATORS)}")
    if drive not in get_args(Drive):
        raise InputError("drive", drive, f"must be one of {', '.join(get_args(Drive))}")
    if drive == "motor" and simulator in OWN_MOTORS:
        raise InputError("drive", drive, f"is read by mujoco, warp and mjx; for {simulator} take none")
    return write_mjcf(scene, SIMULATORS[simulator], simulator, drive=drive)
