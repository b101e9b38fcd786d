"""Bodies of a linkage in Exudyn, and its own springs and dampers upon them.

No other engine brings force laws of its own that hold to round-off. MuJoCo's hold to
the error of its steps; every other engine is given the wrenches of
`tree.TERM_OF`, as Exudyn is of all the rest.
"""

import math
from collections.abc import Callable
from typing import Any

from exudyn.itemInterface import (
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    NodeRigidBody2D,
    ObjectConnectorCoordinateSpringDamper,
    ObjectConnectorSpringDamper,
    ObjectConnectorTorsionalSpringDamper,
    ObjectGround,
    ObjectRigidBody2D,
)

from fourbar.linkage import PINS, FourBar
from fourbar_validation.engines.description import (
    inertia_about_first_pin,
    list_moving_parts,
    place,
)


class ExudynBodies:
    """The ground and a body of each bar.

    The coordinates are those of its first pin and its direction.
    """

    def __init__(self, mbs: Any, linkage: FourBar) -> None:
        self.mbs = mbs
        self.ground_angle = linkage.ground_angle
        self.node: dict[int, Any] = {1: mbs.AddNode(NodePointGround())}
        self.body: dict[int, Any] = {1: mbs.AddObject(ObjectGround())}
        for part in list_moving_parts(linkage):
            self.node[part.bar] = node = mbs.AddNode(NodeRigidBody2D())
            inertia = inertia_about_first_pin(linkage.bar(part.bar))
            body = ObjectRigidBody2D(
                mass=part.mass,
                inertia=inertia,
                centerOfMass=part.centre,
                nodeNumber=node,
            )
            self.body[part.bar] = mbs.AddObject(body)

    def point(
        self,
        bar: int,
        x: float = 0.0,
        y: float = 0.0,
    ) -> Any:
        """Mark a point of a bar, along and across its line from its first pin.

        A point of the ground is given in world axes.
        """
        return self.mbs.AddMarker(
            MarkerBodyPosition(bodyNumber=self.body[bar], localPosition=[x, y, 0.0])
        )

    def end(self, place_of_end: Any) -> Any:
        """Mark an end of a spring or a place of the drive."""
        at = place(place_of_end, self.ground_angle)
        return self.point(place_of_end.bar, at.real, at.imag)

    def direction(self, bar: int) -> Any:
        """Mark the direction of a bar as a coordinate; of the ground a zero."""
        return self.mbs.AddMarker(
            MarkerNodeCoordinate(
                nodeNumber=self.node[bar],
                coordinate=0 if bar == 1 else 2,
            )
        )

    def axes(self, bar: int, turn: float = 0.0) -> Any:
        """Return a marker of axes at a bar's first pin, turned from its line (rad)."""
        cos = math.cos(turn)
        sin = math.sin(turn)
        frame = [
            [cos, -sin, 0.0, 0.0],
            [sin, cos, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
        return self.mbs.AddMarker(
            MarkerBodyRigid(bodyNumber=self.body[bar], localHT=frame)
        )


def _add_viscous(effect: Any, bodies: ExudynBodies) -> None:
    """Add a `CoordinateSpringDamper` between the two directions."""
    for pin, damping in effect.coefficients:
        markers = [bodies.direction(bar) for bar in PINS[pin]]
        bodies.mbs.AddObject(
            ObjectConnectorCoordinateSpringDamper(
                markerNumbers=markers,
                damping=damping,
            )
        )


def _add_torsion(effect: Any, bodies: ExudynBodies) -> None:
    """Add a `TorsionalSpringDamper` between axes that coincide at rest.

    Exudyn measures the angle within half a turn of rest.
    """
    for pin, stiffness, rest, preload in effect.springs:
        first, second = PINS[pin]
        line = bodies.ground_angle if first == 1 else 0.0
        markers = [bodies.axes(first, line + rest), bodies.axes(second)]
        spring = ObjectConnectorTorsionalSpringDamper(
            markerNumbers=markers,
            stiffness=stiffness,
            torque=preload,
        )
        bodies.mbs.AddObject(spring)


def _add_springs(effect: Any, bodies: ExudynBodies) -> None:
    """Add a `SpringDamper` between two points."""
    for spring in effect.springs:
        ends = (spring.start, spring.end)
        bodies.mbs.AddObject(
            ObjectConnectorSpringDamper(
                markerNumbers=[bodies.end(point) for point in ends],
                referenceLength=spring.length,
                stiffness=spring.stiffness,
                force=spring.preload,
                **_act_one_way(spring),
            )
        )


def _act_one_way(spring: Any) -> dict[str, Any]:
    """Return the force law of a spring that acts one way, as Exudyn takes it."""
    if spring.acts is None:
        return {}
    clip = min if spring.acts == "push" else max

    def pull(*state: Any) -> float:
        _, _, _, beyond, _, stiffness, _, preload = state
        return float(clip(preload + stiffness * beyond, 0.0))

    return {"springForceUserFunction": pull}


ELEMENT_OF: dict[str, Callable[[Any, ExudynBodies], None]] = {
    "viscous": _add_viscous,
    "torsion": _add_torsion,
    "springs": _add_springs,
}
"""Function that adds the elements of an effect, by the effect's key."""
