"""Exudyn: nine absolute coordinates, the multipliers of four pins and a drive; loads and effects by its own elements.

A bar is `ObjectRigidBody2D` with coordinates (x, y of its first pin, direction). With g = 0 the nine
constraints (two of each pin and the drive of bar 2), J = dg/dq, M the mass matrix and f what acts,

    J v = e omega_2,   J a = e alpha_2 - (dJ/dt) v,   [J_pins^T e_k] [F12 F32 F43 F14 T_k] = M a - f.

g, J, (dJ/dt) v, M and f are Exudyn's; the three linear systems are solved here.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    NodeRigidBody2D,
    ObjectConnectorCoordinate,
    ObjectGround,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
)

from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.scene import Scene
from validation.compare.answer import Array
from validation.engines.description import ON_BARS, POINTS, about_first_pin, parts, unknown_effect, within_half_a_turn
from validation.engines.exudyn_elements import ELEMENT_OF
from validation.engines.loop import Exact
from validation.engines.tree import Bars, Values

SIZE = 9
"""Coordinates, and constraints."""
B_ROWS, OTHER_ROWS = [4, 5], [0, 1, 2, 3, 6, 7]
"""The rows of pin B and of the others among the constraints, which stand in the order of `JOINTS`, the drive last."""
JOINTS = {"O2": (1, 2), "A": (3, 2), "B": (4, 3), "O4": (1, 4)}
"""Of each pin the force is that on the second bar: F12, F32, F43, F14."""


class ExudynBars(Bars):
    """The bars, built from the description."""

    own = (
        "nine absolute coordinates, constraint equations, their Jacobian and (dJ/dt) v, mass matrix, every load and "
        "effect by an element of its own; Newton's method on its gap and the linear solves are the harness's"
    )

    def __init__(self, scene: Scene) -> None:
        if reason := unknown_effect(scene, ELEMENT_OF, "Exudyn has no element for the effect {!r}"):
            raise LimitError(reason)
        exu.config.printToConsole = False
        linkage = scene.linkage
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        self.ground_angle = linkage.ground_angle
        self.ground_node = mbs.AddNode(NodePointGround())
        self.body = {1: mbs.AddObject(ObjectGround())}
        self.node: dict[int, Any] = {}
        self.part = {part.bar: part for part in parts(linkage)}
        for bar, part in self.part.items():
            self.node[bar] = mbs.AddNode(NodeRigidBody2D())
            about_pin = about_first_pin(linkage.bar(bar))
            self.body[bar] = mbs.AddObject(
                ObjectRigidBody2D(
                    mass=part.mass, inertia=about_pin, centerOfMass=part.centre, nodeNumber=self.node[bar]
                )
            )
        end = {bar: part.points[f"end{bar}"] for bar, part in self.part.items()}
        at = {
            "O2": ((0.0, 0.0), (0.0, 0.0)),
            "A": ((0.0, 0.0), end[2]),
            "B": (end[4], end[3]),
            "O4": (self.part[4].foot, (0.0, 0.0)),
        }
        for pin, bars in JOINTS.items():
            markers = [self.point_marker(bar, *place) for bar, place in zip(bars, at[pin], strict=True)]
            mbs.AddObject(ObjectJointRevolute2D(markerNumbers=markers))
        markers = [self.rotation_marker(bar) for bar in (1, 2)]
        self.drive = mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=markers))
        self.tables: list[Callable[[float], None]] = []
        for term in (*scene.loads, *scene.effects):
            ELEMENT_OF[term.key](term, self)
        mbs.Assemble()
        self.state = mbs.systemData
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        self.solver = exu.MainSolverImplicitSecondOrder()
        self.solver.InitializeSolver(mbs, settings)
        self.turn = {bar: self.state.GetObjectLTGODE2(self.body[bar])[2] for bar in MOVING_BARS}
        self.shifts = [i for i in range(SIZE) if i not in self.turn.values()]
        self.e_drive = np.zeros(SIZE)
        self.e_drive[self.turn[scene.drive_bar]] = 1.0

    def point_marker(self, bar: int, x: float, y: float) -> Any:
        """A point of a bar, along and across its line from its first pin; of the ground in world axes."""
        return self.mbs.AddMarker(MarkerBodyPosition(bodyNumber=self.body[bar], localPosition=[x, y, 0.0]))

    def rotation_marker(self, bar: int) -> Any:
        """The direction of a bar as a coordinate; of the ground a zero."""
        node, coordinate = (self.ground_node, 0) if bar == 1 else (self.node[bar], 2)
        return self.mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))

    def frame_marker(self, bar: int, turn: float = 0.0, x: float = 0.0, y: float = 0.0) -> Any:
        """Axes fixed in a bar, turned by an angle from its line, at a point from its first pin."""
        cos, sin = math.cos(turn), math.sin(turn)
        frame = [[cos, -sin, 0.0, x], [sin, cos, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
        return self.mbs.AddMarker(MarkerBodyRigid(bodyNumber=self.body[bar], localHT=frame))

    def place(self, q: Sequence[float]) -> None:
        """Angles of the bars as given; the pins O2, A and O4 closed, in which Exudyn's constraints are linear."""
        of_3_to_2, theta_4 = q[1:]
        theta_2 = within_half_a_turn(q[0])
        coordinates = np.zeros(SIZE)
        for bar, angle in zip(MOVING_BARS, (theta_2, theta_2 + of_3_to_2, theta_4), strict=True):
            coordinates[self.turn[bar]] = angle
        self.mbs.SetObjectParameter(self.drive, "offset", theta_2)
        self.state.SetODE2Coordinates(coordinates)
        jacobian, gap = self._constraint_jacobian(), self._constraint_gap()
        coordinates[self.shifts] = np.linalg.solve(jacobian[OTHER_ROWS][:, self.shifts], -gap[OTHER_ROWS])
        self.state.SetODE2Coordinates(coordinates)
        self.q, self.jacobians = coordinates, jacobian

    def _constraint_gap(self) -> Array:
        self.solver.ComputeAlgebraicEquations(self.mbs, False)
        return np.array(self.solver.GetSystemResidual())[SIZE:]

    def _constraint_jacobian(self) -> Array:
        self.solver.SetSystemJacobian(np.zeros((2 * SIZE, 2 * SIZE)))  # what is computed is added
        self.solver.ComputeJacobianAE(
            self.mbs, scalarFactor_ODE2=1.0, scalarFactor_ODE2_t=0.0, scalarFactor_ODE1=0.0, velocityLevel=False
        )
        return np.array(self.solver.GetSystemJacobian())[SIZE:, :SIZE]

    def gap(self) -> tuple[float, float]:
        """B on bar 3 minus B on bar 4, from the constraint of pin B."""
        x, y = self._constraint_gap()[B_ROWS].tolist()
        return x, y

    def jacobian(self) -> Array:
        """Derivative of the gap by the turns, pins O2, A and O4 kept closed."""
        turns, pins, b = list(self.turn.values()), self.jacobians[OTHER_ROWS], self.jacobians[B_ROWS]
        shifts = np.linalg.solve(pins[:, self.shifts], -pins[:, turns])
        by_angle = b[:, turns] + b[:, self.shifts] @ shifts
        return np.column_stack((by_angle[:, 0] + by_angle[:, 1], by_angle[:, 1:]))

    def angle(self, bar: int) -> float:
        """Its coordinate, within half a turn."""
        return math.remainder(self.q[self.turn[bar]], math.tau)

    def _output(self, kind: Any) -> dict[str, Array]:
        """Position or acceleration of the points of the parts."""
        every = ((part.bar, name, [*at, 0.0]) for part in self.part.values() for name, at in part.points.items())
        found = {name: self.mbs.GetObjectOutputBody(self.body[bar], kind, at) for bar, name, at in every}
        return {name: np.array(vector[:2]) for name, vector in found.items()}

    def positions(self) -> dict[str, Array]:
        """Points of the bars."""
        at = self._output(exu.OutputVariableType.Position)
        return {name: at[point] for name, point in POINTS.items()}

    def move(self, omega_2: float, alpha_2: float) -> Values:
        """Speeds, accelerations and multipliers; nothing where a toggle leaves them 0/0."""
        jacobian = self.jacobians
        drive = np.eye(SIZE)[-1]
        try:
            v = np.linalg.solve(jacobian, drive * omega_2)
            self.state.SetODE2Coordinates_t(v)
            self.state.SetODE2Coordinates_tt(np.zeros(SIZE))
            at = self._output(exu.OutputVariableType.Acceleration)
            drift = np.concatenate((np.zeros(2), at["end2"], at["end3"] - at["end4"], np.zeros(3)))
            a = np.linalg.solve(jacobian, drive * alpha_2 - drift)
        except np.linalg.LinAlgError:
            return {}
        self.state.SetODE2Coordinates_tt(a)
        at = self._output(exu.OutputVariableType.Acceleration)
        values: Values = {f"a_{name}": at[point] for name, point in ON_BARS.items()}
        for bar in MOVING_BARS[1:]:
            values[f"omega_{bar}"], values[f"alpha_{bar}"] = float(v[self.turn[bar]]), float(a[self.turn[bar]])
        try:
            matrix = np.column_stack((jacobian[:-1].T, self.e_drive))
            unknowns = np.linalg.solve(matrix, self._needed(a))
        except np.linalg.LinAlgError:  # no torque on that bar balances the linkage here
            return values
        for number, pin in enumerate(JOINTS):
            values[PIN_FORCE[pin]] = np.asarray(unknowns[2 * number : 2 * number + 2], dtype=np.float64)
        return values | {"torque": float(unknowns[-1])}

    def _needed(self, a: Array) -> Array:
        """M a less what acts, (9,)."""
        for table in self.tables:
            table(self.q[self.turn[2]])
        self.solver.ComputeMassMatrix(self.mbs)
        self.solver.ComputeODE2RHS(self.mbs)
        mass = np.array(self.solver.GetSystemMassMatrix())
        return np.asarray(mass @ a - np.array(self.solver.GetSystemResidual())[:SIZE])


ExudynConstraints = partial(Exact, "exudyn-constraints", ExudynBars)
