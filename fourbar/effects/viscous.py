"""Viscous pin damping: a couple proportional to the relative angular velocity at a pin."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.pins import pin_values, relative_speed, shortest_bar
from fourbar.effects.wrenches import Wrenches
from fourbar.linkage import PINS, FourBar
from fourbar.solution import Solution
from fourbar.state import Array, State


@dataclass(frozen=True, slots=True)
class Viscous(Effect):
    """Damping coefficients per pin, N m s/rad, as pairs (pin, value)."""

    coefficients: tuple[tuple[str, float], ...]
    key: ClassVar[str] = "viscous"
    example: ClassVar[str] = 'viscous = { O2 = "0.01 N m s/rad" }'

    @classmethod
    def at(cls, **coefficients: float) -> "Viscous":
        """``Viscous.at(O2=0.01)``."""
        return cls(pin_values("effects.viscous", coefficients))

    @classmethod
    def read(cls, value: object, reader: Any) -> "Viscous":
        """From ``{ O2 = "0.01 N m s/rad" }``."""
        return cls.at(**reader.per_pin("effects.viscous", value, "N m s/rad"))

    def write(self, writer: Any) -> Any:
        """Back to the form of a scene file."""
        return {pin: writer.quantity(value, "N m s/rad") for pin, value in self.coefficients}

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """M on bar j = -k (omega_j - omega_i), its opposite on bar i."""
        for pin, k in self.coefficients:
            i, j = PINS[pin]
            couple = -k * (state.omega(j) - state.omega(i))
            wrenches.add_moment(j, couple)
            wrenches.add_moment(i, -couple)

    def power(self, state: State) -> Array | float:
        """P = -sum of k (omega_j - omega_i)^2, W."""
        total: Array | float = 0.0
        for pin, k in self.coefficients:
            i, j = PINS[pin]
            total = total - k * (state.omega(j) - state.omega(i)) ** 2
        return total

    def engine_term(self, tree: Tree) -> Act:
        """Couples against the relative spin of the two bars at each pin."""

        def act() -> None:
            for pin, k in self.coefficients:
                one, other = PINS[pin]
                slip = tree.velocity(one) - tree.velocity(other)
                tree.twist(other, k * slip)
                tree.twist(one, -k * slip)

        return act

    def add_mjcf(self, model: Any) -> None:
        """The attribute ``damping`` of the hinge (of a tendon at the cut pin B)."""
        for pin, k in self.coefficients:
            model.pin[pin]["damping"] = k

    def size(self, linkage: FourBar, solution: Solution) -> Array:
        """Sum of the couples, divided by the shortest moving bar, N."""
        total = np.zeros(len(solution))
        for pin, k in self.coefficients:
            total += k * np.abs(relative_speed(solution, pin)) / shortest_bar(linkage)
        return total

    def couple(self, linkage: FourBar, speed: float) -> float:
        """Sum of the couples at the speed, N m."""
        return sum((k for _, k in self.coefficients), 0.0) * speed
