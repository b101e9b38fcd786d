"""Viscous pin damping: a couple proportional to the relative angular velocity at a pin."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fourbar.effects.wrenches import Wrenches
from fourbar.errors import InputError
from fourbar.kinematics import Array, State
from fourbar.linkage import MOVING_BARS, PINS, FourBar, require
from fourbar.solution import Solution


def pin_values(key: str, values: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """The non-negative value of each pin named, in the order of the pins."""
    for pin, value in values.items():
        if pin not in PINS:
            raise InputError(f"{key}.{pin}", value, "the pins are " + ", ".join(PINS))
    return tuple((pin, require(f"{key}.{pin}", values[pin], at_least_zero=True)) for pin in PINS if pin in values)


def relative_speed(solution: Solution, pin: str) -> Array:
    """omega_j - omega_i of the bars that meet at a pin, rad/s."""
    speeds = {1: 0.0, 2: solution.omega_2, 3: solution.omega_3, 4: solution.omega_4}
    i, j = PINS[pin]
    return np.asarray(speeds[j] - speeds[i])  # type: ignore[operator]


@dataclass(frozen=True, slots=True)
class Viscous:
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

    def size(self, linkage: FourBar, solution: Solution) -> Array:
        """Sum of the couples, divided by the shortest moving bar, N."""
        shortest = min(linkage.bar(number).length for number in MOVING_BARS)
        total = np.zeros(len(solution))
        for pin, k in self.coefficients:
            total += k * np.abs(relative_speed(solution, pin)) / shortest
        return total

    def add_mjcf(self, model: Any) -> None:
        """The attribute ``damping`` of the hinge (of a tendon at the cut pin B)."""
        for pin, k in self.coefficients:
            model.pin[pin]["damping"] = k
