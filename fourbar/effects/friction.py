"""Dry pin friction of given torque: constant magnitude, against the relative rotation at a pin."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.effect import Act, Effect, Tree
from fourbar.effects.pins import pin_values, sense, shortest_bar
from fourbar.effects.wrenches import Wrenches
from fourbar.linkage import PINS, FourBar
from fourbar.solution import Solution
from fourbar.state import Array, State


@dataclass(frozen=True, slots=True)
class Friction(Effect):
    """Friction torques per pin, N m, as pairs (pin, value).

    At a pin that does not turn the couple may have any value up to the torque; 0, the middle, is
    taken, and `torque_low`, `torque_high` of the solution are what the ends give.
    """

    torques: tuple[tuple[str, float], ...]
    side: int = 0
    """Which way pins at rest are about to turn; not part of a scene."""
    key: ClassVar[str] = "friction"
    example: ClassVar[str] = 'friction = { A = "0.05 N m" }'
    dry: ClassVar[bool] = True

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

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """The pins at which it acts."""
        return tuple(pin for pin, f in self.torques if f != 0.0)

    def add_wrenches(self, wrenches: Wrenches, state: State) -> None:
        """M on bar j = -f sign(omega_j - omega_i), its opposite on bar i."""
        for pin, f in self.torques:
            i, j = PINS[pin]
            couple = -f * sense(state, pin, self.side)
            wrenches.add_moment(j, couple)
            wrenches.add_moment(i, -couple)

    def power(self, state: State) -> Array | float:
        """P = -sum of f |omega_j - omega_i|, W."""
        total: Array | float = 0.0
        for pin, f in self.torques:
            i, j = PINS[pin]
            total = total - f * np.abs(state.omega(j) - state.omega(i))
        return total

    def engine_term(self, tree: Tree) -> Act:
        """Couples of constant size against the relative spin; MuJoCo's own frictionloss is a soft constraint."""

        def act() -> None:
            for pin, f in self.torques:
                one, other = PINS[pin]
                slip = tree.velocity(one) - tree.velocity(other)
                couple = f if slip > 0.0 else -f if slip < 0.0 else 0.0
                tree.twist(other, couple)
                tree.twist(one, -couple)

        return act

    def add_mjcf(self, model: Any) -> None:
        """The attribute ``frictionloss`` of the hinge (of a tendon at the cut pin B)."""
        for pin, f in self.torques:
            model.add_dry_friction(pin, f)

    def size(self, linkage: FourBar, solution: Solution) -> Array:
        """Sum of the couples, divided by the shortest moving bar, N."""
        return np.full(len(solution), sum(f for _, f in self.torques) / shortest_bar(linkage))

    def couple(self, linkage: FourBar, speed: float) -> float:
        """Sum of the couples, N m."""
        return sum((f for _, f in self.torques), 0.0)
