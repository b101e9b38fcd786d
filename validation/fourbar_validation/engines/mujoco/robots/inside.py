"""A four-bar inside somebody's whole robot.

MuJoCo gives its torque and pin forces there. No joint is removed, for that would change
the softness that is measured: MuJoCo sizes a constraint's softness by the bodies of the
whole model. The loop's driven hinge moves as commanded, the other joints of the robot
stay where they are, contacts, joint limits and motors are off, and so are equalities
between the moving bars and joints that stay. A file that holds nothing but the loop may
be taken as it is: only what drives the driven hinge is off then.

At a state the joint forces follow from MuJoCo's own inverse dynamics of its soft
constraints. The driven hinge has the acceleration alpha, a held joint none, and the
accelerations x of the loop's other hinges are those at which

    (M a(x) + c - J^T f(a(x)))_i = 0    at each of these hinges i,

since nothing acts there. The forces that hold the joints are then known, and the couple
on the driven hinge is found by `mj_forward`, with the solver of the file.

Were the pins rigid, J a = -(dJ/dt) v would hold, with multipliers in the place of f,
and dry friction in full: that couple and these pin forces are what MuJoCo's are
compared with, in the same model.
"""

import cmath
import math
import time
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import ENDS, PINS
from fourbar.quantities import Array
from fourbar_validation.engines.description import FORCE_AT, FORCE_BETWEEN
from fourbar_validation.engines.mujoco.closed_loop import WARNINGS
from fourbar_validation.engines.mujoco.couple import find_couple
from fourbar_validation.engines.mujoco.robots.ancestry import (
    climb,
    find_tied_bodies,
    is_enabled,
    list_actuators,
    name_joint,
    takes_control,
)
from fourbar_validation.engines.mujoco.robots.answers import (
    BarMotion,
    InsideAnswer,
    InsideRow,
    PinsAndTorque,
    TornState,
)
from fourbar_validation.engines.mujoco.robots.drive import FileCylinder, LoopDrive
from fourbar_validation.engines.mujoco.robots.forces import (
    BearerForces,
    read_equality_force,
)
from fourbar_validation.engines.mujoco.robots.loop import RobotLoop
from fourbar_validation.engines.mujoco.robots.planes import (
    copy_for_closures,
    project_closures,
    resolve_normals,
)
from fourbar_validation.engines.mujoco.runner import Stepper

RESIDUAL_OF_A_CLOSED_STATE = 1e-12
"""m or rad; residual of the closure at which a state is closed."""
OTHER_ASSEMBLY = (
    "MuJoCo goes over to the other assembly before the loop has settled; --pose states"
    " another start"
)
"""Why a motion has no state that counts."""
_CLOSING_STEPS = 50
RESIDUAL_OF_AN_OPEN_LOOP = 1e-6
"""Residual above which the loop does not close at a position, m or rad."""
_STRIDE = math.radians(2.0)
_LONG_STRIDE = math.radians(12.0)
_FAR_FROM_A_LINE = 0.5
"""Largest turns of the driven hinge from one closed state to the next, the longer one
where |sin(theta_4 - theta_3)| is at least this. The assembly is kept so.
"""
LEAST_TRANSMISSION = 1e-5
"""Transmission over the longest bar below which the bars of pin B are in line. A closed
pose is known to the residual over it, and to less than that below.
"""
GAP_OF_ROUNDING = 2.0
"""Gap of a closed loop over the rounding of its lengths. Where the bars are in line the
least gap is that rounding, and Newton's steps end beside it.
"""
KNOWN_TRANSMISSION = 0.01
"""Part of the angle between bars 3 and 4 up to which the digits of a file may turn it:
forces have two digits.
"""
_SOLVE_STEPS = 60
"""Newton steps for the hinges' accelerations; without friction one is enough."""
_BALANCED = 1e-10
"""Part of the generalized forces that may be left on a hinge on which nothing acts."""
HEAVY = 1e4
"""Armature that holds a joint while the model is stepped, over the largest inertia of
the robot. It lets the joints move by about its inverse; beyond 1e5 MuJoCo's solver
loses the light bars beside it: at 1e6 the gap was three times too large.
"""
LIMITS_OFF = int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
SETTLING_TIME = 5.0
"""Time constants after which the loop has yielded but for 1 %, at most half of the
motion.
"""
_TOUCHED = 1e-9
"""rad; a position that is no farther beyond a limit is at it: scenes state angles with
twelve digits.
"""
_DRIVING = 1e3
"""Armature over all other inertia from which it is a flywheel that drives. The speed
then ripples by 1e-3.
"""
_REACHED = 1.0 - 1e-6
"""Part of its couple at which dry friction acts in full."""
_SINE_OF_AN_ASSEMBLY = 0.1
"""|sin(theta_4 - theta_3)| from which a loop that has yielded is in one assembly. A gap
of a thousandth of the bars turns them by its root beside a change point.
"""
MOST_TIMESTEPS = 60_000
"""Steps of one run; at 0.1 ms a step of a humanoid these are six seconds."""


@dataclass(frozen=True, slots=True)
class _RobotState:
    """Closed state of a robot."""

    qpos: Array
    qvel: Array
    theta_2: float


class LoopInside:
    """A loop of a robot whose driven hinge moves.

    Every other joint of the robot is held.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        loop: RobotLoop,
        drive: LoopDrive | FileCylinder | None = None,
        *,
        as_it_is: bool = False,
    ) -> None:
        """Take a loop.

        Parameters
        ----------
        drive : what moves it; None: a couple on bar 2.
        as_it_is : contacts, joint limits and other motors act as in the file.
        """
        self.loop = loop
        self.given = model
        self.as_it_is = as_it_is
        self.acting = None if drive is None or drive.acts_on_crank else drive
        self.model = copy(model)
        self.flags = int(model.opt.disableflags)
        self.taken_off = list_actuators(model, loop.joint)
        """Actuators on the driven hinge."""
        off = self.taken_off
        if as_it_is:
            # a sweep ends at the limits of a joint, to round-off on either side
            self.model.jnt_margin[:] -= _TOUCHED
        else:
            for name in ("CONTACT", "LIMIT"):
                flag = int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}"))
                self.model.opt.disableflags |= flag
            off = [*off, *(i for i in range(model.nu) if takes_control(model, i))]
        self.model.actuator_gainprm[off] = 0.0
        self.model.actuator_biasprm[off] = 0.0
        if isinstance(self.acting, FileCylinder):
            self.acting.take_over(self.model)
        # while joints are held, what ties them to the moving bars would only be torn
        self.model.eq_active0[list(loop.other_equalities)] = 0
        self.data = mujoco.MjData(self.model)
        dofs = {pin: int(model.jnt_dofadr[j]) for pin, j in loop.hinges.items()}
        self.drive = dofs["O2"]
        self.passive = [dof for pin, dof in dofs.items() if pin != "O2"]
        self.passive_addresses = [
            int(model.jnt_qposadr[model.dof_jntid[dof]]) for dof in self.passive
        ]
        free = {self.drive, *self.passive}
        self.held = [dof for dof in range(model.nv) if dof not in free]
        self.sense = loop.senses["O2"]
        self.address = int(model.jnt_qposadr[loop.joint])
        # the closure alone, for kinematics: with every row, and a dense derivative
        self.closure = copy_for_closures(self.model, loop.closures)
        self.closing = mujoco.MjData(self.closure)
        self._last = loop.qpos.copy()
        self._rates = self._find_rates(self._last)
        """Turn of the hinges that are not driven by that of the driven one, at the last
        pose.
        """
        without_friction = int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
        rubs = not self.model.opt.disableflags & without_friction
        self._friction = self.model.dof_frictionloss * rubs
        self.bearers = BearerForces(self.model)
        self.flywheel = 0.0
        """Part of the armature of the driven hinge that keeps its speed, kg m^2. Its
        torque is none of the drive's.
        """
        self.stopped = set[int]()
        """Joints that were at a limit of their range in some state."""
        self.contacts = 0
        """Most contacts in a state."""
        self._doubtful: list[InsideRow] = []
        """Last rows of a simulation that may be in the other assembly."""

    def find_flywheel(self, inertia: float) -> None:
        """Take an armature of the driven hinge for a flywheel if it drives.

        `inertia`: of the flywheels of the scene, kg m^2, which count as load.
        """
        armature = float(self.model.dof_armature[self.drive])
        others = float(self.model.dof_M0.sum() - self.model.dof_armature.sum())
        if armature > _DRIVING * (others + inertia):
            self.flywheel = armature

    def find_carrier(self, heavy: float) -> float:
        """Return the armature that keeps speeds through time, kg m^2.

        `heavy`: its size over the robot's largest inertia.
        """
        inertias = self.model.dof_M0.copy()
        inertias[self.drive] -= self.flywheel
        return heavy * float(inertias.max())

    def angle(self, qpos: Array) -> float:
        """Return theta_2 of a pose, rad."""
        turned = qpos[self.address] - self.loop.qpos[self.address]
        return float(self.loop.angles[1] + self.sense * turned)

    def position(self, theta_2: float) -> float:
        """Return the position of the driven joint at an angle of bar 2, rad."""
        turned = theta_2 - self.loop.angles[1]
        return float(self.loop.qpos[self.address] + self.sense * turned)

    def close(self, theta_2: float) -> Array | None:
        """Return the pose at an angle of bar 2, or None if the loop is open.

        The loop is followed from the last pose in strides, which are small where bars 3
        and 4 are near to a line. A stride begins as the one before it went on, so that
        the motion passes a change point smoothly.
        """
        qpos = self._last.copy()
        rates = self._rates
        longest = _LONG_STRIDE
        while True:
            sine = self._measure_sine(qpos)
            if abs(sine) < _FAR_FROM_A_LINE:
                longest = _STRIDE
            angle = self.angle(qpos)
            strides = max(math.ceil(abs(theta_2 - angle) / longest), 1)
            after = qpos.copy()
            after[self.address] = self.position(angle + (theta_2 - angle) / strides)
            turned = after[self.address] - qpos[self.address]
            after[self.passive_addresses] += rates * turned
            closed = self.close_gap(after)
            if longest > _STRIDE and (
                not closed or self._measure_sine(after) * sine < 0
            ):
                longest = _STRIDE
                continue
            if not closed:
                return self._jump(theta_2)
            if turned:
                rates = (after - qpos)[self.passive_addresses] / turned
            qpos = after
            longest = _LONG_STRIDE
            if strides == 1:
                break
        self._last = qpos.copy()
        self._rates = rates
        return qpos

    def _jump(self, theta_2: float) -> Array | None:
        """Return the pose at an angle of bar 2 to which no motion leads.

        The assembly is that of the loop's pose; None if the loop is open.
        """
        ground, crank, coupler, output = self.loop.lengths
        theta_1, _, theta_3, theta_4 = self.loop.angles
        line = cmath.rect(ground, theta_1) - cmath.rect(crank, theta_2)
        size = abs(line)
        if not abs(coupler - output) < size < coupler + output:
            return None
        side = math.copysign(1.0, math.sin(theta_4 - theta_3))
        near = (size**2 + coupler**2 - output**2) / (2.0 * size * coupler)
        theta_3 = cmath.phase(line) + side * math.acos(near)
        theta_4 = cmath.phase(cmath.rect(coupler, theta_3) - line)
        qpos = turn_hinges(self.model, self.loop, theta_2, theta_3, theta_4)
        if not self.close_gap(qpos):
            return None
        self._last = qpos.copy()
        self._rates = self._find_rates(qpos)
        return qpos

    def _find_rates(self, qpos: Array) -> Array:
        """Return the turn of the other hinges by that of the driven one, (k,).

        The loop is closed in a pose; k is the number of hinges that are not driven.
        """
        _, jacobian = self._evaluate_closure(qpos)
        return _solve_least_squares(
            jacobian[:, self.passive],
            -jacobian[:, self.drive],
        )

    def close_gap(self, qpos: Array) -> bool:
        """Move the hinges that are not driven until the residual is least.

        The residual is that of the closure. Tell whether it is closed.
        """
        least = math.inf
        best = qpos.copy()
        for _ in range(_CLOSING_STEPS):
            residual, jacobian = self._evaluate_closure(qpos)
            size = float(np.abs(residual).max())
            if size >= least:
                break
            least = size
            best = qpos.copy()
            if size <= RESIDUAL_OF_A_CLOSED_STATE:
                break
            step = _solve_least_squares(jacobian[:, self.passive], -residual)
            qpos[self.passive_addresses] += step
        rounding = GAP_OF_ROUNDING * self.loop.rounding
        allowed = max(RESIDUAL_OF_AN_OPEN_LOOP, self._skew(), rounding)
        qpos[:] = best
        return least <= allowed

    def measure_transmission(self, qpos: Array) -> float:
        """Return the least movement of the gap by the other hinges in a pose, m/rad.

        At zero the bars of pin B are in line, and hinges that are not driven cannot
        close a gap in one direction.
        """
        _, jacobian = self._evaluate_closure(qpos)
        sizes = np.linalg.svd(jacobian[:, self.passive], compute_uv=False)
        return float(sizes[1])

    def _measure_condition(self, qpos: Array) -> float:
        """Return |sin(theta_4 - theta_3)| in a pose."""
        return abs(self._measure_sine(qpos))

    def _measure_sine(self, qpos: Array) -> float:
        """Return sin(theta_4 - theta_3) in a pose."""
        self._evaluate_closure(qpos)
        coupler, output = (self._find_line(bar) for bar in (3, 4))
        ground = self.closing.xmat[self.loop.bodies[1][0]].reshape(3, 3)
        return float(np.cross(coupler, output) @ ground @ self.loop.axis)

    def _find_line(self, bar: int) -> Array:
        """Return the unit vector from the first pin of a bar to its second, (3,).

        World axes, in the pose in which the closure was evaluated last.
        """
        body = self.loop.bodies[bar][0]
        first, second = (self.loop.points[bar, pin] for pin in ENDS[bar])
        line = self.closing.xmat[body].reshape(3, 3) @ (second - first)
        ground = self.closing.xmat[self.loop.bodies[1][0]].reshape(3, 3)
        normal = ground @ self.loop.axis
        line = line - (line @ normal) * normal
        return np.asarray(line / np.linalg.norm(line))

    def _is_in_line(self, qpos: Array) -> bool:
        """Tell whether the bars of pin B are in line: at a change point or a limit.

        The loop may go on in two ways there, or no way, and forces are not determined.
        Nor are they where the digits of the file turn bars 3 and 4 by a part of the
        angle between them, which is their rounding over the squared sine.
        """
        longest = self.loop.longest
        if self.measure_transmission(qpos) < LEAST_TRANSMISSION * longest:
            return True
        turned = self.loop.rounding / longest
        return turned > KNOWN_TRANSMISSION * self._measure_condition(qpos) ** 2

    def _skew(self) -> float:
        """Return what axes that are not parallel leave of the gap, m."""
        return self.loop.misaligned * max(self.loop.lengths)

    def _evaluate_closure(self, qpos: Array) -> tuple[Array, Array]:
        """Return the closure's residual in the plane and its derivative.

        The shapes are (m,) and (m, nv).
        """
        data = self.closing
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self.closure, data)
        normal = data.xmat[self.loop.bodies[1][0]].reshape(3, 3) @ self.loop.axis
        return project_closures(
            data.efc_pos[: data.nefc],
            data.efc_J.reshape(-1, self.closure.nv)[: data.nefc],
            data.efc_id[: data.nefc],
            resolve_normals(
                self.closure, data, dict.fromkeys(self.loop.closures, normal)
            ),
        )

    def state(self, theta_2: float, omega_2: float) -> _RobotState | None:
        """Return the closed state at an angle and a speed of bar 2, or None.

        The answer is None if the loop does not close.
        """
        qpos = self.close(theta_2)
        if qpos is None:
            return None
        _, jacobian = self._evaluate_closure(qpos)
        speed = self.sense * omega_2
        due = -jacobian[:, self.drive] * speed
        qvel = np.zeros(self.model.nv)
        qvel[self.drive] = speed
        qvel[self.passive] = _solve_least_squares(jacobian[:, self.passive], due)
        return _RobotState(qpos, qvel, theta_2)

    def ask(
        self,
        qpos: Array,
        qvel: Array,
        alpha_2: float,
    ) -> InsideRow:
        """Evaluate a state in which bar 2 accelerates at alpha_2.

        The couple on it is solved for.

        Raises
        ------
        LimitError : the loop does not close at its theta_2, or no couple moves it.
        """
        model = self.model
        data = self.data
        qpos = qpos.copy()
        qvel = qvel.copy()
        theta_2 = self.angle(qpos)
        omega_2 = float(self.sense * qvel[self.drive])
        closed = self.state(theta_2, omega_2)
        if closed is None:
            raise LimitError(f"the loop does not close at theta_2 = {theta_2:.6g} rad")
        rigid, accelerations = self._solve_rigid(closed, alpha_2)
        held = np.zeros(0)
        if self.held:
            mujoco.mj_resetData(model, data)
            data.qpos[:] = qpos
            data.qvel[:] = qvel
            held = self._balance(accelerations)[self.held]
        mujoco.mj_resetData(model, data)
        data.qpos[:] = qpos
        data.qvel[:] = qvel
        data.qfrc_applied[self.held] = held
        carried = self.flywheel * alpha_2
        data.qfrc_applied[self.drive] = self.sense * carried

        mujoco.mj_kinematics(model, data)

        def acceleration(couple: float) -> float:
            if self.acting is None:
                data.qfrc_applied[self.drive] = self.sense * (carried + couple)
            else:
                self.acting.exert(data, couple)
            mujoco.mj_forward(model, data)
            return float(self.sense * data.qacc[self.drive])

        couple = find_couple(model, data, acceleration, alpha_2)
        if couple is None:
            raise LimitError(f"its drive does not move {self.name} in this robot")
        mujoco.mj_rnePostConstraint(model, data)
        self._watch(data)
        forces = self._read_forces(data)
        if math.isnan(couple):
            forces = {name: np.full(2, np.nan) for name in forces}
        return InsideRow(
            theta_2=theta_2,
            omega_2=omega_2,
            alpha_2=alpha_2,
            joint=float(qpos[self.address]),
            soft=PinsAndTorque(couple, forces),
            rigid=rigid,
            bars=self._read_bars(data),
            gap=self._measure_gap(qpos),
            condition=self._measure_condition(closed.qpos),
            sticking=self._list_sticking(),
        )

    def list_unmet_stops(self) -> list[int]:
        """List the hinges of the loop whose stops ended no state."""
        limits = is_enabled(self.model, "limit", "constraint")
        return [
            joint
            for joint in self.loop.hinges.values()
            if limits and self.model.jnt_limited[joint] and joint not in self.stopped
        ]

    def _watch(self, data: mujoco.MjData) -> None:
        """Take note of contacts, and of joints at a limit of their range."""
        self.contacts = max(self.contacts, int(data.ncon))
        kinds = data.efc_type[: data.nefc]
        limits = kinds == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
        self.stopped.update(data.efc_id[: data.nefc][limits].tolist())

    def _read_bars(self, data: mujoco.MjData) -> BarMotion:
        """Return angles and speeds of bars 3 and 4 in an evaluated state."""
        ground = self.loop.bodies[1][0]
        frame = data.xmat[ground].reshape(3, 3)
        normal = frame @ self.loop.axis
        along = frame @ self.loop.along
        across = np.cross(normal, along)
        self._evaluate_closure(data.qpos)
        angles = []
        speeds = []
        for bar in (3, 4):
            line = self._find_line(bar)
            angles.append(math.atan2(float(line @ across), float(line @ along)))
            turning = data.cvel[self.loop.bodies[bar][0]] - data.cvel[ground]
            speeds.append(float(turning[:3] @ normal))
        return BarMotion(*angles, *speeds)

    def _list_sticking(self) -> tuple[str, ...]:
        """List the hinges of the loop that turn and stick.

        A hinge sticks if its dry friction has not reached its couple.
        """
        model = self.model
        data = self.data
        kinds = data.efc_type[: data.nefc]
        rubbing = kinds == mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF
        of_the_loop = (self.drive, *self.passive)
        names = []
        for row in np.flatnonzero(rubbing):
            dof = int(data.efc_id[row])
            in_full = _REACHED * model.dof_frictionloss[dof]
            reached = abs(data.efc_force[row]) >= in_full
            if dof in of_the_loop and not reached and data.qvel[dof]:
                joint = int(model.dof_jntid[dof])
                names.append(name_joint(model, joint))
        return tuple(names)

    def _measure_gap(self, qpos: Array) -> float:
        """Measure the distance of the ends of the closure in the plane, m."""
        residual, _ = self._evaluate_closure(qpos)
        return float(np.linalg.norm(residual[:3]))

    @property
    def lever(self) -> float:
        """Factor of pin forces that makes them of the drive's kind, m or 1."""
        if self.acting is not None and self.acting.drive is not None:
            return 1.0
        return self.loop.longest

    @property
    def name(self) -> str:
        """Name of the driven joint."""
        return name_joint(self.model, self.loop.joint)

    def _solve_rigid(
        self,
        state: _RobotState,
        alpha_2: float,
    ) -> tuple[PinsAndTorque, Array]:
        """Solve for torque and pin forces with rigid pins at a closed state.

        Return all accelerations too, (nv,).
        """
        model = self.closure
        data = self.closing
        data.qpos[:] = state.qpos
        data.qvel[:] = state.qvel
        mujoco.mj_forward(model, data)
        rows = data.efc_J.reshape(-1, model.nv)[: data.nefc]
        free = rows[:, self.passive]
        drift = _measure_drift(data, rows @ state.qvel)
        accelerations = np.zeros(model.nv)
        accelerations[self.drive] = self.sense * alpha_2
        due = drift - rows[:, self.drive] * accelerations[self.drive]
        accelerations[self.passive] = _solve_least_squares(free, due)
        needed = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, needed, accelerations)
        needed += data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
        needed += self._friction * np.sign(state.qvel)
        needed[self.drive] -= self.sense * self.flywheel * alpha_2
        couple, multipliers = self._solve_drive(rows, needed)
        data.qacc[:] = accelerations
        data.efc_force[: data.nefc] = multipliers
        if self.acting is not None:
            self.acting.exert(data, couple)
        mujoco.mj_rnePostConstraint(model, data)
        forces = self._read_forces(data)
        if self.acting is not None:
            self.acting.exert(data, 0.0)
        return PinsAndTorque(couple, forces), accelerations

    def _solve_drive(self, rows: Array, needed: Array) -> tuple[float, Array]:
        """Solve for the drive, N m or N, and the multipliers of rigid pins, (m,), N.

        `rows`: derivative of the closures, (m, nv); `needed`: generalized forces of the
        motion, (nv,).
        """
        if self.acting is None:
            free = rows[:, self.passive]
            multipliers = _solve_least_squares(free.T, needed[self.passive])
            couple = needed[self.drive] - rows[:, self.drive] @ multipliers
            return float(self.sense * couple), multipliers
        moving = [self.drive, *self.passive]
        pull = self.acting.find_pull(self.closing)[moving]
        # without the pull the closures bear what is across it
        level = pull / np.linalg.norm(pull)
        away = np.eye(len(moving)) - np.outer(level, level)
        columns = rows[:, moving].T
        multipliers = _solve_least_squares(away @ columns, away @ needed[moving])
        left = needed[moving] - columns @ multipliers
        return float(left @ level / np.linalg.norm(pull)), multipliers

    def _balance(self, start: Array) -> Array:
        """Return the joint forces that leave the other hinges alone, (nv,).

        The hinges are those that are not driven.
        """
        model = self.model
        data = self.data
        passive = self.passive
        accelerations = start.copy()
        mujoco.mj_forward(model, data)
        loads = data.qfrc_actuator.copy()

        def forces(at: Array) -> Array:
            data.qacc[:] = at
            mujoco.mj_inverse(model, data)
            return np.asarray(data.qfrc_inverse - loads)

        residual = forces(accelerations)
        for _ in range(_SOLVE_STEPS):
            bias = np.abs(data.qfrc_bias[passive])
            inertial = bias + np.abs(data.qfrc_constraint[passive])
            allowed = _BALANCED * (inertial.max() or 1.0)
            if np.all(np.abs(residual[passive]) <= allowed):
                break
            slopes = np.empty((len(passive), len(passive)))
            size = max(float(np.abs(accelerations[passive]).max()), 1.0)
            for column, dof in enumerate(passive):
                moved = accelerations.copy()
                moved[dof] += size
                change = (forces(moved) - residual)[passive]
                slopes[:, column] = change / size
            step = np.linalg.lstsq(slopes, -residual[passive], rcond=None)[0]
            part = 1.0
            before = np.abs(residual[passive]).max()
            while True:
                moved = accelerations.copy()
                moved[passive] += part * step
                trial = forces(moved)
                after = np.abs(trial[passive]).max()
                if after < before or part < 1e-6:
                    break
                part *= 0.5
            if after >= before:
                break
            accelerations = moved
            residual = trial
        forces(accelerations)
        return np.asarray(residual)

    def _read_forces(self, data: mujoco.MjData) -> dict[str, Array]:
        """Return the pin forces of an evaluated state in the plane's axes, (2,), N."""
        ground_body = self.loop.bodies[1][0]
        ground = data.xmat[ground_body].reshape(3, 3)
        across = np.cross(self.loop.axis, self.loop.along)
        axes = np.array(
            [
                ground @ self.loop.along,
                ground @ across,
            ]
        )
        forces = {}
        for pin, name in FORCE_AT.items():
            joint = self.loop.hinges.get(pin)
            if joint is None:
                force, bar = self._read_closure(data, pin)
            else:
                body = int(self.model.jnt_bodyid[joint])
                force = self.bearers.read(data, body)
                bar = self._find_bar(body, pin)
            _, acted_on = FORCE_BETWEEN[name]
            sign = 1.0 if bar == acted_on else -1.0
            forces[name] = sign * (axes @ force)
        return forces

    def _read_closure(self, data: mujoco.MjData, pin: str) -> tuple[Array, int]:
        """Sum the forces of the equalities at the cut pin.

        Return the sum and the bar that it acts on.
        """
        total = np.zeros(3)
        bars = []
        for equality in self.loop.closures:
            first_body = find_tied_bodies(self.model, equality)[0]
            bar = self._find_bar(first_body, pin)
            bars.append(bar)
            sign = 1.0 if bar == bars[0] else -1.0
            total += sign * read_equality_force(data, equality)
        return total, bars[0]

    def _find_bar(self, body: int, pin: str) -> int:
        """Return which of the two bars of a pin a body belongs to."""
        for above in climb(self.model, body):
            for bar in PINS[pin]:
                if above in self.loop.bodies[bar] and bar != 1:
                    return bar
        return 1

    def answer_states(
        self,
        theta_2: Sequence[float],
        omega_2: float,
        alpha_2: float,
    ) -> InsideAnswer:
        """Answer at closed states, each by itself.

        States in which the bars of pin B are in line are left out and listed.
        """
        answer = InsideAnswer()
        in_line = []
        for angle in theta_2:
            state = self.state(angle, omega_2)
            if state is None:
                answer.open.append(angle)
                continue
            if self._is_in_line(state.qpos):
                in_line.append(float(state.qpos[self.address]))
                continue
            answer.rows.append(self.ask(state.qpos, state.qvel, alpha_2))
        answer.in_line = tuple(in_line)
        return answer

    def answer_through_time(
        self,
        theta_2: Sequence[float],
        omega_2: float,
        alpha_2: float,
        heavy: float = HEAVY,
    ) -> InsideAnswer:
        """Step the whole robot through the angles.

        Timestep, integrator and solver are those of the file. Each joint that is held,
        and the driven one, gets an armature of `heavy` times the robot's largest
        inertia. The couple that a state asks for acts on the driven one until the next,
        so that its speed is kept.
        """
        answer = InsideAnswer()
        angles = sorted(theta_2, reverse=omega_2 < 0.0)
        model = copy(self.model)
        data = mujoco.MjData(self.model)
        timestep = float(model.opt.timestep)
        armature = self.find_carrier(heavy)
        model.dof_armature[self.held] += armature
        if self.flywheel:
            armature = self.flywheel
        else:
            model.dof_armature[self.drive] += armature
        state = self.state(angles[0], omega_2)
        if state is None:
            raise LimitError("the loop does not close where the motion starts")
        data.qpos[:] = state.qpos
        data.qvel[:] = state.qvel

        def drive(row: InsideRow) -> None:
            couple = armature * alpha_2 + self._find_crank_couple(row, data)
            data.qfrc_applied[self.drive] = self.sense * couple

        mujoco.mj_forward(self.model, data)
        drive(self.ask(state.qpos, state.qvel, alpha_2))
        stepper = Stepper(model, data, timestep)
        instants = [
            _find_instant(angles[0], angle, omega_2, alpha_2) for angle in angles
        ]
        duration = instants[-1]
        timesteps = duration / timestep
        if not 1.0 <= timesteps <= MOST_TIMESTEPS:
            raise LimitError(
                f"its timestep of {timestep:g} s makes {timesteps:.3g}"
                f" steps of the motion; must be 1 to {MOST_TIMESTEPS}: --speed states"
                " another speed"
            )
        spent = 0.0
        self._doubtful.clear()
        # the loop starts exactly closed, and takes some time constants to yield as far
        # as it does
        answer.settling = settling_time(self.find_constant(), duration)
        for instant in instants[1:]:
            if instant < answer.settling:
                answer.skipped += 1
                continue
            began = time.process_time()
            stepper.to(instant)
            spent += time.process_time() - began
            mujoco.mj_forward(model, data)
            if stepper.lost() or _has_warned(data):
                answer.lost = "MuJoCo lost the motion: a value not finite, or too large"
                break
            acceleration = float(self.sense * data.qacc[self.drive])
            row = self.ask(data.qpos, data.qvel, acceleration)
            answer.rows.append(row)
            drive(row)
            if self._left_assembly(answer, data.qpos):
                break
        if answer.other_assembly is not None and not answer.rows:
            raise LimitError(OTHER_ASSEMBLY)
        answer.seconds_per_step = spent / max(stepper.done, 1)
        return answer

    def _find_crank_couple(self, row: InsideRow, data: mujoco.MjData) -> float:
        """Return the couple on bar 2 with the power of a row's drive, N m."""
        if not math.isfinite(row.soft.torque):
            return 0.0
        if self.acting is None:
            return row.soft.torque
        return row.soft.torque * self.acting.find_speed(data) / row.omega_2

    def _left_assembly(self, answer: InsideAnswer, qpos: Array) -> bool:
        """Tell whether the last row is in the other assembly, and drop such rows.

        Beside a change point, where a loop that has yielded is in neither, the rows
        before tell.
        """
        row = answer.rows[-1]
        closed = self.close(row.theta_2)
        assert closed is not None  # the row was evaluated there
        now, due = (self._measure_sine(pose) for pose in (qpos, closed))
        if now * due > 0.0:
            self._doubtful.clear()
            return False
        self._doubtful.append(row)
        if min(abs(now), abs(due)) <= _SINE_OF_AN_ASSEMBLY:
            return False
        answer.other_assembly = self._doubtful[0].joint
        del answer.rows[-len(self._doubtful) :]
        return True

    def find_constant(self) -> float:
        """Return the time constant of the closure, s."""
        return find_time_constant(self.model, self.loop.equality)

    def answer_under_torque(
        self,
        theta_2: Iterable[float],
        torque: float,
        seconds: float,
    ) -> list[TornState]:
        """Let a motor's torque act from rest at each angle, for some time.

        The other joints are held. A state is the one of the largest gap on the way from
        each angle; of a motion that MuJoCo loses there is none.
        """
        states = []
        model = copy(self.model)
        data = mujoco.MjData(self.model)
        model.dof_armature[self.held] += self.find_carrier(HEAVY)
        # the motor may meet the stops of the file
        model.opt.disableflags &= ~(LIMITS_OFF & ~self.flags)
        steps = max(round(seconds / model.opt.timestep), 1)
        for angle in theta_2:
            state = self.state(angle, 0.0)
            if state is None:
                continue
            mujoco.mj_resetData(model, data)
            data.qpos[:] = state.qpos
            worst: TornState | None = None
            for _ in range(steps):
                data.qfrc_applied[self.drive] = self.sense * torque
                mujoco.mj_step(model, data)
                mujoco.mj_forward(model, data)
                mujoco.mj_rnePostConstraint(model, data)
                if _has_warned(data):
                    start = float(state.qpos[self.address])
                    worst = TornState(start, math.inf, {})
                    break
                gap = self._measure_gap(data.qpos)
                if worst is None or gap > worst.gap:
                    joint = float(data.qpos[self.address])
                    worst = TornState(joint, gap, self._read_forces(data))
            assert worst is not None
            states.append(worst)
        return states


def _solve_least_squares(matrix: Array, right: Array) -> Array:
    """Solve for the least step; directions that move nothing count as none."""
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-9)[0])


def _measure_drift(data: mujoco.MjData, speeds: Array) -> Array:
    """Return -(dJ/dt) v of the constraints, from the reference that MuJoCo gives them.

    The reference is -(dJ/dt) v - B (J v) - K I r. `speeds`: J v.
    """
    parameters = data.efc_KBIP[: data.nefc]
    damper = parameters[:, 1]
    spring = parameters[:, 0] * parameters[:, 2]
    drift = data.efc_aref[: data.nefc] + damper * speeds
    return np.asarray(drift + spring * data.efc_pos[: data.nefc])


def _has_warned(data: mujoco.MjData) -> bool:
    """Tell whether MuJoCo has warned that it loses the motion."""
    return any(data.warning[kind].number for kind in WARNINGS)


def find_time_constant(model: mujoco.MjModel, equality: int) -> float:
    """Return the time constant of an equality, s."""
    stiffness, damping = model.eq_solref[equality]
    if stiffness > 0.0:
        return float(stiffness)
    # stated as -stiffness and -damping: that of a critically damped closure
    if damping:
        return 2.0 / abs(float(damping))
    return 0.0


def settling_time(constant: float, seconds: float) -> float:
    """Return the time after which a loop that starts closed has yielded, s.

    Parameters
    ----------
    constant : time constant of its closure, s.
    seconds : duration of the motion, s.
    """
    return min(SETTLING_TIME * constant, 0.5 * seconds)


def turn_hinges(
    model: mujoco.MjModel,
    loop: RobotLoop,
    theta_2: float,
    theta_3: float,
    theta_4: float,
) -> Array:
    """Return the pose in which the bars of a loop have these angles, (nq,).

    Each hinge but the driven one turns by less than half a turn.
    """
    turned_2 = theta_2 - loop.angles[1]
    turned_3 = theta_3 - loop.angles[2]
    turned_4 = theta_4 - loop.angles[3]
    turns = {
        "O2": turned_2,
        "A": math.remainder(turned_3 - turned_2, math.tau),
        "B": math.remainder(turned_4 - turned_3, math.tau),
        "O4": math.remainder(turned_4, math.tau),
    }
    qpos = loop.qpos.copy()
    for pin, joint in loop.hinges.items():
        qpos[model.jnt_qposadr[joint]] += loop.senses[pin] * turns[pin]
    return qpos


def reflect(model: mujoco.MjModel, loop: RobotLoop) -> Array | None:
    """Return the pose of the other assembly at the same angle of bar 2, (nq,).

    Bars 3 and 4 are reflected in the line from A to O4, and the gap of the engine is
    closed from there. None where it does not close.
    """
    ground, crank = loop.lengths[:2]
    theta_1, theta_2, theta_3, theta_4 = loop.angles
    line = cmath.rect(ground, theta_1) - cmath.rect(crank, theta_2)
    direction = cmath.phase(line)
    reflected = (2.0 * direction - theta_3, 2.0 * direction - theta_4)
    qpos = turn_hinges(model, loop, theta_2, *reflected)
    # put together anew, no spring is wound by more than half a turn
    for pin, joint in loop.hinges.items():
        if pin == "O2":
            continue
        address = model.jnt_qposadr[joint]
        drawn = model.qpos0[address]
        qpos[address] = drawn + math.remainder(qpos[address] - drawn, math.tau)
    if not LoopInside(model, loop).close_gap(qpos):
        return None
    return qpos


def _find_instant(
    start: float,
    angle: float,
    omega: float,
    alpha: float,
) -> float:
    """Return the time at which a motion passes an angle, s.

    Raises LimitError if it comes to rest before.
    """
    turned = angle - start
    squared = omega**2 + 2.0 * alpha * turned
    if squared <= 0.0:
        raise LimitError(f"alpha_2 brings the input to rest before {angle:.6g} rad")
    speed = math.copysign(math.sqrt(squared), omega)
    return 2.0 * turned / (omega + speed)
