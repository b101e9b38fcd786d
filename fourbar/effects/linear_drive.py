"""A drive along the line between two points of two bars, such as a cylinder."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.effects.force_drive import ForceDrive
from fourbar.effects.place import At, Line, Place
from fourbar.formulas.arithmetic import Number
from fourbar.formulas.motion import State


@dataclass(frozen=True, slots=True)
class LinearDrive(Line, ForceDrive):
    """A force along the line between two points, N, positive where it pushes.

    Parameters
    ----------
    start, end : points on two different bars, one of them the ground perhaps.
    """

    start: Annotated[Place, At("from")]
    end: Annotated[Place, At("to")]
    has_stroke = True

    @property
    def ends(self) -> tuple[tuple[float, Place], tuple[float, Place]]:
        """Return both ends, each with the sense in which the drive pushes it."""
        return (-1.0, self.start), (1.0, self.end)

    @property
    def may_be_commanded(self) -> bool:
        """Return True if the stroke turns bar 2 or 4, as between it and the ground."""
        return {self.start.bar, self.end.bar} in ({1, 2}, {1, 4})

    def line(self, state: State) -> tuple[Number, Number]:
        """Compute the stroke, m, and the unit vector from `start` to `end`.

        The vector is NaN where they coincide.
        """
        across = self.across(state)
        stroke = np.abs(across)
        return stroke, across / stroke

    def act(self, actions: Actions, force: Number) -> None:
        """Push the ends of the drive apart."""
        _, direction = self.line(actions.state)
        actions.pull(self.end, self.start, force * direction)
