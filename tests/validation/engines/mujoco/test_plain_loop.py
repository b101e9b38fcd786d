"""A plain loop over MuJoCo's own calls."""

import numpy as np

from fourbar.scene import command
from fourbar_validation.advise.worst_errors import compute_errors
from fourbar_validation.engines.mujoco.plain_loop import MujocoInverseLoop
from tests.support.scenes import crank_rocker, thesis


def test_it_answers_to_round_off() -> None:
    """Where bar 2, 3 or 4 is driven, under weights and loads, close to limits."""
    scenes = [crank_rocker(drive_bar=bar) for bar in (2, 3)]
    for scene in (*scenes, thesis(np.radians([100.0, 135.0]))):
        rows = command(scene)
        assert (
            compute_errors(scene, rows, MujocoInverseLoop(scene).answer(rows)).worst
            < 1e-11
        )
