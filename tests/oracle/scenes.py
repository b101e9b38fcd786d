"""Scenes of the quick sample of the oracles."""

from fourbar.effects import Load
from fourbar.scene import Scene
from fourbar.scene.motion import Motion, Sweep
from fourbar_lab.fault_scenes import (
    FAULT_SCENES,
    LOADS,
    MOTION_OF_A_TURN,
    POINTS_OF_BARS,
    SLENDER_LINKAGE,
    WEIGHT,
)

STEADY_TURN = MOTION_OF_A_TURN.replace(acceleration=0.0)
"""Motion with RMS values and energies: an accelerated sweep has none."""
SLENDER = Scene(
    SLENDER_LINKAGE, MOTION_OF_A_TURN, effects=(WEIGHT,), points=POINTS_OF_BARS
)
WRITTEN = {
    "slender": SLENDER,
    "loaded": Scene(
        SLENDER_LINKAGE,
        STEADY_TURN,
        2,
        (*LOADS, Load(3, moment=-0.3, from_pin=(0.2, 0.4)), Load(4, moment=0.2)),
        (WEIGHT,),
    ),
    "part of a turn": Scene(
        SLENDER_LINKAGE, Motion(Sweep(0.1, 2.0, 8), 10.0), effects=(WEIGHT,)
    ),
}


def take_scene(name):
    """Return a scene of the sample, or one of those on which faults are tried."""
    return WRITTEN[name] if name in WRITTEN else FAULT_SCENES[name]
