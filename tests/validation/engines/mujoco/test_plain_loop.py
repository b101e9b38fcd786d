"""A plain loop over MuJoCo's own calls."""

import numpy as np

from fourbar.files import load
from fourbar.scene import command
from fourbar_validation.advise.worst_errors import compute_errors
from fourbar_validation.engines.mujoco.plain_loop import MujocoInverseLoop
from fourbar_validation.scenes.suites import MODELS
from tests.support.scenes import crank_rocker, low_parallelogram, thesis


def test_it_answers_to_round_off():
    """Where bar 2 or 3 is driven, close to limits, beyond a change point.

    Loads are placed from any origin.
    """
    scenes = [crank_rocker(drive_bar=bar) for bar in (2, 3)]
    scenes += [
        low_parallelogram(),
        thesis(np.radians([100.0, 135.0])),
        load(MODELS / "crank_rocker.toml"),
    ]
    for scene in scenes:
        rows = command(scene)
        assert (
            compute_errors(scene, rows, MujocoInverseLoop(scene).answer(rows)).worst
            < 1e-11
        )
