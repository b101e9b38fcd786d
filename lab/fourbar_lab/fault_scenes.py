"""Scenes on which injected faults are tried.

Together they have each effect, drive, branch and kind of motion.
"""

import math
from collections import UserDict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.effects import (
    Effect,
    Friction,
    Gravity,
    Load,
    PinFriction,
    Place,
    Spring,
    Springs,
    Torsion,
    Viscous,
)
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import PINS, Bar, FourBar, uniform
from fourbar.scene import Scene
from fourbar.scene.motion import Free, Law, Motion, Sweep
from fourbar.scene.numbers import Point
from fourbar_validation.scenes.suites import list_capability_files, read_scene_files

CRANK_ROCKER_LINKAGE = FourBar(
    0.3,
    Bar(0.1, 0.2, centre=(0.04, 0.4)),
    Bar(0.25, 0.5, 0.004, (0.13, 0.3)),
    Bar(0.22, 0.4, 0.002, (0.12, -0.2)),
    ground_angle=0.2,
)
SLENDER_LINKAGE = FourBar(
    0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4), ground_angle=0.2
)
ROCKER_CRANK_LINKAGE = FourBar(0.3, Bar(0.25, 0.7), Bar(0.1, 1.3), Bar(0.22, 0.9))
MOTION_OF_A_TURN = Motion(Sweep(0.1, 0.1 + 2.0 * math.pi, 24), 10.0, 5.0)
LOADS = (
    Load(4, (3.0, 0.7), arm=(0.05, 1.0)),
    Load(3, (2.0, -0.4), from_centre=(0.06, 0.5), moment=0.1, frame="bar"),
    Load(2, (1.0, 0.3), from_pin=(0.07, -0.2)),
)
WEIGHT = Gravity(9.81, -1.3)
POINTS_OF_BARS = (
    Point("P", 3, (0.1, 0.7)),
    Point("Q", 4, (0.05, -0.3)),
    Point("R", 2, (0.03, 0.2)),
)


def _move(
    motion: Motion,
    *effects: Effect,
    linkage: FourBar = CRANK_ROCKER_LINKAGE,
    **parts: Any,
) -> Scene:
    """Return a linkage without loads that moves under some effects."""
    return Scene(linkage, motion, effects=effects, **parts)


CRANK_ROCKER = Scene(
    CRANK_ROCKER_LINKAGE,
    MOTION_OF_A_TURN,
    loads=LOADS,
    effects=(WEIGHT,),
    points=POINTS_OF_BARS,
)
_RELEASED = Motion(1.0, 3.0, free=Free(0.5, 50))


def _near(angle: float, *offsets: float, speed: float = 1.0) -> Motion:
    """Return a motion at some positions beside an angle."""
    return Motion(angle + np.array(offsets), speed)


_LIMIT = limit_positions(ROCKER_CRANK_LINKAGE)[0].theta_2
_REVERSAL = limit_positions(CRANK_ROCKER_LINKAGE, 4)[0].theta_2
_WRITTEN_SCENES: dict[str, Scene | Path] = {
    "crank-rocker": CRANK_ROCKER,
    "output commanded": replace(
        CRANK_ROCKER,
        motion=Motion(theta_4=Sweep(1.8, 2.5, 12), omega_4=3.0),
        drive_bar=4,
    ),
    "limited": _move(
        Motion(Sweep(0.3, 1.4, 22), 3.0), WEIGHT, linkage=ROCKER_CRANK_LINKAGE
    ),
    "near a limit": _move(
        _near(_LIMIT, 1e-2, 1e-3), WEIGHT, linkage=ROCKER_CRANK_LINKAGE
    ),
    "nearest to a limit": _move(
        _near(_LIMIT, 1e-3, 1e-13), WEIGHT, linkage=ROCKER_CRANK_LINKAGE
    ),
    "sprung at the pins": replace(
        CRANK_ROCKER,
        effects=(
            Springs(
                tuple(
                    Spring(Place(i, (0.12, 0.5)), Place(j, (0.09, -0.4)), 60.0, 0.1)
                    for i, j in PINS.values()
                )
            ),
        ),
    ),
    "wound": _move(Motion(Sweep(0.0, 9.0, 30), 5.0), Torsion.at(O2=(0.5, 1.0, 0.1))),
    "at rest": _move(
        Motion(Sweep(0.1, 6.0, 12), 0.0),
        WEIGHT,
        Friction.at(A=0.05, B=0.02),
        PinFriction.at(O4=(0.2, 0.02)),
        loads=LOADS,
    ),
    "free law": _move(
        Motion(law=Law((0.0, 0.3, 0.7, 1.0, 1.4), (0.3, 1.0, 2.2, 3.0, 3.3), 16))
    ),
    "released and damped": _move(
        _RELEASED,
        WEIGHT,
        Viscous.at(O4=0.01, B=0.003),
        Friction.at(O2=0.02),
        loads=(Load(4, moment=0.1),),
    ),
    "released and pushed from G": _move(
        _RELEASED,
        loads=(Load(3, (2.0, -0.4), from_centre=(0.06, 0.5), frame="bar"),),
    ),
    "double rocker released": _move(
        Motion(math.radians(50.0), 0.0, free=Free(1.0, 100)),
        Gravity(),
        linkage=ROCKER_CRANK_LINKAGE,
    ),
    "positions": _move(Motion(Sweep(0.0, 6.0, 12))),
    "several solutions": _move(
        Motion(np.array([2.3, 2.5]), 10.0), PinFriction.at(A=(50.0, 0.01))
    ),
    "near a reversal": _move(
        _near(_REVERSAL, 1.0, 1e-2, 1e-4, speed=10.0), Friction.at(O4=0.03)
    ),
    "short output": _move(
        _near(math.pi, 5e-4, 1e-3, 1.9e-3, 1.99e-3, speed=10.0),
        linkage=FourBar(1.0, Bar(1.0, 0.2), Bar(2.0, 0.5), Bar(1e-6, 0.4)),
    ),
    "left open": _move(Motion(omega_2=3.0), linkage=ROCKER_CRANK_LINKAGE),
    "many turns away": _move(
        Motion(Sweep(20.0, 22.0, 10), 5.0), Torsion.at(O2=(0.5, 1.0, 0.1))
    ),
    "ends of a spring nearly meet": _move(
        _near(1.0, 1e-5, 0.1, 1.0, speed=10.0),
        Springs((Spring(Place(1, (0.1, 0.8)), Place(2, (0.1, 0.0)), 80.0, 0.05),)),
    ),
    "held by friction": _move(
        Motion(1.0, 0.0, free=Free(0.5, 5)), WEIGHT, Friction.at(B=0.3, O2=2.0)
    ),
    "held in the end": _move(
        Motion(1.0, 3.0, free=Free(1.0, 20)), WEIGHT, Friction.at(A=0.3, O4=1.0)
    ),
    "from rest against friction": _move(
        Motion(1.0, 0.0, free=Free(0.5, 20)), WEIGHT, Friction.at(A=0.01, O4=0.02)
    ),
    "short diagonal": _move(
        Motion(np.array([0.0018, 0.01]), 10.0),
        WEIGHT,
        linkage=uniform(0.859375, 0.853515625, 0.58984375, 0.583984375),
    ),
    "no torque": _move(
        Motion(np.array([0.5, 1.0]), 10.0),
        WEIGHT,
        linkage=uniform(0.3, 0.1, 0.3, 0.1),
        drive_bar=3,
    ),
}


class _FaultScenes(UserDict[str, Any]):
    """Scenes by name, those above and those of the files of small scenes.

    A file is read when its scene is asked for: a fault may leave it unreadable, and the
    other scenes are judged all the same.
    """

    def __getitem__(self, name: str) -> Scene:
        """Return a scene by its name."""
        scene: Scene | Path = self.data[name]
        if isinstance(scene, Path):
            return read_scene_files([scene]).scene(0)
        return scene


FAULT_SCENES = _FaultScenes(
    _WRITTEN_SCENES | {file.stem: file for file in list_capability_files()}
)
"""Scenes by the name under which an entry of faults.toml tries its fault."""
