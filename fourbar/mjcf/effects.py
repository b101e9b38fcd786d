"""Each load and each effect in MJCF: what it adds to the model and asks of the drive, one row of a table each."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.mjcf.model import Model
from fourbar.scene import Scene

if TYPE_CHECKING:
    from fourbar.effects import (
        Effect,
        Flywheel,
        Friction,
        Gravity,
        Load,
        Torsion,
        Viscous,
    )

Joints = tuple[float, float, float]


def _add_gravity(effect: "Gravity", model: Model) -> None:
    """Set the option ``gravity``."""
    model.option["gravity"] = (*effect.vector, 0.0)


def _sum_weights(effect: "Gravity", linkage: FourBar, speed: float) -> float:
    """Sum of m g L, with L the longest arm at which a weight acts."""
    longest, total = max(linkage.lengths), 0.0
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        total += bar.mass * max(longest, abs(bar.mass_centre[0]))
    return total * abs(effect.magnitude)


def _add_viscous(effect: "Viscous", model: Model) -> None:
    """Set the attribute ``damping`` of the hinge (of a tendon at the cut pin B)."""
    for pin, k in effect.coefficients:
        model.pin[pin]["damping"] = k


def _add_friction(effect: "Friction", model: Model) -> None:
    """Set the attribute ``frictionloss`` of the hinge (of a tendon at the cut pin B)."""
    for pin, f in effect.torques:
        model.add_dry_friction(pin, f)


def _add_torsion(effect: "Torsion", model: Model) -> None:
    """Write the ``stiffness`` of the hinge (of a tendon at the cut pin B), its rest shifted by the preload."""
    for pin, k, rest, preload in effect.springs:
        turned = model.linkage.ground_angle if pin in ("O2", "O4") else 0.0
        model.pin[pin]["stiffness"] = k
        # a tendon's rest is a length
        model.pin[pin]["springlength" if pin == "B" else "springref"] = (
            rest + turned - preload / k
        )


def _unwind_torsion(effect: "Torsion", linkage: FourBar, q: Joints) -> Joints:
    """Return each sprung pin within half a turn of its rest; LimitError where the turns of A, B and O4 contradict."""
    rests = {pin: rest for pin, _, rest, _ in effect.springs}

    def turns(pin: str, angle: float, line: float) -> float:
        return (
            0.0
            if pin not in rests
            else math.tau * round((rests[pin] + line - angle) / math.tau)
        )

    theta_1 = linkage.ground_angle
    q2, q3, q4 = (
        q[0] + turns("O2", q[0], theta_1),
        q[1] + turns("A", q[1], 0.0),
        q[2] + turns("O4", q[2], theta_1),
    )
    at_B = turns("B", q4 - q2 - q3, 0.0)
    if at_B and "O4" not in rests:
        q4 += at_B
    elif at_B and "A" not in rests:
        q3 -= at_B
    elif at_B:
        raise LimitError(
            "the springs at A, B and O4 count turns that MuJoCo's joints cannot have at once"
        )
    return q2, q3, q4


def _add_flywheel(effect: "Flywheel", model: Model) -> None:
    """Add the flywheel as inertia of the body, because MuJoCo's armature of pin O2 is the drive."""
    model.inertia[effect.bar] += effect.inertia


def _add_load(effect: "Load", model: Model) -> None:
    """Add a constant actuator on a site (force) or on the bar (couple)."""
    if effect.table is not None:
        raise LimitError(
            "a load that is a table over theta_2 has no counterpart in MJCF"
        )
    model.loads.append(effect)


class MjcfForm(NamedTuple):
    """One effect in MJCF."""

    add: Callable[[Any, Model], None]
    """Puts it into the model."""
    couple: Callable[[Any, FourBar, float], float] = lambda effect, linkage, speed: 0.0
    """The couple that it may ask of the drive at a speed (rad/s), N m: lays out the flywheel."""
    unwind: Callable[[Any, FourBar, Joints], Joints] = lambda effect, linkage, q: q
    """The angles of pins O2, A, O4, moved by the whole turns that the effect tells apart, rad."""


MJCF_OF: dict[str, MjcfForm] = {
    "gravity": MjcfForm(_add_gravity, _sum_weights),
    "viscous": MjcfForm(
        _add_viscous,
        lambda effect, linkage, speed: (
            sum((k for _, k in effect.coefficients), 0.0) * speed
        ),
    ),
    "friction": MjcfForm(
        _add_friction,
        lambda effect, linkage, speed: sum((f for _, f in effect.torques), 0.0),
    ),
    "torsion": MjcfForm(
        _add_torsion,
        lambda effect, linkage, speed: effect.greatest_couple,
        _unwind_torsion,
    ),
    "springs": MjcfForm(  # spatial tendons
        lambda effect, model: model.springs.extend(effect.springs),
        lambda effect, linkage, speed: (
            sum(s.greatest_tension(linkage) for s in effect.springs)
            * max(linkage.lengths)
        ),
    ),
    "flywheel": MjcfForm(_add_flywheel),
    "load": MjcfForm(
        _add_load,
        lambda effect, linkage, speed: (
            effect.greatest_force(linkage) * max(linkage.lengths)
        ),
    ),
}
"""MJCF forms of the effects by key."""
NO_MJCF = {"pin_friction"}
"""Effects of which MJCF has no counterpart: here friction that depends on the pin forces."""


def find_row(effect: "Effect") -> MjcfForm:
    """Return the row of an effect; LimitError where it has none."""
    if effect.key not in MJCF_OF:
        raise LimitError(f"the effect {effect.key!r} has no counterpart in MJCF")
    return MJCF_OF[effect.key]


def unwind(scene: Scene, q: Joints) -> Joints:
    """Compute the angles of pins O2, A, O4 as the scene's springs count them, rad."""
    for effect in scene.effects:
        q = find_row(effect).unwind(effect, scene.linkage, q)
    return q
