"""Somebody's own MJCF of a linkage, and its torque and pin forces on a scene.

At one state: its own assembly and speeds, then the couple on the driven bar with which
its crank accelerates as commanded. The accelerations are linear in that couple, so a
few `mj_forward` find it; where the acceleration found is another one (dry friction,
joint limits, clamped actuators) the couple is bracketed, and where none gives the
acceleration this is said. Through time: the same, at the states that its own timestep,
integrator and closure lead to, a flywheel on pin O2 keeping the speed. The file's own
drive on that pin is taken off in both.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np

from fourbar.effects import Flywheel, Gravity
from fourbar.errors import FourBarError, InputError, LimitError
from fourbar.linkage import PINS
from fourbar.mjcf import choose_run, write_mjcf
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene import command as command_of
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines.description import (
    FORCE_BETWEEN,
    Value,
    list_unknowns,
    name_driving,
)
from fourbar_validation.engines.loaded import Assembled
from fourbar_validation.engines.loop import (
    MADE,
    Assembler,
    JointAngles,
    make_blank,
    read_each,
    split_answer,
)
from fourbar_validation.engines.mujoco.closed_loop import WARNINGS
from fourbar_validation.engines.mujoco.couple import find_couple
from fourbar_validation.engines.mujoco.describe import (
    STIFFEST,
    UNLIMITED_RANGE,
    Described,
    describe_model,
    mend_entry,
    set_entry,
)
from fourbar_validation.engines.mujoco.robots.ancestry import (
    describe_actuator,
    is_enabled,
)
from fourbar_validation.engines.mujoco.robots.compiled import (
    compile_robot,
    list_unknown_parts,
)
from fourbar_validation.engines.mujoco.robots.forces import (
    BearerForces,
    read_equality_force,
)
from fourbar_validation.engines.mujoco.robots.inside import (
    HEAVY,
    find_time_constant,
    settling_time,
)
from fourbar_validation.engines.mujoco.robots.loop import RobotFile
from fourbar_validation.engines.mujoco.robots.scene import is_seen_from_behind
from fourbar_validation.engines.mujoco.runner import (
    Stepper,
    find_assembled,
    order_in_time,
    split_segments,
)
from fourbar_validation.engines.mujoco.topology import Topology, find_topology
from fourbar_validation.engines.tree import solve_closed

FILE_AT_ONE_STATE = "mjcf-one-state"
FILE_THROUGH_TIME = "mjcf-simulated"
POSITIONS_OF_A_FILE = 37
"""Positions taken of a sweep: a file is judged as a whole, not position by position."""
MOST_STEPS_THROUGH_TIME = 400_000
"""A revolution at 628 steps per turn is a thousandth of this; more would be minutes."""
PRICING = 60.0
"""Seconds in which differences are tried one by one; each takes two evaluations."""
_TOUCHED = 1e-9
"""rad. A position that is no farther beyond a limit is at it: scenes state angles with
twelve digits, and the loop is assembled to 1e-12.
"""
_DRIVING = 1e3
"""Armature over all other inertia from which it is a flywheel that drives. The speed
then ripples by 1e-3.
"""
_SAME_GRAVITY = 1e-9
"""Part of gravity by which its direction may differ in the axes of a scene."""
GENERATED = Path("generated.xml")
"""Name of the file that is generated from a scene."""
_NO_BIAS = mujoco.mjtBias.mjBIAS_NONE
SHARED_WITH_THE_FILE = (
    "theta_2, omega_2, alpha_2 and the branch; the rest is the file's"
)
COMPUTED_FROM_THE_FILE = (
    "assembly, speeds, accelerations, drive torque and pin forces, by MuJoCo from the"
    " file as compiled"
)


@dataclass(slots=True)
class Examined:
    """Results of examining one file."""

    described: Described
    answers: list[Answer]
    notes: list[str]
    names: dict[str, str]
    """Role: body or site, as stated or guessed."""


@contextmanager
def collect_warnings() -> Iterator[list[str]]:
    """Collect the warnings of MuJoCo, each once.

    MuJoCo then neither prints nor logs them.
    """
    heard: list[str] = []

    def hear(warning: str) -> None:
        if warning not in heard:
            heard.append(warning)

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(hear)
    try:
        yield heard
    finally:
        mujoco.set_mju_user_warning(before)


def _compile_topology(
    file: RobotFile,
    names: Mapping[str, str],
    scene: Scene,
) -> Topology:
    """Compile a file whose bars have these names, and see it as a scene does."""
    return orient(Topology(compile_robot(file).model, names), scene)


def orient(topology: Topology, scene: Scene) -> Topology:
    """Return a four-bar in the axes of a scene.

    A file in which gravity has another direction there is left as it is. A linkage that
    is turned in its plane together with gravity, or seen from the other side, is the
    same one.
    """
    model = topology.model
    if not np.all(np.isfinite(topology.rest_angles)):
        # its lengths are beyond the range of doubles, which is said of them
        return topology
    gravity = model.opt.gravity * is_enabled(model, "gravity")
    wanted = sum(
        (effect.vector for effect in scene.effects if isinstance(effect, Gravity)),
        start=np.zeros(2),
    )
    allowed = _SAME_GRAVITY * float(np.linalg.norm(gravity))
    # gravity alone does not tell the side: a file whose gravity is reversed has the
    # right one from behind
    behind = is_seen_from_behind(scene, *topology.rest_angles)
    nearest = topology.turned(scene.linkage.ground_angle, behind=behind)
    fits = np.linalg.norm(nearest.in_plane(gravity) - wanted) <= allowed
    return nearest if fits else topology


def examine_file(
    scene: Scene,
    file: RobotFile | None,
    names: Mapping[str, str],
) -> Examined:
    """Describe an MJCF, and evaluate it at single states and through time.

    None: the one generated from the scene.
    """
    with collect_warnings() as warnings:
        examined = _examine_motion(
            scene,
            file or RobotFile(GENERATED, write_mjcf(scene)),
            names,
        )
    examined.notes += [f"MuJoCo warns: {warning}" for warning in warnings]
    return examined


def _examine_motion(
    scene: Scene,
    file: RobotFile,
    names: Mapping[str, str],
) -> Examined:
    robot = compile_robot(file)
    list_unknown_parts(robot, set(range(robot.model.nbody)))
    topology, guessed = find_topology(robot.model, names, scene.linkage.lengths)
    topology = orient(topology, scene)
    loop = _UserLoop(topology, scene)
    described = describe_model(topology, loop.flywheel)
    for key, (value, *_) in described.items():
        if key.startswith(("bars.", "lengths.")) and not math.isfinite(value):  # type: ignore[arg-type]
            raise InputError(
                "MJCF",
                None,
                f"{key} is beyond the range of doubles: {value}",
            )
    answers = _answer_both_ways(loop, scene)
    notes = [*robot.notes, *guessed, *loop.notes]
    notes += _free_unmet_stops(described, loop)
    return Examined(described, answers, notes, topology.names)


def _free_unmet_stops(described: Described, loop: "_UserLoop") -> Iterator[str]:
    """Describe as free what no stop ended at any state.

    Yield a note of each such joint.
    """
    for pin, joint in loop.topology.hinge.items():
        stops = loop.topology.stops(pin)
        if stops is None or joint in loop.stopped:
            continue
        key = f"pins.{pin}.range"
        described[key] = described[key]._replace(value=UNLIMITED_RANGE)
        low, high = (f"{math.degrees(stop):.4g}" for stop in stops)
        yield (
            f"the stops of joint {loop.model.joint(joint).name!r}, at {low} and {high}"
            f" deg of pin {pin}, are not met"
        )


def examine_changed(
    scene: Scene,
    changes: Sequence[tuple[str, Value | None]],
) -> list[list[Answer] | None]:
    """Answer with the generated file, then with each entry alone changed.

    The file is without a drive, and first as it is. None stands for an entry that
    cannot be set alone. After PRICING seconds the rest are not evaluated either.
    """
    start = time.perf_counter()
    answered = list[list[Answer] | None]()
    file = RobotFile(GENERATED, write_mjcf(scene, drive="none"))
    generated = describe_model(_compile_topology(file, {}, scene))
    texts = (set_entry(file.text, generated, key, value) for key, value in changes)
    for changed in chain([file.text], texts):
        answers = None
        if time.perf_counter() - start < PRICING and changed is not None:
            try:
                with collect_warnings():
                    topology = _compile_topology(replace(file, text=changed), {}, scene)
                    answers = _answer_both_ways(_UserLoop(topology, scene), scene)
            except (
                FourBarError
            ):  # with this entry it is no four-bar, or does not compile
                answers = None
        answered.append(answers)
    return answered


def examine_mended(
    scene: Scene,
    file: RobotFile,
    names: Mapping[str, str],
    changes: Sequence[tuple[str, Value | None]],
) -> list[list[Answer] | None]:
    """Return the answers of a file with one entry at a time as in the generated one.

    An answer is None if the entry cannot be set, or if time is up.
    """
    start = time.perf_counter()
    answered = list[list[Answer] | None]()
    seen = _compile_topology(file, names, scene)
    for key, value in changes:
        answers = None
        if time.perf_counter() - start < PRICING:
            topology = seen.copied()
            if mend_entry(topology, key, value):
                with collect_warnings():
                    answers = _answer_both_ways(_UserLoop(topology, scene), scene)
        answered.append(answers)
    return answered


def predict_softness(
    scene: Scene,
    file: RobotFile,
    names: Mapping[str, str],
) -> dict[str, float]:
    """Predict the error of torque (N m) and pin forces (N) by MuJoCo's soft closure.

    The error of a soft constraint goes as (1 - d)/d in its impedance d. Between
    STIFFEST and an impedance of twice that yield it grows by itself, so the error is
    measured without anything to compare the file with. Empty where no connect or weld
    closes the loop.
    """
    answers = []
    seen = _compile_topology(file, names, scene)
    if seen.closure is None:
        return {}
    for times in (1.0, 2.0):
        topology = seen.copied()
        impedance = 1.0 / (1.0 + times * (1.0 / STIFFEST - 1.0))
        topology.model.eq_solimp[topology.closure, :2] = impedance
        loop = _UserLoop(topology, scene)
        with collect_warnings():
            command = _choose_some_positions(command_of(scene))
            answers.append(_answer_one_state(loop, command).quantities)
    stiff, softer = answers
    return {
        name: float(np.nanmax(magnitude(softer[name] - stiff[name]), initial=0.0))
        for name in (name_driving(scene), *PIN_FORCES)
    }


def _answer_both_ways(loop: "_UserLoop", scene: Scene) -> list[Answer]:
    command = _choose_some_positions(command_of(scene))
    answers = [
        _answer_or_refuse(
            FILE_AT_ONE_STATE,
            scene,
            lambda: _answer_one_state(loop, command),
        )
    ]
    if (
        command.omega_2 is not None
        and np.any(command.omega_2)
        and np.ptp(command.theta_2) > 0.0
    ):
        answers.append(
            _answer_or_refuse(
                FILE_THROUGH_TIME,
                scene,
                lambda: answer_through_time(loop, command),
            )
        )
    return answers


def _choose_some_positions(command: Command) -> Command:
    """Choose at most so many of the positions, spread evenly."""
    n = len(command.theta_2)
    if command.omega_2 is None:
        raise InputError(
            "motion.omega_2",
            None,
            "is needed: without a speed there is no torque to compare",
        )
    if np.ptp(command.omega_2) != 0.0 or np.ptp(command.alpha_2) != 0.0:
        raise LimitError(
            "omega_2 or alpha_2 differs from position to position: that is no one"
            " motion through time"
        )
    keep = np.unique(
        np.linspace(0, n - 1, min(n, POSITIONS_OF_A_FILE)).round().astype(int)
    )
    omega_2 = float(np.max(command.omega_2))
    alpha_2 = float(np.max(command.alpha_2))
    return Command(
        command.theta_2[keep],
        command.branch[keep],
        omega_2,
        alpha_2,
    )


def _answer_or_refuse(
    name: str,
    scene: Scene,
    ask: Callable[[], Answer],
) -> Answer:
    start = time.perf_counter()
    try:
        answer = ask()
    except LimitError as error:
        answer = Answer(name, "-", refusal=str(error))
    except ArithmeticError as error:  # its numbers are far from those of any linkage
        raise InputError("MJCF", None, str(error)) from None
    answer.shared, answer.own, answer.seconds = (
        SHARED_WITH_THE_FILE,
        COMPUTED_FROM_THE_FILE,
        time.perf_counter() - start,
    )
    return answer


class _UserLoop(Assembled):
    """Somebody's model with its drive taken off.

    Coordinates are x = (theta_2, theta_3 - theta_2, theta_4).
    """

    def __init__(self, topology: Topology, scene: Scene) -> None:
        self.topology, self.scene, self.model = topology, scene, topology.model
        self.data = mujoco.MjData(self.model)
        self.notes: list[str] = []
        self.unreached: list[str] = []
        """Angles theta_2 at which no couple gives the commanded acceleration, deg."""
        self.stopped: set[int] = set()
        """Joints that were at a limit of their range at some state."""
        self.to_joints, self.from_joints = (
            topology.to_joints,
            np.linalg.inv(topology.to_joints),
        )
        if topology.cut == "O2":
            self.crank = None
        else:
            self.crank = int(self.model.jnt_dofadr[topology.hinge["O2"]])
        if self.crank is None:
            self.armature = 0.0
        else:
            self.armature = float(self.model.dof_armature[self.crank])
        self.flywheel = self._find_flywheel()
        """Part of the armature that keeps the speed, kg m^2. Its torque is that of the
        drive.
        """
        self._take_off_the_drive()
        self.bearers = BearerForces(self.model)
        # a sweep over the range of a joint ends at its limits, to round-off on either
        # side: they push where they are passed, not where they are touched
        self.model.jnt_margin[:] -= _TOUCHED
        self._jac = np.zeros((3, self.model.nv))

    def _find_flywheel(self) -> float:
        """Return the armature of pin O2 if it is so heavy that it drives.

        Otherwise it is inertia like any other.
        """
        mass_matrix = float(self.model.dof_M0.sum() - self.model.dof_armature.sum())
        of_scene = sum(
            effect.inertia
            for effect in self.scene.effects
            if isinstance(effect, Flywheel)
        )
        drives = self.armature > _DRIVING * (mass_matrix + of_scene)
        return self.armature if drives else 0.0

    def find_carrier(self) -> float:
        """Return the armature of pin O2 that keeps the speed through time, kg m^2.

        The file's own flywheel serves, or what holds the joints of a robot: MuJoCo's
        solver loses the light bars beside more at the tolerance of a file.
        """
        if self.flywheel:
            return self.flywheel
        return HEAVY * float(self.model.dof_M0.max())

    def leave_out_settling(
        self,
        times: Mapping[int, float],
        seconds: float,
    ) -> list[int]:
        """List the positions that are judged in a motion of some seconds.

        The loop starts exactly closed, and takes some time constants to yield as far as
        it does. What is left out, and what keeps the speed, is noted.

        `times`: of the positions after the start, s.
        """
        settled = 0.0
        if self.topology.closure is not None:
            constant = find_time_constant(self.model, self.topology.closure)
            settled = settling_time(constant, seconds)
        judged = [index for index, instant in times.items() if instant >= settled]
        if not self.flywheel:
            self.notes.append(
                "through time the speed is kept by"
                f" {self.find_carrier():.3g} kg m^2 on pin O2, which are not the"
                " file's, and by the torque that is solved for at each position"
            )
        if len(judged) < len(times):
            left_out = len(times) - len(judged)
            self.notes.append(
                f"through time the first {settled:.3g} s ({left_out} of {len(times)}"
                " positions after the start) are not judged: the loop yields in them"
            )
        return judged

    def find_crank_couple(self, values: Mapping[str, Array | float]) -> float:
        """Return the couple on bar 2 with the power of the drive, N m.

        `values`: of the state that was asked last. It is zero where nothing on the
        drive gives the acceleration, or bar 2 rests.
        """
        driving = float(values[name_driving(self.scene)])
        if self.cylinder is None:
            speed = float(values[f"omega_{self.scene.drive_bar}"])
        else:
            gear = self.model.actuator_gear[self.cylinder, 0]
            speed = float(self.data.actuator_velocity[self.cylinder] / gear)
        omega_2 = float(values["omega_2"])
        if omega_2 == 0.0 or not math.isfinite(driving * speed):
            return 0.0
        return driving * speed / omega_2

    def _take_off_the_drive(self) -> None:
        model = self.model
        if self.flywheel:
            self.notes.append(
                f"its armature of {self.flywheel:.3g} kg m^2 on pin O2 is taken for a"
                " flywheel that drives: the torque on it is not counted"
            )
        for i in self.topology.drives():
            model.actuator_gainprm[i], model.actuator_biasprm[i] = 0.0, 0.0
            self.notes.append(
                f"its drive on pin O2, {describe_actuator(model, i)}, is taken off:"
                " the torque is solved for"
            )
        if self.scene.drive is not None:
            cylinders = self.topology.cylinders()
        else:
            cylinders = []
        if self.scene.drive is not None and len(cylinders) != 1:
            counted = f"{len(cylinders)} actuators with a control on tendons"
            raise InputError(
                "MJCF",
                counted,
                "the scene's drive is a cylinder: must be one",
            )
        for i in cylinders:  # takes the force itself as its control
            model.actuator_gaintype[i], model.actuator_biastype[i] = (
                mujoco.mjtGain.mjGAIN_FIXED,
                _NO_BIAS,
            )
            model.actuator_gainprm[i], model.actuator_dyntype[i] = (
                0.0,
                mujoco.mjtDyn.mjDYN_NONE,
            )
            model.actuator_gainprm[i, 0] = 1.0 / model.actuator_gear[i, 0]
            model.actuator_ctrllimited[i] = model.actuator_forcelimited[i] = False
            self.notes.append(
                f"its actuator {model.actuator(i).name!r} gives the cylinder's force"
                " that is solved for"
            )
        self.cylinder = next(iter(cylinders), None)
        for i in range(model.neq):
            if (
                i != self.topology.closure
                and model.eq_active0[i]
                and self.topology.closed_by != "tendon"
            ):
                self.data.eq_active[i] = 0
                self.notes.append(
                    f"its equality {model.equality(i).name or i!r} is switched off: it"
                    " is no pin"
                )

    # methods that `Assembler` needs of a tree
    def place(self, x: Sequence[float]) -> None:
        """Move to a configuration."""
        self.data.qpos[:] = self.topology.qpos(x)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def gap(self) -> tuple[float, float]:
        """Return the opening of the cut pin, m.

        For any pin it is +-(A + b e^{i theta_3} - O4 - c e^{i theta_4}).
        """
        first, second = (
            self.topology.world(self.data, bar, self.topology.cut)
            for bar in PINS[self.topology.cut]
        )
        x, y = self.topology.in_plane(first - second).tolist()
        return x, y

    def jacobian(self) -> Array:
        """Return the derivative of the gap by x, (2, 3)."""
        rows = []
        for bar in PINS[self.topology.cut]:
            body = self.topology.root[bar]
            place = self.topology.world(self.data, bar, self.topology.cut)
            mujoco.mj_jac(self.model, self.data, self._jac, None, place, body)
            rows.append(self.topology.axes @ self._jac @ self.to_joints)
        return np.asarray(rows[0] - rows[1])

    def positions(self) -> dict[str, Array]:
        """Return A, B, O4, and the end of bar 4 from O2, laid off by bars, (2,), m."""
        line = {bar: self.topology.line(self.data, bar) for bar in (1, 2, 3, 4)}
        return {
            "A": line[2],
            "B": line[2] + line[3],
            "O4": line[1],
            "B4": line[1] + line[4],
        }

    def speeds(self, omega_2: float) -> Array:
        """Compute the joint speeds that keep the gap closed, (3,).

        The model is placed at the position.
        """
        return np.asarray(self.to_joints @ solve_closed(self.jacobian(), omega_2))

    def ask(
        self,
        q: Array,
        v: Array,
        alpha_2: float,
    ) -> dict[str, Array | float]:
        """Evaluate a state at which the crank accelerates at alpha_2.

        The couple of the driven bar is solved for.
        """
        data = self.data
        drive = self.scene.drive_bar
        active = data.eq_active.copy()
        mujoco.mj_resetData(self.model, data)
        data.eq_active[:] = active
        data.qpos[:], data.qvel[:] = q, v
        if self.crank is not None:  # the torque on a flywheel belongs to the drive
            data.qfrc_applied[self.crank] = (
                self.flywheel * self.topology.sense["O2"] * alpha_2
            )

        def acceleration(couple: float) -> float:
            if self.cylinder is None:
                data.xfrc_applied[self.topology.root[drive], 3:] = (
                    couple * self.topology.normal
                )
            else:
                data.ctrl[self.cylinder] = couple
            mujoco.mj_forward(self.model, data)
            return float((self.from_joints @ data.qacc)[0])

        couple = self._solve_drive(acceleration, alpha_2)
        mujoco.mj_rnePostConstraint(self.model, data)
        values: dict[str, Array | float] = {name_driving(self.scene): couple}
        turned = (
            self.topology.angles(data),
            self.from_joints @ data.qvel,
            self.from_joints @ data.qacc,
        )
        for name, (two, three, four) in zip(
            ("theta", "omega", "alpha"),
            turned,
            strict=True,
        ):
            values |= {f"{name}_2": two, f"{name}_3": two + three, f"{name}_4": four}
        self._count_stops()
        if math.isnan(couple):
            return values | {name: np.full(2, np.nan) for name in PIN_FORCES}
        return values | self._read_forces()

    def _solve_drive(
        self,
        acceleration: Callable[[float], float],
        wanted: float,
    ) -> float:
        """Solve for the couple or force of the drive.

        NaN if none gives the acceleration, which is noted.
        """
        couple = find_couple(self.model, self.data, acceleration, wanted)
        if couple is None:
            if self.cylinder is not None:
                what = "its cylinder"
            else:
                what = f"a couple on bar {self.scene.drive_bar}"
            raise LimitError(f"{what} does not move the crank of this model")
        if math.isnan(couple):
            theta_2 = math.degrees(self.topology.angles(self.data)[0])
            self.unreached.append(f"{theta_2:.4g}")
        return couple

    def _count_stops(self) -> None:
        """Collect the joints that are at a limit of their range in this state."""
        limits = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
        self.stopped.update(self.data.efc_id[limits].tolist())

    def _read_forces(self) -> dict[str, Array]:
        """Read F12, F32, F43, F14 in the plane.

        NaN at a cut pin that no connect or weld holds.
        """
        data = self.data
        topology = self.topology
        on: dict[tuple[int, int], Array] = {}
        for pin in topology.hinge:
            child, parent = topology.turning(pin)
            force = self.bearers.read(data, topology.root[child])
            on[parent, child] = topology.in_plane(force)
        bars = PINS[topology.cut]
        force = np.full(2, np.nan)
        if topology.closure is not None:
            force = topology.in_plane(read_equality_force(data, topology.closure))
            if topology.first == bars[0]:
                on[bars[1], bars[0]] = force
            else:
                on[bars[0], bars[1]] = force
        else:
            on[bars] = force
        forces = {}
        for name, (i, j) in FORCE_BETWEEN.items():
            forces[name] = on[i, j] if (i, j) in on else -on[j, i]
        return forces


def _answer_one_state(loop: _UserLoop, command: Command) -> Answer:
    """Answer every position by itself."""
    contacts = 0

    def read(
        _: JointAngles,
        omega_2: float,
        alpha_2: float,
    ) -> dict[str, Array | float]:
        nonlocal contacts
        try:
            v = loop.speeds(omega_2)
        except np.linalg.LinAlgError:
            return {}
        values = loop.ask(loop.data.qpos.copy(), v, alpha_2)
        contacts = max(contacts, int(loop.data.ncon))
        return values

    told = with_signs(loop.scene.linkage, command)
    out, assembled, gap = read_each(
        loop,
        told,
        [*list_unknowns(loop.scene), *MADE],
        read,
    )
    if contacts:
        loop.notes.append(
            f"{contacts} contacts at a position where nothing but pins should touch"
        )
    if loop.unreached:
        if loop.cylinder is not None:
            what = "the cylinder"
        else:
            what = f"bar {loop.scene.drive_bar}"
        places = ", ".join(dict.fromkeys(loop.unreached))
        loop.notes.append(
            f"nothing on {what} gives the commanded acceleration at theta_2 ="
            f" {places} deg"
        )
    evidence = {"closure_gap_m": gap, "contacts": float(contacts)}
    return Answer(
        FILE_AT_ONE_STATE,
        "as compiled",
        command,
        assembled,
        out,
        evidence=evidence,
    )


def _require_steps(seconds: float, timestep: float) -> None:
    """Raise LimitError if a motion takes no step or over MOST_STEPS_THROUGH_TIME."""
    steps = seconds / timestep
    if not 1.0 <= steps <= MOST_STEPS_THROUGH_TIME:
        raise LimitError(
            f"its timestep of {timestep:g} s makes {steps:.3g} steps of the motion;"
            f" must be 1 to {MOST_STEPS_THROUGH_TIME}"
        )


def _find_longest_segment(loop: _UserLoop, command: Command) -> list[int]:
    """Find the most positions in a row that assemble, in order of time.

    The loop is left at the first of them.

    Raises LimitError if there are no two.
    """
    assert isinstance(command.omega_2, float)
    position = Assembler(loop)
    told = with_signs(loop.scene.linkage, command)
    order = order_in_time(command.theta_2, None, command.omega_2)
    segments = split_segments(find_assembled(position, told, order), order)
    segment = max(segments, key=len, default=[])
    if len(segment) < 2:
        raise LimitError("nowhere do two neighbouring positions assemble in this file")
    start = segment[0]
    position.find(float(told.theta_2[start]), int(told.branch[start]))
    return segment


def answer_through_time(loop: _UserLoop, command: Command) -> Answer:
    """Run the longest segment of positions at the file's own timestep.

    The positions assemble.
    """
    model = loop.model
    data = mujoco.MjData(model)
    data.eq_active[:] = loop.data.eq_active
    if loop.crank is None:
        raise LimitError(
            "pin O2 is not a hinge in this file: nothing can keep its crank at a speed"
        )
    assert isinstance(command.omega_2, float) and isinstance(command.alpha_2, float)
    segment = _find_longest_segment(loop, command)
    run = choose_run(command.theta_2[segment], command.omega_2, command.alpha_2)
    duration = run.time(run.stop)
    timestep = float(model.opt.timestep)
    _require_steps(duration, timestep)
    data.qpos[:] = loop.data.qpos
    data.qvel[:] = loop.speeds(command.omega_2)
    heavy = loop.find_carrier()
    values = loop.ask(data.qpos.copy(), data.qvel.copy(), command.alpha_2)
    couple = loop.find_crank_couple(values)
    times = {index: run.time(float(command.theta_2[index])) for index in segment[1:]}
    segment = loop.leave_out_settling(times, duration)
    out = make_blank(len(segment), [*list_unknowns(loop.scene), *MADE])
    largest_gap = 0.0
    speed_error = 0.0
    alarms: list[str] = []
    stepper = Stepper(model, data, timestep)
    for i, index in enumerate(segment):
        model.dof_armature[loop.crank] = heavy
        driving = heavy * command.alpha_2 + couple
        data.qfrc_applied[loop.crank] = loop.topology.sense["O2"] * driving
        stepper.to(times[index])
        mujoco.mj_forward(model, data)
        if stepper.lost() or any(data.warning[kind].number for kind in WARNINGS):
            alarms.append("the simulation of this file blew up")
            break
        alpha_2 = float((loop.from_joints @ data.qacc)[0])
        model.dof_armature[loop.crank] = loop.armature
        values = loop.ask(data.qpos.copy(), data.qvel.copy(), alpha_2)
        couple = loop.find_crank_couple(values)
        target = float(command.theta_2[index])
        turned = math.remainder(float(values["theta_2"]) - target, math.tau)
        values["theta_2"] = target + turned  # a joint with stops has turns of its own
        largest_gap = max(largest_gap, float(np.hypot(*loop.gap())))
        speed = float(values["omega_2"]) / command.omega_2
        speed_error = max(speed_error, abs(speed - 1.0))
        for name, array in out.items():
            array[i] = values[name]
    model.dof_armature[loop.crank] = loop.armature
    finite = np.isfinite(out["theta_2"])
    out = {name: array[finite] for name, array in out.items()}
    motion, _ = split_answer(out, command.branch[segment][finite])
    integrator = mujoco.mjtIntegrator(model.opt.integrator).name
    setting = f"{integrator.removeprefix('mjINT_')} {timestep:g} s"
    return Answer(
        FILE_THROUGH_TIME,
        setting,
        motion,
        np.ones(finite.sum(), dtype=bool),
        out,
        evidence={"closure_gap_m": largest_gap, "speed_error": speed_error},
        alarms=alarms,
    )
