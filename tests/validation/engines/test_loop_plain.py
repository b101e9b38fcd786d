"""Plain loops over the calls of Pinocchio and of MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest

from fourbar import PinFriction, Viscous, command, load
from fourbar.errors import LimitError
from fourbar_validation.advise.matters import compute_errors
from fourbar_validation.engines.loop import PlainLoop
from fourbar_validation.engines.mujoco.inverse import MujocoTree
from fourbar_validation.engines.pinocchio import PinocchioTree
from fourbar_validation.places import MODELS
from tests.support.scenes import crank_rocker, low_parallelogram, thesis

SCENES = (
    *(crank_rocker(drive_bar=bar) for bar in (2, 3)),
    crank_rocker(effects=(Viscous.at(A=0.1),)),
    low_parallelogram(),
    thesis(np.radians([100.0, 135.0])),
    load(MODELS / "crank_rocker.toml"),
)


@pytest.mark.parametrize("kind", [PinocchioTree, MujocoTree])
def test_it_answers_to_round_off(kind):
    """Where bar 2 or 3 is driven, close to limits, beyond a change point.

    Loads are placed from any origin.
    """
    for scene in SCENES:
        rows = command(scene)
        assert (
            compute_errors(scene, rows, PlainLoop(kind, scene).answer(rows)).worst
            < 1e-11
        )


def test_friction_of_loaded_pins_and_cylinders_are_refused():
    sliding = crank_rocker(effects=(PinFriction.at(A=(0.2, 0.02)),))
    cylinder = load(MODELS / "capabilities" / "cylinder_2_4.toml")
    for scene, words in (
        (sliding, "loads of pins"),
        (replace(cylinder, loads=()), "no cylinder"),
    ):
        with pytest.raises(LimitError, match=words):
            PlainLoop(PinocchioTree, scene)
