"""Drake: inverse dynamics on the open tree, pin forces from its reaction port.

Multipliers close the loop.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    JacobianWrtVariable,
    MultibodyForces,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)

from fourbar.errors import LimitError
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.engines.description import (
    PIN_OF_MOVING_BAR,
    find_unknown,
    inertia_about_first_pin,
    list_moving_parts,
)
from fourbar_validation.engines.loaded import has_term, list_wrenches
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.tree import Tree

_BY_SPEEDS = JacobianWrtVariable.kV
UP = (0.0, 0.0, 1.0)


def find_limit_of_drake(scene: Scene) -> str:
    """Name the declared limit that a scene meets, if any."""
    if reason := find_unknown(scene, has_term, forces=True):
        return reason
    for number in PIN_OF_MOVING_BAR:
        bar = scene.linkage.bar(number)
        if bar.mass == 0.0:
            return f"bar {number} has no mass; the reaction port of Drake divides by it"
        if number != 2 and inertia_about_first_pin(bar) == 0.0:
            return (
                f"bar {number} has no inertia about its pin; the reaction port of Drake"
                " divides by it"
            )
    return ""


class _DrakeTree(Tree):
    """The open tree, built from the description."""

    def __init__(self, scene: Scene) -> None:
        if reason := find_limit_of_drake(scene):
            raise LimitError(reason)
        self.plant = plant = MultibodyPlant(time_step=0.0)
        self.body: dict[int, Any] = {1: plant.world_body()}
        self.joint: dict[int, Any] = {}
        self.local: dict[str, tuple[Any, Array]] = {}
        for part in list_moving_parts(scene.linkage):
            about_g = RotationalInertia(*[part.inertia] * 3)
            inertia = SpatialInertia.MakeFromCentralInertia(
                part.mass,
                np.array([*part.centre, 0.0]),
                about_g,
            )
            body = self.body[part.bar] = plant.AddRigidBody(f"bar{part.bar}", inertia)
            joint_frame = RigidTransform(np.array([*part.first_pin, 0.0]))
            bearer = self.body[part.bearer].body_frame()
            frame = plant.AddFrame(
                FixedOffsetFrame(f"first_pin{part.bar}", bearer, joint_frame)
            )
            joint = RevoluteJoint(
                PIN_OF_MOVING_BAR[part.bar],
                frame,
                body.body_frame(),
                UP,
            )
            self.joint[part.bar] = plant.AddJoint(joint)
            self.local |= {
                name: (body.body_frame(), np.array([*place, 0.0]))
                for name, place in part.points.items()
            }
        plant.Finalize()
        self.context, self.world = plant.CreateDefaultContext(), plant.world_frame()
        self.ready(scene, list_wrenches(scene, self))
        plant.mutable_gravity_field().set_gravity_vector(np.array([*self.field, 0.0]))

    def place(self, q: Sequence[float]) -> None:
        """Set the coordinates."""
        self.plant.SetPositions(self.context, np.array(q, dtype=float))

    def point(self, name: str) -> Array:
        """Return a point fixed in a body."""
        found = self.plant.CalcPointsPositions(
            self.context, *self.local[name], self.world
        )
        return np.array(found[:2, 0])

    def rotation(self, bar: int) -> Array:
        """Return the body's rotation matrix."""
        pose = self.plant.EvalBodyPoseInWorld(self.context, self.body[bar])
        return np.asarray(pose.rotation().matrix()[:2, :2])

    def point_jacobian(self, name: str) -> Array:
        """Return the Jacobian of the point's velocity by the joints' speeds."""
        arguments = (*self.local[name], self.world, self.world)
        return np.asarray(
            self.plant.CalcJacobianTranslationalVelocity(
                self.context,
                _BY_SPEEDS,
                *arguments,
            )[:2]
        )

    def turn(self, bar: int) -> Array:
        """Return the last row of the angular velocity's Jacobian."""
        arguments = (self.body[bar].body_frame(), self.world, self.world)
        return np.array(
            self.plant.CalcJacobianAngularVelocity(
                self.context,
                _BY_SPEEDS,
                *arguments,
            )[2]
        )

    def set_motion(self, v: Array, a: Array) -> None:
        """Set the speeds; accelerations come with each request."""
        self.plant.SetVelocities(self.context, v)

    def accelerations(self, names: Iterable[str]) -> list[list[float]]:
        """Return J a + (dJ/dt) v of points."""
        return [self._accelerate(name).tolist() for name in names]

    def _accelerate(self, name: str) -> Array:
        arguments = (*self.local[name], self.world, self.world)
        bias = self.plant.CalcBiasTranslationalAcceleration(
            self.context,
            _BY_SPEEDS,
            *arguments,
        )
        return np.asarray(self.point_jacobian(name) @ self.a + bias[:2, 0])

    def needed(
        self,
        field: tuple[float, float],
        wrenches: dict[int, list[float]],
    ) -> list[float]:
        """Compute the inverse dynamics with gravity as a force element.

        What acts on the bars are external forces.
        """
        forces = MultibodyForces(self.plant)
        if any(field):
            self.plant.CalcForceElementsContribution(self.context, forces)
        for bar, wrench in wrenches.items():
            self.body[bar].AddInForceInWorld(
                self.context,
                _make_spatial(wrench),
                forces,
            )
        self.balancing = np.array(
            self.plant.CalcInverseDynamics(self.context, self.a, forces)
        )
        torques: list[float] = self.balancing.tolist()
        return torques

    def joint_forces(self) -> dict[int, complex]:
        """Return the force at each bar's first pin from Drake's reaction port, N.

        Drake finds the accelerations once more for it, from the applied wrenches and
        the generalized forces that the motion needs.
        """
        applied = []
        for bar, wrench in self.wrenches.items():
            force = ExternallyAppliedSpatialForce()
            force.body_index = self.body[bar].index()
            force.F_Bq_W = _make_spatial(wrench)
            applied.append(force)
        port = self.plant.get_applied_spatial_force_input_port()
        port.FixValue(self.context, Value[list[ExternallyAppliedSpatialForce]](applied))
        self.plant.get_applied_generalized_force_input_port().FixValue(
            self.context, self.balancing
        )
        try:
            borne = self.plant.get_reaction_forces_output_port().Eval(self.context)
        except RuntimeError as error:  # its mass matrices are inverted there
            raise LimitError(f"the reaction port of Drake: {error}") from None
        return {
            b: self.rotate(
                b, complex(*borne[int(joint.index())].translational()[:2].tolist())
            )
            for b, joint in self.joint.items()
        }


DrakeInverse = partial(Exact, "drake-inverse", _DrakeTree)


def _make_spatial(wrench: Sequence[float]) -> Any:
    x, y, couple = wrench
    return SpatialForce(np.array([0.0, 0.0, couple]), np.array([x, y, 0.0]))
