"""A drive that pushes a point of a bar in a direction, like a hand on a lid.

The handle of pliers is another example. Per newton the bar gets the unit vector of the
direction at the point; ds/dq is the component in that direction of the point's
derivative by the independent angle.
"""

from dataclasses import dataclass
from typing import Annotated

from fourbar.effects.effect import Actions
from fourbar.effects.force_drive import ForceDrive
from fourbar.effects.load import FRAMES
from fourbar.effects.place import At, Place
from fourbar.formulas.arithmetic import Number, polar
from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS, Declared, OneOf


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
