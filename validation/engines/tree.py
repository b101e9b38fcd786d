"""The bars of a four-bar opened at a pin, as an engine holds them, and what follows from the few numbers that it gives.

Coordinates q = (turn of bar 2 at O2, of bar 3 against bar 2 at A, of bar 4 at O4). With g(q) = B on
bar 3 minus B on bar 4 and J = dg/dq the loop holds where g = 0, J v = 0, J a + (dJ/dt) v = 0, and

    [J^T e_drive] [lambda; T] = tau(q, v, a),

lambda = F43 and e_drive = the derivative of the driven bar's rotation. Every number comes from the engine.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from fourbar.linkage import MOVING_BARS
from fourbar.scene import Scene
from validation.compare.answer import Array
from validation.engines.description import FORCE_AT, ON_BARS, POINTS, turned, turned_by

PASSES = 1000
"""Passes over pin loads and the friction they make; each lessens the error where the friction is far from a jam."""
STAGES, STEPS = 16, 30
"""Near a jam friction grows from none in so many stages, each by at most so many of Newton's steps."""
NUDGE = 1e-6
"""Of the greatest load: by how much each is changed for the slopes of a pass."""
REPEATED = 2.0 * 2.0**-52
"""Change of a pin load, relative, that is rounding."""
ROUNDED = 1e-11
"""Change, relative, at or below which one that no longer falls is rounding, near a pole of the torque too."""
DIVERGED = 1e100
"""Load, N, that only passes running away from each other reach."""
Act = Callable[[], None]
"""What acts on a tree, at its present motion."""
Values = dict[str, Array | float]


class Assembled(Protocol):
    """Bars opened at pin A or B, as an engine places them; every number is the engine's own."""

    def place(self, q: Sequence[float]) -> None:
        """Move to a configuration."""

    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4, or A on bar 2 minus A on bar 3, m."""

    def jacobian(self) -> Array:
        """Derivative of the gap, (2, 3), m."""

    def positions(self) -> dict[str, Array]:
        """Points O4, A, B, "B4", the end of bar 4, and where pin A is open "A2", that of bar 2; (2,), m."""


class Bars(Assembled, Protocol):
    """An engine holding the bars of a scene, which knows their mass centres (G2, G3, G4 among the points) and moves."""

    own: str
    """What the engine finds alone, for the report."""
    alone: bool = False
    """Whether it answers the torque that the bars without loads and effects take, too: `torque_inertia`."""
    ground_angle: float

    def angle(self, bar: int) -> float:
        """Direction of a bar's line, in (-pi, pi], rad."""

    def move(self, omega_2: float, alpha_2: float) -> Values:
        """Motion and forces where the bars are placed, by name; empty where a toggle leaves them 0/0."""

    def refusal(self) -> str:
        """Why what was answered does not count, or nothing."""
        return ""


class Tree(Bars, Protocol):
    """Bars opened at pin B; the engine gives points, Jacobians, accelerations, inverse dynamics and joint forces.

    The ground (bar 1) does not move; its line points from O2 to O4.
    """

    own: str = (
        "assembly (Newton on its own gap), velocities (own Jacobian), accelerations (own dJ/dt v), "
        "inverse dynamics, effects from its own state, loop multipliers, pin forces"
    )
    drive_bar: int
    field: tuple[float, float] = (0.0, 0.0)
    """Of gravity, m/s^2."""
    loaded: list[str]
    """Pins whose friction depends on their load."""
    pin_loads: dict[str, float]
    """Magnitudes of its own pin forces in the last pass, by pin, N; empty before the first."""
    turns: dict[int, Array]
    """Derivatives of the bars' rotations by the coordinates, constant in the plane."""
    wrenches: dict[int, list[float]]
    """What acts on each moving bar, summed: a force at its first pin and a couple, (x, y, moment), N and N m."""
    v: Array
    a: Array
    terms: list[Act]

    def ready(self, scene: Scene, terms: list[Act]) -> None:
        """To be called by an engine that has built its bars, with what acts on them."""
        self.ground_angle, self.drive_bar, self.terms = scene.linkage.ground_angle, scene.drive_bar, terms
        self.alone = bool(scene.loads or scene.effects)
        self.loaded = [pin for effect in scene.effects for pin in effect.loaded_pins]
        self.pin_loads = {}
        self.place((0.0, 0.0, 0.0))
        self.turns = {1: np.zeros(3)} | {bar: self.turn(bar) for bar in MOVING_BARS}

    # what the engine gives
    def point(self, name: str) -> Array:
        """A point that `description.parts` names, world axes, (2,), m; perhaps the engine's own memory."""

    def rotation(self, bar: int) -> Array:
        """Axes along and across a moving bar's line, (2, 2)."""

    def point_jacobian(self, name: str) -> Array:
        """Derivative of a point, (2, 3), m."""

    def turn(self, bar: int) -> Array:
        """Derivative of a moving bar's rotation, (3,)."""

    def set_motion(self, v: Array, a: Array) -> None:
        """Speeds and accelerations of the coordinates."""

    def acceleration(self, name: str) -> Array:
        """Of a point at the motion last set, (2,), m/s^2."""

    def needed(self, field: tuple[float, float], wrenches: dict[int, list[float]]) -> Array:
        """Generalised forces that the motion last set asks for beyond gravity and what acts, (3,), N m."""

    def carried(self) -> dict[int, Array]:
        """Force on each moving bar at its first pin, at the motion last set and under `wrenches`, (2,), N."""

    # what follows
    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4."""
        x, y = (self.point("end3") - self.point("end4")).tolist()
        return x, y

    def jacobian(self) -> Array:
        """Difference of the two points' Jacobians."""
        return self.point_jacobian("end3") - self.point_jacobian("end4")

    def positions(self) -> dict[str, Array]:
        """Points of the bars."""
        return {name: np.array(self.point(point)) for name, point in POINTS.items() if name != "A2"}

    def angle(self, bar: int) -> float:
        """From the bar's axes; the ground's line as described."""
        if bar == 1:
            return self.ground_angle
        along = self.rotation(bar)[:, 0]
        return math.atan2(along[1], along[0])

    def turned(self, bar: int, x: float, y: float) -> Array:
        """World axes of the vector that is (x, y) along and across a bar's line, (2,)."""
        found = turned(self.ground_angle, x, y) if bar == 1 else turned_by(self.rotation(bar).tolist(), x, y)
        return np.array(found)

    def foot(self, bar: int) -> Array:
        """First pin of a bar (O2, O2, A, O4 of bars 1, 2, 3, 4), m, (2,)."""
        return np.zeros(2) if bar == 1 else self.point(f"foot{bar}")

    def velocity(self, bar: int) -> float:
        """Angular velocity of a bar, rad/s."""
        return float(self.turns[bar] @ self.v)

    def alpha(self, bar: int) -> float:
        """Angular acceleration of a bar, rad/s^2."""
        return float(self.turns[bar] @ self.a)

    def gravity(self, field: tuple[float, float]) -> None:
        """A field (g_x, g_y) for the engine's own gravity, m/s^2."""
        self.field = field

    def push(self, bar: int, force: Array, point: Array) -> None:
        """Add a force (N, world axes) at a point (m, world axes); on the ground it does nothing."""
        if bar != 1:
            (x, y), (f_x, f_y), wrench = (point - self.foot(bar)).tolist(), force.tolist(), self.wrenches[bar]
            wrench[0] += f_x
            wrench[1] += f_y
            wrench[2] += x * f_y - y * f_x

    def twist(self, bar: int, couple: float) -> None:
        """Add a couple, N m; on the ground it does nothing."""
        if bar != 1:
            self.wrenches[bar][2] += couple

    def moving(self, v: Array, a: Array) -> None:
        """Take speeds and accelerations of the coordinates, for all that follows."""
        self.v, self.a = v, a
        self.set_motion(v, a)

    def drift(self, v: Array) -> Array:
        """Acceleration of the gap at speeds v where a = 0, (2,), m/s^2."""
        self.moving(v, np.zeros(3))
        return self.acceleration("end3") - self.acceleration("end4")

    def torques(self) -> Array:
        """What the motion asks for beyond loads and effects, (3,), N m."""
        self.wrenches = _no_wrenches()
        for act in self.terms:
            act()
        return self.needed(self.field, self.wrenches)

    def forces(self, loop_force: Array, torque: float) -> dict[str, Array]:
        """F12, F32, F14 with the loop force on bar 3 at B, its opposite on bar 4, and the drive's couple put back."""
        self.push(3, loop_force, self.point("end3"))
        self.push(4, -loop_force, self.point("end4"))
        self.twist(self.drive_bar, torque)
        on = self.carried()
        return {"F12": on[2], "F32": -on[3], "F14": on[4]}

    def move(self, omega_2: float, alpha_2: float) -> Values:
        """Velocities, accelerations and forces where the tree is placed; nothing where a toggle leaves them 0/0.

        Effects that depend on the load of a pin are given the loads of the pass before, until they repeat.
        """
        jacobian = self.jacobian()
        try:
            v = closed(jacobian, omega_2)
            a = closed(jacobian, alpha_2, *self.drift(v).tolist())
        except np.linalg.LinAlgError:
            return {}
        self.moving(v, a)
        self.pin_loads = {}
        inertial = [self.needed((0.0, 0.0), _no_wrenches())] if self.alone else []
        needed = self.torques()
        values: Values = {f"a_{name}": self.acceleration(point) for name, point in ON_BARS.items()}
        for bar in (3, 4):
            values[f"omega_{bar}"], values[f"alpha_{bar}"] = self.velocity(bar), self.alpha(bar)
        solve = partial(multipliers, jacobian, self.turns[self.drive_bar])
        try:
            forces = self._balanced(solve(needed))
        except np.linalg.LinAlgError:  # no torque on that bar balances the linkage here
            return values
        if inertial:
            values["torque_inertia"] = float(solve(inertial[0])[2])
        if self.loaded:
            forces = self._settled(forces, lambda: self._balanced(solve(self.torques())))
        return values | forces

    def _balanced(self, unknowns: Array) -> dict[str, Any]:
        """Driving torque and the four pin forces."""
        return {**self.forces(unknowns[:2], float(unknowns[2])), "F43": unknowns[:2], "torque": unknowns[2]}

    def _settled(self, forces: dict[str, Any], again: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Passes over pin loads and the friction they make, until they repeat; nothing where they never do."""
        before = math.inf
        for _ in range(PASSES):
            loads = {pin: math.hypot(*forces[FORCE_AT[pin]]) for pin in self.loaded}
            most = max(loads.values())
            change = max(abs(load - self.pin_loads.get(pin, 0.0)) for pin, load in loads.items())
            # once down to the rounding of a pass, the change falls no further
            if change <= REPEATED * most or before <= change <= ROUNDED * most:
                return forces
            if not most < DIVERGED:
                break
            before, self.pin_loads = change, loads
            forces = again()
        return self._grown(again)

    def _grown(self, again: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """The forces with friction grown from none, where passes run away; nothing where the growth ends in a jam.

        By Newton's steps, the slopes from passes with each load changed a little.
        """

        def passed(loads: Array) -> tuple[dict[str, Any], Array]:
            self.pin_loads = dict(zip(self.loaded, loads.tolist(), strict=True))
            forces = again()
            return forces, np.array([math.hypot(*forces[FORCE_AT[pin]]) for pin in self.loaded])

        unit = np.eye(len(self.loaded))
        forces, loads = passed(np.zeros(len(unit)))
        for share in np.arange(1, STAGES + 1) / STAGES:
            before = math.inf
            for _ in range(STEPS):
                forces, found = passed(share * loads)
                most, change = float(found.max()), float(np.abs(found - loads).max())
                if not most < DIVERGED or change <= REPEATED * most or before <= change <= ROUNDED * most:
                    break
                nudge, before = NUDGE * most, change
                moved = [(passed(share * (loads + nudge * one))[1] - found) / nudge for one in unit]
                matrix = unit - np.stack(moved, axis=1)
                if np.linalg.det(matrix) <= 0.0:  # 1 without friction: beyond zero the growth has turned back
                    return {}
                loads = loads + np.linalg.solve(matrix, found - loads)
            if not change <= ROUNDED * most or (loads < 0.0).any():
                return {}
        return forces


def _no_wrenches() -> dict[int, list[float]]:
    return {bar: [0.0, 0.0, 0.0] for bar in MOVING_BARS}


def closed(jacobian: Array, of_2: float, x: float = 0.0, y: float = 0.0) -> Array:
    """Rates of the three coordinates where J rates + (x, y) = 0 and bar 2 has its own; LinAlgError at a toggle."""
    (e, a, b), (f, c, d) = jacobian.tolist()
    x, y, det = x + e * of_2, y + f * of_2, a * d - b * c
    if det == 0.0:
        raise np.linalg.LinAlgError("the bars are in one line")
    return np.array([of_2, (b * y - d * x) / det, (c * x - a * y) / det])


def multipliers(jacobian: Array, turn: Array, needed: Array) -> Array:
    """[lambda; T] where [J^T turn] [lambda; T] = tau, (3,); LinAlgError where no torque on that bar balances tau.

    By Cramer's rule: of bar 2 the determinant is that of `closed` to the last digit, so that there are forces wherever
    there are speeds, as far as rounding leaves them digits; elimination may find the matrix singular there.
    """
    (a, b, c), (d, e, f) = jacobian.tolist()
    (p, q, r), (x, y, z) = turn.tolist(), needed.tolist()
    u, v, w = b * f - c * e, c * d - a * f, a * e - b * d
    det = p * u + q * v + r * w
    if det == 0.0:
        raise np.linalg.LinAlgError("the torque is at a pole")
    one = x * (e * r - f * q) + y * (f * p - d * r) + z * (d * q - e * p)
    other = x * (q * c - r * b) + y * (r * a - p * c) + z * (p * b - q * a)
    return np.array([one / det, other / det, (x * u + y * v + z * w) / det])
