"""What acts on each moving bar apart from its pins: a resultant force and a moment about its first pin."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fourbar.state import Array, State, Vector, cross, is_zero


class Wrenches:
    """Sums of forces (N, world axes) and of moments (N m) about the first pin (O2, A, O4) of bars 2, 3, 4.

    A bar on which nothing acts keeps the number 0.0: its term is never evaluated. With `growths`
    each term grows by the next of them (the error bars move every term by its last digit).
    """

    def __init__(self, state: State, growths: Iterator[float] | None = None) -> None:
        self.state = state
        self.growths = growths
        self.force_x: dict[int, Any] = {2: 0.0, 3: 0.0, 4: 0.0}
        self.force_y: dict[int, Any] = {2: 0.0, 3: 0.0, 4: 0.0}
        self.moments: dict[int, Any] = {2: 0.0, 3: 0.0, 4: 0.0}
        self.at_A: tuple[Any, Any] | None = None
        """A force at pin A whose moment about O2 is known apart from it; bar 2 carries it."""

    def add_constant_force(self, bar: int, force: tuple[float, float], point: tuple[float, float]) -> None:
        """A force of world axes at a point fixed in the bar, in its frame at its first pin."""
        (fx, fy), (p, q), u = force, point, self.state.unit(bar)
        self.add_force(bar, force)
        # (p u + q u turned) x F
        along, across = p * fx + q * fy, p * fy - q * fx
        moment = across * u[0]
        if along != 0.0:
            moment -= along * u[1]
        self.add_moment(bar, moment)

    def add_force(self, bar: int, force: Vector | tuple[float, float], arm: Vector | None = None) -> None:
        """A force on a bar, applied at `arm` from the bar's first pin; at that pin where no arm is given."""
        if not is_zero(force[0]):
            self.force_x[bar] = self._plus(self.force_x[bar], force[0])
        if not is_zero(force[1]):
            self.force_y[bar] = self._plus(self.force_y[bar], force[1])
        if arm is not None:
            self.add_moment(bar, cross(arm, force))  # type: ignore[arg-type]

    def add_moment(self, bar: int, moment: Array | float) -> None:
        """A pure couple on a bar; on the ground (bar 1) it does nothing."""
        if bar != 1:
            self.moments[bar] = self._plus(self.moments[bar], moment)

    def carry_at_A(self, force: Vector, moment: Array | float) -> None:
        """A force at pin A with its moment about O2, stated exactly where the force points to O2."""
        self.at_A = (self._plus(0.0, force[0]), self._plus(0.0, force[1]))
        self.add_moment(2, moment)

    def force(self, bar: int) -> Vector:
        """Resultant on a bar, N."""
        return (self._array(self.force_x[bar]), self._array(self.force_y[bar]))

    def moment(self, bar: int) -> Array:
        """Resultant moment on a bar about its first pin, N m."""
        return self._array(self.moments[bar])

    def _array(self, value: Any) -> Array:
        return value if np.shape(value) else np.broadcast_to(float(value), self.state.theta_2.shape)

    def _plus(self, total: Array | float, term: Array | float) -> Array | float:
        if self.growths is not None:
            term = term + next(self.growths) * term
        if not isinstance(self.state.theta_2, np.ndarray):  # in 32 digits couples that doubles hold exactly add up so
            term = term + 0.0 * self.state.theta_2
        return term if isinstance(total, float) and total == 0.0 else total + term
