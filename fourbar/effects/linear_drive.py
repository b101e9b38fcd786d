"""A drive along the line between two points of two bars, such as a cylinder."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.effects.force_drive import ForceDrive
from fourbar.effects.place import At, Line, Place
from fourbar.effects.spring import COINCIDENT_POINTS
from fourbar.errors import InputError, write_in_units
from fourbar.formulas.arithmetic import Number, is_any
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.linkage import ENDS, MOVING_BARS, PINS, FourBar
from fourbar.quantities import NO_DIRECTION, NO_LEVER, OK


@dataclass(frozen=True, slots=True)
class LinearDrive(Line, ForceDrive):
    """A force along the line between two points, N, positive where it pushes.

    Parameters
    ----------
    start, end : points on two different bars, one of them the ground perhaps.
    """

    start: Annotated[Place, At("from")]
    end: Annotated[Place, At("to")]
    has_stroke: ClassVar[bool] = True

    @property
    def ends(self) -> tuple[tuple[float, Place], tuple[float, Place]]:
        """Return both ends, each with the sense in which the drive pushes it."""
        return (-1.0, self.start), (1.0, self.end)

    @property
    def may_be_commanded(self) -> bool:
        """Return True if the stroke turns bar 2 or 4, as between it and the ground."""
        return {self.start.bar, self.end.bar} in ({1, 2}, {1, 4})

    @property
    def may_be_left_out(self) -> tuple[int, ...]:
        """Return the bars of which one may be left out.

        The moments of the other two then give the force between them. From the ground
        to bar 2 or 4 it is in the moment of that bar alone, as a couple is; else it is
        in any pair's.
        """
        bars = {self.start.bar, self.end.bar}
        if bars in ({1, 2}, {1, 4}):
            return (*bars - {1},)
        return MOVING_BARS

    def require_motion(self, linkage: FourBar) -> None:
        """Raise InputError if no motion changes the distance of the ends.

        An example is a drive with both ends on one bar.
        """
        if common := _list_bars(linkage, self.start) & _list_bars(linkage, self.end):
            allowed = (
                f"keeps its distance from `from` at every position: bar {min(common)}"
                " holds both"
            )
            raise InputError(
                "drive.to",
                f"bar {self.end.bar} at {write_in_units('m', self.end.distance)}",
                allowed,
            )

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

    def status(self, state: State, sines: dict[int, Number]) -> Number:
        """Return NO_DIRECTION where the ends coincide, NO_LEVER where P vanishes.

        P vanishes within its rounding. None: there is no such position. Places are
        rounded by the lengths over which they are reached, the line's direction by that
        over the stroke.
        """
        stroke, _ = self.line(state)
        lever, most = self.leverage(state, sines)
        away = self.reach(state)
        without_lever = abs(lever) * stroke <= NO_DIGIT_LEFT * most * away
        coincide = stroke <= COINCIDENT_POINTS * away
        if not is_any(without_lever | coincide):
            return None
        status = np.where(without_lever, NO_LEVER, OK)
        return np.where(coincide, NO_DIRECTION, status)


def _list_bars(linkage: FourBar, point: Place) -> set[int]:
    """List the bars that hold a point: its own, and at a pin the other bar there."""
    length = linkage.lengths[point.bar - 1]
    nothing = COINCIDENT_POINTS * length
    first_pin, second_pin = ENDS[point.bar]
    bars = {point.bar}
    if abs(point.in_bar) <= nothing:
        bars.update(PINS[first_pin])
    if abs(point.in_bar - length) <= nothing:
        bars.update(PINS[second_pin])
    return bars
