"""Gravity: m g at the mass centre of every bar that has mass."""

import math
from typing import Annotated, Any

from fourbar.effects.effect import Actions, Effect
from fourbar.formulas.arithmetic import is_any, polar, vector
from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS, Declared, FourBar, record


@record
class Gravity(Effect):
    """A uniform field of some magnitude (m/s^2) and direction (rad, from +x, ccw)."""

    magnitude: Annotated[float, Declared("m/s^2", key="0")] = 9.81
    angle: Annotated[float, Declared("rad", key="1")] = -math.pi / 2
    key = "gravity"
    in_balls = True
    example = 'gravity = ["9.81 m/s^2", "-90 deg"]'

    @property
    def field(self) -> Any:
        """g_x + i g_y, m/s^2; a component lost in the rounding of the angle is zero.

        A component counts as lost if adding it to 1 changes nothing. Components in
        longer numbers, or with slopes, are kept: error bars and derivatives need the
        small ones.
        """
        u = polar(1.0, self.angle)
        along = u.real * (1.0 + abs(u.real) != 1.0)
        across = u.imag * (1.0 + abs(u.imag) != 1.0)
        return self.magnitude * vector(along, across)

    @property
    def vector(self) -> tuple[float, float]:
        """(g_x, g_y), m/s^2."""
        return float(self.field.real), float(self.field.imag)

    def act(self, actions: Actions, state: State) -> None:
        """Add F = m g at G."""
        field = self.field
        for number, body in zip(MOVING_BARS, actions.bodies, strict=True):
            if is_any(body.m != 0.0):
                actions.force(number, body.m * field, body.z)

    def add_to_mjcf(self, model: Any) -> None:
        """Set the option ``gravity``."""
        model.option["gravity"] = (*self.vector, 0.0)

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Sum m g L, with L the longest arm at which a weight acts."""
        longest = max(linkage.lengths)
        total = 0.0
        for number in MOVING_BARS:
            bar = linkage.bar(number)
            total += bar.mass * max(longest, abs(bar.mass_centre[0]))
        return total * abs(self.magnitude)
