"""OpenSim (Simbody): bars 2 and 4 on the ground, bar 3 on bar 4, closed at pin A.

Simbody's constraint and solver close the loop. Coordinates are the direction of bar 2,
that of bar 4, and that of bar 3 against bar 4. The closing force, the joint reactions,
the accelerations and the couple that moves bar 2 or 4 as commanded come from Simbody's
constrained dynamics. No coordinate is the direction of bar 3, whose command is refused.
"""

import math
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
import opensim as osim

from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_validation.compare.pins import resolve
from fourbar_validation.engines.description import (
    ON_BARS,
    find_unknown,
    inertia_about_first_pin,
    list_moving_parts,
    reduce_angle,
)
from fourbar_validation.engines.loaded import BarValues, Loaded, has_term, list_wrenches
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.sliding import solve_refined

ZERO_VECTOR = (0.0, 0.0, 0.0)
"""Zero vector."""
_PER_COORDINATE = {
    2: np.array([1.0, 0.0, 0.0]),
    3: np.array([0.0, 1.0, 1.0]),
    4: np.array([0.0, 1.0, 0.0]),
}
"""Derivative of each bar's direction by the coordinates."""
MULTIPLIER_PASSES = 50
"""Number of passes, down to rounding. Each leaves a millionth to a tenth of the
previous pass's multipliers.
"""
LEAST_CONDITIONED = 1e-11
"""Ratio at which Simbody 4.6 drops a constraint as dependent. Measured: 5e-12 to 7e-12,
at 1000 positions near limits of 40 linkages.
"""
_PER_TIME = 2.0**100
"""Acceleration of the prescribed motion per unit of time, rad/s^3. Its positions and
speeds are then next to nothing; of large ones Simbody makes forces that are anything.
"""
_PRESCRIBED = (_PER_TIME / 6.0, 0.0, 0.0, 0.0)
"""Motion _PER_TIME t^3/6 prescribed for bar 2 or 4, whose second derivative is set by
the time to the bar's acceleration.
"""
DIRECTION_JOINTS = {2: "O2", 4: "O4"}
"""Joint whose coordinate is the direction of a bar."""

CYLINDER_ENDS = ("start", "end")
"""Names of the two ends of a cylinder; a force at a point has the first alone."""


def find_limit_of_opensim(scene: Scene) -> str:
    """Name the declared limit that a scene meets, if any."""
    if reason := find_unknown(scene, has_term, forces=True):
        return reason
    for number in MOVING_BARS:
        if scene.linkage.bar(number).mass == 0.0:
            return (
                f"bar {number} has no mass; OpenSim takes no such body at the end of a"
                " chain, and drops its inertia"
            )
    if inertia_about_first_pin(scene.linkage.input):
        return ""
    return "bar 2 has no inertia about O2; Simbody divides by it"


class _OpenSimBars(Loaded):
    """The bars, built from the description."""

    own = (
        "constraint equations with the loop cut at A, joint reactions, closing force"
        " and torque by Simbody's constrained dynamics, effects from its own state;"
        " Newton's method on its gap, and the linear solve for speeds and"
        " accelerations, are the harness's"
    )

    def __init__(self, scene: Scene) -> None:
        if reason := find_limit_of_opensim(scene):
            raise LimitError(reason)
        osim.Logger.setLevelString("Off")
        osim.Logger.removeFileSink()
        linkage = scene.linkage
        self.model = model = osim.Model()
        self.ready(scene, list_wrenches(scene, self))
        model.setGravity(_make_vec(*self.field))
        self.body = {1: model.getGround()}
        self.part = {part.bar: part for part in list_moving_parts(linkage)}
        for bar, part in self.part.items():
            about_z = osim.Inertia(*[part.inertia] * 3, *ZERO_VECTOR)
            self.body[bar] = osim.Body(
                f"bar{bar}",
                part.mass,
                _make_vec(*part.centre),
                about_z,
            )
            model.addBody(self.body[bar])
        self.local = {
            name: (part.bar, place)
            for part in self.part.values()
            for name, place in part.points.items()
        }
        if scene.drive is not None:
            self.local |= {
                name: (end.bar, resolve(end.distance, end.angle))
                for name, (_, end) in zip(CYLINDER_ENDS, scene.drive.ends, strict=False)
            }
        self.length = {bar: part.length for bar, part in self.part.items()}
        self.joint = {
            "O2": self._make_joint("O2", 1, ZERO_VECTOR, 2, ZERO_VECTOR),
            "O4": self._make_joint("O4", 1, self.part[4].first_pin, 4, ZERO_VECTOR),
            "B": self._make_joint(
                "B",
                4,
                (self.length[4], 0.0, 0.0),
                3,
                (self.length[3], 0.0, 0.0),
            ),
        }
        self.pin_a = osim.PointConstraint(
            self.body[2],
            _make_vec(self.length[2]),
            self.body[3],
            _make_vec(),
        )
        self.pin_a.set_isEnforced(
            False
        )  # until a position is found: OpenSim would assemble it at angles of its own
        model.addConstraint(self.pin_a)
        for pin in DIRECTION_JOINTS.values():
            self.joint[pin].updCoordinate().setPrescribedFunction(
                osim.PolynomialFunction(make_simbody_vector(_PRESCRIBED))
            )
            self.joint[pin].updCoordinate().setDefaultIsPrescribed(pin == "O2")
        self.commanded = 2
        self.applied = {bar: self._add_at_first_pin(bar) for bar in MOVING_BARS}
        self.state = model.initSystem()
        self.pin_a.setIsEnforced(self.state, True)
        self.matter = model.getMatterSubsystem()

    def _make_joint(
        self,
        name: str,
        parent: int,
        on_parent: Any,
        child: int,
        on_child: Any,
    ) -> Any:
        joint = osim.PinJoint(
            name,
            self.body[parent],
            _make_vec(*on_parent),
            _make_vec(),
            self.body[child],
            _make_vec(*on_child),
            _make_vec(),
        )
        self.model.addJoint(joint)
        return joint

    def _add_at_first_pin(self, bar: int) -> list[Any]:
        """Add a wrench on a bar at its first pin; return its x, y and moment.

        The three are OpenSim constants, which are set at each position.
        """
        element = osim.PrescribedForce(f"wrench{bar}", self.body[bar])
        element.setForceIsInGlobalFrame(True)
        element.setPointFunctions(*_make_constants())
        element.setForceFunctions(*_make_constants())
        element.setTorqueFunctions(*_make_constants())
        self.model.addForce(element)
        force = element.updForceFunctions()
        torque = element.updTorqueFunctions()
        return [
            osim.Constant.safeDownCast(x)
            for x in (force.get(0), force.get(1), torque.get(2))
        ]

    def place(self, q: Sequence[float]) -> None:
        """Set the bars' angles, at rest.

        Simbody forms its matrices by differences from the present motion.
        """
        of_3_to_2, theta_4 = q[1:]
        theta_2 = reduce_angle(q[0])
        self.state.setTime(0.0)
        self.state.setU(make_simbody_vector((0.0, 0.0, 0.0)))
        self.state.setQ(
            make_simbody_vector((theta_2, theta_4, theta_2 + of_3_to_2 - theta_4))
        )
        self.model.realizePosition(self.state)

    def point(self, name: str) -> Array:
        """Return a station of a body."""
        bar, place = self.local[name]
        station = _make_vec(*place)
        found = self.body[bar].findStationLocationInGround(self.state, station)
        return np.array(found.to_numpy()[:2])

    def gap(self) -> tuple[float, float]:
        """Return A on bar 2 minus A on bar 3, which opens as B would."""
        x, y = (self.point("end2") - self.point("first_pin3")).tolist()
        return x, y

    def jacobian(self) -> Array:
        """Return the Jacobian of the gap at pin A, (2, 3), in m/rad.

        Columns are the angles of bar 2, of bar 3 against bar 2, and of bar 4.
        """
        by_own = self._compute_station_jacobian(
            "end2"
        ) - self._compute_station_jacobian("first_pin3")
        return np.column_stack(
            (by_own[:, 0] + by_own[:, 2], by_own[:, 2], by_own[:, 1] - by_own[:, 2])
        )

    def _compute_station_jacobian(self, name: str) -> Array:
        bar, place = self.local[name]
        matrix = osim.Matrix()
        self.matter.calcStationJacobian(
            self.state,
            self.body[bar].getMobilizedBodyIndex(),
            _make_vec(*place),
            matrix,
        )
        return np.array(matrix.to_numpy())[:2]

    def rotation(self, bar: int) -> Array:
        """Return the body's rotation matrix, (2, 2)."""
        matrix = self.body[bar].getTransformInGround(self.state).R()
        return np.array([[matrix.get(i, j) for j in (0, 1)] for i in (0, 1)])

    def move(
        self,
        bar: int,
        speed: float,
        acceleration: float,
    ) -> BarValues:
        """Return speeds, accelerations and forces by name; {} at a toggle's 0/0."""
        if bar != self.commanded:
            self.commanded = bar
            q = self.state.getQ().to_numpy()
            for moving, pin in DIRECTION_JOINTS.items():
                coordinate = self.joint[pin].updCoordinate()
                coordinate.setIsPrescribed(self.state, moving == bar)
            self.state.setQ(make_simbody_vector(q))
            self.model.realizePosition(self.state)
        try:
            turns, accelerations = self._set_motion(speed, acceleration)
        except np.linalg.LinAlgError:
            return {}
        self.a = accelerations
        leverage = float(self._drive_column() @ turns)
        # without leverage nothing that the drive does moves that bar
        return self._motion() | (
            {} if leverage == 0.0 else self.settled(lambda: self._forces(leverage))
        )

    def _drive_column(self) -> Array:
        """Return the generalized forces of the drive per N m or N, (3,)."""
        if self.force_drive is None:
            return _PER_COORDINATE[self.drive_bar]
        rate = np.zeros((2, 3))
        for name, (sense, place) in zip(
            CYLINDER_ENDS, self.force_drive.ends, strict=False
        ):
            if place.bar != 1:
                rate += sense * self._compute_station_jacobian(name)
        _, along = self.line()
        return np.array([along.real, along.imag]) @ rate

    def _set_motion(self, speed: float, acceleration: float) -> tuple[Array, Array]:
        """Set the commanded speed; return the coordinates' speeds and accelerations.

        Speeds (3,) are per unit of the commanded speed, accelerations (3,) in rad/s^2.
        """
        equations = self._differentiate_constraints()
        turns = solve_refined(equations, np.eye(3)[0])
        self.state.setTime(acceleration / _PER_TIME)
        self.state.setU(make_simbody_vector(turns * speed))
        self.model.realizeVelocity(self.state)
        bias = osim.Vector()
        matrix = osim.Matrix()
        self.matter.calcBiasForAccelerationConstraints(self.state, bias)
        self.matter.calcProjectedMInv(self.state, matrix)
        sizes = np.linalg.svd(np.array(matrix.to_numpy())[:3, :3], compute_uv=False)
        conditioned = float(sizes[-1] / sizes[0])
        if conditioned < LEAST_CONDITIONED:
            raise LimitError(
                "the matrix of Simbody's multipliers is conditioned by"
                f" {conditioned:.1e}; below {LEAST_CONDITIONED:g} it takes constraints"
                " for dependent, and drops them"
            )
        return turns, solve_refined(equations, -np.array(bias.to_numpy())[:3])

    def _motion(self) -> BarValues:
        values: BarValues = {}
        for bar in MOVING_BARS:
            values[f"omega_{bar}"] = self.velocity(bar)
            values[f"alpha_{bar}"] = self.alpha(bar)
        for name, point in ON_BARS.items():
            bar, place = self.local[point]
            drift = self.matter.calcBiasForStationJacobian(
                self.state,
                self.body[bar].getMobilizedBodyIndex(),
                _make_vec(*place),
            )
            values[f"a_{name}"] = self._compute_station_jacobian(
                point
            ) @ self.a + np.array(drift.to_numpy()[:2])
        return values

    def _forces(self, leverage: float) -> dict[str, Any]:
        """Return joint reactions, closing force and torque of the constrained dynamics.

        Simbody holds the commanded bar to its motion by a couple: over the leverage it
        is what the drive gives. What it finds is given back as forces and found anew,
        until its multipliers hold nothing but rounding.
        """
        self.act()
        pin_a = self.locate("end2")
        drive = 0.0
        closing = np.zeros(2)
        before = (math.inf, math.inf)
        seen: set[tuple[float, float]] = set()
        for number in range(MULTIPLIER_PASSES):
            for bar, wrench in self.wrenches.items():
                for function, value in zip(self.applied[bar], wrench, strict=True):
                    function.setValue(value)
            # Simbody computes again what depends on it
            self.state.setTime(self.state.getTime())
            self.model.realizeAcceleration(self.state)
            held = self.joint[DIRECTION_JOINTS[self.commanded]]
            reaction = held.calcReactionOnChildExpressedInGround(self.state)
            couple = float(reaction.get(0).get(2))
            force = self._compute_closing_force()
            drive = drive + couple / leverage
            closing = closing + force
            self.work(couple / leverage)
            self.push(2, complex(*force), pin_a)
            self.push(3, -complex(*force), pin_a)
            size = abs(couple), math.hypot(*force)
            # torque, then force, come first
            falls = size[0] < before[0] or size[1] < before[1]
            # rounding may go round in a circle
            if size in seen or (number > 1 and not falls):
                break
            before = size
            seen.add(size)
        reactions = {
            name: self._read_reaction(pin)
            for pin, name in {"O2": "F12", "B": "F43", "O4": "F14"}.items()
        }
        return {**reactions, "F32": closing, self.driving: drive}

    def _differentiate_constraints(self) -> Array:
        """Return the constraints' Jacobian (3, 3): of the command, and of pin A."""
        matrix = osim.Matrix()
        self.matter.calcG(self.state, matrix)
        return np.array(matrix.to_numpy())[:3]

    def velocity(self, bar: int) -> float:
        """Return a bar's angular velocity in rad/s; the ground has none."""
        if bar == 1:
            return 0.0
        return float(self.body[bar].getAngularVelocityInGround(self.state).get(2))

    def alpha(self, bar: int) -> float:
        """Return a bar's angular acceleration in rad/s^2."""
        return float(_PER_COORDINATE[bar] @ self.a)

    def _read_reaction(self, pin: str) -> Array:
        reaction = self.joint[pin].calcReactionOnChildExpressedInGround(self.state)
        return np.array(reaction.get(1).to_numpy()[:2])

    def _compute_closing_force(self) -> Array:
        """Return the force of bar 3 on bar 2 in N, from the constraint's multipliers.

        Simbody's constraint acts on the bodies with -G^T lambda.
        """
        on_bodies = osim.VectorOfSpatialVec()
        self.matter.calcConstraintForcesFromMultipliers(
            self.state, self.state.getMultipliers(), on_bodies, osim.Vector()
        )
        force = on_bodies.get(int(self.body[2].getMobilizedBodyIndex())).get(1)
        return np.array([-force.get(0), -force.get(1)])


OpenSimConstraints = partial(
    Exact,
    "opensim-constraints",
    _OpenSimBars,
    ("theta_2", "theta_4", "stroke"),
)


def _make_vec(
    x: float = 0.0,
    y: float = 0.0,
    z: float = 0.0,
) -> Any:
    """Make a vector of three components."""
    return osim.Vec3(float(x), float(y), float(z))


def make_simbody_vector(values: Iterable[float]) -> Any:
    """Make a vector of Simbody."""
    return osim.Vector.createFromMat(np.array([*values], dtype=float))


def _make_constants() -> list[Any]:
    """Return three OpenSim functions of time that are zero until they are set."""
    return [osim.Constant(value) for value in ZERO_VECTOR]
