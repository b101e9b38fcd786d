"""Exudyn: nine absolute coordinates, and multipliers of the four pins and the drive.

Springs and dampers are Exudyn's own. A bar is `ObjectRigidBody2D` with coordinates (x,
y of its first pin, direction). The nine constraints g = 0 are two of each pin, and the
drive: a bar's direction, or the distance of a cylinder's ends. With J = dg/dq, J_c the
pins' rows above that of the commanded bar's direction, M the mass matrix and f what
acts,

    J_c v = e omega,
    J_c a = e alpha - (dJ_c/dt) v,
    J^T [F12 F32 F43 F14 drive] = M a - f.

g, J, (dJ/dt) v, M and f are Exudyn's; the three linear systems are solved here. A force
at a point is that of a cylinder from the ground, whose end there is moved at each
position such that the point lies ahead of it in the direction of the force.
"""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    LoadForceVector,
    LoadMassProportional,
    LoadTorqueVector,
    MarkerBodyMass,
    ObjectConnectorCoordinate,
    ObjectConnectorDistance,
    ObjectJointRevolute2D,
)

from fourbar.effects import PointDrive
from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_lab.engines.exudyn_elements import ELEMENT_OF, ExudynBodies
from fourbar_validation.engines.description import (
    ON_BARS,
    find_unknown,
    list_moving_parts,
    reduce_angle,
)
from fourbar_validation.engines.loaded import BarValues, Loaded, has_term, list_wrenches
from fourbar_validation.engines.loop import Exact
from fourbar_validation.engines.sliding import solve_refined

EXUDYN_SIZE = 9
"""Coordinates, and constraints."""
_B_ROWS, _OTHER_ROWS = [4, 5], [0, 1, 2, 3, 6, 7]
"""Rows of pin B and of the others among the constraints, in the order of `JOINTS`, the
drive last.
"""
JOINTS = {"O2": (1, 2), "A": (3, 2), "B": (4, 3), "O4": (1, 4)}
"""Bars of each pin; the pin's force is that on the second bar: F12, F32, F43, F14."""


class ExudynBars(Loaded):
    """The bars, built from the description."""

    own = (
        "nine absolute coordinates, constraint equations, their Jacobian and (dJ/dt) v,"
        " mass matrix, springs and dampers by elements of its own, other effects from"
        " its own state; Newton's method on its gap and the linear solves are the"
        " harness's"
    )
    behind: Any = None
    """Marker of the end on the ground, where a force at a point drives."""
    reach: float
    """Distance of that end, m, of the size of the coordinates, so that the direction
    keeps its digits.
    """

    def __init__(self, scene: Scene) -> None:
        if reason := find_unknown(scene, has_term, forces=True):
            raise LimitError(reason)
        exu.config.printToConsole = False
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        bodies = ExudynBodies(mbs, scene.linkage)
        self.body = bodies.body
        of_bar = {part.bar: part for part in list_moving_parts(scene.linkage)}
        self.local = {
            name: (part.bar, [*xy, 0.0])
            for part in of_bar.values()
            for name, xy in part.points.items()
        }
        end = {bar: part.points[f"end{bar}"] for bar, part in of_bar.items()}
        pin_places = {
            "O2": ((0.0, 0.0), (0.0, 0.0)),
            "A": ((0.0, 0.0), end[2]),
            "B": (end[4], end[3]),
            "O4": (of_bar[4].first_pin, (0.0, 0.0)),
        }
        for pin, bars in JOINTS.items():
            markers = [
                bodies.point(bar, *place)
                for bar, place in zip(bars, pin_places[pin], strict=True)
            ]
            mbs.AddObject(ObjectJointRevolute2D(markerNumbers=markers))
        if scene.drive is None:
            markers = [bodies.direction(bar) for bar in (1, scene.drive_bar)]
            self.drive = mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=markers))
        else:
            markers = [bodies.end(end) for _, end in scene.drive.ends]
            if isinstance(scene.drive, PointDrive):
                away = abs(scene.drive.place.distance)
                self.reach = sum(scene.linkage.lengths) + away
                self.behind = bodies.point(1, -self.reach)
                markers.insert(0, self.behind)
            mbs.AddObject(
                ObjectConnectorDistance(markerNumbers=markers, distance=1.0)
            )  # any: what is asked is its rate
        for effect in scene.effects:
            if effect.key in ELEMENT_OF:
                ELEMENT_OF[effect.key](effect, bodies)
        self.ready(scene, list_wrenches(scene, self, ELEMENT_OF))
        self.load = {}
        for bar in MOVING_BARS:
            mass = mbs.AddMarker(MarkerBodyMass(bodyNumber=self.body[bar]))
            mbs.AddLoad(
                LoadMassProportional(markerNumber=mass, loadVector=[*self.field, 0.0])
            )
            first_pin = bodies.axes(bar)
            self.load[bar] = tuple(
                mbs.AddLoad(kind(markerNumber=first_pin))
                for kind in (LoadForceVector, LoadTorqueVector)
            )
        mbs.Assemble()
        self.state = mbs.systemData
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        self.solver = exu.MainSolverImplicitSecondOrder()
        self.solver.InitializeSolver(mbs, settings)
        self.turn = {
            bar: self.state.GetObjectLTGODE2(self.body[bar])[2] for bar in MOVING_BARS
        }
        self.shifts = [i for i in range(EXUDYN_SIZE) if i not in self.turn.values()]

    def place(self, q: Sequence[float]) -> None:
        """Set the bars' angles; the pins O2, A and O4 are closed.

        Exudyn's constraints are linear in these pins.
        """
        of_3_to_2, theta_4 = q[1:]
        theta_2 = reduce_angle(q[0])
        coordinates = np.zeros(EXUDYN_SIZE)
        directions = theta_2, theta_2 + of_3_to_2, theta_4
        coordinates[[*self.turn.values()]] = directions
        self.state.SetODE2Coordinates(coordinates)
        jacobian = self._read_constraint_jacobian()
        gap = self._read_constraint_gap()
        coordinates[self.shifts] = np.linalg.solve(
            jacobian[_OTHER_ROWS][:, self.shifts], -gap[_OTHER_ROWS]
        )
        self.state.SetODE2Coordinates(coordinates)
        self.q = coordinates
        self.jacobians = jacobian

    def _read_constraint_gap(self) -> Array:
        self.solver.ComputeAlgebraicEquations(self.mbs, False)
        return np.array(self.solver.GetSystemResidual())[EXUDYN_SIZE:]

    def _read_constraint_jacobian(self) -> Array:
        self.solver.SetSystemJacobian(
            np.zeros((2 * EXUDYN_SIZE, 2 * EXUDYN_SIZE))
        )  # the computed values are added to it
        self.solver.ComputeJacobianAE(
            self.mbs,
            scalarFactor_ODE2=1.0,
            scalarFactor_ODE2_t=0.0,
            scalarFactor_ODE1=0.0,
            velocityLevel=False,
        )
        return np.array(self.solver.GetSystemJacobian())[EXUDYN_SIZE:, :EXUDYN_SIZE]

    def gap(self) -> tuple[float, float]:
        """Return B on bar 3 minus B on bar 4, from the constraint of pin B."""
        x, y = self._read_constraint_gap()[_B_ROWS].tolist()
        return x, y

    def jacobian(self) -> Array:
        """Return the derivative of the gap by the joint angles.

        Pins O2, A and O4 are kept closed.
        """
        turns = list(self.turn.values())
        pins = self.jacobians[_OTHER_ROWS]
        b = self.jacobians[_B_ROWS]
        shifts = np.linalg.solve(pins[:, self.shifts], -pins[:, turns])
        by_angle = b[:, turns] + b[:, self.shifts] @ shifts
        return np.column_stack((by_angle[:, 0] + by_angle[:, 1], by_angle[:, 1:]))

    def angle(self, bar: int) -> float:
        """Read its coordinate, within half a turn; the ground's line as described."""
        if bar == 1:
            return self.ground_angle
        return math.remainder(self.q[self.turn[bar]], math.tau)

    def _read_output(self, kind: Any, name: str) -> Array:
        bar, local = self.local[name]
        return np.array(self.mbs.GetObjectOutputBody(self.body[bar], kind, local)[:2])

    def point(self, name: str) -> Array:
        """Return a point of a body."""
        return self._read_output(exu.OutputVariableType.Position, name)

    def acceleration(self, name: str) -> Array:
        """Return the acceleration of a point of a body, (2,), m/s^2."""
        return self._read_output(exu.OutputVariableType.Acceleration, name)

    def rotation(self, bar: int) -> Array:
        """Return the body's rotation matrix, (2, 2)."""
        kind = exu.OutputVariableType.RotationMatrix
        matrix = self.mbs.GetObjectOutputBody(self.body[bar], kind, [0.0, 0.0, 0.0])
        return np.reshape(matrix, (3, 3))[:2, :2]

    def velocity(self, bar: int) -> float:
        """Return a bar's angular velocity in rad/s; the ground has none."""
        if bar == 1:
            return 0.0
        return float(self.v[self.turn[bar]])

    def alpha(self, bar: int) -> float:
        """Return a bar's angular acceleration in rad/s^2."""
        return float(self.a[self.turn[bar]])

    def move(
        self,
        bar: int,
        speed: float,
        acceleration: float,
    ) -> BarValues:
        """Return speeds, accelerations and forces by name; {} at a toggle's 0/0."""
        if self.behind is not None:
            self._move_behind()
        of_drive = self._read_constraint_jacobian()
        commanded = np.eye(EXUDYN_SIZE)[-1]  # a cylinder's is that of closed pins
        jacobian = np.vstack((of_drive[:-1], np.eye(EXUDYN_SIZE)[self.turn[bar]]))
        try:
            self.v = v = solve_refined(jacobian, commanded * speed)
            self.state.SetODE2Coordinates_t(v)
            self.state.SetODE2Coordinates_tt(np.zeros(EXUDYN_SIZE))
            at_b = self.acceleration("end3") - self.acceleration("end4")
            drift = np.concatenate(
                (np.zeros(2), self.acceleration("end2"), at_b, np.zeros(3))
            )
            self.a = a = solve_refined(jacobian, commanded * acceleration - drift)
        except np.linalg.LinAlgError:
            return {}
        self.state.SetODE2Coordinates_tt(a)
        values: BarValues = {
            f"a_{name}": self.acceleration(point) for name, point in ON_BARS.items()
        }
        for moving in MOVING_BARS:
            values[f"omega_{moving}"] = self.velocity(moving)
            values[f"alpha_{moving}"] = self.alpha(moving)
        self.solver.ComputeMassMatrix(self.mbs)
        inertial = np.array(self.solver.GetSystemMassMatrix()) @ a

        def balanced() -> dict[str, Any]:
            unknowns = np.linalg.solve(of_drive.T, inertial - self._sum_applied())
            pins = zip(JOINTS, unknowns[:-1].reshape(4, 2), strict=True)
            return {PIN_FORCE[pin]: force for pin, force in pins} | {
                self.driving: unknowns[-1]
            }

        try:
            return values | self.settled(balanced)
        except (
            np.linalg.LinAlgError
        ):  # no torque or force of the drive balances the linkage here
            return values

    def _move_behind(self) -> None:
        """Move the end on the ground behind the point that a force drives."""
        [(_, _, point)], along = self.line()
        behind = point - self.reach * along
        position = [behind.real, behind.imag, 0.0]
        self.mbs.SetMarkerParameter(self.behind, "localPosition", position)

    def _sum_applied(self) -> Array:
        """Sum what acts, less what the speeds ask for, (9,)."""
        if self.terms:
            self.act()
            for bar, (x, y, couple) in self.wrenches.items():
                force, torque = self.load[bar]
                self.mbs.SetLoadParameter(force, "loadVector", [x, y, 0.0])
                self.mbs.SetLoadParameter(torque, "loadVector", [0.0, 0.0, couple])
        self.solver.ComputeODE2RHS(self.mbs)
        return np.array(self.solver.GetSystemResidual())[:EXUDYN_SIZE]


ExudynConstraints = partial(Exact, "exudyn-constraints", ExudynBars)
