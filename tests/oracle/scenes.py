"""Scenes of the quick sample of the oracles."""

from dataclasses import replace

import numpy as np

from fourbar.effects import Load, Table
from fourbar.formulas.mobility import TURN, choose_range
from fourbar.scene import Scene
from fourbar.scene.motion import RISE_LAWS, Motion, Rise, Sine, Sweep
from fourbar_lab.fault_scenes import (
    CRANK_ROCKER,
    FAULT_SCENES,
    LOADS,
    MOTION_OF_A_TURN,
    POINTS_OF_BARS,
    SLENDER_LINKAGE,
    WEIGHT,
)
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from tests.support.scenes import CYLINDER, crank_rocker

STEADY_TURN = MOTION_OF_A_TURN.replace(acceleration=0.0)
"""Motion with RMS values and energies: an accelerated sweep has none."""
SLENDER = Scene(
    SLENDER_LINKAGE, MOTION_OF_A_TURN, effects=(WEIGHT,), points=POINTS_OF_BARS
)
SPIKE = Load(
    2,
    moment=-0.5,
    table=Table(
        tuple(np.radians((0.0, 98.3, 101.3, 104.3, 360.0))), (0.5, 0.5, 50.0, 0.5, 0.5)
    ),
)
"""Couple whose corners lie between the positions of a turn."""


def fall(duration, steps):
    """Let the crank fall back in a time that a few of its steps cover."""
    law = Rise("cycloidal", (1.2, 0.5), 0.3, 0.1, duration, 0.1, steps=steps)
    return replace(CRANK_ROCKER, motion=Motion(law=law))


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
    "load with corners": replace(CRANK_ROCKER, loads=(SPIKE,)),
    "fall in 5 ms": fall(0.005, 24),
    "fall in 20 ms": fall(0.02, 24),
    "slow fall": fall(0.4, 90),
    "pushed": crank_rocker(
        Motion(stroke=Sweep(0.19, 0.31, 36), stroke_speed=0.2, side="left"),
        drive=CYLINDER,
    ),
}


def take_scene(name):
    """Return a scene of the sample, or one of those on which faults are tried."""
    return WRITTEN[name] if name in WRITTEN else FAULT_SCENES[name]


def draw_motion(seed, number):
    """Draw a random linkage whose commanded angle follows a random law.

    Parts of the law last from 5 ms to 1 s, and 12 to 90 steps cover all of them.
    """
    rng = np.random.default_rng([seed, number])
    scene = draw_random_scene(seed, number, tuple(DrawnType))
    low, high = choose_range(scene.linkage)
    first, last = low + (high - low) * rng.uniform((0.05, 0.55), (0.45, 0.95))
    steps = int(rng.integers(12, 91))
    dwell, rise, fall, rest = 10.0 ** rng.uniform(-2.3, 0.0, 4)
    if rng.random() < 0.2:
        half = 0.5 * (last - first)
        law = Sine(first + half, half, TURN / rise, dwell, fall, steps)
    else:
        kind = str(rng.choice(RISE_LAWS))
        falls = {"fall": fall, "rest": rest} if rng.random() < 0.8 else {}
        law = Rise(kind, (last - first, rise), first, dwell, steps=steps, **falls)
    return replace(scene, motion=Motion(law=law), drive=None, drive_bar=2)
