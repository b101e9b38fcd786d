"""MuJoCo simulates the closed loop of the generated MJCF, driven through the sweep."""

import time
from collections.abc import Container
from dataclasses import replace
from functools import partial

import numpy as np

from fourbar.effects import PointDrive
from fourbar.errors import InputError, LimitError
from fourbar.linkage import record
from fourbar.mjcf import RECIPE, Settings, write_mjcf
from fourbar.mjcf.model import CYLINDER, unwind
from fourbar.scene import Command, Scene
from fourbar.scene.motion import COMMAND_NAMES
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.scales import make_reference, size_answer
from fourbar_validation.engines.description import (
    list_speeds,
    list_unknowns,
    name_driving,
)
from fourbar_validation.engines.limits import (
    NEAREST_CENTRE,
    NEAREST_TOGGLE,
    NO_PUSH,
    find_exceeded,
    find_uneven,
)
from fourbar_validation.engines.loaded import BarValues
from fourbar_validation.engines.loop import MADE, Assembler, make_blank
from fourbar_validation.engines.mujoco.closed_loop import (
    O2,
    O4,
    A,
    ClosedLoop,
    merges_points,
)
from fourbar_validation.engines.mujoco.monitor import (
    ResidualMonitor,
    list_alarms,
    softens_friction,
)
from fourbar_validation.engines.mujoco.runner import (
    Found,
    Lead,
    RunCourse,
    Segment,
    SimulatedRun,
    clip_angles,
    evaluate_loads,
    find_assembled,
    receive_forces,
    split_segments,
    supply_forces,
    take_full_size,
)

SHARED_WITH_SIMULATION = (
    "lengths, masses, inertias, centres, loads and effects as MJCF text; tables of"
    " loads; what is commanded or the motion law, and the branch"
)
COMPUTED_BY_MUJOCO = (
    "assembly, velocities at the start, the motion through time, accelerations, drive"
    " torque, pin forces"
)
_RESIDUALS = (
    "closure_gap_m",
    "speed_error",
    "time_went_back",
    "bad_states",
    "solver_iterations",
    "steps",
)
LONGEST_STEP_OF_A_CHECK = np.radians(2.0)
"""Greatest step between positions at which the loop is tried for closure, rad."""


@record
class MujocoSimulated:
    """Engine "mujoco-simulated"."""

    settings: Settings = RECIPE
    name: str = "mujoco-simulated"
    commands: tuple[str, ...] = ("theta_2", "theta_3", "theta_4", "stroke")

    def at_setting(self, steps_per_turn: int) -> "MujocoSimulated":
        """Return the engine that makes so many steps in a turn."""
        settings = replace(
            self.settings,
            steps_per_revolution=float(steps_per_turn),
            steps_per_window=1,
        )
        return replace(self, settings=settings)

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Run the sweep through in time, and return every quantity along it.

        Quantities are those at the crank's own angle, speed and acceleration.
        """
        scene = state_from_pins(scene)
        if isinstance(scene.drive, PointDrive):
            return Answer(self.name, "", refusal=NO_PUSH)
        began = time.perf_counter()
        try:
            course = _choose_course(scene, command)
            _require_run(course)
            answer = _Simulation(self.settings, course).answer()
        except (
            LimitError,
            InputError,
        ) as error:  # anything else is a failure, not a declared limit
            answer = Answer(self.name, self.settings.integrator, refusal=str(error))
        answer.shared = SHARED_WITH_SIMULATION
        answer.own = COMPUTED_BY_MUJOCO
        answer.seconds = time.perf_counter() - began
        return answer


def _choose_course(scene: Scene, command: Command) -> RunCourse:
    """Choose how a command is run through; LimitError where there is nothing to run."""
    motion = scene.motion
    if motion.free is not None:
        raise LimitError("a free motion has no commanded sweep")
    if command.speed is None or not np.any(command.speed):
        raise LimitError(
            f"{motion.names[1]} is 0 or not stated: nothing to simulate through time"
        )
    course: RunCourse
    rates = list_speeds(command)
    if command.bar != 2 or command.moves_stroke:
        course = Lead(scene, command)
        rates = motion.speed, motion.acceleration
    else:
        course = RunCourse(scene, command)
    if course.law is None and any(map(np.ptp, rates)):
        _, speed, acceleration = motion.names
        raise LimitError(
            f"{speed} or {acceleration} differs from position to position: that is no"
            " one motion through time"
        )
    return course


def _require_run(course: RunCourse) -> None:
    """Raise LimitError where this motion of the input is not simulated."""
    theta_2 = course.of_input.theta_2
    if np.ptp(theta_2) == 0.0:
        raise LimitError("one position: nothing to run through")
    scene = course.scene
    if reason := find_exceeded(scene, abs(scene.motion.omega_2 or 0.0)):
        raise LimitError(reason)


class _Simulation:
    """One scene: its own assembly, then each segment run through in time.

    A segment is of positions that assemble.
    """

    def __init__(
        self,
        settings: Settings,
        course: RunCourse,
        *,
        bounded: bool = True,
    ) -> None:
        self.bounded = bounded
        self.settings = settings
        self.course = course
        self.command = course.command
        self.scene = scene = course.scene
        self.supplied = evaluate_loads(scene)
        n = len(self.command.angle)
        unknowns = list_unknowns(scene)
        # quantities of a cylinder that MuJoCo has
        self.out = make_blank(
            n, [*MADE, *unknowns, *(("stroke", "stroke_speed") if scene.drive else ())]
        )
        self.branch = self.command.branch.copy()
        self.evidence = dict.fromkeys(_RESIDUALS, 0.0)
        self.steps_per_revolution = 0.0
        self.predicted = {name: np.zeros(n) for name in unknowns}

    def answer(self) -> Answer:
        """Answer over all positions."""
        bar = self.command.bar
        linkage = self.scene.linkage
        # kinematics alone: the timestep plays no part
        settings = replace(self.settings, timestep=1e-3)
        loop = self._compile_loop((), settings)
        if self.bounded and merges_points(loop.model):
            raise LimitError(NEAREST_CENTRE.reason)
        position = Assembler(loop, bar)
        assembled = find_assembled(position, self.command)
        closes = np.array([angles is not None for angles in assembled])
        least = self.course.least_sine(closes)
        if self.bounded and least < NEAREST_TOGGLE.boundary:
            raise LimitError(
                f"|sin(theta_4 - theta_3)| falls to {least:.1e};"
                f" {NEAREST_TOGGLE.reason}"
            )
        for segment in split_segments(
            assembled,
            self.course.order(),
            partial(self._closes_between, position),
        ):
            self._run(segment, assembled[segment[0]])
        self.out["theta_2"] = clip_angles(self.scene, self.out["theta_2"])
        # the command stands for the motion where nothing moved
        commanded = self.command.angle, *list_speeds(self.command)
        made = []
        for name, told in zip(COMMAND_NAMES[bar], commanded, strict=True):
            made.append(np.where(np.isnan(self.out[name]), told, self.out[name]))
        made[0] += 2.0 * np.pi * np.round((commanded[0] - made[0]) / (2.0 * np.pi))
        motion = Command(made[0], self.branch, made[1], made[2], bar=bar)
        values = {
            name: x for name, x in self.out.items() if bar != 2 or name not in MADE
        }
        setting = f"{self.settings.integrator} {self.steps_per_revolution:.0f}/rev"
        answer = Answer(
            "mujoco-simulated",
            setting,
            motion,
            closes,
            values,
            predicted=self.predicted,
            evidence=self.evidence,
        )
        size = sum(linkage.lengths)
        alarms = list_alarms(self.evidence, size, self._find_factor(answer))
        first = next(iter(alarms), "")
        uneven = find_uneven(self.scene) if self.bounded and first else None
        # no rounding keeps a crank alone from its speed
        if uneven and first != "speed_error":
            raise LimitError(f"{alarms[first]}; {uneven}")
        answer.alarms += alarms.values()
        return answer

    def _find_factor(self, answer: Answer) -> float:
        """Find max(1, N/K) of the drive's torque or force, by the answer itself."""
        solution = make_reference(self.scene, answer)
        if solution is None or answer.at is None or answer.at.speed is None:
            return 1.0
        drive = name_driving(self.scene)
        sizes = size_answer(self.scene, solution)
        effort = getattr(solution, drive)
        if sizes is None or effort is None:
            return 1.0
        factor = sizes.scale(drive, effort).factor
        return float(np.nanmin(factor)) if np.isfinite(factor).any() else 1.0

    def _compile_loop(self, supplied: Container[str], settings: Settings) -> ClosedLoop:
        """Compile a model that takes from `supply_forces` what its text cannot say.

        `supplied`: names of the actuators whose force is supplied.
        """
        text = write_mjcf(take_full_size(self.scene), settings, keyframe=False)
        return receive_forces(ClosedLoop(text), supplied)

    def _closes_between(
        self,
        position: Assembler,
        one: int,
        second: int,
    ) -> bool:
        """Tell whether the loop closes everywhere between two positions."""
        start, stop = self.command.angle[[one, second]]
        pieces = int(np.ceil(abs(stop - start) / LONGEST_STEP_OF_A_CHECK))
        branch = int(self.command.branch[one])
        return all(
            position.find(theta, branch) is not None
            for theta in np.linspace(start, stop, pieces + 1)[1:-1].tolist()
        )

    def _run(self, segment: list[int], start: Found) -> None:
        """Step through one segment and read at the step nearest to each position."""
        motion_segment = Segment(self.course, segment)
        timestep = motion_segment.timestep(self.settings)
        if len(segment) > 1:
            turn = 2.0 * np.pi / motion_segment.turning
            self.steps_per_revolution = max(self.steps_per_revolution, turn / timestep)
        supplied = dict(self.supplied)
        accelerate = self.course.accelerate(motion_segment, timestep)
        if accelerate is not None:
            supplied["drive"] = lambda m, d: m.dof_armature[O2] * accelerate(m, d)
        settings = replace(self.settings, timestep=timestep, timestep_scale=1.0)
        with supply_forces(supplied):
            compile_loop = partial(self._compile_loop, supplied)
            run = SimulatedRun(motion_segment, start, settings, compile_loop)
            monitor = ResidualMonitor(compile_loop(settings), self.scene.drive_bar)
            for index in segment:
                run.to(index)
                self._read(run, monitor, index)
        self.evidence["steps"] += run.stepper.done
        self._keep_worst(monitor.evidence())

    def _read(
        self,
        run: SimulatedRun,
        monitor: ResidualMonitor,
        index: int,
    ) -> None:
        """Read everything of one sample, and what the engine says of itself there."""
        loop = run.loop
        d = loop.data
        loop.forward()
        due = run.motion_segment.speed(run.stepper.time)
        speed = float(loop.drive_column(self.course.bar) @ d.qvel)
        missed = abs(abs(speed) - due)
        evidence = {
            "closure_gap_m": float(np.hypot(*loop.gap())),
            "speed_error": float(missed / (run.motion_segment.fastest or 1.0)),
            "solver_iterations": float(d.solver_niter.max()),
            "bad_states": float(loop.bad()),
            "time_went_back": float(run.stepper.lost()),
        }
        self._keep_worst(evidence)
        q = (float(d.qpos[O2]), float(d.qpos[A]), float(d.qpos[O4]))
        if unwind(self.scene, q) != q:
            raise LimitError(
                "a torsion spring is wound by more than half a turn from its rest"
            )
        self.branch[index] = loop.branch(self.command.bar)
        torque, pins = run.read()
        if torque is None:
            drive = f"the couple on bar {self.scene.drive_bar}"
            if self.scene.drive:
                drive = "the cylinder"
            raise LimitError(f"{drive} does not move the input: a pole of its size")
        values: BarValues = {name_driving(self.scene): torque, **pins}
        if self.scene.drive is not None:
            tendon = loop.model.tendon(CYLINDER).id
            values["stroke"] = d.ten_length[tendon]
            values["stroke_speed"] = d.ten_velocity[tendon]
        for name, x, ahead in (
            ("theta", d.qpos, run.turns),
            ("omega", d.qvel, 0.0),
            ("alpha", d.qacc, 0.0),
        ):
            values[f"{name}_2"] = x[O2] - ahead
            values[f"{name}_3"] = x[O2] + x[A] - ahead
            values[f"{name}_4"] = x[O4]
        for name, value in values.items():
            self.out[name][index] = value
        expected = monitor.look(loop, run.light or loop, torque, pins["F43"])
        if softens_friction(loop):
            expected |= dict.fromkeys((name_driving(self.scene), *pins), np.inf)
        for name, error in expected.items():
            self.predicted[name][index] = error

    def _keep_worst(self, evidence: dict[str, float]) -> None:
        """Keep the worst of what the engine says of itself."""
        for name, value in evidence.items():
            worst = np.maximum(self.evidence.get(name, 0.0), value)
            self.evidence[name] = float(worst)
