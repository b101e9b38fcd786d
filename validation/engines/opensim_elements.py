"""Loads and effects of a scene as elements of OpenSim, one row of a table each; and its vectors."""

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import opensim as osim

from validation.engines.description import PINS, applied, field, place
from validation.engines.effects import look_up

if TYPE_CHECKING:
    from validation.engines.opensim import OpenSimBars


ZERO = (0.0, 0.0, 0.0)
"""Nothing along three axes."""


def vec(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    """Three components."""
    return osim.Vec3(float(x), float(y), float(z))


def vector(values: Iterable[float]) -> Any:
    """A vector of Simbody."""
    numbers = [float(value) for value in values]
    made = osim.Vector(len(numbers), 0.0)
    for index, value in enumerate(numbers):
        made.set(index, value)
    return made


def constants(*values: float) -> list[Any]:
    """Functions of time that are constant, and may be given another value later."""
    return [osim.Constant(value) for value in values]


def _load(load: Any, bars: "OpenSimBars") -> None:
    """`PrescribedForce`, fixed in the bar or in world axes."""
    point, force, couple = applied(load, bars.part[load.bar])
    element = osim.PrescribedForce(f"load{bars.model.getForceSet().getSize()}", bars.body[load.bar])
    element.setForceIsInGlobalFrame(load.frame == "world")
    element.setPointFunctions(*constants(*point, 0.0))
    element.setForceFunctions(*constants(*force, 0.0))
    element.setTorqueFunctions(*constants(0.0, 0.0, couple))
    bars.model.addForce(element)
    if load.table is not None:
        forces, torques = element.updForceFunctions(), element.updTorqueFunctions()
        parts = [(forces, 0, force[0]), (forces, 1, force[1]), (torques, 2, couple)]
        functions = [(osim.Constant.safeDownCast(group.get(index)), value) for group, index, value in parts]

        def follow() -> None:
            factor = look_up(load.table, bars.angle(2))
            for function, value in functions:
                function.setValue(factor * value)

        bars.before_move.append(follow)


def _gravity(effect: Any, bars: "OpenSimBars") -> None:
    """The model's own gravity."""
    bars.model.setGravity(vec(*field(effect)))


def _pin_frames(pin: str, bars: "OpenSimBars", turn: float = 0.0) -> list[Any]:
    """Bodies, places and turns of the axes of both bars of a pin, those of the first turned from its line."""
    one, other = PINS[pin]
    line = bars.ground_angle if one == 1 else 0.0
    return [bars.body[one], vec(), vec(0.0, 0.0, line + turn), bars.body[other], vec(), vec()]


def _viscous(effect: Any, bars: "OpenSimBars") -> None:
    """`ExpressionBasedBushingForce` with rotational damping alone."""
    for pin, damping in effect.coefficients:
        element = osim.ExpressionBasedBushingForce(f"viscous{pin}", *_pin_frames(pin, bars))
        element.set_rotational_damping(vec(0.0, 0.0, damping))
        bars.model.addForce(element)


def _friction(effect: Any, bars: "OpenSimBars") -> None:
    """`TorqueActuator` against the spin that OpenSim found."""
    for pin, torque in effect.torques:
        one, other = PINS[pin]
        actuator = bars.torque_between(one, other)

        def act(one: int = one, other: int = other, torque: float = torque, actuator: Any = actuator) -> None:
            slip = bars.velocity(other) - bars.velocity(one)
            actuator.setOverrideActuation(bars.state, -torque * float(np.sign(slip)))

        bars.before_move.append(act)


def _torsion(effect: Any, bars: "OpenSimBars") -> None:
    """`ExpressionBasedBushingForce`, which measures within half a turn of rest between axes that coincide there."""
    for pin, stiffness, rest, preload in effect.springs:
        element = osim.ExpressionBasedBushingForce(f"torsion{pin}", *_pin_frames(pin, bars, rest))
        element.setMzExpression(f"{stiffness!r}*theta_z+({preload!r})")
        bars.model.addForce(element)


def _springs(effect: Any, bars: "OpenSimBars") -> None:
    """`PointToPointSpring`, a preload as a shorter rest length."""
    for number, spring in enumerate(effect.springs):
        ends: list[Any] = []
        for point in (spring.start, spring.end):
            ends += [bars.body[point.bar], vec(*place(point, bars.ground_angle))]
        rest = spring.length - spring.preload / spring.stiffness
        element = osim.PointToPointSpring(*ends, spring.stiffness, rest)
        element.setName(f"spring{number}")
        bars.model.addForce(element)


def _flywheel(effect: Any, bars: "OpenSimBars") -> None:
    """Inertia of the body that carries it; OpenSim drops that of a body without mass, so the wheel is none."""
    body = bars.body[effect.bar]
    inertia = body.getInertia().getMoments().get(2) + effect.inertia
    body.setInertia(osim.Inertia(inertia, inertia, inertia, *ZERO))


ELEMENT_OF: dict[str, Callable[[Any, "OpenSimBars"], None]] = {
    "gravity": _gravity,
    "viscous": _viscous,
    "friction": _friction,
    "torsion": _torsion,
    "springs": _springs,
    "flywheel": _flywheel,
    "load": _load,
}
"""By the key of an effect; friction in proportion to a pin's load has no element."""
