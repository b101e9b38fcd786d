"""The bars of a four-bar as bodies that lie and move in the plane.

Vectors of the plane are complex numbers, x + i y.
"""

import cmath
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Place
from fourbar.linkage import MOVING_BARS, PINS, FourBar
from fourbar.quantities import Array, ComplexArray
from fourbar_validation.compare.pins import find_centre

_TURNS_AS_ONE = 64.0 * 2.0**-52
"""Two bars whose speeds differ by less than this part of them turn as one."""


class BodyMotion(NamedTuple):
    """The bars at n positions, by number, each (n,); the ground is bar 1."""

    linkage: FourBar
    theta_2: Array
    unit: dict[int, ComplexArray]
    """Directions e^{i theta}."""
    first_pin: dict[int, ComplexArray]
    """Place of the first pin of each bar (O2, O2, A, O4), m."""
    omega: dict[int, Array]
    alpha: dict[int, Array]
    beginning: dict[int, Array] | None = None
    """Speeds of the motion that is about to begin where the linkage rests, rad/s. None:
    it stays at rest.
    """

    def to_centre(self, bar: int) -> ComplexArray:
        """Return the vector from a moving bar's first pin to its mass centre, m."""
        return self.unit[bar] * make_vector(find_centre(self.linkage.bar(bar)))

    def swing(self, bar: int, arm: ComplexArray) -> ComplexArray:
        """Return the acceleration of the end of an arm about its bar's first pin.

        The unit is m/s^2.
        """
        return (1j * self.alpha[bar] - self.omega[bar] ** 2) * arm

    def slip(self, pin: str) -> Array:
        """Return omega_j - omega_i of the bars that meet at a pin, rad/s."""
        i, j = PINS[pin]
        return self.omega[j] - self.omega[i]

    def sense(self, pin: str) -> Array:
        """Return the sign of the slip; at rest, that of the motion about to begin."""
        slip = self.slip(pin)
        if self.beginning is None:
            return np.sign(slip)
        of_i, of_j = (self.beginning[bar] for bar in PINS[pin])
        begins = of_j - of_i
        as_one = np.abs(begins) < _TURNS_AS_ONE * (np.abs(of_j) + np.abs(of_i))
        moves = np.any([self.omega[bar] for bar in MOVING_BARS], axis=0)
        return np.sign(np.where(moves, slip, np.where(as_one, 0.0, begins)))

    def lay(self, places: Sequence[Place]) -> tuple[list[ComplexArray], ComplexArray]:
        """Return the arms from the bars' first pins to places stated from there, m.

        The vector from the first place to the last is returned too.
        """
        arms = [
            self.unit[place.bar] * make_vector((place.distance, place.angle))
            for place in places
        ]
        points = [
            self.first_pin[place.bar] + arm
            for place, arm in zip(places, arms, strict=True)
        ]
        return arms, points[-1] - points[0]

    def places(self) -> dict[str, Array]:
        """Return the places of A, B and the mass centres, m, (n, 2) each."""
        return {
            point: stack_components(self.first_pin[bar] + arm)
            for point, (bar, arm) in self._list_arms().items()
        }

    def swing_points(self, name: str = "a_") -> dict[str, Array]:
        """Return the accelerations of A, B and the mass centres, m/s^2, (n, 2) each.

        `name`: what stands before a point's name.
        """
        of_pins: dict[int, Any] = {2: 0.0, 3: self.swing(2, self.first_pin[3]), 4: 0.0}
        return {
            name + point: stack_components(of_pins[bar] + self.swing(bar, arm))
            for point, (bar, arm) in self._list_arms().items()
        }

    def _list_arms(self) -> dict[str, tuple[int, ComplexArray]]:
        """List the bar of each of these points, and its arm from the first pin, m."""
        arms = {bar: self.to_centre(bar) for bar in MOVING_BARS}
        return {
            "A": (2, self.first_pin[3]),
            "B": (4, self.linkage.output.length * self.unit[4]),
            **{f"G{bar}": (bar, arm) for bar, arm in arms.items()},
        }


def pose(linkage: FourBar, theta: Sequence[Array] | Array) -> BodyMotion:
    """Lay bars 2, 3 and 4 at their angles, rad, (n,) each, at rest."""
    zero = np.zeros(len(theta[0]))
    unit = {bar: np.exp(1j * theta[bar - 2]) for bar in MOVING_BARS}
    unit[1] = np.exp(1j * (linkage.ground_angle + zero))
    origin = zero.astype(complex)
    tip = linkage.input.length * unit[2]
    first_pin = {1: origin, 2: origin, 3: tip, 4: linkage.ground * unit[1]}
    rest = dict.fromkeys(unit, zero)
    return BodyMotion(linkage, theta[0], unit, first_pin, rest, rest)


def make_vector(pair: tuple[float, float]) -> complex:
    """Return (distance, angle) as a vector."""
    return cmath.rect(*pair)


def stack_components(vectors: ComplexArray) -> Array:
    """Return x and y of vectors (n,) as (n, 2), as they lie in memory."""
    return vectors.view(float).reshape(-1, 2)
