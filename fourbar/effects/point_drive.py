"""A drive that pushes a point of a bar in a direction, like a hand on a lid.

The handle of pliers is another example. Per newton the bar gets the unit vector of the
direction at the point; ds/dq is the component in that direction of the point's
derivative by the independent angle.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from fourbar.effects.effect import Actions
from fourbar.effects.force_drive import ForceDrive
from fourbar.effects.load import FRAMES
from fourbar.effects.place import At, Place
from fourbar.effects.spring import COINCIDENT_POINTS
from fourbar.errors import InputError
from fourbar.formulas.arithmetic import Number, is_any, polar
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.linkage import MOVING_BARS, Declared, FourBar, OneOf
from fourbar.quantities import NO_LEVER, OK


@dataclass(frozen=True, slots=True)
class PointDrive(ForceDrive):
    """A force at a place of bar 2, 3 or 4 in a direction, N, positive along it.

    Parameters
    ----------
    place : where the force acts, which turns with its bar.
    direction : angle of the force, rad.
    frame : "world": the direction is from +x; "bar": from the bar's line, and turns
        with it.
    """

    place: Annotated[Place, At(bars=MOVING_BARS, is_value=True)]
    direction: Annotated[float, Declared("rad")]
    frame: Annotated[str, OneOf(FRAMES)] = "world"

    @property
    def ends(self) -> tuple[tuple[float, Place], ...]:
        """Return the place, along the direction."""
        return ((1.0, self.place),)

    @property
    def may_be_left_out(self) -> tuple[int, ...]:
        """Return the bars of which one may be left out.

        The moments of the other two then give the force between them. The force on bar
        2 or 4 is in the moment of that bar alone, as a couple is; on bar 3 it is in any
        pair's.
        """
        if self.place.bar == 3:
            return MOVING_BARS
        return (self.place.bar,)

    def require_motion(self, linkage: FourBar) -> None:
        """Raise InputError where the point is a fixed pin."""
        bar = self.place.bar
        distance = abs(self.place.distance)
        if bar != 3 and distance <= COINCIDENT_POINTS * linkage.bar(bar).length:
            allowed = "is a fixed pin, at which a force does no work: state another"
            raise InputError("drive", f"the first pin of bar {bar}", allowed)

    def line(self, state: State) -> tuple[None, Number]:
        """Return no stroke, and the unit vector of the direction in world axes."""
        unit = polar(1.0, self.direction)
        if self.frame == "bar":
            return None, unit * state.direction(self.place.bar)
        return None, unit + 0.0 * state.direction(self.place.bar)

    def act(self, actions: Actions, force: Number) -> None:
        """Push the point of the drive."""
        _, direction = self.line(actions.state)
        actions.force(self.place.bar, force * direction, self.place.in_bar)

    def status(self, state: State, sines: dict[int, Number]) -> Number:
        """Return NO_LEVER where P lies within its rounding; None: nowhere."""
        lever, most = self.leverage(state, sines)
        without_lever = abs(lever) <= NO_DIGIT_LEFT * most
        if not is_any(without_lever):
            return None
        return np.where(without_lever, NO_LEVER, OK)
