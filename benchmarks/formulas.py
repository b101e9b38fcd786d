"""Time of the formulas over commits.

`asv continuous HEAD~1 HEAD --bench Solve` compares two.
"""

import numpy as np

import fourbar
from fourbar.scene import Command
from fourbar_validation.places import MODELS


class Solve:
    """Time of `fourbar.solve` for one position and for many."""

    params = ([1, 361, 100_000], ["position", "force", "error"])
    param_names = ("positions", "stage")

    def setup(self, positions, stage):
        """Load the crank-rocker and command a turn."""
        self.scene = fourbar.load(MODELS / "crank_rocker.toml")
        self.command = Command(
            np.linspace(0.0, 6.0, positions), np.ones(positions, np.int8), 10.0, 0.0
        )
        self.time_solve(positions, stage)

    def time_solve(self, positions, stage):
        """Solve as far as the stage."""
        fourbar.solve(self.scene, stage, at=self.command)
