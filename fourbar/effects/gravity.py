"""Gravity: m g at the mass centre of every bar that has mass."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.effect import Actions, Effect
from fourbar.formulas.arithmetic import U, is_any, namespace, polar, vector
from fourbar.formulas.longer import shorten
from fourbar.formulas.motion import State
from fourbar.linkage import MOVING_BARS, Declared, check_numbers


@dataclass(frozen=True, slots=True)
class Gravity(Effect):
    """A uniform field of the given magnitude (m/s^2) and direction (rad, from +x, counter-clockwise)."""

    magnitude: float = 9.81
    angle: float = -math.pi / 2
    key: ClassVar[str] = "gravity"
    example: ClassVar[str] = 'gravity = ["9.81 m/s^2", "-90 deg"]'
    numbers: ClassVar[dict[str, Declared]] = {
        "magnitude": Declared("m/s^2"),
        "angle": Declared("rad"),
    }

    def __post_init__(self) -> None:
        check_numbers(self, "effects.gravity")

    @property
    def field(self) -> Any:
        """g_x + i g_y, m/s^2; a component that the angle as a double cannot tell from zero is zero."""
        u = polar(1.0, self.angle)
        # derivatives by the angle need the small component, and so does the error bar in longer numbers
        if namespace(u) is not np or shorten(self.angle) is not self.angle:
            return self.magnitude * u
        return self.magnitude * vector(
            u.real * (abs(u.real) > U), u.imag * (abs(u.imag) > U)
        )

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
