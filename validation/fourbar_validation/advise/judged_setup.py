"""Trials of a scene that are judged at the steps and between them.

A run is read at the step nearest to each position. Between the steps it can be judged
only if every step was read, so that more steps take more positions.
"""

import numpy as np

from fourbar.mjcf import Settings
from fourbar.scene import Command, Scene
from fourbar.scene import command as command_of
from fourbar_validation.engines.mujoco.trial import Edit, Trial, TrialSetup

INTERVALS_READ = 180
"""Intervals of the sweep at which a run is read at least."""
DENSEST_INTERVALS = 16 * INTERVALS_READ
"""Intervals beyond which steps are so dense that a curve of degree 7 through them is
exact to round-off.
"""


class JudgedSetup(TrialSetup):
    """A scene, ready to be tried with any settings, each read at all of its steps.

    Parameters
    ----------
    before : theta_2 of a further position before the sweep, from which a run starts,
        rad.
    """

    def __init__(
        self,
        scene: Scene,
        intervals: int = INTERVALS_READ,
        before: float | None = None,
    ) -> None:
        command = add_positions(command_of(scene), intervals)
        if before is not None:
            command = command._replace(
                angle=np.append(command.theta_2, before),
                branch=np.append(command.branch, command.branch[0]),
            )
        super().__init__(scene, command)
        self.stated = scene
        self.intervals = intervals
        self.before = before
        self._denser: JudgedSetup | None = None

    def try_out(self, settings: Settings, edit: Edit | None = None) -> Trial:
        """Run through the scene with as many positions as there are steps."""
        if self.intervals > self.steps(settings) or self.intervals >= DENSEST_INTERVALS:
            return super().try_out(settings, edit)
        if self._denser is None:
            self._denser = JudgedSetup(self.stated, 4 * self.intervals, self.before)
        return self._denser.try_out(settings, edit)


def add_positions(command: Command, intervals: int) -> Command:
    """Return a command with evenly spaced positions between its own.

    Errors have their peaks there, most near a pole of T3, T4. A command whose branch
    changes is left as it is.
    """
    if np.ptp(command.branch) != 0:
        return command
    ends = command.theta_2.min(), command.theta_2.max()
    theta_2 = np.union1d(command.theta_2, np.linspace(*ends, intervals + 1))
    return command._replace(
        angle=theta_2,
        branch=np.full(theta_2.shape, command.branch[0], dtype=np.int8),
    )
