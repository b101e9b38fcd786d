"""Gravity: m g at the mass centre of every bar that has mass."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.wrenches import Wrenches
from fourbar.linkage import MOVING_BARS, FourBar, require
from fourbar.margins import U
from fourbar.solution import Solution
from fourbar.state import Array, State, centre_in_bar


@dataclass(frozen=True, slots=True)
class Gravity(Effect):
    """A uniform field of the given magnitude (m/s^2) and direction (rad, from +x, counter-clockwise)."""

    magnitude: float = 9.81
    angle: float = -math.pi / 2
    key: ClassVar[str] = "gravity"
    example: ClassVar[str] = 'gravity = ["9.81 m/s^2", "-90 deg"]'

    def __post_init__(self) -> None:
        require("effects.gravity", self.magnitude)
        require("effects.gravity", self.angle)

    @property
    def vector(self) -> tuple[float, float]:
        """(g_x, g_y), m/s^2; a component that the angle as a double cannot tell from zero is zero."""
        cosine, sine = (x if abs(x) > U else 0.0 for x in (math.cos(self.angle), math.sin(self.angle)))
        return (self.magnitude * cosine, self.magnitude * sine)

    @classmethod
    def read(cls, value: object, reader: Any) -> "Gravity":
        """From ``["9.81 m/s^2", "-90 deg"]``."""
        return cls(*reader.polar("effects.gravity", value, "m/s^2"))

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        return writer.polar(self.magnitude, self.angle, "m/s^2")

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """F = m g at G."""
        gx, gy = self.vector
        for number in MOVING_BARS:
            bar = state.linkage.bar(number)
            if bar.mass != 0.0:
                wrenches.add_constant_force(number, (bar.mass * gx, bar.mass * gy), centre_in_bar(bar))

    def rounded_anew(self, beside: Callable[[float], float], *, all_of_it: bool) -> "Gravity":
        """Magnitude and angle."""
        return Gravity(beside(self.magnitude), beside(self.angle))

    def power(self, state: State) -> Array | float:
        """P = sum of m g . v_G, W."""
        gx, gy = self.vector
        total: Array | float = 0.0
        for number in MOVING_BARS:
            bar = state.linkage.bar(number)
            if bar.mass != 0.0:
                vx, vy = state.velocity(number, *centre_in_bar(bar))
                total = total + bar.mass * (gx * vx + gy * vy)
        return total

    def engine_term(self, tree: Tree) -> Act | None:
        """The engine's own gravity."""
        tree.gravity(self.vector)
        return None

    def add_mjcf(self, model: Any) -> None:
        """The option ``gravity``."""
        model.option["gravity"] = (*self.vector, 0.0)

    def size(self, linkage: FourBar, solution: Solution) -> float:
        """Sum of the weights, counted with their levers, N."""
        total = 0.0
        for number in MOVING_BARS:
            bar = linkage.bar(number)
            total += bar.mass * abs(self.magnitude) * (1.0 + abs(bar.centre[0]) / bar.length)  # type: ignore[index]
        return total

    def couple(self, linkage: FourBar, speed: float) -> float:
        """Sum of m g L, with L the longest arm at which a weight acts, N m."""
        longest, total = max(linkage.lengths), 0.0
        for number in MOVING_BARS:
            bar = linkage.bar(number)
            total += bar.mass * max(longest, abs(bar.centre[0]))  # type: ignore[index]
        return total * abs(self.magnitude)
