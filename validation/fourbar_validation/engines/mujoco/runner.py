"""Run a model through a motion: segments, steps, and forces that MJCF cannot express.

MuJoCo is supplied with loads over theta_2 and the acceleration of a law at each stage
of a step, from the description alone, at its own angle and time.

Where another bar or the cylinder is commanded the input is led so that it moves as
told. With J the derivative of the gap by the joint angles and c that of the commanded
bar's direction or of the stroke,

    J a + (dJ/dt) v = 0,   c a + (dc/dt) v = the commanded acceleration

are solved for the acceleration of the input from MuJoCo's own state at each stage,
which the motor of its flywheel is given.

A released linkage is run through time by MuJoCo's forward dynamics of the generated
MJCF without its flywheel.
"""

import math
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from fourbar.effects import Table
from fourbar.errors import InputError, LimitError
from fourbar.linkage import copy_with
from fourbar.mjcf import RECIPE, Settings, choose_run, write_mjcf
from fourbar.mjcf.model import unwind
from fourbar.quantities import Array, Indices, Mask
from fourbar.scene import Command, Scene, with_signs
from fourbar.scene import command as command_of
from fourbar.scene.motion import Motion
from fourbar_validation.compare.answer import RELEASED_QUANTITIES, Answer, Arrays
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.engines.description import (
    find_from_middle,
    list_speeds,
    look_up,
)
from fourbar_validation.engines.free_body_closure import find_angle
from fourbar_validation.engines.limits import compute_least_sine
from fourbar_validation.engines.loop import Assembler
from fourbar_validation.engines.mujoco.closed_loop import FRICTION_ROWS, O2, ClosedLoop
from fourbar_validation.engines.tree import solve_closed

INSTANTS_OF_A_LAW = 2000
"""Instants at which a law is searched for its greatest speed and acceleration. Between
them it hardly differs.
"""


ActuatorForce = Callable[[mujoco.MjModel, mujoco.MjData], float]
"""The force of an actuator, in units of its gear."""
LIGHT_FLYWHEEL = 1e4
"""Flywheel of the model that gives T3 or T4: heavy enough to keep the closure's
softness small, light enough that the torque it needs does not drown in its rounding.
"""


class Segment:
    """Some positions of a course that follow one another, run through without a stop.

    Attributes are: `fastest`, the greatest speed of what is commanded; `turning`, the
    greatest of the input, rad/s; `omega`, the commanded speed at the start.
    """

    def __init__(self, course: "RunCourse", positions: list[int]) -> None:
        self.course = course
        times = course.times(positions)
        self.began = float(times.min())
        self.duration = float(np.ptp(times))
        self.seconds = dict(zip(positions, (times - self.began).tolist(), strict=True))
        """Time at which each position is passed, from the start of the segment, s."""
        self.width = len(np.unique(times)) - 1
        self.turned = course.turned(positions)
        instants = np.linspace(0.0, self.duration, INSTANTS_OF_A_LAW)
        speeds = course.speeds(self.began + instants)
        self.omega = float(speeds[0])
        self.fastest = float(np.abs(speeds).max())
        self.turning = course.turning(positions, self.fastest)

    def timestep(self, settings: Settings, at_least: int | None = None) -> float:
        """Return the timestep for this segment, s.

        The steps are as many as at the greatest speed of the input throughout, and at
        least as many as positions. One position alone takes any timestep.
        """
        if settings.timestep is not None:
            return settings.timestep * settings.timestep_scale
        if not self.width or not self.turned:
            return 1e-3
        steps = settings.count_steps(self.duration * self.turning, self.turned)
        least = self.width if at_least is None else at_least
        # what is a whole number must not become one more by a rounding
        unit = self.width if self.course.law is not None else 1
        steps = math.ceil(steps / unit * (1.0 - 1e-9)) * unit
        steps = max(steps, least)
        return self.duration / steps * settings.timestep_scale

    def speed(self, seconds: float) -> float:
        """Return the speed that is due after a time, without its sign."""
        due = self.course.speeds(np.array([self.began + seconds]))
        return float(abs(due[0]))


class RunCourse:
    """A command run through in time.

    The input moves at constant acceleration, or by a law; flywheel and closure are then
    laid out for its greatest |omega_2| and |alpha_2|.
    """

    bar: int | None = 2
    """Number of the bar that moves as commanded; None for the stroke."""
    law: Any = None
    """Motion law of the input, of whose instants each position is one."""

    def __init__(self, scene: Scene, command: Command) -> None:
        self.command = self.of_input = command
        self.values = self.theta_2 = command.theta_2
        speeds, accelerations = list_speeds(command)
        self.speed = float(speeds.max())
        self.acceleration = float(accelerations.max())
        if scene.motion.law is not None and command.time is not None:
            self.law = law = scene.motion.law
            self.values = command.time
            instants = np.linspace(law.time[0], law.time[-1], INSTANTS_OF_A_LAW)
            _, speeds, accelerations = np.abs(law.at(instants))
            self.speed = float(speeds.max())
            self.acceleration = float(accelerations.max())
        greatest = self.speed, self.acceleration
        motion = Motion(command.theta_2, *greatest, scene.motion.branch)
        self.scene = replace(scene, motion=motion)
        """The scene whose MJCF is run through."""

    def order(self) -> Indices:
        """Order the positions as they are passed, as indices."""
        values = self.values if self.speed > 0.0 else -self.values
        return np.argsort(values, kind="stable")

    def times(self, positions: list[int]) -> Array:
        """Return when positions that follow one another are passed, s.

        Without a law the first is passed at 0.
        """
        values = self.values[positions]
        if self.law is not None:
            return values
        run = choose_run(values, self.speed, self.acceleration)
        return np.array([run.time(value) for value in values.tolist()])

    def speeds(self, times: Array) -> Array:
        """Return the commanded speed at times."""
        if self.law is None:
            return self.speed + self.acceleration * times
        _, speeds, _ = self.law.at(times)
        return np.asarray(speeds)

    def turned(self, positions: list[int]) -> float:
        """Return the range of theta_2 over some positions, rad.

        A law may go out and back between them.
        """
        angles = self.theta_2[positions]
        if self.law is not None:
            first, last = self.values[[positions[0], positions[-1]]]
            angles, _, _ = self.law.at(np.linspace(first, last, INSTANTS_OF_A_LAW))
        return float(np.ptp(angles))

    def turning(self, positions: list[int], fastest: float) -> float:
        """Return the greatest speed of the input, rad/s; `fastest`: the commanded."""
        return fastest

    def accelerate(self, segment: Segment, timestep: float) -> ActuatorForce | None:
        """Return the input's acceleration at a state, None if the file states it.

        A law is evaluated once, at all stages of a segment's steps.
        """
        if self.law is None:
            return None
        half = timestep / 2.0
        stages = segment.began + np.arange(0.0, segment.duration + timestep, half)
        _, _, alpha = self.law.at(np.minimum(stages, self.law.time[-1]))
        return lambda _, data: float(alpha[round(data.time / half)])

    def least_sine(self, closes: Mask) -> float:
        """Return the least |sin(theta_4 - theta_3)| on the way."""
        return compute_least_sine(self.scene.linkage, self.command.theta_2, closes)


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

    Bar 2 is driven by its flywheel. Another drive is read from a second loop, which is
    closed like the one that is stepped: at a state that a soft closure has reached,
    another closure asks for other forces. Pads stiffen the closure of a crank with a
    flywheel alone, so with pads the second loop has a light one; otherwise it is the
    linkage by itself.

    Parameters
    ----------
    start : own joint angles at the first position.
    settings : with the timestep of the segment.
    compile_loop : makes a loop by settings.
    """

    def __init__(
        self,
        motion_segment: Segment,
        start: Found,
        settings: Settings,
        compile_loop: Callable[[Settings], ClosedLoop],
    ) -> None:
        assert start is not None and settings.timestep is not None
        self.motion_segment = motion_segment
        self.course = course = motion_segment.course
        self.loop = loop = compile_loop(settings)
        self.light = None
        if course.scene.drive_bar != 2:
            flywheel = 0.0
            if settings.pad is not None:
                flywheel = min(settings.flywheel, LIGHT_FLYWHEEL)
            self.light = compile_loop(replace(settings, flywheel=flywheel))
        wound = unwind(course.scene, start)
        self.turns = wound[O2] - start[O2]
        """Whole turns by which MuJoCo's theta_2 is ahead, rad. Springs at pins count
        them.
        """
        loop.set_state(wound, motion_segment.omega, course.bar)
        self.stepper = Stepper(loop.model, loop.data, settings.timestep)

    def to(self, index: int) -> None:
        """Step on to the step nearest to a position."""
        self.stepper.to(self.motion_segment.seconds[index])

    def read(self) -> tuple[float | None, Arrays]:
        """Read the drive and the pin forces of the state last forwarded.

        The drive is a torque (N m), or the force of a cylinder (N). The torque is None
        where it does not move the input.
        """
        torque = self.loop.crank_torque()
        if self.light is None:
            return torque, self.loop.forces()
        return self._solve_elsewhere(self.light, torque), self.light.forces()

    def _solve_elsewhere(self, light: ClosedLoop, crank_torque: float) -> float | None:
        """Solve for what accelerates the crank as it was.

        None if it does not move the crank. That is a couple on bar 3 or 4, or the force
        of the actuator between the cylinder's two sites. The accelerations are linear
        in it; two trials of the size of the crank's torque (T2, N m) give it, and
        `light`, the same linkage with a light flywheel, is left at a third, to be read.
        """
        loop = self.loop
        drive_bar = self.course.scene.drive_bar
        data = light.data
        size = data.qpos.size  # a drive may have coordinates of its own
        data.qpos[:] = loop.data.qpos[:size]
        data.qvel[:] = loop.data.qvel[:size]
        data.time = loop.data.time
        happened = loop.data.qacc[O2]
        # the light flywheel's motor gives it alpha_2 as commanded; this gives it what
        # the crank really had
        given = loop.motor() / (loop.model.dof_armature[O2] or 1.0)
        correction = light.model.dof_armature[O2] * (happened - given)
        speed = float(loop.drive_column(drive_bar)[:size] @ data.qvel)
        guess = crank_torque
        if speed:
            guess = crank_torque * data.qvel[O2] / speed
        trials = (-1.0, 1.0)
        if guess:
            trials = (0.5 * guess, 1.5 * guess)
        return light.solve_drive(drive_bar, happened, trials, correction)


def find_assembled(position: Assembler, command: Command) -> list[Found]:
    """Return the joint angles of every commanded position, None where none closes."""
    places = zip(command.angle.tolist(), command.branch.tolist(), strict=True)
    return [position.find(theta, branch) for theta, branch in places]


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


_MOST_HURRIED = 20.0
"""Greatest speed of the input over its mean: near a limit of what is commanded it grows
without bound, and with it the steps of a window, which are those of the fastest
throughout; here they are 40 000.
"""


class Lead(RunCourse):
    """A command of another bar or of the stroke, and the input's motion by it."""

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
        self.bar = command.bar
        if command.moves_stroke:
            self.bar = None
            command = find_angle(command, motion, *loop.cylinder(command.bar))
        self.command = command
        self.values = command.stated[0]
        self.speed = float(np.max(motion.speed))
        self.acceleration = float(np.max(motion.acceleration))
        assembled = find_assembled(Assembler(loop, command.bar), command)
        closes = np.array([q is not None for q in assembled])
        if not closes.any():
            raise LimitError("the loop closes at none of the positions")
        found = np.full((4, len(assembled)), np.nan)
        for index, q in enumerate(assembled):
            if q is not None:
                found[:, index] = *self._find_input(q), loop.branch()
        found[0, closes] = np.unwrap(found[0, closes])
        self.theta_2, self.omega_2, _, _ = found
        theta_2, omega_2, alpha_2, branch = found[:, closes]
        # greatest speed and acceleration, as for a law: flywheel and closure are sized
        # by them
        fastest = float(np.abs(omega_2).max())
        most_accelerated = float(np.abs(alpha_2).max()) or np.finfo(float).tiny
        largest = Motion(theta_2, fastest, most_accelerated)
        self.scene = replace(scene, motion=largest)
        signs = branch.astype(np.int8)
        self.of_input = Command(theta_2, signs, fastest, most_accelerated)

    def turning(self, positions: list[int], fastest: float) -> float:
        """Return the greatest speed of the input; LimitError if it must hurry."""
        greatest = float(np.abs(self.omega_2[positions]).max())
        if turned := self.turned(positions):
            uneven = float(np.ptp(self.times(positions))) * greatest / turned
            if uneven > _MOST_HURRIED:
                raise LimitError(
                    f"the input is at most {uneven:.0f} times as fast as on the mean;"
                    f" up to {_MOST_HURRIED:g} it is led"
                )
        return greatest

    def accelerate(self, segment: Segment, timestep: float) -> ActuatorForce | None:
        """Return what solves for the acceleration at MuJoCo's state."""
        return self.alpha_2

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
        accelerations = solve_closed(loop.jacobian(), due, column, drift.tolist())
        return float(accelerations[O2])

    def least_sine(self, closes: Mask) -> float:
        """Return the least |sin(theta_4 - theta_3)| on the way; 0 if signs differ."""
        command = self.of_input
        if np.ptp(command.branch):
            return 0.0
        everywhere = np.ones(len(command.theta_2), dtype=bool)
        return compute_least_sine(self.scene.linkage, command.theta_2, everywhere)


OVERRUN = 1e-7
"""Angle by which a simulated crank may turn too far, rad; 1e-9 was seen in healthy
runs, and the angle is judged to 1e-5.
"""


def take_full_size(scene: Scene) -> Scene:
    """Give the scene with loads over theta_2 at their largest size.

    MJCF can state that of them.
    """
    loads = []
    for load in scene.loads:
        if load.table is not None:
            peak = _find_peak(load.table)
            force = load.force
            if force is not None:
                force = (force[0] * peak, force[1])
            moment = load.moment * peak
            loads.append(replace(load, force=force, moment=moment, table=None))
        else:
            loads.append(load)
    return replace(scene, loads=tuple(loads))


def _find_peak(table: Table) -> float:
    return max(map(abs, table.factor)) or 1.0


def evaluate_loads(scene: Scene) -> dict[str, ActuatorForce]:
    """Return functions that evaluate each load's table, by the actuator's name.

    The value is the factor at MuJoCo's own theta_2, over the largest.
    """
    return {
        f"load_{number}": _evaluate_table(load.table)
        for number, load in enumerate(scene.loads, 1)
        if load.table is not None
    }


def _evaluate_table(table: Table) -> ActuatorForce:
    """Return the function that evaluates a table over its largest factor."""
    peak = _find_peak(table)
    points, factors = np.array(table.theta_2), np.array(table.factor)
    arrays = copy_with(table, theta_2=points, factor=factors)
    return lambda _, data: float(look_up(arrays, data.qpos[O2])) / peak


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
        from_middle = find_from_middle(load.table, inside)
        over = np.abs(from_middle) - (last - first) / 2.0
        if (over >= OVERRUN).any():
            raise LimitError(
                f"the motion leaves the table of a load, which covers {first:g} to"
                f" {last:g} rad"
            )
        inside = np.where(over > 0.0, inside - np.copysign(over, from_middle), inside)
    return inside


def receive_forces(loop: ClosedLoop, supplied: Container[str]) -> ClosedLoop:
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


RELEASED = "mujoco-forward"
"""Name of the engine."""
CLOSURE_TIMESTEPS = 2.0
"""Time constant of the loop's closure, in timesteps. Through change points the closure
takes energy out: 1e-6 of it in ten seconds at 1 ms with 2, three hundred times as much
with 10.
"""


class MujocoForward:
    """Free motion of the closed loop with a fixed step, s."""

    name = RELEASED
    version = mujoco.__version__

    def __init__(self, step: float = 1e-3) -> None:
        self.step = step

    def release(self, scene: Scene, times: Array) -> Answer:
        """Integrate the motion at the given times, rising from 0 (s)."""
        scene = state_from_pins(scene)
        setting = f"RK4 {self.step:g} s"
        start = with_signs(scene.linkage, command_of(scene))
        # the times are evenly spaced, and the step divides the interval
        interval = float(times[1] - times[0])
        timestep = interval / math.ceil(interval / self.step - 1e-6)
        settings = replace(
            RECIPE,
            flywheel=0.0,
            timestep=timestep,
            time_constant_steps=CLOSURE_TIMESTEPS,
            pad=None,
        )
        bare = replace(scene, motion=scene.motion.replace(free=None, acceleration=0.0))
        try:
            loop = ClosedLoop(write_mjcf(bare, settings, keyframe=False))
        except InputError as error:
            return Answer(RELEASED, setting, refusal=str(error))
        theta_2 = float(start.theta_2[0])
        q_0 = Assembler(loop).find(theta_2, int(start.branch[0]))
        if q_0 is None:
            refusal = "the loop does not close at the start"
            return Answer(RELEASED, setting, refusal=refusal)
        loop.model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
        loop.set_state(q_0, scene.motion.omega_2 or 0.0)
        rows = []
        stepper = Stepper(loop.model, loop.data, timestep)
        work = _WorkOnBars(loop.model, loop.data, timestep)
        d = loop.data
        for t in times:
            stepper.to(float(t), work.add)
            mujoco.mj_forward(loop.model, d)
            terms = np.array([*d.energy, -work.done])
            rows.append((d.qpos[O2], d.qvel[O2], terms.sum(), np.abs(terms).sum()))
        columns = zip(RELEASED_QUANTITIES, np.array(rows).T, strict=True)
        return Answer(RELEASED, setting, quantities=dict(columns))


class _WorkOnBars:
    """Work of loads, damping and dry friction on the bars, J.

    MuJoCo's own powers at the ends of each step are summed up.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        timestep: float,
    ) -> None:
        self.model = model
        self.data = data
        self.timestep = timestep
        self.done = 0.0
        damped = model.dof_damping.any() or model.tendon_damping.any()
        dry = model.dof_frictionloss.any() or model.tendon_frictionloss.any()
        self.any = bool(model.nu or damped or dry)
        mujoco.mj_forward(model, data)
        self.before = self._compute_power()

    def add(self, _: float) -> None:
        """Add the step just made.

        After a Runge-Kutta step some fields are still of the step before.
        """
        if self.any:
            mujoco.mj_forward(self.model, self.data)
            now = self._compute_power()
            self.done += 0.5 * self.timestep * (self.before + now)
            self.before = now

    def _compute_power(self) -> float:
        d = self.data
        rubbing = np.isin(d.efc_type, FRICTION_ROWS)
        power = float(d.qvel @ (d.qfrc_actuator + d.qfrc_damper))
        return power + float(d.efc_force[rubbing] @ d.efc_vel[rubbing])
