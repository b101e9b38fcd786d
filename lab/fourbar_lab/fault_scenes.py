"""Scenes on which injected faults are tried.

Together they have each effect, drive, branch and kind of motion.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from fourbar.effects import (
    Flywheel,
    Friction,
    Gravity,
    LinearDrive,
    Load,
    PinFriction,
    Place,
    PointDrive,
    Spring,
    Springs,
    Table,
    Torsion,
    Viscous,
)
from fourbar.formulas.mobility import limit_positions
from fourbar.linkage import PINS, Bar, FourBar, uniform
from fourbar.scene import Scene
from fourbar.scene.motion import CROSSED, Free, Law, Motion, Rise, Sweep
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
_ROUND_AND_FLAT = FourBar(
    0.3,
    Bar(0.1, density=7850.0, diameter=0.02),
    Bar(0.25, density=2700.0, section=(0.02, 0.005)),
    Bar(0.22, 0.4),
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
CRANK_ROCKER = Scene(
    CRANK_ROCKER_LINKAGE,
    MOTION_OF_A_TURN,
    2,
    LOADS,
    (WEIGHT,),
    points=POINTS_OF_BARS,
)
_WRITTEN_SCENES: dict[str, Scene] = {
    "crank-rocker": CRANK_ROCKER,
    "coupler driven": replace(
        CRANK_ROCKER,
        motion=MOTION_OF_A_TURN.replace(branch=CROSSED),
        drive_bar=3,
    ),
    "output driven": replace(
        CRANK_ROCKER,
        motion=Motion(Sweep(0.5, 1.5, 12), -10.0, 5.0),
        drive_bar=4,
    ),
    "cylinder": replace(
        CRANK_ROCKER,
        motion=MOTION_OF_A_TURN.replace(branch=CROSSED),
        drive_bar=None,  # type: ignore[arg-type]
        drive=LinearDrive(Place(2, (0.17, -1.1)), Place(4, (0.09, 0.7))),
    ),
    "stroke": replace(
        CRANK_ROCKER,
        motion=Motion(
            stroke=Sweep(0.25, 0.35, 12),
            stroke_speed=0.2,
            stroke_acceleration=0.1,
            side="left",
        ),
        drive_bar=None,  # type: ignore[arg-type]
        drive=LinearDrive(Place(1, (0.3, 2.2)), Place(2, (0.12, 0.4))),
    ),
    "stroke of the output": replace(
        CRANK_ROCKER,
        motion=Motion(
            stroke=Sweep(0.33, 0.36, 12),
            stroke_speed=0.2,
            stroke_acceleration=0.1,
            side="right",
        ),
        drive_bar=None,  # type: ignore[arg-type]
        drive=LinearDrive(Place(1, (0.5, -0.5)), Place(4, (0.09, 0.7))),
    ),
    "output commanded": replace(
        CRANK_ROCKER,
        motion=Motion(theta_4=Sweep(1.8, 2.5, 12), omega_4=3.0),
        drive_bar=4,
    ),
    "push": replace(
        CRANK_ROCKER,
        drive_bar=None,  # type: ignore[arg-type]
        drive=PointDrive(Place(4, (0.17, -0.6)), 1.1, "bar"),
    ),
    "push on the coupler": replace(
        CRANK_ROCKER,
        drive_bar=None,  # type: ignore[arg-type]
        drive=PointDrive(Place(3, from_centre=(0.07, 0.9)), 2.1),
    ),
    "cylinder on the ground": replace(
        CRANK_ROCKER,
        drive_bar=None,  # type: ignore[arg-type]
        drive=LinearDrive(Place(1, (0.17, -1.1)), Place(3, (0.09, 0.7))),
    ),
    "slender bars": Scene(SLENDER_LINKAGE, MOTION_OF_A_TURN),
    "limited": Scene(
        ROCKER_CRANK_LINKAGE,
        Motion(Sweep(0.3, 1.4, 22), 3.0),
        effects=(WEIGHT,),
    ),
    "near a limit": Scene(
        ROCKER_CRANK_LINKAGE,
        Motion(
            limit_positions(ROCKER_CRANK_LINKAGE)[0].theta_2 + np.array([1e-2, 1e-3]),
            1.0,
        ),
        effects=(WEIGHT,),
    ),
    "nearest to a limit": Scene(
        ROCKER_CRANK_LINKAGE,
        Motion(
            limit_positions(ROCKER_CRANK_LINKAGE)[0].theta_2 + np.array([1e-3, 1e-13]),
            1.0,
        ),
        effects=(WEIGHT,),
    ),
    "positions": Scene(CRANK_ROCKER_LINKAGE, Motion(Sweep(0.0, 6.0, 12))),
    "damped": replace(
        CRANK_ROCKER,
        effects=(
            Viscous.at(O2=0.01, A=0.02, B=0.03, O4=0.015),
            Friction.at(O2=0.02, A=0.05, B=0.04, O4=0.03),
        ),
    ),
    "sprung": replace(
        CRANK_ROCKER,
        effects=(
            Springs(
                (
                    Spring(
                        Place(1, (0.2, 0.6)),
                        Place(3, (0.15, -0.4)),
                        80.0,
                        0.1,
                        2.0,
                    ),
                    Spring(Place(2, (0.05, 0.3)), Place(4, (0.1, 0.5)), 50.0, 0.12),
                )
            ),
            Torsion.at(B=(0.5, 0.7, 0.1), O4=(0.3, 1.2, -0.05)),
            Flywheel(0.003, 4),
        ),
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
    "flywheel": replace(
        CRANK_ROCKER,
        effects=(Flywheel(0.003, 2), Torsion.at(A=(0.5, 0.2, 0.1))),
    ),
    "wound": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(0.0, 9.0, 30), 5.0),
        effects=(Torsion.at(O2=(0.5, 1.0, 0.1)),),
    ),
    "sliding pins": replace(
        CRANK_ROCKER,
        effects=(WEIGHT, PinFriction.at(A=(0.2, 0.02), O4=(0.3, 0.03))),
    ),
    "one sliding pin": replace(
        CRANK_ROCKER,
        effects=(WEIGHT, PinFriction.at(B=(0.3, 0.03))),
        drive_bar=4,
    ),
    "at rest": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(0.1, 6.0, 12), 0.0),
        2,
        LOADS,
        (WEIGHT, Friction.at(A=0.05, B=0.02), PinFriction.at(O4=(0.2, 0.02))),
    ),
    "table": replace(
        CRANK_ROCKER,
        loads=(
            Load(
                4,
                (3.0, 0.7),
                arm=(0.05, 1.0),
                moment=0.2,
                table=Table(
                    (0.1, 2.0, 4.0, 0.1 + 2.0 * math.pi), (1.0, -0.5, 2.0, 1.0)
                ),
            ),
        ),
    ),
    "law": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(
            law=Law(
                (0.0, 0.2, 0.5, 0.9, 1.2),
                (0.3, 1.5, 3.1, 5.2, 0.3 + 2.0 * math.pi),
                16,
                "periodic",
            )
        ),
        effects=(WEIGHT,),
    ),
    "law at rest": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(law=Law((0.0, 0.3, 0.7, 1.0), (0.3, 1.0, 2.2, 3.0), 16, "rest")),
    ),
    "rises": Scene(
        _ROUND_AND_FLAT,
        Motion(law=Rise("cycloidal", (1.2, 0.4), 0.3, 0.1, 0.3, 0.1, steps=24)),
        effects=(WEIGHT,),
    ),
    "3-4-5 rise": Scene(
        _ROUND_AND_FLAT, Motion(law=Rise("345", (1.2, 0.4), 0.3, 0.1, steps=24))
    ),
    "free law": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(law=Law((0.0, 0.3, 0.7, 1.0, 1.4), (0.3, 1.0, 2.2, 3.0, 3.3), 16)),
    ),
    "released": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0, 3.0, free=Free(0.5, 50)),
        effects=(WEIGHT,),
    ),
    "released, damped": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0, 3.0, free=Free(0.5, 50)),
        2,
        (Load(4, moment=0.1),),
        (WEIGHT, Viscous.at(O4=0.01, B=0.003), Friction.at(O2=0.02)),
    ),
    "released, pushed from G": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0, 3.0, free=Free(0.5, 50)),
        2,
        (Load(3, (2.0, -0.4), from_centre=(0.06, 0.5), frame="bar"),),
    ),
    "double rocker released": Scene(
        ROCKER_CRANK_LINKAGE,
        Motion(math.radians(50.0), 0.0, free=Free(1.0, 100)),
        effects=(Gravity(),),
    ),
    "several solutions": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(np.array([2.3, 2.5]), 10.0),
        effects=(PinFriction.at(A=(50.0, 0.01)),),
    ),
    "near a reversal": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(
            limit_positions(CRANK_ROCKER_LINKAGE, 4)[0].theta_2
            + np.array([1.0, 1e-2, 1e-4]),
            10.0,
        ),
        effects=(Friction.at(O4=0.03),),
    ),
    "short output": Scene(
        FourBar(1.0, Bar(1.0, 0.2), Bar(2.0, 0.5), Bar(1e-6, 0.4)),
        Motion(math.pi + np.array([5e-4, 1e-3, 1.9e-3, 1.99e-3]), 10.0),
    ),
    "left open": Scene(ROCKER_CRANK_LINKAGE, Motion(omega_2=3.0)),
    "many turns away": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(20.0, 22.0, 10), 5.0),
        effects=(Torsion.at(O2=(0.5, 1.0, 0.1)),),
    ),
    "ends of a spring nearly meet": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0 + np.array([1e-5, 0.1, 1.0]), 10.0),
        effects=(
            Springs((Spring(Place(1, (0.1, 0.8)), Place(2, (0.1, 0.0)), 80.0, 0.05),)),
        ),
    ),
    "held by friction": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0, 0.0, free=Free(0.5, 5)),
        effects=(WEIGHT, Friction.at(B=0.3, O2=2.0)),
    ),
    "held in the end": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0, 3.0, free=Free(1.0, 20)),
        effects=(WEIGHT, Friction.at(A=0.3, O4=1.0)),
    ),
    "from rest against friction": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(1.0, 0.0, free=Free(0.5, 20)),
        effects=(WEIGHT, Friction.at(A=0.01, O4=0.02)),
    ),
    "to full accuracy: short diagonal": Scene(
        uniform(0.859375, 0.853515625, 0.58984375, 0.583984375),
        Motion(np.array([0.0018, 0.01]), 10.0),
        effects=(WEIGHT,),
    ),
    "no torque": Scene(
        uniform(0.3, 0.1, 0.3, 0.1),
        Motion(np.array([0.5, 1.0]), 10.0),
        3,
        effects=(WEIGHT,),
    ),
    "simulated": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(0.1, 6.0, 12), 10.0),
        2,
        LOADS,
        (
            WEIGHT,
            Viscous.at(A=0.002, B=0.003),
            Springs(
                (Spring(Place(1, (0.2, 0.6)), Place(3, (0.15, -0.4)), 80.0, 0.1, 2.0),)
            ),
        ),
    ),
    "simulated, dry": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(0.1, 3.0, 8), 10.0),
        effects=(Friction.at(A=0.05, B=0.04), Torsion.at(O4=(0.3, 1.2, -0.05))),
    ),
    "simulated cylinder": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(0.1, 3.0, 8), 10.0),
        loads=LOADS,
        drive=LinearDrive(Place(1, (0.17, -1.1)), Place(3, (0.09, 0.7))),
    ),
    "simulated stroke": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(
            stroke=Sweep(0.25, 0.35, 8),
            stroke_speed=0.2,
            stroke_acceleration=0.1,
            side="left",
        ),
        loads=LOADS,
        drive=LinearDrive(Place(1, (0.3, 2.2)), Place(2, (0.12, 0.4))),
    ),
    "simulated, quickening": Scene(
        CRANK_ROCKER_LINKAGE,
        Motion(Sweep(0.1, 3.0, 8), 10.0, 20.0),
        4,
        effects=(Flywheel(0.003, 4),),
    ),
}


class _FaultScenes(Mapping[str, Scene]):
    """Scenes by name, those above and those of the files of small scenes.

    A file is read when its scene is asked for: a fault may leave it unreadable, and the
    other scenes are judged all the same.
    """

    def __init__(self) -> None:
        self._files: dict[str, Path] = {
            f"simulated, {file.stem}": file for file in list_capability_files()
        }

    def __getitem__(self, name: str) -> Scene:
        """Return a scene by its name."""
        if name in _WRITTEN_SCENES:
            return _WRITTEN_SCENES[name]
        return read_scene_files([self._files[name]]).scene(0)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        yield from _WRITTEN_SCENES
        yield from self._files

    def __len__(self) -> int:
        """Count the scenes."""
        return len(_WRITTEN_SCENES) + len(self._files)


FAULT_SCENES = _FaultScenes()
"""Scenes by the name under which an entry of faults.toml tries its fault."""
