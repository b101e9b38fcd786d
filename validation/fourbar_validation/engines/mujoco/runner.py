"""Run a model through a motion: segments, steps, and forces that MJCF cannot express.

MuJoCo is supplied with loads over theta_2 and the acceleration of a law at each stage
of a step, from the description alone, at its own angle and time.

Where another bar or the cylinder is commanded the input is led so that it moves as
told. With J the derivative of the gap by the joint angles and c that of the commanded
bar's direction or of the stroke,

    J a + (dJ/dt) v = 0,   c a + (dc/dt) v = the commanded acceleration

are solved for the acceleration of the input from MuJoCo's own state at each stage,
which the motor of its flywheel is given.
"""

import bisect
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Load, Table
from fourbar.errors import LimitError
from fourbar.mjcf import RECIPE, Settings, choose_run, write_mjcf
from fourbar.mjcf.document import FULL_TURN
from fourbar.mjcf.model import unwind
from fourbar.quantities import Array
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Law, Motion, Rise, Sine
from fourbar_validation.engines.applied_effects import look_up
from fourbar_validation.engines.free_body_closure import find_angle
from fourbar_validation.engines.limits import compute_least_sine
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.closed_loop import (
    O2,
    ClosedLoop,
    solve_couple_elsewhere,
)
from fourbar_validation.engines.tree import solve_closed

INSTANTS_OF_A_LAW = 2000
"""Instants at which a law is searched for its greatest speed and acceleration. Between
them it hardly differs.
"""


class SteadySegment:
    """A segment of positions in the order of their angles, at constant alpha_2.

    As in `LawSegment`, `omega` is the speed at the start, `fastest` the greatest
    |omega_2|, and `turning` that of the input, rad/s.
    """

    bar: int | None = 2
    """Number of the bar that moves so; None for the stroke."""

    def __init__(
        self,
        theta_2: Array,
        segment: Sequence[int],
        omega: float,
        alpha: float,
    ) -> None:
        self.theta_2 = theta_2
        commanded = theta_2[list(segment)]
        self.run = choose_run(commanded, omega, alpha)
        self.width = len(np.unique(commanded)) - 1
        self.omega = omega
        self.fastest = self.run.fastest
        self.turning = self.fastest

    def timestep(self, settings: Settings) -> float:
        """Return the timestep for this segment, s.

        The segment has at least as many steps as positions; one alone takes any
        timestep.
        """
        if self.width:
            return self.run.timestep(settings, at_least=self.width)
        return 1e-3

    def seconds(self, index: int) -> float:
        """Return the time at which it passes a position.

        The angle from the start of the segment gives it.
        """
        return self.run.time(float(self.theta_2[index]))

    def speed(self, turned: float, seconds: float) -> float:
        """Return |omega_2| that is due after a turn (rad) and a time.

        The angle turned gives it.
        """
        squared = self.run.omega**2 + 2.0 * self.run.alpha * turned
        return math.sqrt(max(squared, 0.0))


class LawSegment:
    """A segment of positions in the order of their times, by a motion law."""

    bar = 2

    def __init__(
        self,
        law: Law | Rise | Sine,
        command: Command,
        segment: Sequence[int],
    ) -> None:
        assert command.time is not None
        self.law = law
        self.time = command.time
        self.began = float(command.time[segment[0]])
        ends = float(command.time[segment[-1]])
        self.intervals = len(segment) - 1
        self.duration = ends - self.began
        _, at_begin, _ = law.at(np.array([self.began]))
        self.omega = float(at_begin[0])
        self.knots = list(law.time)
        _, _, at_knots = law.at(np.array(law.time))
        self.at_knots = at_knots.tolist()
        instants = np.linspace(self.began, ends, INSTANTS_OF_A_LAW)
        angles, speeds, _ = law.at(instants)
        # the stages of a step share their instants
        self.evaluate_alpha = lru_cache(maxsize=4)(self._evaluate_alpha)
        self.fastest = float(np.abs(speeds).max())
        self.turning = self.fastest
        self.width = float(np.ptp(angles))

    def timestep(self, settings: Settings) -> float:
        """Divide the time from each position to the next into whole steps."""
        if not self.intervals:
            return 1e-3
        turned = self.duration * self.fastest
        revolutions = turned / (2.0 * math.pi)
        steps = revolutions * settings.steps_per_revolution
        if 0.0 < self.width < FULL_TURN:
            steps = max(steps, settings.steps_per_window * turned / self.width)
        pieces = math.ceil(steps / self.intervals * (1.0 - 1e-9))
        timestep = self.duration / (self.intervals * pieces)
        return timestep * settings.timestep_scale

    def seconds(self, index: int) -> float:
        """Return the time of a position since the segment began, s."""
        return float(self.time[index]) - self.began

    def speed(self, turned: float, seconds: float) -> float:
        """Return |omega_2| at a time from the segment's begin, rad/s."""
        instant = np.array([self.began + seconds])
        _, speed, _ = self.law.at(instant)
        return float(abs(speed[0]))

    def alpha(self, seconds: float) -> float:
        """Return the law's angular acceleration at a time, rad/s^2.

        A law of cubic pieces is linear between knots in acceleration, and is
        interpolated; another law is evaluated.
        """
        instant = self.began + seconds
        if not (isinstance(self.law, Law) and self.law.omega is None):
            return self.evaluate_alpha(instant)
        times = self.knots
        knots_before = bisect.bisect_right(times, instant)
        after = min(max(knots_before, 1), len(times) - 1)
        before = after - 1
        part = (instant - times[before]) / (times[after] - times[before])
        start = self.at_knots[before]
        stop = self.at_knots[after]
        return float(start + part * (stop - start))

    def _evaluate_alpha(self, instant: float) -> float:
        _, _, alpha = self.law.at(np.array([instant]))
        return float(alpha[0])


MotionSegment = SteadySegment | LawSegment


def find_extremes(law: Law | Rise | Sine) -> tuple[float, float]:
    """Find the greatest |omega_2| and |alpha_2| of a law.

    Flywheel and closure are laid out for them.
    """
    instants = np.linspace(law.time[0], law.time[-1], INSTANTS_OF_A_LAW)
    _, omega, alpha = law.at(instants)
    return float(np.abs(omega).max()), float(np.abs(alpha).max())


def order_in_time(
    values: Array,
    time: Array | None,
    speed: float,
) -> NDArray[np.intp]:
    """Order the positions as they are passed, as indices.

    The order is by what is commanded or by the times of a law.
    """
    if time is not None:
        passed = time
    elif speed > 0.0:
        passed = values
    else:
        passed = -values
    return np.argsort(passed, kind="stable")


LIGHT_FLYWHEEL = 1e4
"""Flywheel of the model that gives T3 or T4: heavy enough to keep the closure's
softness small, light enough that the torque it needs does not drown in its rounding.
"""
Found = tuple[float, float, float] | None
"""Own joint angles (O2, A, O4), None where the loop does not close."""


class Stepper:
    """Counts the steps of a model from its present state on."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        timestep: float,
    ) -> None:
        self.model = model
        self.data = data
        self.timestep = timestep
        self.done = 0

    def to(self, seconds: float, each: Callable[[float], None] | None = None) -> None:
        """Step on to the step nearest to a time.

        `each` is called with the time after every step.
        """
        steps = round(seconds / self.timestep) - self.done
        if each is None:
            if steps > 0:
                mujoco.mj_step(self.model, self.data, steps)
                self.done += steps
            return
        for _ in range(steps):
            mujoco.mj_step(self.model, self.data)
            self.done += 1
            each(self.time)

    @property
    def time(self) -> float:
        """Return what the model's own time must be, s."""
        return self.done * self.timestep

    def lost(self) -> bool:
        """Return whether MuJoCo reset the data.

        A reset starts time again, and clears the warnings.
        """
        return bool(self.data.time < self.time * (1.0 - 1e-6))


class SimulatedRun:
    """One segment of positions at a prescribed motion.

    `light`: the model that a drive elsewhere is read from.
    """

    def __init__(
        self,
        scene: Scene,
        loop: ClosedLoop,
        light: ClosedLoop | None,
        motion_segment: MotionSegment,
        start: tuple[float, float, float],
        timestep: float,
    ) -> None:
        self.scene = scene
        self.loop = loop
        self.light = light
        self.motion_segment = motion_segment
        wound = unwind(scene, start)
        self.turns = wound[O2] - start[O2]
        """Whole turns by which MuJoCo's theta_2 is ahead, rad. Springs at pins count
        them.
        """
        loop.set_state(wound, motion_segment.omega, motion_segment.bar)
        self.begins = self.progress()
        self.stepper = Stepper(loop.model, loop.data, timestep)

    def progress(self) -> float:
        """Return the angle or stroke of what moves as commanded."""
        bar = self.motion_segment.bar
        if bar is None:
            return self.loop.stroke()
        return self.loop.angle(bar)

    def to(self, index: int) -> None:
        """Step on to the step nearest to a position."""
        self.stepper.to(self.motion_segment.seconds(index))

    def read(self) -> tuple[float | None, dict[str, Array]]:
        """Read the drive and the pin forces of the state last forwarded.

        The drive is a torque (N m), or the force of a cylinder (N). The torque is None
        where it does not move the input.
        """
        torque = self.loop.crank_torque()
        if self.light is None:
            return torque, self.loop.forces()
        couple = solve_couple_elsewhere(
            self.loop,
            self.light,
            self.scene.drive_bar,
            self.loop.given(),
            torque,
        )
        return couple, self.light.forces()


def find_assembled(
    position: Assembler,
    command: Command,
    order: Iterable[int],
) -> list[Found]:
    """Return the joint angles of every commanded position, None where none closes.

    Positions are assembled in the order given, each from the one before.
    """
    assembled: list[Found] = [None] * len(command.angle)
    for index in order:
        angle = float(command.angle[index])
        branch = int(command.branch[index])
        assembled[index] = position.find(angle, branch)
    return assembled


def split_segments(
    assembled: list[Found],
    order: Iterable[int],
    joined: Callable[[int, int], bool] = lambda one, other: True,
) -> list[list[int]]:
    """Split the positions, in order of time, into segments.

    A segment ends where the loop does not close, or two neighbours are not joined.
    """
    segments: list[list[int]] = [[]]
    for index in order:
        current = segments[-1]
        if assembled[index] is None:
            segments.append([])
        elif current and not joined(current[-1], index):
            segments.append([int(index)])
        else:
            current.append(int(index))
    return [segment for segment in segments if segment]


_MOST_UNEVEN = 20.0
"""Greatest speed of the input over its mean: near a limit of what is commanded it grows
without bound, and with it the steps of a window, which are those of the fastest
throughout; here they are 40 000.
"""


class Lead:
    """Command of another bar or of the stroke, and the input's motion.

    The motion is that at each position.
    """

    def __init__(self, scene: Scene, command: Command) -> None:
        motion = scene.motion
        if motion.law is not None:
            raise LimitError(
                "a motion law of another bar than the input is not run through time"
                " here"
            )
        still = replace(take_full_size(scene), motion=Motion(0.0, 1.0))
        settings = replace(RECIPE, timestep=1e-3)
        self.loop = loop = ClosedLoop(write_mjcf(still, settings, keyframe=False))
        self.bar: int | None = command.bar
        """Number of the commanded bar; None if the stroke is commanded."""
        if command.moves_stroke:
            self.bar = None
            command = find_angle(command, motion, *loop.cylinder(command.bar))
        self.command = command
        self.values: Array = command.stated[0]
        self.speed = float(np.max(motion.speed or 0.0))
        self.acceleration = float(np.max(motion.acceleration))
        positions = range(len(self.values))
        assembled = find_assembled(Assembler(loop, command.bar), command, positions)
        self.closes = np.array([q is not None for q in assembled])
        if not self.closes.any():
            raise LimitError("the loop closes at none of the positions")
        self.input = np.full((3, len(assembled)), np.nan)
        """theta_2, omega_2, alpha_2."""
        branch = command.branch.copy()
        for index, q in enumerate(assembled):
            if q is not None:
                self.input[:, index] = self._find_input(q)
                branch[index] = loop.branch()
        self.input[0, self.closes] = np.unwrap(self.input[0, self.closes])
        theta_2, omega_2, alpha_2 = self.input[:, self.closes]
        # greatest speed and acceleration, as for a law: flywheel and closure are sized
        # by them
        fastest = float(np.abs(omega_2).max())
        most_accelerated = float(np.abs(alpha_2).max()) or np.finfo(float).tiny
        largest = Motion(theta_2, fastest, most_accelerated)
        self.scene = replace(scene, motion=largest)
        self.of_input = Command(
            theta_2,
            branch[self.closes],
            fastest,
            most_accelerated,
        )

    def _find_input(self, q: tuple[float, float, float]) -> tuple[float, float, float]:
        """Find theta_2, omega_2 and alpha_2 of the input at joint angles.

        MuJoCo is left at that state.
        """
        loop = self.loop
        try:
            loop.set_state(q, self.speed, self.bar)
        except np.linalg.LinAlgError:
            raise LimitError(
                "the commanded motion stands at a limit of its own"
            ) from None
        mujoco.mj_forward(loop.model, loop.data)
        omega_2 = float(loop.data.qvel[O2])
        return q[O2], omega_2, self.alpha_2(loop.model, loop.data)

    def alpha_2(self, model: mujoco.MjModel, data: mujoco.MjData) -> float:
        """Solve for the acceleration of the input at a state, rad/s^2.

        MuJoCo is evaluating the state.
        """
        loop = copy(self.loop)
        loop.model = model
        loop.data = data
        drift = (loop.rate_at("B3") - loop.rate_at("B4")) @ data.qvel
        due = self.acceleration - loop.drive_drift(self.bar)
        column = loop.drive_column(self.bar)
        accelerations = solve_closed(loop.jacobian(), due, column, *drift.tolist())
        return float(accelerations[O2])

    def least_sine(self) -> float:
        """Return the least |sin(theta_4 - theta_3)| on the way; 0 if signs differ."""
        command = self.of_input
        if np.ptp(command.branch):
            return 0.0
        everywhere = np.ones(len(command.theta_2), dtype=bool)
        return compute_least_sine(self.scene.linkage, command.theta_2, everywhere)


class LedSegment(SteadySegment):
    """A segment of positions in the order of what is commanded."""

    def __init__(self, lead: Lead, segment: Sequence[int]) -> None:
        super().__init__(lead.values, segment, lead.speed, lead.acceleration)
        self.bar = lead.bar
        theta_2, omega_2, _ = lead.input[:, list(segment)]
        self.turning = float(np.abs(omega_2).max())
        self.turned = float(np.ptp(theta_2))

    def timestep(self, settings: Settings) -> float:
        """Divide the time by what the input turns."""
        if not self.width or not self.turned:
            return 1e-3
        duration = self.run.time(self.run.stop)
        most = duration * self.turning
        uneven = most / self.turned
        if uneven > _MOST_UNEVEN:
            raise LimitError(
                f"the input is at most {uneven:.0f} times as fast as on the mean; up to"
                f" {_MOST_UNEVEN:g} it is led"
            )
        steps = most / (2.0 * np.pi) * settings.steps_per_revolution
        if 0.0 < self.turned < FULL_TURN:
            steps = max(steps, settings.steps_per_window * uneven)
        timestep = duration / max(np.ceil(steps), self.width)
        return float(timestep * settings.timestep_scale)


OVERRUN = 1e-7
"""Angle by which a simulated crank may turn too far, rad; 1e-9 was seen in healthy
runs, and the angle is judged to 1e-5.
"""
ActuatorForce = Callable[[mujoco.MjModel, mujoco.MjData], float]
"""The force of an actuator, in units of its gear."""


def take_full_size(scene: Scene) -> Scene:
    """Give the scene with loads over theta_2 at their largest size.

    MJCF can state that of them.
    """
    loads = []
    for load in scene.loads:
        peak = _find_peak_of_load(load)
        force = None
        if load.force is not None:
            size, angle = load.force
            force = (size * peak, angle)
        full = replace(load, force=force, moment=load.moment * peak, table=None)
        loads.append(full)
    return replace(scene, loads=tuple(loads))


def _find_peak_of_load(load: Load) -> float:
    if load.table is None:
        return 1.0
    return _find_peak_of_table(load.table)


def _find_peak_of_table(table: Table) -> float:
    return max(abs(factor) for factor in table.factor) or 1.0


def evaluate_loads(scene: Scene) -> dict[str, ActuatorForce]:
    """Return functions that evaluate each load's table, by the actuator's name.

    The value is the factor at MuJoCo's own theta_2, over the largest.
    """
    forces = {}
    for number, load in enumerate(scene.loads, 1):
        if load.table is not None:
            forces[f"load_{number}"] = _evaluate_table(load.table)
    return forces


def _evaluate_table(table: Table) -> ActuatorForce:
    """Return the function that evaluates a table over its largest factor."""
    peak = _find_peak_of_table(table)
    first = table.theta_2[0]
    last = table.theta_2[-1]

    def factor(_: mujoco.MjModel, data: mujoco.MjData) -> float:
        turned = (float(data.qpos[O2]) - first) % math.tau
        angle = first + turned
        if angle > last:  # the stages of a step may look beyond the end of a table
            to_first = first + math.tau - angle
            angle = last if angle - last < to_first else first
        return look_up(table, angle) / peak

    return factor


def clip_angles(scene: Scene, theta_2: Array) -> Array:
    """Put angles that overran the end of a table back on it.

    The overrun is a rounding of the motion; LimitError beyond that.
    """
    inside = theta_2.copy()
    for load in scene.loads:
        if load.table is None:
            continue
        first = load.table.theta_2[0]
        last = load.table.theta_2[-1]
        angle = first + np.remainder(inside - first, math.tau)
        over = angle - last
        under = first + math.tau - angle
        outside = over > 0.0
        near = np.minimum(over, under) < OVERRUN
        if not (~outside | near).all():
            raise LimitError(
                f"the motion leaves the table of a load, which covers {first:g} to"
                f" {last:g} rad"
            )
        back = np.where(over < under, -over, under)
        inside = inside + np.where(outside, back, 0.0)
    return inside


def receive_forces(loop: ClosedLoop, supplied: dict[str, ActuatorForce]) -> ClosedLoop:
    """Let the actuators of these names take their force from `supply_forces`."""
    for number in range(loop.model.nu):
        if loop.model.actuator(number).name in supplied:
            loop.model.actuator_biastype[number] = mujoco.mjtBias.mjBIAS_USER
    return loop


@contextmanager
def supply_forces(supplied: dict[str, ActuatorForce]) -> Iterator[None]:
    """Supply forces to MuJoCo as long as the context lasts.

    MuJoCo's callbacks are of the whole process.
    """
    if not supplied:
        yield
        return

    def force(
        model: mujoco.MjModel,
        data: mujoco.MjData,
        number: int,
    ) -> float:
        name = model.actuator(number).name
        return supplied[name](model, data)

    before = mujoco.get_mjcb_act_bias()
    mujoco.set_mjcb_act_bias(force)
    try:
        yield
    finally:
        mujoco.set_mjcb_act_bias(before)
