"""The bars of a four-bar opened at pin B, as a tree of an engine.

A few numbers of the engine give everything.

The coordinates q are the turns of bar 2 at O2, of bar 3 against bar 2 at A, and of bar
4 at O4. With g(q) the place of B on bar 3 minus that on bar 4, and J = dg/dq, the loop
holds where

    g = 0,   J v = 0,   J a + (dJ/dt) v = 0,
    [J^T e_drive] [lambda; T] = tau(q, v, a).

lambda is F43, and e_drive the generalized force of the drive per N m or N. Every number
comes from the engine.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.description import (
    ON_BARS,
    PART_POINTS,
)
from fourbar_validation.engines.loaded import (
    Act,
    BarValues,
    Components,
    Loaded,
    Wrenches,
    make_no_wrenches,
)

if TYPE_CHECKING:
    from fourbar.effects.place import Place


_OPEN_AT_B = [(name, point) for name, point in PART_POINTS.items() if name != "A2"]
"""Names of points where bars 2 and 3 share pin A, and of the points of the bars."""
_ACCELERATIONS = [f"a_{name}" for name in ON_BARS]
Components3 = tuple[float, float, float]
NO_RATES = np.zeros(3)
"""Speeds or accelerations of the coordinates, where they are zero."""
BEARERS = {2: (2,), 3: (3, 2), 4: (4,)}
"""Bars whose first pins carry what acts on a bar of the open tree."""


class Tree(Loaded, Protocol):
    """Bars opened at pin B.

    The engine gives points, Jacobians, accelerations, inverse dynamics and joint
    forces.
    """

    own: str = (
        "assembly (Newton on its own gap), velocities (own Jacobian), accelerations"
        " (own dJ/dt v), inverse dynamics, effects from its own state, loop"
        " multipliers, pin forces"
    )
    turns: Mapping[int, Array]
    """Derivatives of the bars' rotations by the coordinates, in the plane constant."""
    v: Array
    a: Array
    at: Mapping[str, Array]
    """Places of the points that `list_moving_parts` names, m: the engine's memory."""
    turned_to: Mapping[int, Array]
    """Axes along and across each bar's line: the engine's memory."""

    def ready(self, scene: Scene, terms: list[Act]) -> None:
        """Prepare the evaluation.

        An engine calls this once it holds the bars and what acts on them.
        """
        super().ready(scene, terms)
        self.alone = bool(scene.loads or scene.effects)
        self.place((0.0, 0.0, 0.0))
        self.turns = {1: np.zeros(3)} | {bar: self.turn(bar) for bar in MOVING_BARS}

    # methods that the engine defines
    def point_jacobian(self, name: str) -> Array:
        """Return the derivative of a point, (2, 3), m."""

    def turn(self, bar: int) -> Array:
        """Return the derivative of a moving bar's rotation, (3,)."""

    def set_motion(self, v: Array, a: Array) -> None:
        """Set speeds and accelerations of the coordinates."""

    def accelerations(self, names: Iterable[str]) -> list[list[float]]:
        """Return the accelerations of points, [x, y] of each, m/s^2.

        The motion is the one last set.
        """

    def needed(
        self,
        field: Components,
        wrenches: Wrenches,
    ) -> list[float]:
        """Return the three generalized forces of the motion last set, N m.

        Gravity and what acts are taken off.
        """

    def joint_forces(self) -> dict[int, complex]:
        """Return the force on each moving bar at its first pin, N.

        Motion and wrenches are those last asked for.
        """

    def point(self, name: str) -> Array:
        """Read a place."""
        return self.at[name]

    def rotation(self, bar: int) -> Array:
        """Read a bar's axes."""
        return self.turned_to[bar]

    # methods that follow from these
    def gap(self) -> Components:
        """Return B on bar 3 minus B on bar 4."""
        across = self.locate("end3") - self.locate("end4")
        return across.real, across.imag

    def jacobian(self) -> Array:
        """Return the difference of the two points' Jacobians."""
        return self.point_jacobian("end3") - self.point_jacobian("end4")

    def positions(self) -> dict[str, Sequence[float]]:
        """Locate the points of the bars."""
        return {name: self.point(point).tolist() for name, point in _OPEN_AT_B}

    def velocity(self, bar: int) -> float:
        """Return the angular velocity of a bar, rad/s."""
        return float(self.turns[bar].dot(self.v))

    def alpha(self, bar: int) -> float:
        """Return the angular acceleration of a bar, rad/s^2."""
        return float(self.turns[bar].dot(self.a))

    def moving(self, v: Array, a: Array) -> None:
        """Take speeds and accelerations of the coordinates, for all that follows."""
        self.v = v
        self.a = a
        self.set_motion(v, a)

    def drift(self, v: Array) -> Components:
        """Return the acceleration of the gap at speeds v where a = 0, m/s^2."""
        self.moving(v, NO_RATES)
        (x, y), (x_4, y_4) = self.accelerations(("end3", "end4"))
        return x - x_4, y - y_4

    def torques(self) -> list[float]:
        """Compute what the motion asks for beyond loads and effects, N m."""
        self.act()
        return self.needed(self.field, self.wrenches)

    def drive_column(self) -> Array:
        """Return the generalized forces of the drive per N m or N, (3,)."""
        if self.force_drive is None:
            return self.turns[self.drive_bar]
        _, along = self.line()
        rate = sum(
            sense * self.end_jacobian(place) for sense, place in self.force_drive.ends
        )
        return np.array([along.real, along.imag]) @ rate

    def end_jacobian(self, point: "Place") -> Array:
        """Return the derivative of an end of the drive by the coordinates, (2, 3), m.

        The rotation of the bar adds the arm turned across to the first pin's
        derivative.
        """
        if point.bar == 1:
            return np.zeros((2, 3))
        arm = self.end(point) - self.first_pin(point.bar)
        return self.point_jacobian(f"first_pin{point.bar}") + np.outer(
            (-arm.imag, arm.real), self.turns[point.bar]
        )

    def forces(self, loop_force: complex, drive: float) -> dict[str, Components]:
        """Return F12, F32, F14 at the motion and wrenches last set.

        The open tree carries what acts. The force of the loop on bar 3, its opposite on
        bar 4 and the force of a drive are carried on to the ground; a couple asks
        nothing of the pins.
        """
        on = self.joint_forces()
        if self.force_drive is not None:
            ends, along = self.line()
            for sense, bar, _ in ends:
                carry(on, bar, sense * drive * along)
        return put_back(on, loop_force)

    def move(self, bar: int, speed: float, acceleration: float) -> BarValues:
        """Return speeds, accelerations and forces by name; {} where they are 0/0."""
        jacobian = self.jacobian()
        commanded = self.turns[bar]
        try:
            v = solve_closed(jacobian, speed, commanded)
            a = solve_closed(jacobian, acceleration, commanded, self.drift(v))
        except np.linalg.LinAlgError:
            return {}
        self.moving(v, a)
        values: BarValues = dict(
            zip(_ACCELERATIONS, self.accelerations(ON_BARS.values()), strict=True)
        )
        for moving in MOVING_BARS:
            values[f"omega_{moving}"] = self.velocity(moving)
            values[f"alpha_{moving}"] = self.alpha(moving)
        solve = partial(solve_multipliers, jacobian, self.drive_column())

        def balanced() -> dict[str, Any]:
            x, y, drive = solve(self.torques())
            forces: BarValues = dict(self.forces(complex(x, y), drive))
            forces["F43"] = x, y
            forces[self.driving] = drive
            return forces

        try:
            values |= self.settled(balanced)
        except (
            np.linalg.LinAlgError
        ):  # no torque or force of the drive balances the linkage here
            return values
        if self.alone:
            *_, inertia = solve(self.needed((0.0, 0.0), make_no_wrenches()))
            values[f"{self.driving}_inertia"] = inertia
        return values


def carry(on: dict[int, complex], bar: int, force: complex) -> None:
    """Let the pins of an open tree carry one more force on a bar, N.

    The ground takes none.
    """
    for bearer in BEARERS.get(bar, ()):
        on[bearer] -= force


def put_back(on: dict[int, complex], loop_force: complex) -> dict[str, Components]:
    """Return the pin forces F12, F32, F14, N, with the loop closed again.

    `on` is what the pins of the open tree carry, `loop_force` that of bar 4 on bar 3.
    """
    carry(on, 3, loop_force)
    carry(on, 4, -loop_force)
    forces = {"F12": on[2], "F32": -on[3], "F14": on[4]}
    return {name: (force.real, force.imag) for name, force in forces.items()}


_BAR_2 = np.array([1.0, 0.0, 0.0])
"""Derivative of its rotation by the coordinates."""


def solve_closed(
    jacobian: Array,
    rate: float,
    turn: Array = _BAR_2,
    drift: Sequence[float] = (0.0, 0.0),
) -> Array:
    """Solve J rates + drift = 0, turn . rates = rate.

    The rates are those of the coordinates; LinAlgError at a toggle.
    """
    x, y = drift
    rows = (*jacobian.tolist(), turn.tolist())
    return np.array(_solve_three(rows, (-x, -y, rate)))


def solve_multipliers(
    jacobian: Array,
    turn: Array,
    needed: Sequence[float],
) -> Components3:
    """Solve [J^T turn] [lambda; T] = tau.

    Raises LinAlgError if no torque on that bar balances tau.
    """
    columns = (*jacobian.tolist(), turn.tolist())
    return _solve_three(zip(*columns, strict=True), needed)


def _solve_three(
    rows: Iterable[Sequence[float]], right: Sequence[float]
) -> Components3:
    """Solve three linear equations; LinAlgError where they are singular.

    By Cramer's rule, in plain numbers: for bar 2 the determinant is that of Newton's
    steps to the last digit, so there are speeds and forces wherever the loop closes, as
    far as rounding leaves them digits; elimination may find the matrix singular there.
    Beside a toggle the rule alone leaves a residual of eps/s of its terms, and
    accelerations differ by that over s once more; a step of refinement leaves eps.
    """
    (a, b, c), (d, e, f), (g, h, i) = rows
    p = b * f - c * e
    q = c * d - a * f
    r = a * e - b * d
    det = g * p + h * q + i * r
    if det == 0.0:
        raise np.linalg.LinAlgError("the bars are in one line, or the drive at a pole")

    def solve(x: float, y: float, z: float) -> Components3:
        return (
            (x * (e * i - f * h) + y * (c * h - b * i) + z * p) / det,
            (x * (f * g - d * i) + y * (a * i - c * g) + z * q) / det,
            (x * (d * h - e * g) + y * (b * g - a * h) + z * r) / det,
        )

    x, y, z = right
    u, v, w = solve(x, y, z)
    du, dv, dw = solve(
        x - (a * u + b * v + c * w),
        y - (d * u + e * v + f * w),
        z - (g * u + h * v + i * w),
    )
    return u + du, v + dv, w + dw
