"""Pinocchio's forward dynamics of the closed loop, integrated by RK4.

The impulse solvers of Pinocchio 4.1 are tried too.
"""

from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from fourbar.errors import LimitError
from fourbar.mjcf import size_flywheel
from fourbar.quantities import Array
from fourbar.scene import Scene, with_signs
from fourbar.scene import command as list_positions
from fourbar_lab.simulators.protocol_engines import (
    DEFAULT_STEPS_OF_A_TURN,
    RECIPE_WITH_A_LIGHT_FLYWHEEL,
    Course,
    Instant,
    Readings,
    Simulator,
    bar_directions,
    find_timestep,
    start,
)
from fourbar_validation.engines.pinocchio import ClosedTree, PinocchioTree, make_step

_SOFTNESS_STEPS = 30.0
"""Time constant of Baumgarte's stabilisation, in steps of RK4."""
DELASSUS_DIAGONAL = 1e-10
"""Added to the diagonal of the Delassus matrix, as in Pinocchio's example: one of
its three rows depends on the rest.
"""
_ACCURATE = 1e-10
"""Accuracy asked of the impulse solvers, absolute and relative. It replaces the
example's 1e-6.
"""


class _LoopConstrained(ClosedTree):
    """The same closure solved by lcaba.

    The name is short for loop-constrained articulated body algorithm.
    """

    def __init__(self, tree: PinocchioTree, time_constant: float) -> None:
        super().__init__(tree, time_constant)
        pin.computeJointMinimalOrdering(tree.model, self.data, self.models)

    def acceleration(
        self,
        q: Array,
        v: Array,
        tau: Array,
    ) -> Any:
        """Accelerate the closed loop."""
        return pin.lcaba(
            self.tree.model,
            self.data,
            q,
            v,
            tau,
            self.models,
            self.closure_data,
            self.proximal,
        ).copy()

    def loop_force(self) -> Array:
        """Return F43, in whatever frame the closure was given.

        lcaba leaves the force on bar 4 in the axes of bar 3.
        """
        return np.array(
            -self.tree.rotation(3) @ self.closure_data[0].contact_force.linear[:2]
        )


class _Impulses:
    """A PointAnchorConstraintModel whose impulse over a step ADMM or PGS finds.

    Source: Pinocchio 4.1, examples of its ADMM solver.
    """

    def __init__(
        self,
        tree: PinocchioTree,
        timestep: float,
        solver: str,
    ) -> None:
        self.tree = tree
        self.h = timestep
        self.model, self.data = tree.model, tree.model.createData()
        ends = [
            (tree.joint[bar], self.model.frames[tree.frame[f"end{bar}"]].placement)
            for bar in (3, 4)
        ]
        self.closure = pin.ConstraintModel(
            pin.PointAnchorConstraintModel(self.model, *ends[0], *ends[1])
        )
        self.models, self.closure_data = [self.closure], [self.closure.createData()]
        self.cholesky: Any = None
        self.solver = getattr(pin, f"{solver}ConstraintSolver")()
        self.settings = getattr(pin, f"{solver}SolverSettings")()
        self.result = getattr(pin, f"{solver}SolverResult")()
        self.settings.max_iterations = 10000
        for part in ("feasibility", "complementarity"):
            setattr(self.settings, f"absolute_{part}_tol", _ACCURATE)
            setattr(self.settings, f"relative_{part}_tol", _ACCURATE)

    def step(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Compute the speeds a step later, and F43 in the mean of the step."""
        model = self.model
        data = self.data
        h = self.h
        loops = self.models, self.closure_data
        none = np.zeros(3)
        pin.crba(model, data, q, pin.Convention.WORLD)
        free = v + h * pin.aba(model, data, q, v, none)
        self.closure.calc(model, data, self.closure_data[0])
        if self.cholesky is None:
            self.cholesky = pin.ConstraintCholeskyDecomposition(model, data, *loops)
        self.cholesky.compute(model, data, *loops, DELASSUS_DIAGONAL)
        jacobian = pin.getConstraintsJacobian(model, data, *loops)
        apart = self.closure_data[0].extract().constraint_position_error
        self.solver.solve(
            self.cholesky.getDelassusOperatorCholeskyExpression(),
            jacobian @ free + apart / h,
            *loops,
            self.settings,
            self.result,
        )
        force = np.array(self.result.retrieveConstraintImpulses()) / h
        self.tree.place(q.tolist())
        speeds = v + h * pin.aba(model, data, q, v, jacobian.T @ force)
        return speeds, -self.tree.rotation(3) @ force[:2]


class PinocchioSolvers(Simulator):
    """Pinocchio's solvers of closed loops."""

    name = "Pinocchio"
    version = pin.__version__
    changed = (
        "the tree is built in Python; around its acceleration solvers (proximal"
        " settings 1e-14, 1e-8, 10) stands RK4, around its impulse solvers (tolerances"
        " 1e-10) the semi-implicit Euler of its own example"
    )
    settings: ClassVar[dict[str, Any]] = {
        "constraintDynamics": ClosedTree,
        "lcaba": _LoopConstrained,
        "ADMM": "ADMM",
        "PGS": "PGS",
    }
    single_states = True

    def through(self, scene: Scene, course: Course) -> Readings:
        """Return the readings of a run through a course, carried by a flywheel."""
        solver = self.settings[self.setting]
        begin = start(scene)
        tree = PinocchioTree(scene)
        q = np.array(begin.qpos)
        v = np.array(begin.qvel)
        if not isinstance(solver, str):
            loop = _carry(scene, tree, solver, course.timestep)

            def advance(steps: int) -> tuple[Array, Array]:
                nonlocal q, v
                for _ in range(steps):
                    q, v = make_step(
                        lambda q, v: loop.acceleration(q, v, np.zeros(3)),
                        q,
                        v,
                        course.timestep,
                    )
                return q, v

            return self.run(
                scene, course, advance, lambda now: _evaluate_loop(loop, *now)
            )
        impulses = _Impulses(tree, course.timestep, solver)
        _set_flywheel(tree, size_flywheel(scene, RECIPE_WITH_A_LIGHT_FLYWHEEL))
        force = np.zeros(2)

        def step() -> None:
            nonlocal q, v, force
            v, force = impulses.step(q, v)
            q = q + course.timestep * v

        def read(before: tuple[Array, Array]) -> Instant:
            acceleration = (v - before[1]) / course.timestep
            return _read_joint_forces(tree, *before, acceleration, force)

        return self.run_by_steps(scene, course, step, lambda: (q, v), read)

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states.

        The impulse solvers have none: a step sees (dJ/dt) v in the step before.
        """
        solver = self.settings[self.setting]
        if isinstance(solver, str):
            raise LimitError("an impulse solver has no single states")
        timestep = find_timestep(scene, DEFAULT_STEPS_OF_A_TURN)
        loop = _carry(scene, PinocchioTree(scene), solver, timestep)
        readings = Readings()
        told = with_signs(scene.linkage, list_positions(scene))
        for theta_2, sign in zip(
            told.theta_2.tolist(),
            told.branch.tolist(),
            strict=True,
        ):
            state = loop.start(theta_2, sign, scene.motion.omega_2 or 0.0)
            if state is not None:
                readings.read(scene, _evaluate_loop(loop, *state))
        return readings


def _set_flywheel(tree: PinocchioTree, inertia: float) -> None:
    """Let the input carry a flywheel, kg m^2."""
    tree.model.armature = np.array([inertia, 0.0, 0.0])


def _carry(scene: Scene, tree: PinocchioTree, solver: Any, timestep: float) -> Any:
    """Return the closed loop of a solver, whose input carries a flywheel."""
    loop = solver(tree, _SOFTNESS_STEPS * timestep)
    _set_flywheel(tree, size_flywheel(scene))
    return loop


def _evaluate_loop(loop: ClosedTree, q: Array, v: Array) -> Instant:
    acceleration = loop.acceleration(q, v, np.zeros(3))
    loop.tree.place(q.tolist())
    return _read_joint_forces(loop.tree, q, v, acceleration, loop.loop_force())


def _read_joint_forces(
    tree: PinocchioTree,
    q: Array,
    v: Array,
    a: Array,
    loop_force: Array,
) -> Instant:
    """Return pin forces (N) and torque (N m) of a state, by Pinocchio's RNEA.

    The closing force is the one that Pinocchio found; the flywheel loads no pin.
    """
    inertia = float(tree.model.armature[0])
    _set_flywheel(tree, 0.0)
    tree.place(q.tolist())
    tree.moving(v, a)
    tree.torques()
    _set_flywheel(tree, inertia)
    torque = float(-inertia * a[0])
    x, y = loop_force.tolist()
    forces = {"F43": loop_force, **tree.forces(complex(x, y), torque)}
    return Instant(bar_directions(q), v[0], a[0], torque, forces)
