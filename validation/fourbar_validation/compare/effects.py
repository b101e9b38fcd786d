"""Compute the size of the forces of each load and effect, couples divided by a bar's length, N: one table row each.

A sum of forces that (nearly) vanishes is judged by these.
"""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import FourBarError
from fourbar.linkage import MOVING_BARS, PIN_FORCE, FourBar
from fourbar.solution import Solution
from fourbar_validation.compare.reversals import compute_slip
from fourbar_validation.compare.tolerance import Array, magnitude

if TYPE_CHECKING:
    from fourbar.effects import Effect


def _find_shortest(linkage: FourBar) -> float:
    """Find the least length of a moving bar, m."""
    return min(linkage.bar(number).length for number in MOVING_BARS)


def _multiply_levers(linkage: FourBar, places: Iterable[tuple[int, float]]) -> float:
    """Return the size of forces at distances along bars with their couples, as a multiple of the force."""
    return sum(
        1.0 + abs(distance) / linkage.bar(bar).length
        for bar, distance in places
        if bar != 1
    )


def _pin_force(formulas: Solution, pin: str) -> Array:
    return np.nan_to_num(magnitude(getattr(formulas, PIN_FORCE[pin])))


SIZE_OF: dict[str, Callable[[Any, FourBar, Solution], Array | float]] = {
    "gravity": lambda gravity, linkage, _: sum(
        bar.mass
        * abs(gravity.magnitude)
        * _multiply_levers(linkage, [(number, bar.mass_centre[0])])
        for number, bar in ((number, linkage.bar(number)) for number in MOVING_BARS)
    ),
    "viscous": lambda viscous, linkage, formulas: sum(
        k * np.abs(compute_slip(formulas, pin)) / _find_shortest(linkage)
        for pin, k in viscous.coefficients
    ),
    "friction": lambda friction, linkage, _: (
        sum(torque for _, torque in friction.torques) / _find_shortest(linkage)
    ),
    "pin_friction": lambda friction, linkage, formulas: sum(
        mu * r * _pin_force(formulas, pin) / _find_shortest(linkage)
        for pin, mu, r in friction.pins
    ),
    "torsion": lambda torsion, linkage, _: (
        torsion.greatest_couple / _find_shortest(linkage)
    ),
    "springs": lambda springs, linkage, _: sum(
        spring.greatest_tension(linkage)
        * _multiply_levers(
            linkage, [(p.bar, p.distance) for p in (spring.start, spring.end)]
        )
        for spring in springs.springs
    ),
    "flywheel": lambda flywheel, linkage, formulas: (
        flywheel.inertia
        * abs(getattr(formulas, f"alpha_{flywheel.bar}"))
        / linkage.bar(flywheel.bar).length
    ),
    "load": lambda load, linkage, _: load.greatest_force(linkage),
}
"""Size of the forces of an effect, by its key; others bring their own."""


def find_size(effect: "Effect", linkage: FourBar, formulas: Solution) -> Array | float:
    """Return the size of an effect's forces, N, (n,) or one for all positions.

    An effect without one raises FourBarError: nothing is judged by another effect's scale.
    """
    if effect.key in SIZE_OF:
        return SIZE_OF[effect.key](effect, linkage, formulas)
    try:
        size: Array | float = effect.size(linkage, formulas)
    except NotImplementedError:
        raise FourBarError(
            f"the effect {effect.key!r} has no size to judge forces by"
        ) from None
    return size
