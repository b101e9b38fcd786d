"""Dry pin friction of given torque: constant magnitude, against the relative rotation at a pin."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.viscous import pin_values
from fourbar.effects.wrenches import Wrenches
from fourbar.kinematics import Array, State
from fourbar.linkage import MOVING_BARS, PINS, FourBar
from fourbar.solution import Solution


@dataclass(frozen=True, slots=True)
class Friction:
    """Friction torques per pin, N m, as pairs (pin, value); zero where the pin does not turn."""

    torques: tuple[tuple[str, float], ...]
    key: ClassVar[str] = "friction"
    example: ClassVar[str] = 'friction = { A = "0.05 N m" }'

    @classmethod
    def at(cls, **torques: float) -> "Friction":
        """``Friction.at(A=0.05)``."""
        return cls(pin_values("effects.friction", torques))

    @classmethod
    def read(cls, value: object, reader: Any) -> "Friction":
        """From ``{ A = "0.05 N m" }``."""
        return cls.at(**reader.per_pin("effects.friction", value, "N m"))

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        return {pin: writer.quantity(value, "N m") for pin, value in self.torques}

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """M on bar j = -f sign(omega_j - omega_i), its opposite on bar i."""
        for pin, f in self.torques:
            i, j = PINS[pin]
            couple = -f * np.sign(state.omega(j) - state.omega(i))
            wrenches.add_moment(j, couple)
            wrenches.add_moment(i, -couple)

    def power(self, state: State) -> Array | float:
        """P = -sum of f |omega_j - omega_i|, W."""
        total: Array | float = 0.0
        for pin, f in self.torques:
            i, j = PINS[pin]
            total = total - f * np.abs(state.omega(j) - state.omega(i))
        return total

    def size(self, linkage: FourBar, solution: Solution) -> Array:
        """Sum of the couples, divided by the shortest moving bar, N."""
        shortest = min(linkage.bar(number).length for number in MOVING_BARS)
        return np.full(len(solution), sum(f for _, f in self.torques) / shortest)

    def add_mjcf(self, model: Any) -> None:
        """The attribute ``frictionloss`` of the hinge (of a tendon at the cut pin B)."""
        for pin, f in self.torques:
            model.pin[pin]["frictionloss"] = f
