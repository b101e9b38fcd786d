"""A four-bar inside somebody's whole robot.

MuJoCo gives its torque and pin forces there. No joint is removed, for that would change
the softness that is measured: MuJoCo sizes a constraint's softness by the bodies of the
whole model. One bar of the loop moves as commanded, the other joints of the robot stay
where they are, contacts, joint limits and motors are off, and so are equalities between
the moving bars and joints that stay. A file that holds nothing but the loop may be
taken as it is: only what drives the hinge of the commanded bar is off then.

At a state the joint forces follow from MuJoCo's own inverse dynamics of its soft
constraints. The commanded bar has the acceleration alpha, a held joint none, and the
accelerations x of the hinges that follow are those at which

    basis^T (M a(x) + c - J^T f(a(x))) = 0

since nothing acts on them. The forces that hold the joints are then known, and the
couple on the bar, or what its drive exerts, is found by `mj_forward`, with the solver
of the file.

Were the pins rigid, J a = -(dJ/dt) v would hold, with multipliers in the place of f,
and dry friction in full: that couple and these pin forces are what MuJoCo's are
compared with, in the same model.
"""

import math
import time
from collections.abc import Iterable, Iterator
from copy import copy
from typing import Any, NamedTuple

import mujoco
import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import ENDS, MOVING_BARS, PINS, Bar, FourBar
from fourbar.mjcf.document import WindowMotion
from fourbar.quantities import Array, Signs
from fourbar.scene import Scene, command, find_signs
from fourbar.scene.motion import OPEN
from fourbar_validation.engines.description import FORCE_AT, FORCE_BETWEEN
from fourbar_validation.engines.free_body_closure import close
from fourbar_validation.engines.mujoco.closed_loop import WARNINGS, find_couple
from fourbar_validation.engines.mujoco.robots.ancestry import (
    find_bits,
    find_tied_bodies,
    is_enabled,
    list_actuators,
    name_joint,
    take_control,
)
from fourbar_validation.engines.mujoco.robots.drive import LoopDrive
from fourbar_validation.engines.mujoco.robots.loop_facts import (
    DRIVEN_PINS,
    FOLLOWING,
    OTHER_ASSEMBLY,
    InsideAnswer,
    RobotLoop,
    TornState,
    is_in_line,
    record_states,
    varies,
)
from fourbar_validation.engines.mujoco.robots.planes import (
    copy_for_closures,
    evaluate_closures,
    find_bearer_forces,
    read_equality_force,
)
from fourbar_validation.engines.mujoco.robots.seen import LoopFrame
from fourbar_validation.engines.mujoco.runner import Stepper

CLOSED = 1e-15
"""m or rad; residual of the closure at which a state is closed: a stiff constraint
turns 1e-12 m into 1e-6 N. Steps end before it where rounding leaves more.
"""
_CLOSING_STEPS = 50
RESIDUAL_OF_AN_OPEN_LOOP = 1e-6
"""Residual above which the loop does not close at a position, m or rad."""
_STRIDE = math.radians(2.0)
"""Largest turn of the commanded bar from one closed state to the next. The assembly is
kept so.
"""
LEAST_SINE = 1e-5
"""|sin(theta_4 - theta_3)| below which the bars of pin B are in line. A closed pose is
known to the residual over it, and to less than that below.
"""
GAP_OF_ROUNDING = 2.0
"""Gap of a closed loop over the rounding of its lengths. Where the bars are in line the
least gap is that rounding, and Newton's steps end beside it.
"""
KNOWN_TRANSMISSION = 0.01
"""Part of the angle between bars 3 and 4 up to which the digits of a file may turn it:
forces have two digits.
"""
_BALANCED = 1e-14
"""Relative step of the hinges' accelerations at which nothing is left that acts on
them.
"""
HEAVY = 1e4
"""Armature that holds a joint while the model is stepped, over the largest inertia of
the robot. It lets the joints move by about its inverse; beyond 1e5 MuJoCo's solver
loses the light bars beside it: at 1e6 the gap was three times too large.
"""
LIMITS_OFF = find_bits("limit")
SETTLING_TIME = 5.0
"""Time constants after which the loop has yielded but for 1 %, at most half of the
motion.
"""
_TOUCHED = 1e-9
"""rad; a position that is no farther beyond a limit is at it: scenes state angles with
twelve digits.
"""
_PASSED = 10.0
"""Timesteps by which a simulated motion may pass its end, where a joint may have its
stop: a hinge may turn faster than the commanded bar. Single states meet other stops.
"""
_DRIVING = 1e3
"""Armature over all other inertia from which it is a flywheel that drives. The speed
then ripples by 1e-3.
"""
_SINE_OF_AN_ASSEMBLY = 0.1
"""|sin(theta_4 - theta_3)| from which a loop that has yielded is in one assembly. A gap
of a thousandth of the bars turns them by its root beside a change point.
"""
MOST_TIMESTEPS = 130_000
"""Steps of one run: two turns at 1 rad/s and a timestep of 0.1 ms. At 0.1 ms a step of
a humanoid these are 13 seconds.
"""


class _RobotState(NamedTuple):
    """Closed state of a robot."""

    qpos: Array
    qvel: Array


class LoopInside:
    """A loop of a robot of which one bar moves as commanded.

    Every other joint of the robot is held. A motion of the loop is written as

        dq = basis x + step phi,    turn . dq = phi,    turn . basis = 0,

    with phi the turn of the commanded bar and x what follows: a couple on the bar is
    the generalized force `turn`, whichever hinges bear the bar.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        loop: RobotLoop,
        scene: Scene | None = None,
        *,
        as_it_is: bool = False,
    ) -> None:
        """Take a loop.

        Parameters
        ----------
        scene : tells the commanded bar, what drives it, and the assembly where the bars
            that follow are in line in the pose; None: a couple on bar 2, and the open
            one.
        as_it_is : contacts, joint limits and other motors act as in the file.
        """
        self.loop = loop
        self.given = model
        self.scene = scene
        self.as_it_is = as_it_is
        self.bar = bar = 2 if scene is None else command(scene).bar
        self.drive = LoopDrive(model, loop, scene)
        self.model = copy(model)
        self.joint = loop.hinges.get(DRIVEN_PINS.get(bar, ""))
        """Hinge between the ground and the commanded bar, if the file has one."""
        self.taken_off = list_actuators(model, self.joint)
        """Actuators on that hinge."""
        self._switch_off()
        self.data = mujoco.MjData(self.model)
        # the closure alone, for kinematics: with every row, and a dense derivative
        self.closure = copy_for_closures(self.model, loop.closures)
        self.closing = mujoco.MjData(self.closure)
        joints = [*loop.hinges.values()]
        self.moving: list[int] = model.jnt_dofadr[joints].tolist()
        self.addresses = model.jnt_qposadr[joints]
        self.held = [dof for dof in range(model.nv) if dof not in self.moving]
        self._evaluate_closure(loop.qpos)
        self.turn = self._find_turn()
        self.lead = int(np.flatnonzero(self.turn)[-1])
        """Degree of freedom of the driven hinge, if the file has one."""
        self.step = self.turn / (self.turn @ self.turn)
        of_moving = self.turn[None, self.moving]
        self.basis = np.zeros((model.nv, len(joints) - 1))
        self.basis[self.moving] = np.linalg.svd(of_moving)[2][1:].T
        crank, coupler, output = map(Bar, loop.met[1:])
        self.linkage = FourBar(loop.met[0], crank, coupler, output, loop.angles[0])
        first, second = (loop.angles[one - 1] for one in FOLLOWING[bar])
        self.signs = np.array([1 if math.sin(second - first) > 0.0 else -1], np.int8)
        """Sign of the sine of the angle between the bars that follow in the pose."""
        self.assembly: Signs | int = OPEN if scene is None else scene.motion.branch
        if not is_in_line(loop.angles, bar):
            at_pose = np.array([loop.angles[bar - 1]])
            self.assembly = find_signs(self.linkage, at_pose, self.signs, bar)
        self._theta = np.array(loop.angles)
        """theta_1 to theta_4 at the last pose, with their whole turns, rad."""

        self.flywheel = 0.0
        """Part of the armature of the driven hinge that keeps its speed, kg m^2. Its
        torque is none of the drive's.
        """
        self.stopped = set[int]()
        """Joints that were at a limit of their range in some state."""
        self.contacts = 0
        """Most contacts in a state."""

    def _switch_off(self) -> None:
        """Switch off what acts on the loop beside its drive."""
        off = self.taken_off
        model = self.model
        if self.as_it_is:
            # a sweep ends at the limits of a joint, to round-off on either side
            model.jnt_margin[:] -= _TOUCHED
        else:
            model.opt.disableflags |= LIMITS_OFF | find_bits("contact")
            off = [*off, *np.flatnonzero(take_control(model))]
        off = [*off, *self.drive.cylinders]
        model.actuator_gainprm[off] = 0.0
        model.actuator_biasprm[off] = 0.0
        # while joints are held, what ties them to the moving bars would only be torn
        model.eq_active0[list(self.loop.other_equalities)] = 0

    def _find_turn(self) -> Array:
        """Return the turn of the commanded bar by each degree of freedom, (nv,)."""
        turn = np.zeros(self.model.nv)
        turns = np.zeros((3, self.model.nv))
        body = self.loop.bodies[self.bar][0]
        mujoco.mj_jacBody(self.closure, self.closing, None, turns, body)
        # axes are parallel but for what a file misaligns: each turns by one, or not
        turn[self.moving] = np.rint(self.frame.normal @ turns)[self.moving]
        return turn

    def find_flywheel(self, inertia: float) -> None:
        """Take an armature of the driven hinge for a flywheel if it drives.

        `inertia`: of the flywheels of the scene, kg m^2, which count as load.
        """
        if self.joint is None:
            return
        armature = float(self.model.dof_armature[self.lead])
        others = float(self.model.dof_M0.sum() - self.model.dof_armature.sum())
        if armature > _DRIVING * (others + inertia):
            self.flywheel = armature

    def _hold_others(self) -> tuple[mujoco.MjModel, float]:
        """Return a model whose armatures hold the other joints, their size, kg m^2."""
        model = copy(self.model)
        inertias = model.dof_M0.copy()
        inertias[self.lead] -= self.flywheel
        armature = HEAVY * float(inertias.max())
        model.dof_armature[self.held] += armature
        # the solver counts its tolerance in parts of the mean inertia
        mean = model.stat.meaninertia
        model.opt.tolerance *= mean / (mean + armature * len(self.held) / model.nv)
        return model, armature

    def angle(self, qpos: Array) -> float:
        """Return the angle of the commanded bar in a pose, rad."""
        turned = (qpos - self.loop.qpos)[self.addresses]
        return float(self.loop.angles[self.bar - 1] + self.turn[self.moving] @ turned)

    def position(self, angle: float) -> float:
        """Return the position of the driven joint at an angle of the commanded bar.

        Without a hinge between the bar and the ground it is the angle itself, rad.
        """
        if self.joint is None:
            return angle
        turned = angle - self.loop.angles[self.bar - 1]
        address = self.model.jnt_qposadr[self.joint]
        return float(self.loop.qpos[address] + self.turn[self.lead] * turned)

    def _read_position(self, qpos: Array) -> float:
        """Return the position of the driven joint in a pose, as `position` does."""
        return self.position(self.angle(qpos))

    def close(self, wanted: float) -> Array | None:
        """Return the pose at an angle of the commanded bar, or None if it is open.

        The bars are followed from the last pose in strides, so that whole turns of the
        hinges count, and through change points as a scene does.
        """
        start = self._theta[self.bar - 1]
        strides = max(math.ceil(abs(wanted - start) / _STRIDE), 1)
        angles = np.linspace(start, wanted, strides + 1)
        qpos = self._follow(self.turn_bars(angles))
        return qpos if self.close_gap(qpos) else None

    def turn_bars(self, angles: Array, signs: Signs | None = None) -> Array:
        """Return theta_1 to theta_4 at angles of the commanded bar, (n, 4), rad.

        The others go on from the last pose; where the loop is open they are NaN.
        `signs`: of the sine of the angle from the first bar that follows to the second;
        None: those of the assembly of the pose.
        """
        if signs is None:
            signs = find_signs(self.linkage, angles, self.assembly, self.bar)
        closed = close(self.linkage, angles, signs, self.bar)
        theta = np.full((len(angles), len(self._theta)), self.linkage.ground_angle)
        theta[:, [bar - 1 for bar in FOLLOWING[self.bar]]] = closed.theta.T
        path = [self._theta, *theta[closed.assembled]]
        theta[closed.assembled] = np.unwrap(path, axis=0)[1:]
        theta[:, self.bar - 1] = angles
        return theta

    def _follow(self, theta: Array) -> Array:
        """Return the pose at the last angles that `turn_bars` returns, (nq,).

        Angles at which the loop is open are passed over.
        """
        loop = self.loop
        closed = theta[np.isfinite(theta).all(axis=1)]
        self._theta = [self._theta, *closed][-1]
        self._theta[self.bar - 1] = theta[-1, self.bar - 1]
        turned = self._theta - loop.angles
        qpos = loop.qpos.copy()
        for pin, joint in loop.hinges.items():
            first, second = (turned[bar - 1] for bar in PINS[pin])
            qpos[self.model.jnt_qposadr[joint]] += loop.senses[pin] * (second - first)
        return qpos

    def reflect(self) -> Array | None:
        """Return the pose of the other assembly at the same commanded angle, (nq,).

        None where it does not close.
        """
        angle = np.array([self.loop.angles[self.bar - 1]])
        qpos = self._follow(self.turn_bars(angle, -self.signs))
        # put together anew, no spring is wound by more than half a turn
        for joint in {*self.loop.hinges.values()} - {self.joint}:
            address = self.model.jnt_qposadr[joint]
            drawn = self.model.qpos0[address]
            qpos[address] = drawn + math.remainder(qpos[address] - drawn, math.tau)
        return qpos if self.close_gap(qpos) else None

    def close_gap(self, qpos: Array) -> bool:
        """Move the hinges that follow until the closure's residual is least.

        Return whether the loop is then closed.
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
            if size <= CLOSED:
                break
            turns = _solve_least_squares(jacobian @ self.basis, -residual)
            qpos[self.addresses] += (self.basis @ turns)[self.moving]
        # axes that are not parallel leave a gap
        skew = self.loop.misaligned * max(self.loop.lengths)
        rounding = GAP_OF_ROUNDING * self.loop.rounding
        qpos[:] = best
        return least <= max(RESIDUAL_OF_AN_OPEN_LOOP, skew, rounding)

    def measure_sine(self, qpos: Array) -> float:
        """Return the sine of the angle between the bars that follow in a pose."""
        self._evaluate_closure(qpos)
        first, second = map(self.frame.line, FOLLOWING[self.bar])
        product = first.conjugate() * second
        return product.imag / abs(product)

    def _is_in_line(self, qpos: Array) -> bool:
        """Tell whether the bars that follow are in line: at a change point or a limit.

        The loop may go on in two ways there, or no way, and forces are not determined.
        Nor are they where the digits of the file turn these bars by a part of the
        angle between them, which is their rounding over the squared sine.
        """
        sine = abs(self.measure_sine(qpos))
        turned = self.loop.rounding / self.loop.longest
        return sine < LEAST_SINE or turned > KNOWN_TRANSMISSION * sine**2

    def _evaluate_closure(self, qpos: Array) -> tuple[Array, Array]:
        """Return the closure's residual in the plane, (m,), and its derivative."""
        data = self.closing
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(self.closure, data)
        self.frame = LoopFrame(self.loop, data)
        normals = dict.fromkeys(self.loop.closures, self.frame.normal)
        return evaluate_closures(self.closure, data, normals)

    def state(self, angle: float, speed: float) -> _RobotState | None:
        """Return the closed state at an angle and a speed of the commanded bar.

        None if the loop does not close.
        """
        qpos = self.close(angle)
        if qpos is None:
            return None
        _, jacobian = self._evaluate_closure(qpos)
        turns = _solve_least_squares(jacobian @ self.basis, -jacobian @ self.step)
        return _RobotState(qpos, speed * (self.step + self.basis @ turns))

    def ask(self, qpos: Array, qvel: Array, wanted: float) -> Any:
        """Evaluate a state in which the commanded bar accelerates as wanted, rad/s^2.

        The couple on it, or what its drive exerts, is solved for. A record of STATE is
        returned.

        Raises
        ------
        LimitError : the loop does not close at its angle, or its drive does not move
            it.
        """
        model = self.model
        data = self.data
        qpos = qpos.copy()
        qvel = qvel.copy()
        angle = self.angle(qpos)
        speed = float(self.turn @ qvel)
        closed = self.state(angle, speed)
        if closed is None:
            raise LimitError(
                f"the loop does not close at {self.name} = {angle:.6g} rad"
            )
        rigid, accelerations = self._solve_rigid(closed, wanted)

        def place() -> None:
            mujoco.mj_resetData(model, data)
            data.qpos[:] = qpos
            data.qvel[:] = qvel

        holding = np.zeros(model.nv)
        if self.held:
            place()
            holding[self.held] = self._balance(accelerations)[self.held]
        place()
        mujoco.mj_kinematics(model, data)
        carried = self.flywheel * wanted

        def accelerate(size: float) -> float:
            data.qfrc_applied[:] = holding + self.turn * carried
            self.drive.exert(data, size)
            mujoco.mj_forward(model, data)
            return float(self.turn @ data.qacc)

        size = find_couple(model, data, accelerate, wanted)
        if size is None:
            raise LimitError(f"its drive does not move {self.name} in this robot")
        self.contacts = max(self.contacts, int(data.ncon))
        limits = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
        self.stopped.update(data.efc_id[: data.nefc][limits].tolist())
        forces = self._read_forces(model, data)
        if math.isnan(size):
            forces *= np.nan
        row = (
            angle,
            speed,
            wanted,
            self._read_position(qpos),
            (size, *forces),
            rigid,
            self._measure_gap(qpos),
            self._read_bars(data),
            self.measure_sine(closed.qpos),
        )
        return record_states([row])[0]

    def list_unmet_stops(self) -> list[int]:
        """List the hinges of the loop whose stops ended no state."""
        limits = is_enabled(self.model, "limit", "constraint")
        return [
            joint
            for joint in self.loop.hinges.values()
            if limits and self.model.jnt_limited[joint] and joint not in self.stopped
        ]

    def _read_bars(self, data: mujoco.MjData) -> tuple[float, ...]:
        """Return angles and speeds of the moving bars in an evaluated state."""
        self._evaluate_closure(data.qpos)
        bodies = [self.loop.bodies[bar][0] for bar in ENDS]
        ground, *speeds = data.cvel[bodies, :3] @ self.frame.normal
        turning = (float(speed - ground) for speed in speeds)
        return (*map(self.frame.angle, MOVING_BARS), *turning)

    def _measure_gap(self, qpos: Array) -> float:
        """Measure the distance of the ends of the closure in the plane, m."""
        residual, _ = self._evaluate_closure(qpos)
        return math.hypot(*residual[:3])

    @property
    def lever(self) -> float:
        """Factor of pin forces that makes them of the drive's kind, m or 1."""
        return self.loop.longest if self.drive.force is None else 1.0

    @property
    def name(self) -> str:
        """Name of the driven joint, or of the commanded angle if there is none."""
        if self.joint is None:
            return f"theta_{self.bar}"
        return name_joint(self.model, self.joint)

    def _solve_rigid(
        self,
        state: _RobotState,
        wanted: float,
    ) -> tuple[tuple[Any, ...], Array]:
        """Solve for the drive and pin forces with rigid pins at a closed state.

        Return all accelerations too, (nv,).
        """
        model = self.closure
        data = self.closing
        data.qpos[:] = state.qpos
        data.qvel[:] = state.qvel
        mujoco.mj_forward(model, data)
        every = data.efc_J.reshape(-1, model.nv)[: data.nefc]
        rows, rubbing = np.split(every, [data.ne])
        accelerations = self.step * wanted
        due = _measure_drift(data, rows @ state.qvel) - rows @ accelerations
        turns = _solve_least_squares(rows @ self.basis, due)
        accelerations = accelerations + self.basis @ turns
        needed = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, needed, accelerations)
        needed += data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator
        # dry friction in full
        limits = data.efc_frictionloss[data.ne : data.nefc]
        needed += rubbing.T @ (limits * np.sign(rubbing @ state.qvel))
        needed -= self.turn * self.flywheel * wanted
        # M a + c = J^T f + pull s on the hinges of the loop
        columns = np.vstack([rows, self.drive.find_pull(data)]).T[self.moving]
        *multipliers, size = _solve_least_squares(columns, needed[self.moving]).tolist()
        data.qacc[:] = accelerations
        data.efc_force[: data.ne] = multipliers
        self.drive.exert(data, size)
        forces = self._read_forces(model, data)
        self.drive.exert(data, 0.0)
        return (size, *forces), accelerations

    def _balance(self, accelerations: Array) -> Array:
        """Return the joint forces that leave the hinges that follow alone, (nv,).

        `accelerations`: those with rigid pins, (nv,), from which the others differ.
        """
        from scipy.optimize import root

        model = self.model
        data = self.data
        mujoco.mj_forward(model, data)
        loads = data.qfrc_actuator.copy()
        size = max(float(np.abs(accelerations[self.moving]).max()), 1.0)

        def find_forces(turns: Array) -> Array:
            data.qacc[:] = accelerations + self.basis @ (size * turns)
            mujoco.mj_inverse(model, data)
            return np.asarray(data.qfrc_inverse - loads)

        def leave(turns: Array) -> Array:
            return find_forces(turns) @ self.basis

        def differ(turns: Array) -> Array:
            # the forces are linear but where dry friction reaches its couple
            changes = [leave(turns + step) for step in np.eye(len(turns))]
            return np.column_stack(changes) - leave(turns)[:, None]

        start = np.zeros(len(self.moving) - 1)
        return find_forces(root(leave, start, jac=differ, tol=_BALANCED).x)

    def _read_forces(self, model: mujoco.MjModel, data: mujoco.MjData) -> Array:
        """Return the pin forces of an evaluated state, (4, 2), N.

        Rows are in the order of PIN_FORCES.
        """
        loop = self.loop
        bearing = find_bearer_forces(model, data)
        forces = np.zeros((len(FORCE_AT), 3))
        for row, (pin, name) in enumerate(FORCE_AT.items()):
            if pin in loop.hinges:
                body = model.jnt_bodyid[loop.hinges[pin]]
                parts = [(body, bearing[body])]
            else:
                bodies = [find_tied_bodies(model, one)[0] for one in loop.closures]
                pulls = [read_equality_force(data, one) for one in loop.closures]
                parts = [*zip(bodies, pulls, strict=True)]
            _, acted_on = FORCE_BETWEEN[name]
            for body, part in parts:
                forces[row] += part if loop.bars[body] == acted_on else -part
        return forces @ LoopFrame(loop, data).axes.T

    def answer_states(self, motion: Array) -> InsideAnswer:
        """Answer at closed states, each by itself.

        States in which the bars that follow are in line are left out and listed.
        """
        answer = InsideAnswer()
        rows = []
        for angle, speed, acceleration in motion.tolist():
            state = self.state(angle, speed)
            if state is None:
                answer.open.append(angle)
            elif self._is_in_line(state.qpos):
                answer.in_line.append(self._read_position(state.qpos))
            else:
                rows.append(self.ask(state.qpos, state.qvel, acceleration))
        answer.rows = record_states(rows)
        return answer

    def answer_through_time(self, motion: Array) -> InsideAnswer:
        """Step the whole robot through the angles.

        Timestep, integrator and solver are those of the file. Each joint that is held,
        and the commanded bar, gets an armature of HEAVY times the robot's largest
        inertia. The couple that a state asks for acts on the bar until the next, so
        that its speed is kept.
        """
        answer = InsideAnswer()
        start, instants = self._list_instants(motion)
        _, omega, alpha = motion[0].tolist()
        speed = np.ptp(motion[:, 0]) / instants[-1]
        self.model.jnt_margin[:] -= _PASSED * self.model.opt.timestep * speed
        model, armature = self._keep_speeds()
        data = mujoco.MjData(self.model)
        state = self.state(start, omega)
        if state is None:
            raise LimitError("the loop does not close where the motion starts")
        data.qpos[:] = state.qpos
        data.qvel[:] = state.qvel

        def drive(row: Any) -> None:
            """Exert a couple on the bar with the power of a row's drive."""
            power = row.soft.torque * self.drive.find_speed(data)
            couple = power / row.speed if math.isfinite(power) else 0.0
            data.qfrc_applied[:] = self.turn * (armature * alpha + couple)

        mujoco.mj_forward(self.model, data)
        drive(self.ask(state.qpos, state.qvel, alpha))
        stepper = Stepper(model, data, model.opt.timestep)
        rows: list[Any] = []
        doubtful = 0  # number of the last rows that may be in the other assembly
        # the loop starts exactly closed, and takes some time constants to yield as far
        # as it does
        answer.settling = min(SETTLING_TIME * self.find_constant(), 0.5 * instants[-1])
        for instant in instants[1:]:
            if instant < answer.settling:
                answer.skipped += 1
                continue
            # a limit on processor time lets the clock of the process tick coarsely
            began = time.thread_time()
            done = stepper.done
            stepper.to(instant)
            if stepper.done > done:
                spent = (time.thread_time() - began) / (stepper.done - done)
                answer.seconds_per_step = min(answer.seconds_per_step, spent)
            mujoco.mj_forward(model, data)
            if stepper.lost() or _has_warned(data):
                answer.lost = "MuJoCo lost the motion: a value not finite, or too large"
                break
            row = self.ask(data.qpos, data.qvel, float(self.turn @ data.qacc))
            rows.append(row)
            drive(row)
            first, second = (row.bars[f"theta_{bar}"] for bar in FOLLOWING[self.bar])
            sine = math.sin(second - first)
            doubtful = doubtful + 1 if sine * row.sine <= 0.0 else 0
            # beside a change point a loop that has yielded is in no assembly
            if doubtful and min(abs(sine), abs(row.sine)) > _SINE_OF_AN_ASSEMBLY:
                answer.other_assembly = float(rows[-doubtful].joint)
                del rows[-doubtful:]
                break
        if answer.other_assembly is not None and not rows:
            raise LimitError(OTHER_ASSEMBLY)
        answer.rows = record_states(rows)
        return answer

    def _list_instants(self, motion: Array) -> tuple[float, list[float]]:
        """Return the angle at which a motion starts, rad, and when its angles pass, s.

        Raises LimitError for speeds of each position, or for too few steps or too many.
        """
        if varies(motion):
            raise LimitError(
                "omega or alpha differs from position to position: that is no one"
                " motion through time"
            )
        _, omega, alpha = motion[0].tolist()
        angles = sorted(motion[:, 0].tolist(), reverse=omega < 0.0)
        run = WindowMotion(angles[0], angles[-1], omega, alpha)
        instants = [*map(run.time, angles)]
        timestep = self.model.opt.timestep
        steps = instants[-1] / timestep
        if not 1.0 <= steps <= MOST_TIMESTEPS:
            raise LimitError(
                f"its timestep of {timestep:g} s makes {steps:.3g} steps of the motion;"
                f" must be 1 to {MOST_TIMESTEPS}: --speed states another speed"
            )
        return angles[0], instants

    def _keep_speeds(self) -> tuple[mujoco.MjModel, float]:
        """Return a model whose armatures keep speeds, and that of the commanded bar."""
        model, armature = self._hold_others()
        if self.flywheel:
            return model, self.flywheel
        if self.joint is not None:
            model.dof_armature[self.lead] += armature
        else:
            # about its own centre alone, and alike about every axis: it turns no other
            model.body_inertia[self.loop.bodies[self.bar][0]] += armature
        return model, armature

    def find_constant(self) -> float:
        """Return the time constant of the closure, s."""
        stiffness, damping = self.model.eq_solref[self.loop.equality].tolist()
        if stiffness > 0.0:
            # MuJoCo raises it to two timesteps unless a flag forbids that
            is_raised = is_enabled(self.model, "refsafe")
            return float(max(stiffness, 2.0 * self.model.opt.timestep * is_raised))
        # stated as -stiffness and -damping: that of a critically damped closure
        return 2.0 / abs(damping) if damping else 0.0

    def answer_under_torque(
        self,
        angles: Iterable[float],
        torque: float,
        seconds: float,
    ) -> list[TornState]:
        """Let a motor's torque act from rest at each angle, for some time.

        The other joints are held. A state is the one of the largest gap on the way from
        each angle; of a motion that MuJoCo loses there is none.
        """
        model, _ = self._hold_others()
        # the motor may meet the stops of the file
        model.opt.disableflags &= ~(LIMITS_OFF & ~self.given.opt.disableflags)
        model.jnt_margin[:] = self.given.jnt_margin
        steps = max(round(seconds / model.opt.timestep), 1)

        def let_go(qpos: Array) -> Iterator[TornState]:
            """Yield the states of a pose that is let go under the torque."""
            data = mujoco.MjData(model)
            data.qpos[:] = qpos
            for _ in range(steps):
                data.qfrc_applied[:] = self.turn * torque
                mujoco.mj_step(model, data)
                mujoco.mj_forward(model, data)
                if _has_warned(data):
                    joint = self._read_position(qpos)
                    yield TornState(joint, math.inf, np.empty((0, 2)))
                    return
                joint = self._read_position(data.qpos)
                gap = self._measure_gap(data.qpos)
                yield TornState(joint, gap, self._read_forces(model, data))

        starts = (self.close(angle) for angle in angles)
        return [
            max(let_go(start), key=lambda one: one.gap)
            for start in starts
            if start is not None
        ]


def _solve_least_squares(matrix: Array, right: Array) -> Array:
    """Solve for the least step; directions that move nothing count as none."""
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-9)[0])


def _measure_drift(data: mujoco.MjData, speeds: Array) -> Array:
    """Return -(dJ/dt) v of the equalities, from the reference that MuJoCo gives them.

    The reference is -(dJ/dt) v - B (J v) - K I r. `speeds`: J v.
    """
    parameters = data.efc_KBIP[: data.ne]
    damper = parameters[:, 1]
    spring = parameters[:, 0] * parameters[:, 2]
    drift = data.efc_aref[: data.ne] + damper * speeds
    return np.asarray(drift + spring * data.efc_pos[: data.ne])


def _has_warned(data: mujoco.MjData) -> bool:
    """Tell whether MuJoCo has warned that it loses the motion."""
    return any(data.warning[kind].number for kind in WARNINGS)
