"""Compute the size of the forces of each load and effect, N.

Couples are divided by a bar's length. Each kind is one row of a table. A sum of forces
that (nearly) vanishes is judged by these, so none of them is asked of the formulas'
side: what an effect said of itself would excuse what it does wrong.
"""

import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import FourBarError
from fourbar.linkage import MOVING_BARS, PIN_FORCE, FourBar
from fourbar.quantities import Array
from fourbar.solution import Solution
from fourbar_validation.compare.pins import find_centre, find_mass
from fourbar_validation.compare.reversals import compute_slip
from fourbar_validation.compare.tolerance import magnitude, sum_lengths

if TYPE_CHECKING:
    from fourbar import effects


def _find_shortest(linkage: FourBar) -> float:
    """Find the least length of a moving bar, m."""
    return min(linkage.lengths[1:])


def _multiply_levers(linkage: FourBar, places: Iterable[tuple[int, float]]) -> float:
    """Return the size of forces with their couples, as a multiple of the force.

    The forces act at distances along bars.
    """
    return sum(
        1.0 + abs(distance) / linkage.lengths[bar - 1]
        for bar, distance in places
        if bar != 1
    )


def _find_gravity(gravity: "effects.Gravity", linkage: FourBar, _: Solution) -> float:
    """Sum the weights with their levers about the bars' first pins."""
    bars = zip(MOVING_BARS, linkage.moving, strict=True)
    return sum(
        find_mass(bar)
        * abs(gravity.magnitude)
        * _multiply_levers(linkage, [(number, find_centre(bar)[0])])
        for number, bar in bars
    )


def _find_viscous(
    viscous: "effects.Viscous", linkage: FourBar, formulas: Solution
) -> Any:
    return sum(
        k * np.abs(compute_slip(formulas, pin)) / _find_shortest(linkage)
        for pin, k in viscous.coefficients
    )


def _find_friction(
    friction: "effects.Friction", linkage: FourBar, _: Solution
) -> float:
    return sum(torque for _, torque in friction.torques) / _find_shortest(linkage)


def _find_pin_friction(
    friction: "effects.PinFriction",
    linkage: FourBar,
    formulas: Solution,
) -> Any:
    def load(pin: str) -> Array:
        return np.nan_to_num(magnitude(getattr(formulas, PIN_FORCE[pin])))

    return sum(
        mu * r * load(pin) / _find_shortest(linkage) for pin, mu, r in friction.pins
    )


def _find_torsion(torsion: "effects.Torsion", linkage: FourBar, _: Solution) -> float:
    """Sum the couples at half a turn from rest, beyond which there are none."""
    couples = (abs(preload) + k * math.pi for _, k, _, preload in torsion.springs)
    return sum(couples) / _find_shortest(linkage)


def _find_springs(springs: "effects.Springs", linkage: FourBar, _: Solution) -> float:
    """Sum the tensions with their levers.

    The ends stay within the linkage and the arms to them.
    """
    total = 0.0
    for spring in springs.springs:
        ends = [(end.bar, _find_reach(end)) for end in (spring.start, spring.end)]
        reach = sum_lengths(linkage) + sum(distance for _, distance in ends)
        tension = abs(spring.preload) + spring.stiffness * (reach + spring.length)
        total += tension * _multiply_levers(linkage, ends)
    return total


def _find_flywheel(
    flywheel: "effects.Flywheel", linkage: FourBar, formulas: Solution
) -> Any:
    alpha = np.abs(getattr(formulas, f"alpha_{flywheel.bar}"))
    return flywheel.inertia * alpha / linkage.bar(flywheel.bar).length


def _find_load(load: "effects.Load", linkage: FourBar, _: Solution) -> float:
    """Return the force with its lever, and the couple over the bar's length.

    The table's factor is its greatest.
    """
    bar = linkage.bar(load.bar)
    size = abs(load.moment) / bar.length
    if load.force is not None:
        if load.arm is None:
            reach = _find_reach(load.place)
        else:
            reach = abs(find_centre(bar)[0]) + abs(load.arm[0])
        size += abs(load.force[0]) * (1.0 + reach / bar.length)
    if load.table is not None:
        size *= max(abs(factor) for factor in load.table.factor)
    return size


def _find_reach(place: Any) -> float:
    """Return the distance of a place from its bar's first pin, m."""
    assert place.from_pin is not None and place.from_centre is None
    return abs(float(place.from_pin[0]))


SIZE_OF: dict[str, Callable[[Any, FourBar, Solution], Array | float]] = {
    "gravity": _find_gravity,
    "viscous": _find_viscous,
    "friction": _find_friction,
    "pin_friction": _find_pin_friction,
    "torsion": _find_torsion,
    "springs": _find_springs,
    "flywheel": _find_flywheel,
    "load": _find_load,
}
"""Size of the forces of an effect, by its key; effects of others bring their own."""


def find_size(
    effect: "effects.Effect", linkage: FourBar, formulas: Solution
) -> Array | float:
    """Return the size of an effect's forces, N, (n,) or one for all positions.

    An effect without one raises FourBarError: nothing is judged by another effect's
    scale.
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
