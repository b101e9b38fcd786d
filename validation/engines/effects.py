"""What each load and each effect does on an engine's tree, from the engine's own numbers: one row of a table each.

No engine is named here, and nothing of the formulas' `act` is used: this is the second derivation.
"""

import bisect
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fourbar.linkage import MOVING_BARS
from fourbar.scene import Scene
from validation.compare.answer import Array
from validation.engines.description import PINS, along_and_across, field

if TYPE_CHECKING:
    from fourbar.effects import Flywheel, Friction, Gravity, Load, PinFriction, Springs, Table, Torsion, Viscous

Act = Callable[[], None]


class Pushed:
    """What acts on each moving bar, summed: a force at its first pin and a couple, (x, y, moment), N and N m."""

    wrenches: dict[int, list[float]]

    def foot(self, bar: int) -> Array:
        """First pin of a bar, m, world axes."""
        raise NotImplementedError

    def act(self, acting: Sequence[Callable[[], None]]) -> None:
        """Sum anew what these add."""
        self.wrenches = {bar: [0.0, 0.0, 0.0] for bar in MOVING_BARS}
        for each in acting:
            each()

    def push(self, bar: int, force: Array, point: Array) -> None:
        """Add a force at a point, world axes; on the ground it does nothing."""
        if bar != 1:
            (x, y), (f_x, f_y), wrench = (point - self.foot(bar)).tolist(), force.tolist(), self.wrenches[bar]
            wrench[0] += f_x
            wrench[1] += f_y
            wrench[2] += x * f_y - y * f_x

    def twist(self, bar: int, couple: float) -> None:
        """Add a couple; on the ground it does nothing."""
        if bar != 1:
            self.wrenches[bar][2] += couple


class Tree(Protocol):
    """An engine holding the open tree of bars at its present motion; every number is the engine's own.

    The ground (bar 1) does not move; its line points from O2 to O4.
    """

    def gravity(self, vector: tuple[float, float]) -> None:
        """Give the engine's own gravity a field (g_x, g_y), m/s^2."""

    def push(self, bar: int, force: Array, point: Array) -> None:
        """Add a force (N, world axes) at a point (m, world axes); on the ground it does nothing."""

    def twist(self, bar: int, couple: float) -> None:
        """Add a couple, N m; on the ground it does nothing."""

    def angle(self, bar: int) -> float:
        """Direction of a bar's line, in (-pi, pi], rad."""

    def velocity(self, bar: int) -> float:
        """Angular velocity of a bar, rad/s."""

    def alpha(self, bar: int) -> float:
        """Angular acceleration of a bar, rad/s^2."""

    def turned(self, bar: int, x: float, y: float) -> Array:
        """World axes of the vector that is (x, y) along and across a bar's line, (2,)."""

    def foot(self, bar: int) -> Array:
        """First pin of a bar (O2, O2, A, O4 of bars 1, 2, 3, 4), m, (2,)."""

    def centre(self, bar: int) -> Array:
        """Mass centre of a moving bar, m, (2,)."""

    def pin_load(self, pin: str) -> float:
        """Magnitude of the pin force that the engine itself found in its last pass, N."""


def _gravity(effect: "Gravity", tree: Tree) -> None:
    """The engine's own gravity, set once and for all."""
    tree.gravity(field(effect))


def _viscous(effect: "Viscous", tree: Tree) -> Act:
    """Couples against the relative spin of the two bars at each pin."""

    def act() -> None:
        for pin, k in effect.coefficients:
            one, other = PINS[pin]
            slip = tree.velocity(one) - tree.velocity(other)
            tree.twist(other, k * slip)
            tree.twist(one, -k * slip)

    return act


def _friction(effect: "Friction", tree: Tree) -> Act:
    """Couples of constant size against the relative spin; MuJoCo's own frictionloss is a soft constraint."""

    def act() -> None:
        for pin, f in effect.torques:
            one, other = PINS[pin]
            slip = tree.velocity(one) - tree.velocity(other)
            couple = f if slip > 0.0 else -f if slip < 0.0 else 0.0
            tree.twist(other, couple)
            tree.twist(one, -couple)

    return act


def _pin_friction(effect: "PinFriction", tree: Tree) -> Act:
    """Couples of mu r times the load that the engine found at the pin in its last pass, against the spin."""

    def act() -> None:
        for pin, mu, r in effect.pins:
            one, other = PINS[pin]
            slip = tree.velocity(one) - tree.velocity(other)
            if slip != 0.0:
                couple = math.copysign(mu * r * tree.pin_load(pin), slip)
                tree.twist(other, couple)
                tree.twist(one, -couple)

    return act


def _torsion(effect: "Torsion", tree: Tree) -> Act:
    """Couples from the engine's own angles of the two bars."""

    def act() -> None:
        for pin, k, rest, preload in effect.springs:
            one, other = PINS[pin]
            twist = math.remainder(tree.angle(one) - tree.angle(other) + rest, math.tau)
            tree.twist(other, k * twist - preload)
            tree.twist(one, preload - k * twist)

    return act


def _springs(effect: "Springs", tree: Tree) -> Act:
    """Pulls at the engine's own places of the two points."""

    def act() -> None:
        for spring in effect.springs:
            one, other = (
                tree.foot(point.bar) + tree.turned(point.bar, *along_and_across(point.distance, point.angle))
                for point in (spring.start, spring.end)
            )
            vector = np.asarray(other - one)
            distance = math.hypot(*vector)
            if spring.slack:
                tension = spring.preload + spring.stiffness * (distance - spring.length)
                vector = vector * (tension / distance) if distance else np.full(2, np.nan)
            else:
                vector = spring.stiffness * vector
            tree.push(spring.start.bar, vector, one)
            tree.push(spring.end.bar, -vector, other)

    return act


def _flywheel(effect: "Flywheel", tree: Tree) -> Act:
    """The couple that turning the wheel takes, from the engine's own angular acceleration."""

    def act() -> None:
        tree.twist(effect.bar, -effect.inertia * tree.alpha(effect.bar))

    return act


def _load(load: "Load", tree: Tree) -> Act:
    """A force at its point and a couple; in the bar's frame both vectors turn with the engine's bar."""
    of_force, of_arm = (
        np.array([size * math.cos(angle), size * math.sin(angle)])
        for size, angle in (load.force or (0.0, 0.0), load.at)
    )

    def act() -> None:
        factor = 1.0 if load.table is None else look_up(load.table, tree.angle(2))
        if load.force is not None:
            force, arm = of_force, of_arm
            if load.frame == "bar":
                force, arm = tree.turned(load.bar, *of_force), tree.turned(load.bar, *of_arm)
            tree.push(load.bar, factor * force, tree.centre(load.bar) + arm)
        tree.twist(load.bar, factor * load.moment)

    return act


def look_up(table: "Table", theta_2: float) -> float:
    """The factor of a table at one angle, by the two neighbours' chord, apart from the formulas' `at`."""
    angle = table.theta_2[0] + math.fmod(math.fmod(theta_2 - table.theta_2[0], math.tau) + math.tau, math.tau)
    k = min(max(bisect.bisect_right(table.theta_2, angle), 1), len(table.theta_2) - 1)
    (a, b), (f, g) = table.theta_2[k - 1 : k + 1], table.factor[k - 1 : k + 1]
    return (f * (b - angle) + g * (angle - a)) / (b - a)


TERM_OF: dict[str, Callable[[Any, Tree], Act | None]] = {
    "gravity": _gravity,
    "viscous": _viscous,
    "friction": _friction,
    "pin_friction": _pin_friction,
    "torsion": _torsion,
    "springs": _springs,
    "flywheel": _flywheel,
    "load": _load,
}
"""By the key of an effect: what acts at each state of a tree; None where all is set once and for all."""


def acting(scene: Scene, tree: Tree) -> list[Act]:
    """What loads and effects do at each state of a tree."""
    terms = [TERM_OF[effect.key](effect, tree) for effect in (*scene.effects, *scene.loads)]
    return [term for term in terms if term is not None]


def unknown_effect(scene: Scene) -> str | None:
    """The reason to refuse a scene: an effect that is not in the table."""
    for effect in scene.effects:
        if effect.key not in TERM_OF:
            return f"the effect {effect.key!r} has no model here"
    return None
