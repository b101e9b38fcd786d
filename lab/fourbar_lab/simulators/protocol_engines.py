"""Simulators as engines of the protocol.

A command is run through in time, or each of its positions is set as a state.
"""

import cmath
import copy
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Gravity
from fourbar.errors import InputError, LimitError, NotAssembledError
from fourbar.mjcf import RECIPE
from fourbar.mjcf.document import Start, choose_run
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, command, find_signs, with_signs
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.bodies import pose
from fourbar_validation.engines.description import find_field, list_speeds
from fourbar_validation.engines.free_body import speeds_and_accelerations
from fourbar_validation.engines.free_body_closure import close

Floats = NDArray[np.floating[Any]]
"""Array in the precision of a simulator."""
DEFAULT_STEPS_OF_A_TURN = 628
"""Steps in a turn where no setting states them."""
RECIPE_WITH_A_LIGHT_FLYWHEEL = replace(RECIPE, flywheel=30.0)
"""Recipe for accelerations that are differences of speeds: of a heavier flywheel's they
keep no digits, and solvers that end at a part of all momentum leave the loop to itself
beside it.
"""
_LEADS = tuple(np.pi / 2.0**power for power in range(1, 6))
"""Angle by which a run begins before its first position, rad. Where the linkage closes
there, its closure settles.
"""
_FROM_TOGGLE = 0.1
"""Least |sin(theta_4 - theta_3)| on the way to the first position."""


class Instant(NamedTuple):
    """Numbers that can be read from a simulator at one instant, SI units."""

    theta: Sequence[Any]
    """theta_2, theta_3, theta_4, of the simulator itself, rad."""
    omega_2: float
    alpha_2: float
    torque: float
    forces: dict[str, Any]
    """Forces of the pins that can be read, N."""


class Course(NamedTuple):
    """One run of a simulator through the positions of a command."""

    timestep: float
    """s."""
    steps: int
    """Steps in a turn."""
    stops: list[int]
    """Numbers of steps after which the simulator is read, rising."""
    rows: NDArray[np.intp]
    """Stop of each position, (n,)."""


@dataclass(slots=True)
class Readings:
    """Instants of one simulator, in the order in which they were read."""

    instants: list[Instant] = field(default_factory=list)
    gap: float = 0.0
    """Greatest distance of B on bar 3 from B on bar 4, m."""
    seconds: float = 0.0
    """Processor time of the steps alone, s."""

    def read(self, scene: Scene, now: Instant) -> None:
        """Add a reading, as a copy: a simulator may hand out views of its state."""
        self.instants.append(copy.deepcopy(now))
        gap = compute_gap_at_B(scene, now.theta)
        self.gap = float(np.maximum(self.gap, gap))  # NaN stays NaN


class Worlds(NamedTuple):
    """Single states of one model in many worlds, evaluated by one call."""

    evaluate: Callable[[], Any]
    """Evaluates the states where they lie, and returns when all are done."""
    exchange: Callable[[], tuple[Floats, ...]]
    """Sets the states from NumPy's arrays, evaluates them, and copies the results back:
    qpos, qvel, qacc, actuator_force, closing force and cfrc_int, a row a world.
    """
    read: Callable[[tuple[Floats, ...]], Readings]
    """Reads the last worlds, one for each position of the scene."""


class Simulator:
    """Base of the simulators.

    A simulator chooses a setting, runs or evaluates single states, and states the
    motion made.
    """

    name: str
    version = ""
    device = "CPU"
    on_gpu = False
    made_for = ""
    changed = ""
    """Changes to the simulator's input or defaults that were needed."""
    quantities = ("theta_3", "theta_4", "torque", *PIN_FORCES)
    effects: tuple[str, ...] = ("gravity",)
    tolerance = (0.05, "a simulation whose error falls with its timestep")
    settings: ClassVar[Mapping[str, Any]]
    """Names of the settings, each with what it sets."""
    single_states = False
    """True if `states` evaluates positions that are set one by one."""

    def __init__(self) -> None:
        self.setting = next(iter(self.settings))
        self.steps = None if self.single_states else DEFAULT_STEPS_OF_A_TURN

    def at_setting(
        self,
        name: str | None = None,
        steps_per_turn: int | None = None,
        error: float | None = None,
    ) -> "Simulator":
        """Return the simulator with a setting, in so many steps a turn."""
        if error is not None:
            raise LimitError("it knows no law of its error: ask for steps_per_turn")
        chosen = copy.copy(self)
        chosen.setting = name or self.setting
        chosen.steps = steps_per_turn or self.steps
        return chosen

    def run(
        self,
        scene: Scene,
        course: Course,
        advance: Callable[[int], Any],
        read: Callable[[Any], Instant],
    ) -> Readings:
        """Run through a course.

        Parameters
        ----------
        advance : so many steps further; what it returns is read.
        """
        # the clock of the wall on a GPU, of the processor elsewhere
        clock = time.perf_counter if self.on_gpu else time.process_time
        readings = Readings()
        done = 0
        for stop in course.stops:
            began = clock()
            reached = advance(stop - done)
            readings.seconds += clock() - began
            done = stop
            readings.read(scene, read(reached))
        return readings

    def run_by_steps(
        self,
        scene: Scene,
        course: Course,
        step: Callable[[], Any],
        look: Callable[[], Any],
        read: Callable[[Any], Instant],
    ) -> Readings:
        """Run through a course whose forces are those of a step.

        Parameters
        ----------
        look : the state in which the last step before a stop begins.
        read : the instant of that state, after the step.
        """

        def advance(steps: int) -> Any:
            for _ in range(steps - 1):
                step()
            before = look()
            step()
            return before

        return self.run(scene, course, advance, read)

    def through(self, scene: Scene, course: Course) -> Readings:
        """Step through a course, and return a reading at each of its stops."""
        raise NotImplementedError

    def states(self, scene: Scene) -> Readings:
        """Evaluate the scene's positions, each set by itself."""
        raise NotImplementedError

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer at the motion that was made."""
        rows: NDArray[np.intp] = np.arange(len(command.angle))
        how = "single states" if self.steps is None else f"{self.steps}/rev"
        setting = f"{self.setting}, {how}"
        try:
            if self.steps is None:
                _refuse_what_no_simulator_holds(scene, command)
                readings = self.states(scene)
            else:
                led, course = lay_out(scene, command, self.steps)
                rows = course.rows
                readings = self.through(led, course)
        # InputError: a scene that no file for this simulator can hold
        except (InputError, LimitError) as limit:
            return Answer(self.name, setting, refusal=str(limit))
        return self.make_answer(scene, command, setting, readings, rows)

    def make_answer(
        self,
        scene: Scene,
        command: Command,
        setting: str,
        readings: Readings,
        rows: NDArray[np.intp],
    ) -> Answer:
        """Make an answer of readings, at the motion that was made.

        `rows`: reading of each position of the command, (n,).
        """
        count = len(readings.instants)
        asked = len(np.unique(rows))
        if count != asked:
            raise NotAssembledError(f"{count} of {asked} positions were read")
        read = zip(*(readings.instants[row] for row in rows), strict=True)
        theta, omega, alpha, torque, forces = read
        theta_2, theta_3, theta_4 = np.array(theta, float).T
        motion = np.array([omega, alpha], float)
        if not (np.isfinite(theta).all() and np.isfinite(motion).all()):
            raise ArithmeticError("the simulation diverged")
        values = {
            "theta_3": theta_3,
            "theta_4": theta_4,
            "torque": np.array(torque, float),
        }
        for name in forces[0]:
            values[name] = np.array([of_pins[name] for of_pins in forces], float)
        turned = np.remainder(theta_2 - command.theta_2 + np.pi, math.tau) - np.pi
        gap = readings.gap / max(scene.linkage.lengths)
        return Answer(
            self.name,
            setting,
            Command(command.theta_2 + turned, command.branch, *motion),
            np.ones(len(rows), bool),
            values,
            evidence={"gap": gap},
            shared=self.changed,
            seconds=readings.seconds,
        )


def _refuse_what_no_simulator_holds(scene: Scene, command: Command) -> None:
    """Raise LimitError for a motion other than omega_2 on one branch, and for loads."""
    speed, acceleration = list_speeds(command)
    steady = (
        command.speed is not None
        and speed[0] != 0.0
        and np.ptp(speed) == 0.0
        and not acceleration.any()
    )
    if not steady or scene.loads or np.ptp(command.branch) != 0:
        raise LimitError(
            "a simulator runs at one speed omega_2, without loads, on one branch"
        )


def lay_out(
    scene: Scene,
    command: Command,
    steps: int,
) -> tuple[Scene, Course]:
    """Lay out a run through the positions of a command.

    The scene's motion begins before them, so that it settles.
    """
    _refuse_what_no_simulator_holds(scene, command)
    sense = math.copysign(1.0, scene.motion.omega_2 or 0.0)
    first = float((sense * command.theta_2).min()) * sense
    lead = next(
        (
            lead
            for lead in _LEADS
            if _closes(scene, np.linspace(first - sense * lead, first, 50))
        ),
        0.0,
    )
    progress = sense * (command.theta_2 - first) + lead
    stops, rows = np.unique(
        np.maximum(1, np.rint(progress / math.tau * steps).astype(int)),
        return_inverse=True,
    )
    if len(stops) < len(np.unique(progress)):
        raise LimitError("its positions lie closer together than the steps")
    motion = scene.motion.replace(
        angle=np.array([first - sense * lead, *command.theta_2])
    )
    return replace(scene, motion=motion), Course(
        find_timestep(scene, steps),
        steps,
        stops.tolist(),
        rows,
    )


def _closes(scene: Scene, theta_2: Array) -> bool:
    """Tell whether the linkage closes at all these angles, and far from a toggle."""
    signs = find_signs(scene.linkage, theta_2, scene.motion.branch)
    closed = close(scene.linkage, theta_2, signs)
    return bool(
        closed.assembled.all()
        and np.abs(np.sin(closed.theta[1] - closed.theta[0])).min() > _FROM_TOGGLE
    )


def find_timestep(scene: Scene, steps: int) -> float:
    """Return the timestep of a turn in so many steps, s."""
    return math.tau / abs(float(scene.motion.omega_2 or math.nan)) / steps


def start(scene: Scene) -> Start:
    """Return the state at the first position that closes, in the sense of motion.

    Angles and speeds are of the free bodies' engine: no simulator starts from what the
    formulas computed.
    """
    commanded = with_signs(scene.linkage, command(scene))
    omega_2 = scene.motion.omega_2 or 0.0
    closed = close(scene.linkage, commanded.theta_2, commanded.branch)
    usable = np.flatnonzero(closed.assembled)
    if not len(usable):
        raise NotAssembledError(
            "the linkage closes at none of the scene's positions: there is nothing to"
            " start from"
        )
    theta_2 = commanded.theta_2[usable]
    first = usable[[np.argmin(theta_2) if omega_2 >= 0.0 else np.argmax(theta_2)]]
    theta = (commanded.theta_2[first], *closed.theta[:, first])
    omega = speeds_and_accelerations(
        pose(scene.linkage, theta), np.array([omega_2]), np.zeros(1)
    ).omega
    q = [float(x[0]) for x in theta]
    v = [float(omega[bar][0]) for bar in (2, 3, 4)]
    return Start(
        (q[0], q[1] - q[0], q[2]),
        (v[0], v[1] - v[0], v[2]),
        choose_run(theta_2, omega_2, 0.0),
    )


def gravity_field(scene: Scene) -> tuple[float, float, float]:
    """Return the field of gravity, m/s^2."""
    for effect in scene.effects:
        if isinstance(effect, Gravity):
            return (*find_field(effect), 0.0)
    return (0.0, 0.0, 0.0)


@contextmanager
def write_temp(text: str, name: str) -> Iterator[str]:
    """Write text to a temporary file, and yield its path to a simulator.

    The file lasts as long as the context.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_text(text, encoding="utf-8")
        yield str(file)


def rotate(angle: float, x: float, y: float) -> tuple[float, float]:
    """Rotate (x, y) along and across a line at an angle (rad) into world axes."""
    turned = complex(x, y) * cmath.rect(1.0, angle)
    return turned.real, turned.imag


def bar_directions(q: Any) -> tuple[Any, Any, Any]:
    """Return theta_2, theta_3, theta_4 of the joint angles at O2, A and O4, rad."""
    return q[0], q[0] + q[1], q[2]


def read_flywheel(
    course: Course,
    inertia: float,
    theta: Sequence[Any],
    speeds: tuple[float, float],
    forces: dict[str, Any],
) -> Instant:
    """Return the instant in which a step begins.

    Parameters
    ----------
    inertia : of the flywheel, whose change of momentum is the torque, kg m^2.
    speeds : omega_2 before and after the step, rad/s.
    """
    before, after = speeds
    alpha = (after - before) / course.timestep
    return Instant(theta, before, alpha, -inertia * alpha, forces)


def compute_gap_at_B(scene: Scene, theta: Sequence[float]) -> float:
    """Compute the distance of B on bar 3 from B on bar 4 at the bars' directions, m."""
    d, *lengths = scene.linkage.lengths
    a, b, c = lengths * np.exp(1j * np.asarray(theta))
    return float(abs(a + b - c - d * np.exp(1j * scene.linkage.ground_angle)))
