"""Drake: inverse dynamics on the open tree, the loop closed by multipliers, pin forces from its reaction port."""

import math
from collections.abc import Sequence
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

from fourbar.linkage import MOVING_BARS
from fourbar.scene import Command, Scene
from validation.compare.answer import Answer, Array
from validation.engines import description
from validation.engines.effects import Pushed, acting, unknown_effect
from validation.engines.loop import answer_exactly, turned_ground

NAME = "drake-inverse"
BY_SPEEDS = JacobianWrtVariable.kV
UP = (0.0, 0.0, 1.0)


class DrakeInverse:
    """Inverse dynamics with loop multipliers; pin forces by a forward pass with what it found."""

    name = NAME

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Its answer, or the refusal that names an effect it does not know or a bar it cannot hold."""
        if (reason := refusal(scene)) is not None:
            return Answer(NAME, "exact", refusal=reason)
        return answer_exactly(NAME, DrakeTree, scene, command)


def refusal(scene: Scene) -> str | None:
    """The declared limit that a scene meets, or None."""
    if (reason := unknown_effect(scene)) is not None:
        return reason
    for number in MOVING_BARS:
        bar = scene.linkage.bar(number)
        if bar.mass == 0.0:
            return f"bar {number} has no mass; the reaction port of Drake divides by it"
        if number != 2 and description.inertia(bar) + bar.mass * description.centre(bar)[0] ** 2 == 0.0:
            return f"bar {number} has no inertia about its pin; the reaction port of Drake divides by it"
    return None


class DrakeTree(Pushed):
    """The open tree, built from the description."""

    def __init__(self, scene: Scene) -> None:
        linkage = scene.linkage
        self.plant = plant = MultibodyPlant(time_step=0.0)
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        theta_1, d = linkage.ground_angle, linkage.ground
        foot = {2: (0.0, 0.0), 3: (linkage.input.length, 0.0), 4: (d * math.cos(theta_1), d * math.sin(theta_1))}
        self.body: dict[int, Any] = {}
        self.joint: dict[int, Any] = {}
        self.local: dict[str, tuple[int, Array]] = {}
        for number in MOVING_BARS:
            part = linkage.bar(number)
            r, phi = description.centre(part)
            centre = np.array([r * math.cos(phi), r * math.sin(phi), 0.0])
            about_g = RotationalInertia(*[description.inertia(part)] * 3)
            inertia = SpatialInertia.MakeFromCentralInertia(part.mass, centre, about_g)
            body = plant.AddRigidBody(f"bar{number}", inertia)
            parent = self.body[2] if number == 3 else plant.world_body()
            at = RigidTransform(np.array([*foot[number], 0.0]))
            frame = plant.AddFrame(FixedOffsetFrame(f"foot{number}", parent.body_frame(), at))
            joint = RevoluteJoint(description.FIRST_PIN[number], frame, body.body_frame(), UP)
            self.joint[number] = plant.AddJoint(joint)
            self.body[number] = body
            self.local |= {f"G{number}": (number, centre), f"end{number}": (number, np.array([part.length, 0.0, 0.0]))}
            self.local[f"foot{number}"] = (number, np.zeros(3))
        self.ground_angle = theta_1
        self.pin_loads: dict[str, float] = {}
        self.context: Any = None
        self.acting = acting(scene, self)
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.world = plant.world_frame()
        self.drive = scene.drive_bar
        self.v, self.a, self.needed = np.zeros(3), np.zeros(3), np.zeros(3)

    def place(self, q: Sequence[float]) -> None:
        """Set the coordinates."""
        self.plant.SetPositions(self.context, np.array(q, dtype=float))

    def point(self, name: str) -> Array:
        """A point fixed in a bar, world axes, (2,)."""
        bar, at = self.local[name]
        frame = self.body[bar].body_frame()
        return np.array(self.plant.CalcPointsPositions(self.context, frame, at, self.world)[:2, 0])

    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4."""
        x, y = (self.point("end3") - self.point("end4")).tolist()
        return x, y

    def _jacobian(self, name: str) -> Array:
        bar, at = self.local[name]
        found = self.plant.CalcJacobianTranslationalVelocity(
            self.context, BY_SPEEDS, self.body[bar].body_frame(), at, self.world, self.world
        )
        return np.asarray(found[:2])

    def _bias(self, name: str) -> Array:
        """(dJ/dt) v of a point."""
        bar, at = self.local[name]
        found = self.plant.CalcBiasTranslationalAcceleration(
            self.context, BY_SPEEDS, self.body[bar].body_frame(), at, self.world, self.world
        )
        return np.array(found[:2, 0])

    def jacobian(self) -> Array:
        """Difference of the two points' Jacobians."""
        return self._jacobian("end3") - self._jacobian("end4")

    def turn(self, bar: int) -> Array:
        """Last row of the angular velocity's Jacobian."""
        found = self.plant.CalcJacobianAngularVelocity(
            self.context, BY_SPEEDS, self.body[bar].body_frame(), self.world, self.world
        )
        return np.array(found[2])

    def positions(self) -> dict[str, Array]:
        """Points of the bars."""
        names = {"A": "foot3", "O4": "foot4", "B": "end3", "B4": "end4"}
        return {name: self.point(names.get(name, name)) for name in (*names, "G2", "G3", "G4")}

    def gravity(self, vector: tuple[float, float]) -> None:
        """The plant's own gravity."""
        self.plant.mutable_gravity_field().set_gravity_vector(np.array([*vector, 0.0]))

    def foot(self, bar: int) -> Array:
        """First pin of a bar, (2,)."""
        return np.zeros(2) if bar == 1 else self.point(f"foot{bar}")

    def centre(self, bar: int) -> Array:
        """Mass centre of a bar."""
        return self.point(f"G{bar}")

    def _rotation(self, bar: int) -> Array:
        pose = self.plant.EvalBodyPoseInWorld(self.context, self.body[bar])
        return np.asarray(pose.rotation().matrix()[:2, :2])

    def turned(self, bar: int, x: float, y: float) -> Array:
        """A vector of a bar in world axes, by the body's rotation."""
        return turned_ground(self.ground_angle, x, y) if bar == 1 else self._rotation(bar) @ (x, y)

    def pin_load(self, pin: str) -> float:
        """Pin force of the last pass; none before the first."""
        return self.pin_loads.get(pin, 0.0)

    def angle(self, bar: int) -> float:
        """From the body's rotation matrix; the ground's line as described."""
        if bar == 1:
            return self.ground_angle
        rotation = self._rotation(bar)
        return math.atan2(rotation[1, 0], rotation[0, 0])

    def drift(self, v: Array) -> Array:
        """Difference of the two points' (dJ/dt) v."""
        self.plant.SetVelocities(self.context, v)
        return self._bias("end3") - self._bias("end4")

    def velocity(self, bar: int) -> float:
        """Spin of the body; the ground has none."""
        if bar == 1:
            return 0.0
        return float(self.plant.EvalBodySpatialVelocityInWorld(self.context, self.body[bar]).rotational()[2])

    def alpha(self, bar: int) -> float:
        """From the rotational Jacobian, which is constant in the plane."""
        return float(self.turn(bar) @ self.a) if bar != 1 else 0.0

    def torques(self, v: Array, a: Array) -> Array:
        """Inverse dynamics with gravity and what acts on the bars as external forces."""
        self.v, self.a = v, a
        self.plant.SetVelocities(self.context, v)
        self.act(self.acting)
        forces = MultibodyForces(self.plant)
        self.plant.CalcForceElementsContribution(self.context, forces)
        for bar, wrench in self.wrenches.items():
            self.body[bar].AddInForceInWorld(self.context, _spatial(wrench), forces)
        self.needed = np.array(self.plant.CalcInverseDynamics(self.context, a, forces))
        return self.needed

    def inertial(self, v: Array, a: Array) -> Array:
        """Inverse dynamics with no force element."""
        self.plant.SetVelocities(self.context, v)
        return np.array(self.plant.CalcInverseDynamics(self.context, a, MultibodyForces(self.plant)))

    def accelerations(self) -> dict[str, Array]:
        """J a + (dJ/dt) v of each point."""
        points = {"A": "end2", "B": "end4", "G2": "G2", "G3": "G3", "G4": "G4"}
        return {name: self._jacobian(point) @ self.a + self._bias(point) for name, point in points.items()}

    def forces(self, loop_force: Array) -> dict[str, Array]:
        """The reaction port, with the loop force put back and the torque that is left for the drive."""
        e_drive = self.turn(self.drive)
        left = self.needed - self.jacobian().T @ loop_force
        self.push(3, loop_force, self.point("end3"))
        self.push(4, -loop_force, self.point("end4"))
        self.twist(self.drive, float(left @ e_drive / (e_drive @ e_drive)))
        applied = []
        for bar, wrench in self.wrenches.items():
            force = ExternallyAppliedSpatialForce()
            force.body_index, force.F_Bq_W = self.body[bar].index(), _spatial(wrench)
            applied.append(force)
        port = self.plant.get_applied_spatial_force_input_port()
        port.FixValue(self.context, Value[list[ExternallyAppliedSpatialForce]](applied))
        found = self.plant.get_reaction_forces_output_port().Eval(self.context)
        on = {b: self._rotation(b) @ found[int(joint.index())].translational()[:2] for b, joint in self.joint.items()}
        return {"F12": on[2], "F32": -on[3], "F14": on[4]}


def _spatial(wrench: Sequence[float]) -> Any:
    x, y, couple = wrench
    return SpatialForce(np.array([0.0, 0.0, couple]), np.array([x, y, 0.0]))
