"""Compute the wrench of each load and effect on the free bodies of a four-bar.

A table leads from its kind to its wrench. Definitions as in docs/scene-file.md, from
the numbers of the description alone. Vectors of the plane are complex numbers, x + i y.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.linkage import MOVING_BARS, PINS
from fourbar.quantities import Array, ComplexArray
from fourbar.scene import Scene, command, find_signs
from fourbar_validation.compare.bodies import BodyMotion, make_vector
from fourbar_validation.compare.pins import find_mass
from fourbar_validation.engines.description import declares, look_up
from fourbar_validation.engines.free_body_closure import close, cross_products

GREATEST_WINDING = math.pi * (1.0 - 1e-12)
"""Greatest winding of a spring from rest, rad: half a turn less the rounding of an
angle of several turns.
"""


class BodyWrenches:
    """Sums of the forces (N) and moments (N m) on the moving bars, (n,) each.

    The moments are about the first pins.
    """

    def __init__(self, n: int) -> None:
        self.force: dict[int, ComplexArray] = {
            bar: np.zeros(n, dtype=complex) for bar in MOVING_BARS
        }
        self.moment: dict[int, Array] = {bar: np.zeros(n) for bar in MOVING_BARS}

    def push(self, bar: int, force: Any, arm: Any) -> None:
        """Add a force, at `arm` from the bar's first pin.

        Forces on the ground have no effect.
        """
        if bar in self.force:
            self.force[bar] = self.force[bar] + force
            self.moment[bar] = self.moment[bar] + cross_products(arm, force)

    def couple(self, bar: int, couple: Any) -> None:
        """Add a couple; on the ground it does nothing."""
        if bar in self.moment:
            self.moment[bar] = self.moment[bar] + couple

    def twist_at(self, pin: str, couple: Any) -> None:
        """Add a couple to bar j of a pin (i, j), its opposite to bar i."""
        i, j = PINS[pin]
        self.couple(j, couple)
        self.couple(i, -couple)


_MEET = 16.0 * 2.0**-52
"""Part of the lengths below which two points lie in one. The lengths are those by which
they are reached.
"""
FOLLOWED = np.radians(2.0)
"""Step in which angles are followed from where a motion begins, rad."""


def _apply_gravity(effect: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Apply m g at every mass centre."""
    for bar in MOVING_BARS:
        wrenches.push(
            bar,
            find_mass(motion.linkage.bar(bar))
            * make_vector((effect.magnitude, effect.angle)),
            motion.to_centre(bar),
        )


def _add_viscous_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Couple -k (omega_j - omega_i)."""
    for pin, k in effect.coefficients:
        wrenches.twist_at(pin, -k * motion.slip(pin))


def _add_friction_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Couple -f sign(omega_j - omega_i), none at rest."""
    for pin, f in effect.torques:
        wrenches.twist_at(pin, -f * motion.sense(pin))


def _add_torsion_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Apply the couple -(preload + k (theta_j - theta_i - rest)).

    The angle is within half a turn.
    """
    for pin, k, rest, preload in effect.springs:
        i, j = PINS[pin]
        angle = np.angle(
            motion.unit[j] * np.conj(motion.unit[i]) * make_vector((1.0, -rest))
        )
        wrenches.twist_at(pin, -(preload + k * angle))


def _add_spring_pulls(effect: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Apply the pull preload + k (distance - length) along the points' line.

    The line has no direction where they coincide.
    """
    for spring in effect.springs:
        arms, across = motion.lay((spring.start, spring.end))
        if spring.preload == spring.stiffness * spring.length:
            pull = spring.stiffness * across
        else:
            reach = (
                sum(motion.linkage.lengths)
                + abs(spring.start.distance)
                + abs(spring.end.distance)
            )
            distance = np.where(np.abs(across) <= _MEET * reach, np.nan, np.abs(across))
            tension = spring.preload + spring.stiffness * (distance - spring.length)
            if spring.acts == "push":
                tension = np.minimum(tension, 0.0)
            elif spring.acts == "pull":  # off where the ends meet
                tension = np.maximum(np.nan_to_num(tension), 0.0)
                distance = np.nan_to_num(distance, nan=1.0)
            pull = tension / distance * across
        wrenches.push(spring.start.bar, pull, arms[0])
        wrenches.push(spring.end.bar, -pull, arms[1])


def _add_flywheel_couple(
    effect: Any,
    motion: BodyMotion,
    wrenches: BodyWrenches,
) -> None:
    """Couple -J alpha (d'Alembert)."""
    wrenches.couple(effect.bar, -effect.inertia * motion.alpha[effect.bar])


WRENCH_OF: dict[str, Callable[[Any, BodyMotion, BodyWrenches], None]] = {
    "gravity": _apply_gravity,
    "viscous": _add_viscous_couple,
    "friction": _add_friction_couple,
    "pin_friction": lambda *_: (
        None
    ),  # it depends on the pin forces, and is solved with them
    "torsion": _add_torsion_couple,
    "springs": _add_spring_pulls,
    "flywheel": _add_flywheel_couple,
}
"""Function that applies an effect, by the effect's name in a scene file. Others bring
their own.
"""


def has_wrench(effect: Any) -> bool:
    """Return True if an effect can be applied to the free bodies."""
    return effect.key in WRENCH_OF or declares(effect, "act_on_free_bodies")


def apply_effect(effect: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Add what an effect does to the free bodies."""
    act = WRENCH_OF.get(effect.key, type(effect).act_on_free_bodies)
    act(effect, motion, wrenches)


def sum_acting(scene: Scene, motion: BodyMotion) -> BodyWrenches:
    """Sum all that acts on the bars but pins, inertia and drive.

    What depends on the pin forces is left out too.
    """
    wrenches = BodyWrenches(len(motion.theta_2))
    for load in scene.loads:
        apply_load(load, motion, wrenches)
    for effect in scene.effects:
        apply_effect(effect, motion, wrenches)
    return wrenches


def apply_load(load: Any, motion: BodyMotion, wrenches: BodyWrenches) -> None:
    """Apply a force where it acts, from the bar's first pin, and a couple."""
    factor = 1.0 if load.table is None else look_up(load.table, motion.theta_2)
    if load.force is not None:
        force: Any = make_vector(load.force)
        if load.frame == "bar":
            force = motion.unit[load.bar] * force
        wrenches.push(load.bar, factor * force, find_arm(load, motion))
    wrenches.couple(load.bar, factor * load.moment)


def find_arm(load: Any, motion: BodyMotion) -> Any:
    """Return the vector from the bar's first pin to where a load acts.

    A couple without a place enters bars 2 and 4 at the shaft and bar 3 at G.
    """
    if load.arm is not None:
        return motion.to_centre(load.bar) + make_vector(load.arm)
    if load.place is not None:
        return motion.unit[load.bar] * make_vector(load.place.from_pin)
    return motion.to_centre(3) if load.bar == 3 else 0.0 * motion.unit[load.bar]


def find_wound(scene: Scene, motion: BodyMotion) -> NDArray[np.bool_] | None:
    """Return where a torsion spring is wound more than half a turn from its rest.

    The spring's turns are followed from the motion's start, in its assembly. Where the
    loop is open bars 3 and 4 lie along the line from A to O4, as at its limits. None
    where no spring counts turns.
    """
    springs = [
        spring
        for effect in scene.effects
        if effect.key == "torsion"
        for spring in effect.springs  # type: ignore[attr-defined]
    ]
    if not springs or scene.motion.free is not None:
        return None
    begins = command(scene)
    link = scene.linkage
    gone = np.zeros(len(motion.theta_2), dtype=bool)
    ends = np.concatenate((begins.theta_2, motion.theta_2))
    steps = math.ceil(float(np.ptp(ends)) / FOLLOWED) + 1
    path = np.unique(np.concatenate((ends, np.linspace(ends.min(), ends.max(), steps))))
    closed = close(link, path, find_signs(link, path, scene.motion.branch))
    on_path = np.isin(begins.theta_2, path[closed.assembled])
    if not on_path.any():
        return gone
    followed = np.where(closed.assembled, closed.theta, closed.in_line)
    theta_3, theta_4 = np.unwrap(followed)
    theta = {1: link.ground_angle + 0.0 * path, 2: path, 3: theta_3, 4: theta_4}
    start = begins.theta_2[on_path][0]
    first = int(np.searchsorted(path, start))
    places = np.clip(np.searchsorted(path, motion.theta_2), 0, len(path) - 1)
    for pin, _, rest, _ in springs:
        i, j = PINS[pin]
        away = theta[j] - theta[i] - rest
        turns = np.floor(away[first] / math.tau + 0.5)
        gone |= np.abs(away[places] - math.tau * turns) > GREATEST_WINDING
    return gone


def list_sliding_pins(scene: Scene) -> dict[str, float]:
    """Return mu r of each pin whose friction depends on its load, m."""
    pins = [
        pin
        for effect in scene.effects
        if effect.key == "pin_friction"
        for pin in effect.pins  # type: ignore[attr-defined]
    ]
    return {name: mu * r for name, mu, r in pins if mu * r != 0.0}
