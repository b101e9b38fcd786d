"""MuJoCo's settings for a wanted error.

One scene is run through in time with any of them. From the laws that the study of cost
measured:

    error = STIFFNESS_CONSTANT (h/tc)^4, whatever h   -> tc, the closure's time constant
    error ~ h^ORDER_OF_RK4 until a floor              -> h, the timestep

The scene is assembled once by the engine itself; each trial compiles the generated MJCF
anew and reports its own motion, torque and pin forces.

A run that is no more precise than wanted has the settings of the laws, confirmed by the
error that the engine predicts from its own residuals, never by what the formulas say:
how wrong it is against them stays a finding.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from fourbar.errors import LimitError, write_count
from fourbar.mjcf import Settings, write_mjcf
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene import command as command_of
from fourbar_validation.compare.answer import Answer, Arrays
from fourbar_validation.compare.compare import COMPARED_QUANTITIES, mark_turning
from fourbar_validation.compare.tolerance import divide, magnitude
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.loop import (
    MADE,
    Assembler,
    make_blank,
    split_answer,
)
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop
from fourbar_validation.engines.mujoco.runner import (
    RunCourse,
    Segment,
    SimulatedRun,
    find_assembled,
    split_segments,
)
from fourbar_validation.engines.mujoco.simulate import MujocoSimulated

STIFFNESS_CONSTANT = 4e-2
"""Value of error (tc/h)^4 of RK4, with tc in steps. Measured: 1.3e-2 to 6e-2 on
crank-rocker, drag link and double rocker.
"""
SHORTEST_TIME_CONSTANT = 3.0
"""Steps of the time constant: below 2 the closure follows no integrator."""
LONGEST_TIME_CONSTANT = 400.0
"""Time constant beyond which nothing is gained above 1e-12. The loop is then no longer
held together over a revolution.
"""
ORDER_OF_RK4 = 4.0
"""Order of RK4, for the first guess of the next number of steps; it decides nothing."""
_FIRST_STEPS, _FIRST_ERROR = 60.0, 1e-5
"""Steps per revolution from which the search begins, by the order, for other errors."""
FEWEST_STEPS = 6.0
"""A revolution cannot be followed by less."""
TRIAL_FLYWHEEL = 1e5
"""Flywheel, lighter than the recipe's. The torque, armature times acceleration, is
rounded in proportion to it.
"""
_MOST_READINGS = 100
"""Readings that are timed at once, at most."""
Edit = Callable[[str], str]
"""Function that changes the text of an MJCF."""
MOST_SIMULATIONS = 6
"""Simulations of a scene at most; the laws are seldom wrong by more than one."""
PREDICTED_PART = 0.5
"""The engine's own prediction must stay within this part of the wanted error."""


def guess(error: float) -> tuple[float, float]:
    """Compute the steps per revolution and the time constant for an error.

    The laws give them; the time constant is in steps.
    """
    tc = (STIFFNESS_CONSTANT / (error / 2.0)) ** (1.0 / ORDER_OF_RK4)
    steps = _FIRST_STEPS * (_FIRST_ERROR / error) ** (1.0 / ORDER_OF_RK4)
    return max(steps, FEWEST_STEPS), min(
        max(tc, SHORTEST_TIME_CONSTANT), LONGEST_TIME_CONSTANT
    )


def make_settings(steps_per_revolution: float, time_constant_steps: float) -> Settings:
    """Give the recommended settings at a number of steps and a time constant.

    A window has no steps of its own.
    """
    return Settings(
        steps_per_revolution=steps_per_revolution,
        steps_per_window=1,
        time_constant_steps=time_constant_steps,
        flywheel=TRIAL_FLYWHEEL,
    )


def describe_settings(settings: Settings, steps_per_revolution: float) -> str:
    """Write in one line what is to be typed into MuJoCo."""
    return ", ".join(
        (
            f"{settings.integrator}, {steps_per_revolution:.0f} steps a revolution",
            f"time constant {settings.time_constant_steps:.3g} steps",
            "no pads" if settings.pad is None else "pads",
            f"tolerance {settings.tolerance:g}",
            write_count(settings.iterations, "iteration"),
            f"flywheel {settings.flywheel:g}",
        )
    )


@dataclass(slots=True, eq=False)
class Trial:
    """Result of one run through a scene with some settings."""

    at: Command
    """Motion that was really made."""
    quantities: Arrays = field(default_factory=dict)
    """Torque (n,) and pin forces (n, 2), under the names of `fourbar.Solution`."""
    steps: int = 0
    steps_per_revolution: float = 0.0
    """Steps per revolution at the fastest speed of the run."""
    segments: tuple[tuple[slice, int], ...] = ()
    """Samples of each segment, and its steps. Several samples are of one step if the
    steps are fewer.
    """
    broken: str = ""
    """Report of the engine on itself, if it lost the motion."""

    @property
    def readings(self) -> int:
        """Number of states read: one a position, or one a step if these are fewer."""
        count = 0
        for rows, steps in self.segments:
            positions = len(np.unique(self.at.theta_2[rows]))
            count += min(positions, steps + 1)
        return count


class TrialSetup:
    """A scene, ready to be tried with any settings.

    Raises LimitError for a scene that cannot be run through in time.
    """

    def __init__(self, scene: Scene, command: Command) -> None:
        if command.bar != 2 or command.moves_stroke:
            raise LimitError(
                "settings are tried along a sweep of theta_2, not of another bar or of "
                "a stroke"
            )
        if scene.motion.law is not None or scene.motion.has_rate_of_each:
            raise LimitError(
                "settings are tried at a constant alpha_2, not along a motion law or"
                " speeds of each angle"
            )
        if (
            scene.motion.free is not None
            or not np.any(command.omega_2)
            or np.ptp(command.theta_2) == 0.0
        ):
            raise LimitError(
                "nothing to run through in time: a sweep of theta_2 at omega_2 is"
                " needed"
            )
        self.course = course = RunCourse(scene, command)
        self.scene = course.scene
        self.command = command
        position = Assembler(
            ClosedLoop(write_mjcf(self.scene, Settings(timestep=1e-3), keyframe=False))
        )
        signed = with_signs(scene.linkage, command)
        self.start = find_assembled(position, signed)
        """Joint angles of each position, None where the loop does not close."""
        self.segments = [
            segment
            for segment in split_segments(self.start, course.order())
            if len(segment) > 1
        ]
        if not self.segments:
            raise LimitError(
                "the loop closes at no two neighbouring positions: nothing to run"
                " through in time"
            )
        self._motions = [Segment(course, one) for one in self.segments]

    @property
    def simulated_seconds(self) -> float:
        """Time in which the linkage passes all segments."""
        return sum(segment.duration for segment in self._motions)

    @property
    def revolutions(self) -> float:
        """Revolutions of the input through all segments."""
        turned = sum(
            float(np.ptp(self.command.theta_2[segment])) for segment in self.segments
        )
        return turned / (2.0 * np.pi)

    def steps(self, settings: Settings) -> int:
        """Count the steps of one run, without making it."""
        # a whole number of steps over each segment
        return sum(
            round(segment.duration / segment.timestep(settings, 1))
            for segment in self._motions
        )

    def try_out(self, settings: Settings, edit: Edit | None = None) -> Trial:
        """Run through every segment that assembles.

        The state read for a position is that of the nearest step.

        Parameters
        ----------
        edit : changes the text of every loop: how the four-bar is closed.
        """
        samples = [*chain.from_iterable(self.segments)]
        driving = name_driving(self.scene)
        out = make_blank(len(samples), (*MADE, driving, *PIN_FORCES))
        trial = Trial(self.command)
        first = 0
        for segment in self.segments:
            run = self._start(segment, settings, edit)
            for row, index in enumerate(segment, first):
                run.to(index)
                run.loop.forward()
                d = run.loop.data
                lost = run.stepper.lost() or run.loop.bad()
                if lost or not np.isfinite(d.qacc).all():
                    trial.broken = (
                        "MuJoCo lost the motion: a value not finite, or too large"
                    )
                    break
                torque, pins = run.read()
                motion = d.qpos[O2] - run.turns, d.qvel[O2], d.qacc[O2]
                values = dict(zip(MADE, motion, strict=True))
                values[driving] = np.nan if torque is None else torque
                for name, value in (values | pins).items():
                    out[name][row] = value
            rows = slice(first, first + len(segment))
            first = rows.stop
            trial.segments += ((rows, run.stepper.done),)
            made = 2.0 * np.pi / run.motion_segment.fastest / run.stepper.timestep
            trial.steps_per_revolution = max(trial.steps_per_revolution, made)
            if trial.broken:
                break
        trial.steps = sum(steps for _, steps in trial.segments)
        trial.at, trial.quantities = split_answer(out, self.command.branch[samples])
        return trial

    def _start(
        self, segment: list[int], settings: Settings, edit: Edit | None
    ) -> SimulatedRun:
        """Return a run that stands at the first position of a segment."""
        motion_segment = Segment(self.course, segment)
        timestep = motion_segment.timestep(settings, 1)
        settings = replace(settings, timestep=timestep, timestep_scale=1.0)

        def compile_loop(built: Settings) -> ClosedLoop:
            text = write_mjcf(self.scene, built, keyframe=False)
            return ClosedLoop(text if edit is None else edit(text))

        start = self.start[segment[0]]
        return SimulatedRun(motion_segment, start, settings, compile_loop)

    def make_clocks(
        self,
        settings: Settings,
        edit: Edit | None = None,
    ) -> tuple[Callable[[int], float], Callable[[int], float]]:
        """Return two functions of a count: CPU time in s of steps, and of readings.

        Each call of the first starts again at the start of the longest segment.
        """
        segment = max(self.segments, key=len)
        run = self._start(segment, settings, edit)
        loop = run.loop
        data = loop.data
        start = self.start[segment[0]]
        assert start is not None
        forces = np.empty((_MOST_READINGS, *data.cfrc_int.shape))
        closing = np.empty((_MOST_READINGS, 2))
        accelerations = np.empty(_MOST_READINGS)

        def time_steps(count: int) -> float:
            loop.set_state(start, self.course.speed)
            began = time.process_time()
            mujoco.mj_step(loop.model, loop.data, count)
            return time.process_time() - began

        def time_readings(count: int) -> float:
            loop.set_state(start, self.course.speed)
            mujoco.mj_step(loop.model, loop.data)
            began = time.process_time()
            for row in range(count):
                loop.forward()
                if run.light is not None:
                    run.read()
                    continue
                # kept as they are: arithmetic on whole arrays later takes no time
                forces[row] = data.cfrc_int
                closing[row] = data.efc_force[:2]
                accelerations[row] = data.qacc[O2]
            return time.process_time() - began

        return time_steps, time_readings


_LEAST_GROWTH, _MOST_GROWTH = 1.15, 3.0
"""Factor on the steps from one round to the next."""


@dataclass(slots=True)
class SimulatedToError:
    """Engine "mujoco-simulated" with settings for a wanted error."""

    error: float
    name: str = "mujoco-simulated"

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Simulate with the laws' number of steps, then with more if need be.

        A run is repeated with more while its own residuals predict too large an error.
        """
        steps, tc = guess(self.error)
        spent = 0.0
        runs = 0.0
        for _ in range(MOST_SIMULATIONS):
            answer = MujocoSimulated(make_settings(steps, tc)).answer(scene, command)
            if answer.refusal is not None:
                return answer
            spent += answer.evidence["steps"]
            runs += 1.0
            expected = compute_expected_error(scene, answer)
            ratio = expected / (PREDICTED_PART * self.error)
            if ratio <= 1.0 and not answer.alarms:
                break
            growth = _MOST_GROWTH
            if np.isfinite(ratio):
                growth = min(ratio ** (1.0 / ORDER_OF_RK4), _MOST_GROWTH)
            growth = max(growth, _LEAST_GROWTH)
            # a run has at least as many steps as it has positions to read
            made = answer.setting.rpartition(" ")[2]  # of "RK4 628/rev"
            steps = max(steps, float(made.removesuffix("/rev"))) * growth
            tc = min(tc * growth, LONGEST_TIME_CONSTANT)
        answer.evidence |= {
            "wanted_error": self.error,
            "expected_error": expected,
            "steps_with_the_search": spent,
            "runs": runs,
        }
        return answer


def compute_expected_error(scene: Scene, answer: Answer) -> float:
    """Return the worst error that the engine predicts.

    An error is relative to a quantity's largest magnitude (angles: 1 rad).
    """
    worst = 0.0
    for name, predicted in answer.predicted.items():
        if name not in COMPARED_QUANTITIES:
            continue
        values = answer.quantities[name]
        if name.startswith("theta"):
            sizes = np.where(np.isfinite(values), 1.0, np.nan)
        else:
            sizes = magnitude(values)
        finite = np.isfinite(sizes)
        if name == "torque" and scene.drive_bar != 2:
            finite &= mark_turning(answer.quantities[f"omega_{scene.drive_bar}"])
        if finite.any() and sizes[finite].max() > 0.0:
            worst = float(
                np.maximum(worst, divide(predicted[finite].max(), sizes[finite].max()))
            )  # NaN stays NaN
    if np.isfinite(worst):
        return worst
    return float("inf")


INTERVALS_READ = 180
"""Intervals of the sweep at which a run is read at least."""
DENSEST_INTERVALS = 16 * INTERVALS_READ
"""Intervals beyond which steps are so dense that a curve of degree 7 through them is
exact to round-off.
"""


class JudgedSetup(TrialSetup):
    """A scene, ready to be tried with any settings, each read at all of its steps.

    Parameters
    ----------
    before : theta_2 of a further position before the sweep, from which a run starts,
        rad.
    """

    def __init__(
        self,
        scene: Scene,
        intervals: int = INTERVALS_READ,
        before: float | None = None,
    ) -> None:
        command = add_positions(command_of(scene), intervals)
        if before is not None:
            command = command._replace(
                angle=np.append(command.theta_2, before),
                branch=np.append(command.branch, command.branch[0]),
            )
        super().__init__(scene, command)
        self.stated = scene
        self.intervals = intervals
        self.before = before
        self._denser: JudgedSetup | None = None

    def try_out(self, settings: Settings, edit: Edit | None = None) -> Trial:
        """Run through the scene with as many positions as there are steps."""
        if self.intervals > self.steps(settings) or self.intervals >= DENSEST_INTERVALS:
            return super().try_out(settings, edit)
        if self._denser is None:
            self._denser = JudgedSetup(self.stated, 4 * self.intervals, self.before)
        return self._denser.try_out(settings, edit)


def add_positions(command: Command, intervals: int) -> Command:
    """Return a command with evenly spaced positions between its own.

    Errors have their peaks there, most near a pole of T3, T4. A command whose branch
    changes is left as it is.
    """
    if np.ptp(command.branch) != 0:
        return command
    ends = command.theta_2.min(), command.theta_2.max()
    theta_2 = np.union1d(command.theta_2, np.linspace(*ends, intervals + 1))
    return command._replace(
        angle=theta_2,
        branch=np.full(theta_2.shape, command.branch[0], dtype=np.int8),
    )


def remove_attributes(mjcf: str, attributes: Mapping[str, Sequence[str]]) -> str:
    """Remove these attributes of the elements at these paths from a text.

    What they state is left to MuJoCo.
    """
    root = ET.fromstring(mjcf)
    for path, names in attributes.items():
        element = root.find(path)
        assert element is not None
        for name in names:
            element.attrib.pop(name, None)
    return ET.tostring(root, encoding="unicode")


def restore_defaults(mjcf: str) -> str:
    """Return a text in which solref, solimp and the solver are left to MuJoCo.

    MuJoCo's defaults are 0.02 s, impedance 0.9 to 0.95, and Newton to 1e-8.
    """
    return remove_attributes(
        mjcf,
        {
            "option": ("solver", "tolerance", "iterations"),
            "equality/connect": ("solref", "solimp"),
        },
    )
