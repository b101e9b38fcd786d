"""How large the forces of each load and each effect are, couples divided by a bar's length, N: one row of a table each.

A sum of forces that (nearly) vanishes is judged by these.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import FourBarError
from fourbar.linkage import MOVING_BARS, PIN_FORCE, PINS, FourBar
from fourbar.solution import Solution
from validation.compare.tolerance import Array

if TYPE_CHECKING:
    from fourbar.effects import Effect, Flywheel, Friction, Gravity, Load, PinFriction, Springs, Torsion, Viscous


def _gravity(effect: "Gravity", linkage: FourBar, formulas: Solution) -> float:
    """Sum of the weights, counted with their levers."""
    total = 0.0
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        total += bar.mass * abs(effect.magnitude) * (1.0 + abs(bar.mass_centre[0]) / bar.length)
    return total


def _viscous(effect: "Viscous", linkage: FourBar, formulas: Solution) -> Array:
    total = np.zeros(len(formulas))
    for pin, k in effect.coefficients:
        total += k * np.abs(_slip(formulas, pin)) / _shortest(linkage)
    return total


def _friction(effect: "Friction", linkage: FourBar, formulas: Solution) -> Array:
    return np.full(len(formulas), sum(f for _, f in effect.torques) / _shortest(linkage))


def _pin_friction(effect: "PinFriction", linkage: FourBar, formulas: Solution) -> Array:
    total = np.zeros(len(formulas))
    for pin, mu, r in effect.pins:
        total += mu * r * np.nan_to_num(np.hypot(*getattr(formulas, PIN_FORCE[pin]).T)) / _shortest(linkage)
    return total


def _torsion(effect: "Torsion", linkage: FourBar, formulas: Solution) -> float:
    return effect.greatest_couple / _shortest(linkage)


def _springs(effect: "Springs", linkage: FourBar, formulas: Solution) -> float:
    """Greatest tensions counted with their levers."""
    return sum(
        spring.greatest_tension(linkage)
        * sum(1.0 + abs(p.distance) / linkage.bar(p.bar).length for p in (spring.start, spring.end) if p.bar != 1)
        for spring in effect.springs
    )


def _flywheel(effect: "Flywheel", linkage: FourBar, formulas: Solution) -> Array:
    """J |alpha|."""
    alpha = getattr(formulas, f"alpha_{effect.bar}")
    return effect.inertia * abs(alpha) / linkage.bar(effect.bar).length  # type: ignore[no-any-return]


def _load(load: "Load", linkage: FourBar, formulas: Solution) -> float:
    return load.greatest_force(linkage)


def _slip(formulas: Solution, pin: str) -> Array:
    """omega_j - omega_i of the bars that meet at a pin, rad/s."""
    speeds = {1: 0.0, 2: formulas.omega_2, 3: formulas.omega_3, 4: formulas.omega_4}
    i, j = PINS[pin]
    return np.asarray(speeds[j] - speeds[i])  # type: ignore[operator]


def _shortest(linkage: FourBar) -> float:
    """The least length of a moving bar, m."""
    return min(linkage.bar(number).length for number in MOVING_BARS)


SIZE_OF: dict[str, Callable[[Any, FourBar, Solution], Array | float]] = {
    "gravity": _gravity,
    "viscous": _viscous,
    "friction": _friction,
    "pin_friction": _pin_friction,
    "torsion": _torsion,
    "springs": _springs,
    "flywheel": _flywheel,
    "load": _load,
}
"""By the key of an effect."""


def size(effect: "Effect", linkage: FourBar, formulas: Solution) -> Array | float:
    """Its forces, N, (n,) or one for all; FourBarError where it has no row: nothing is judged by another's scale."""
    if effect.key not in SIZE_OF:
        raise FourBarError(f"the effect {effect.key!r} has no size to judge forces by")
    return SIZE_OF[effect.key](effect, linkage, formulas)
