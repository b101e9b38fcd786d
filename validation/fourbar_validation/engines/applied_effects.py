"""Apply each load and effect to an engine's bars, from the engine's numbers.

Each kind is one row of a table. No engine is named here, and nothing of the formulas'
`act` is used, so that this is a second derivation.
"""

import cmath
import math
from collections.abc import Callable, Container
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.linkage import PINS
from fourbar.scene import Scene
from fourbar_validation.engines.description import declares, find_field, look_up
from fourbar_validation.engines.tree import Act, Loaded

if TYPE_CHECKING:
    from fourbar.effects import (
        Effect,
        Flywheel,
        Friction,
        Gravity,
        Load,
        PinFriction,
        Springs,
        Torsion,
        Viscous,
    )


def _set_gravity(effect: "Gravity", bars: Loaded) -> None:
    """Set the engine's own gravity."""
    bars.gravity(find_field(effect))


def _find_slip(bars: Loaded, pin: str) -> float:
    """Return omega_j - omega_i of the bars i, j that meet at a pin, rad/s."""
    i, j = PINS[pin]
    return bars.velocity(j) - bars.velocity(i)


def _apply_pin_couple(
    bars: Loaded,
    pin: str,
    couple: float,
) -> None:
    """Apply a couple to bar j of a pin (i, j), and its opposite to bar i."""
    i, j = PINS[pin]
    bars.couple(j, couple)
    bars.couple(i, -couple)


def _apply_viscous(effect: "Viscous", bars: Loaded) -> None:
    """Apply couples against the slip, in proportion to it."""
    for pin, k in effect.coefficients:
        _apply_pin_couple(bars, pin, -k * _find_slip(bars, pin))


def _apply_friction(effect: "Friction", bars: Loaded) -> None:
    """Apply couples of constant size.

    MuJoCo's own frictionloss is a soft constraint.
    """
    for pin, f in effect.torques:
        _apply_pin_couple(bars, pin, -f * float(np.sign(_find_slip(bars, pin))))


def _pin_friction(effect: "PinFriction", bars: Loaded) -> None:
    """Apply couples of mu r times the load at the pin.

    The engine computed the load in its last pass.
    """
    for pin, mu, r in effect.pins:
        greatest = mu * r * bars.pin_loads.get(pin, 0.0)
        sense = float(np.sign(_find_slip(bars, pin)))
        _apply_pin_couple(bars, pin, -greatest * sense)


def _apply_torsion(effect: "Torsion", bars: Loaded) -> None:
    """Apply couples from the engine's own angles of the two bars."""
    for pin, k, rest, preload in effect.springs:
        i, j = PINS[pin]
        turned = math.remainder(bars.angle(j) - bars.angle(i) - rest, math.tau)
        _apply_pin_couple(bars, pin, -(preload + k * turned))


def _apply_springs(effect: "Springs", bars: Loaded) -> None:
    """Pull at the engine's own places of the two points."""
    for spring in effect.springs:
        start = bars.end(spring.start)
        end = bars.end(spring.end)
        across = end - start
        distance = abs(across)
        if spring.preload == spring.stiffness * spring.length:
            per_metre = spring.stiffness
        else:
            tension = spring.preload + spring.stiffness * (distance - spring.length)
            if spring.acts is not None and (tension < 0.0) != (spring.acts == "push"):
                continue
            per_metre = tension / distance if distance else math.nan
        bars.push(spring.start.bar, per_metre * across, start)
        bars.push(spring.end.bar, -per_metre * across, end)


def _apply_flywheel(effect: "Flywheel", bars: Loaded) -> None:
    """Apply the couple that accelerating the wheel takes.

    The angular acceleration is the engine's own.
    """
    bars.couple(effect.bar, -effect.inertia * bars.alpha(effect.bar))


def _carry_load(load: "Load", bars: Loaded) -> None:
    """Apply a force at its place, which the engine's bar carries along.

    A couple is applied too.
    """
    factor = 1.0
    if load.table is not None:
        factor = float(look_up(load.table, bars.angle(2)))
    if load.force is not None:
        force = cmath.rect(*load.force)
        if load.frame == "bar":
            force = bars.rotate(load.bar, force)
        if load.arm is not None:
            point = bars.locate(f"G{load.bar}") + cmath.rect(*load.arm)
        else:
            assert load.place is not None
            point = bars.end(load.place)
        bars.push(load.bar, factor * force, point)
    bars.couple(load.bar, factor * load.moment)


TERM_OF: dict[str, Callable[[Any, Loaded], None]] = {
    "gravity": _set_gravity,
    "viscous": _apply_viscous,
    "friction": _apply_friction,
    "pin_friction": _pin_friction,
    "torsion": _apply_torsion,
    "springs": _apply_springs,
    "flywheel": _apply_flywheel,
    "load": _carry_load,
}
"""Function that applies an effect at a state of the bars, by the effect's key. Others
bring their own.
"""


def has_term(effect: "Effect") -> bool:
    """Return True if an effect can be applied to an engine's bars."""
    return effect.key in TERM_OF or declares(effect, "act_on_engine")


def list_wrenches(
    scene: Scene,
    bars: Loaded,
    own: Container[str] = (),
) -> list[Act]:
    """List what loads and effects do at each state of the bars.

    Gravity is the engine's own, and is set once.

    `own`: the keys of effects for which the engine has elements of its own.
    """
    acts: list[Act] = []
    for effect in (*scene.effects, *scene.loads):
        term = TERM_OF.get(effect.key, type(effect).act_on_engine)
        act = partial(term, effect, bars)
        if effect.key == "gravity":
            act()
        elif effect.key not in own:
            acts.append(act)
    return acts
