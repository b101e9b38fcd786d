"""Pinocchio: recursive Newton-Euler on the open tree, and a released motion.

Multipliers close the loop.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from fourbar.effects import Gravity
from fourbar.errors import LimitError
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Scene, command, with_signs
from fourbar_validation.compare.answer import RELEASED_QUANTITIES, Answer
from fourbar_validation.engines.description import (
    PIN_OF_MOVING_BAR,
    find_unknown,
    list_moving_parts,
)
from fourbar_validation.engines.loaded import (
    Components,
    Wrenches,
    has_term,
    list_wrenches,
)
from fourbar_validation.engines.loop import Assembler, Exact
from fourbar_validation.engines.tree import Tree, solve_closed

WORLD = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def _shift(place: Sequence[float]) -> pin.SE3:
    """Return the placement of axes that are moved in the plane, not turned."""
    return pin.SE3(np.eye(3), np.array([*place, 0.0]))


class PinocchioTree(Tree):
    """The open tree, built from the description."""

    def __init__(self, scene: Scene) -> None:
        if reason := find_unknown(scene, has_term, forces=True):
            raise LimitError(reason)
        self.model = model = pin.Model()
        self.joint = {1: 0}
        self.frame = dict[str, int]()
        for part in list_moving_parts(scene.linkage):
            joint = model.addJoint(
                self.joint[part.bearer],
                pin.JointModelRZ(),
                _shift(part.first_pin),
                PIN_OF_MOVING_BAR[part.bar],
            )
            self.joint[part.bar] = joint
            # nothing is appended, no frame either: below 2.2e-16 kg the sum of two
            # inertias has another mass centre
            about_g = np.diag([0.0, 0.0, part.inertia])
            centre = np.array([*part.centre, 0.0])
            model.inertias[joint] = pin.Inertia(part.mass, centre, about_g)
            for name, place in part.points.items():
                frame = pin.Frame(name, joint, 0, _shift(place), pin.FrameType.OP_FRAME)
                self.frame[name] = model.addFrame(frame, False)
        self.data = data = model.createData()
        self.q = np.zeros(3)
        self.external = pin.StdVec_Force([pin.Force.Zero()] * model.njoints)
        # the engine's own memory, read and written in place: to look it up again costs
        # more than a pass of the engine
        self.at = {
            name: data.oMf[frame].translation[:2] for name, frame in self.frame.items()
        }
        self.turned_to = {
            bar: data.oMi[joint].rotation[:2, :2] for bar, joint in self.joint.items()
        }
        self.joint_force = {
            bar: data.f[self.joint[bar]].linear[:2] for bar in MOVING_BARS
        }
        self.model_gravity = model.gravity.linear
        self.ready(scene, list_wrenches(scene, self))
        self.model_gravity[:2] = self.field

    def place(self, q: Sequence[float]) -> None:
        """Place joint frames, Jacobian columns and points at q."""
        self.q[:] = q
        pin.computeJointJacobians(self.model, self.data, self.q)
        pin.updateFramePlacements(self.model, self.data)

    def point_jacobian(self, name: str) -> Array:
        """Return the Jacobian of a frame's origin, (2, 3)."""
        jacobian: Array = pin.getFrameJacobian(
            self.model, self.data, self.frame[name], WORLD
        )
        return jacobian[:2]

    def turn(self, bar: int) -> Array:
        """Return the last row of the bar's frame Jacobian."""
        return np.array(
            pin.getFrameJacobian(self.model, self.data, self.frame[f"G{bar}"], WORLD)[5]
        )

    def set_motion(self, v: Array, a: Array) -> None:
        """Compute the forward kinematics."""
        pin.forwardKinematics(self.model, self.data, self.q, v, a)

    def accelerations(self, names: Iterable[str]) -> list[list[float]]:
        """Return the accelerations of frames, [x, y] of each, m/s^2."""
        model = self.model
        data = self.data
        frame = self.frame
        return [
            pin.getFrameClassicalAcceleration(
                model, data, frame[name], WORLD
            ).linear.tolist()[:2]
            for name in names
        ]

    def needed(
        self,
        field: Components,
        wrenches: Wrenches,
    ) -> list[float]:
        """Compute recursive Newton-Euler.

        What acts on the bars are external forces.
        """
        self.model_gravity[:2] = field
        for bar, (x, y, moment) in wrenches.items():
            inside = complex(x, y) / self.rotate(bar, 1.0)
            force = [inside.real, inside.imag, 0.0, 0.0, 0.0, moment]
            self.external[self.joint[bar]] = pin.Force(np.array(force))
        torques: list[float] = pin.rnea(
            self.model, self.data, self.q, self.v, self.a, self.external
        ).tolist()
        return torques

    def joint_forces(self) -> dict[int, complex]:
        """Read what each joint transmits, which the last pass left in its own axes."""
        return {
            bar: self.rotate(bar, complex(*force.tolist()))
            for bar, force in self.joint_force.items()
        }


PinocchioInverse = partial(Exact, "pinocchio-inverse", PinocchioTree)
RELEASED_NAME = "pinocchio-forward"
BAUMGARTE_TIMESTEPS = 10.0
"""Time constant of Baumgarte's stabilisation of a free motion, in timesteps: with 30
the loop is lost at a change point from h = 5 ms on.
"""
PROXIMAL_SETTINGS = (1e-14, 1e-8, 10)
"""Accuracy, mu, iterations. With the default mu = 0 every acceleration is NaN: of the
three rows of the closure only two are independent in the plane.
"""
Acceleration = Callable[[Array, Array], Array]


class ClosedTree:
    """A tree with its loop closed at B.

    `time_constant`: of the stabilisation, s: Kp = 1/tc^2 and Kd = 2/tc.
    """

    def __init__(self, tree: PinocchioTree, time_constant: float) -> None:
        self.tree = tree
        ends = [
            (tree.joint[bar], tree.model.frames[tree.frame[f"end{bar}"]].placement)
            for bar in (3, 4)
        ]
        closure = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            tree.model,
            *ends[0],
            *ends[1],
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
        gains = pin.BaumgarteCorrectorParameters(
            1.0 / time_constant**2, 2.0 / time_constant
        )
        closure.setBaumgarteCorrectorParameters(gains)
        self.models = pin.StdVec_RigidConstraintModel()
        self.closure_data = pin.StdVec_RigidConstraintData()
        self.models.append(closure)
        self.closure_data.append(closure.createData())
        self.data = tree.model.createData()
        pin.initConstraintDynamics(
            tree.model, self.data, self.models, self.closure_data
        )
        self.proximal = pin.ProximalSettings(*PROXIMAL_SETTINGS)

    def start(
        self,
        theta_2: float,
        branch: int,
        omega_2: float,
    ) -> tuple[Array, Array] | None:
        """Assemble at the speeds that keep the loop closed.

        None if it does not close.
        """
        q = Assembler(self.tree).find(theta_2, branch)
        if q is None:
            return None
        return (np.array(q), solve_closed(self.tree.jacobian(), omega_2))

    def acceleration(self, q: Array, v: Array, tau: Array) -> Any:
        """Accelerate the closed loop under loads, effects and the flywheel's motor."""
        model = self.tree.model
        data = self.data
        return pin.constraintDynamics(
            model, data, q, v, tau, self.models, self.closure_data, self.proximal
        ).copy()

    def loop_force(self) -> Array:
        """Return F43 of the acceleration last found, (2,), N."""
        return np.array(self.closure_data[0].contact_force.linear[:2])


def make_step(f: Acceleration, q: Array, v: Array, h: float) -> tuple[Array, Array]:
    """Make one step of the classical Runge-Kutta method."""
    a1 = f(q, v)
    v2 = v + 0.5 * h * a1
    a2 = f(q + 0.5 * h * v, v2)
    v3 = v + 0.5 * h * a2
    a3 = f(q + 0.5 * h * v2, v3)
    v4 = v + h * a3
    a4 = f(q + h * v3, v4)
    return q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (
        a1 + 2.0 * a2 + 2.0 * a3 + a4
    )


class PinocchioReleased:
    """Free motion of the closed loop with a fixed step, s."""

    name = RELEASED_NAME
    version = pin.__version__

    def __init__(self, step: float = 2e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> Answer:
        """Integrate the motion at the given times, rising from 0 (s)."""
        setting = f"RK4 {self.step:g} s"

        def refuse(reason: str) -> Answer:
            return Answer(RELEASED_NAME, setting, refusal=reason)

        if scene.loads or any(
            not isinstance(effect, Gravity) for effect in scene.effects
        ):
            return refuse("in forward dynamics only gravity has a model here")
        for bar in (3, 4):  # the ends of the open tree
            inertia = scene.linkage.bar(bar)
            if inertia.mass == 0.0 and inertia.moment_of_inertia == 0.0:
                return refuse(
                    f"bar {bar} has no inertia: the open tree has no mass matrix"
                )
        tree = PinocchioTree(scene)
        none = np.zeros(3)
        start = with_signs(scene.linkage, command(scene))
        loop = ClosedTree(tree, BAUMGARTE_TIMESTEPS * self.step)
        state = loop.start(
            float(start.theta_2[0]), int(start.branch[0]), scene.motion.omega_2 or 0.0
        )
        if state is None:
            return refuse("the loop does not close at the start")
        q, v = state
        accelerate = partial(loop.acceleration, tau=none)
        data = tree.data
        rows = []
        now = 0.0
        for t in times:
            steps = math.ceil((t - now) / self.step - 1e-6)
            for _ in range(steps):
                q, v = make_step(accelerate, q, v, (t - now) / steps)
            now = float(t)
            energy = pin.computeMechanicalEnergy(tree.model, data, q, v)
            terms = data.kinetic_energy + abs(data.potential_energy)
            rows.append((q[0], v[0], energy, terms))
        columns = zip(RELEASED_QUANTITIES, np.array(rows).T, strict=True)
        return Answer(RELEASED_NAME, setting, quantities=dict(columns))
