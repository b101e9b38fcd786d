"""External loads: a force at a point of a bar, or a pure couple on it."""

import math
from dataclasses import dataclass
from typing import Any

from fourbar.effects.wrenches import Wrenches
from fourbar.errors import InputError
from fourbar.kinematics import Array, State, Vector, along, centre_in_bar
from fourbar.linkage import MOVING_BARS, FourBar, require


@dataclass(frozen=True, slots=True)
class Load:
    """A force and a couple on a moving bar.

    Parameters
    ----------
    bar : 2, 3 or 4.
    force : (magnitude, angle), N and rad, or None.
    at : (distance, angle) from the mass centre G to where the force acts, m and rad.
    moment : couple, N m, counter-clockwise.
    frame : "world": both angles are from +x; "bar": both turn with the bar, from its line.
    """

    bar: int
    force: tuple[float, float] | None = None
    at: tuple[float, float] = (0.0, 0.0)
    moment: float = 0.0
    frame: str = "world"

    def __post_init__(self) -> None:
        if self.bar not in MOVING_BARS or isinstance(self.bar, bool):
            raise InputError("loads.bar", self.bar, "must be 2, 3 or 4")
        if self.frame not in ("world", "bar"):
            raise InputError("loads.frame", self.frame, 'must be "world" or "bar"')
        for key, pair in (("loads.force", self.force), ("loads.at", self.at)):
            for number in pair or ():
                require(key, number)
        require("loads.moment", self.moment)

    def force_and_arm(self, state: State) -> tuple[Vector | tuple[float, float], Vector]:
        """The force in world axes and its point of application from the bar's first pin."""
        assert self.force is not None
        f, f_angle = self.force
        r, r_angle = self.at
        fx, fy = f * math.cos(f_angle), f * math.sin(f_angle)
        rx, ry = r * math.cos(r_angle), r * math.sin(r_angle)
        gx, gy = centre_in_bar(state.linkage.bar(self.bar))
        if self.frame == "bar":
            return along(state.unit(self.bar), fx, fy), state.arm(self.bar, gx + rx, gy + ry)
        x, y = state.arm(self.bar, gx, gy)
        return (fx, fy), (x + rx, y + ry)

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """F at its point, and the couple."""
        if self.force is not None:
            wrenches.add_force(self.bar, *self.force_and_arm(state))
        if self.moment != 0.0:
            wrenches.add_moment(self.bar, self.moment)

    def power(self, state: State) -> Array | float:
        """P = F . v of the point of application + M omega, W."""
        total: Array | float = self.moment * state.omega(self.bar)
        if self.force is not None:
            force, (x, y) = self.force_and_arm(state)
            pin_x, pin_y = state.velocity(self.bar, 0.0, 0.0)
            w = state.omega(self.bar)
            total = total + force[0] * (pin_x - w * y) + force[1] * (pin_y + w * x)
        return total

    def size(self, linkage: FourBar) -> float:
        """The force counted with its lever, and the couple divided by the bar's length, N."""
        bar = linkage.bar(self.bar)
        total = abs(self.moment) / bar.length
        if self.force is not None:
            total += abs(self.force[0]) * (1.0 + (abs(bar.centre[0]) + abs(self.at[0])) / bar.length)  # type: ignore[index]
        return total

    def add_mjcf(self, model: Any) -> None:
        """A constant actuator on a site (force) or on the bar (couple)."""
        model.loads.append(self)
