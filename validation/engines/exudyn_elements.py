"""Loads and effects of a scene as elements of Exudyn, one row of a table each."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from exudyn.itemInterface import (
    LoadForceVector,
    LoadMassProportional,
    LoadTorqueVector,
    MarkerBodyMass,
    ObjectConnectorCoordinateSpringDamper,
    ObjectConnectorCoordinateSpringDamperExt,
    ObjectConnectorSpringDamper,
    ObjectConnectorTorsionalSpringDamper,
    ObjectGenericODE2,
)

from fourbar.linkage import MOVING_BARS
from validation.engines.description import PINS, applied, field, place
from validation.engines.effects import look_up

if TYPE_CHECKING:
    from validation.engines.exudyn import ExudynBars

SIGN_ZONE = sys.float_info.min
"""rad/s; the friction law of `CoordinateSpringDamperExt` is proportional to slower slips, and a sign beyond."""


def _load(load: Any, bars: "ExudynBars") -> None:
    """`LoadForceVector`, fixed in the bar or in world axes, and `LoadTorqueVector`."""
    point, force, couple = applied(load, bars.part[load.bar])
    marker = bars.frame_marker(load.bar, 0.0, *point)
    push, twist = np.array([*force, 0.0]), np.array([0.0, 0.0, couple])
    acting = {
        bars.mbs.AddLoad(LoadForceVector(markerNumber=marker, loadVector=push, bodyFixed=load.frame == "bar")): push,
        bars.mbs.AddLoad(LoadTorqueVector(markerNumber=marker, loadVector=twist)): twist,
    }
    if load.table is not None:

        def follow(theta_2: float) -> None:
            for number, vector in acting.items():
                bars.mbs.SetLoadParameter(number, "loadVector", look_up(load.table, theta_2) * vector)

        bars.tables.append(follow)


def _gravity(effect: Any, bars: "ExudynBars") -> None:
    """`LoadMassProportional` on each body."""
    for bar in MOVING_BARS:
        marker = bars.mbs.AddMarker(MarkerBodyMass(bodyNumber=bars.body[bar]))
        bars.mbs.AddLoad(LoadMassProportional(markerNumber=marker, loadVector=[*field(effect), 0.0]))


def _between(pin: str, bars: "ExudynBars") -> list[Any]:
    return [bars.rotation_marker(bar) for bar in PINS[pin]]


def _viscous(effect: Any, bars: "ExudynBars") -> None:
    """`CoordinateSpringDamper` between the two directions."""
    for pin, damping in effect.coefficients:
        markers = _between(pin, bars)
        bars.mbs.AddObject(ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, damping=damping))


def _friction(effect: Any, bars: "ExudynBars") -> None:
    """`CoordinateSpringDamperExt` between the two directions."""
    for pin, torque in effect.torques:
        bars.mbs.AddObject(
            ObjectConnectorCoordinateSpringDamperExt(
                markerNumbers=_between(pin, bars), dynamicFrictionForce=torque, frictionProportionalZone=SIGN_ZONE
            )
        )


def _torsion(effect: Any, bars: "ExudynBars") -> None:
    """`TorsionalSpringDamper`, which measures within half a turn of rest between axes that coincide there."""
    for pin, stiffness, rest, preload in effect.springs:
        one, other = PINS[pin]
        line = bars.ground_angle if one == 1 else 0.0
        markers = [bars.frame_marker(one, line + rest), bars.frame_marker(other)]
        bars.mbs.AddObject(
            ObjectConnectorTorsionalSpringDamper(markerNumbers=markers, stiffness=stiffness, torque=preload)
        )


def _springs(effect: Any, bars: "ExudynBars") -> None:
    """`SpringDamper` between two points."""
    for spring in effect.springs:
        ends = (spring.start, spring.end)
        markers = [bars.point_marker(point.bar, *place(point, bars.ground_angle)) for point in ends]
        bars.mbs.AddObject(
            ObjectConnectorSpringDamper(
                markerNumbers=markers,
                referenceLength=spring.length,
                stiffness=spring.stiffness,
                force=spring.preload,
            )
        )


def _flywheel(effect: Any, bars: "ExudynBars") -> None:
    """`ObjectGenericODE2` whose mass matrix turns with the bar's node."""
    bars.mbs.AddObject(
        ObjectGenericODE2(nodeNumbers=[bars.node[effect.bar]], massMatrix=np.diag([0.0, 0.0, effect.inertia]))
    )


ELEMENT_OF: dict[str, Callable[[Any, "ExudynBars"], None]] = {
    "gravity": _gravity,
    "viscous": _viscous,
    "friction": _friction,
    "torsion": _torsion,
    "springs": _springs,
    "flywheel": _flywheel,
    "load": _load,
}
"""By the key of an effect; friction in proportion to a pin's load has no element in the plane."""
