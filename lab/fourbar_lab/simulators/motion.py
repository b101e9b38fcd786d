"""Simulators as engines of the protocol.

A command is run through in time, or each of its positions is set as a state.
"""

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
        theta = (float(now.theta[0]), float(now.theta[1]), float(now.theta[2]))
        forces = {
            name: np.array(force[:2], float) for name, force in now.forces.items()
        }
        self.instants.append(
            Instant(
                theta,
                float(now.omega_2),
                float(now.alpha_2),
                float(now.torque),
                forces,
            )
        )
        gap = compute_gap_at_B(scene, theta)
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

    def choose_clock(self) -> Callable[[], float]:
        """Choose the clock of the wall on a GPU, and of the processor elsewhere."""
        if self.on_gpu:
            return time.perf_counter
        return time.process_time

    def through(self, scene: Scene, course: Course) -> Readings:
        """Step through a course, and return a reading at each of its stops."""
        raise NotImplementedError

    def states(self, scene: Scene) -> Readings:
        """Evaluate the scene's positions, each set by itself."""
        raise NotImplementedError

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer at the motion that was made."""
        n = len(command.angle)
        rows: NDArray[np.intp] = np.arange(n)
        steps = self.steps
        if steps is None:
            how = "single states"
        else:
            how = f"{steps}/rev"
        setting = f"{self.setting}, {how}"
        try:
            if steps is None:
                _refuse_what_no_simulator_holds(scene, command)
                readings = self.states(scene)
            else:
                led, course = lay_out(scene, command, steps)
                rows = course.rows
                readings = self.through(led, course)
        except (
            InputError,
            LimitError,
        ) as limit:  # InputError: a scene that no file for this simulator can hold
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
        if len(readings.instants) != len(set(rows.tolist())):
            raise NotAssembledError(
                f"{len(readings.instants)} of {len(set(rows.tolist()))} positions were"
                " read"
            )
        read = [readings.instants[row] for row in rows]
        theta = np.array([instant.theta for instant in read])
        moved = [
            np.array([getattr(instant, name) for instant in read])
            for name in ("omega_2", "alpha_2")
        ]
        if not (np.isfinite(theta).all() and np.isfinite(moved).all()):
            raise ArithmeticError("the simulation diverged")
        values = {"theta_3": theta[:, 1], "theta_4": theta[:, 2]}
        values["torque"] = np.array([instant.torque for instant in read])
        values |= {
            name: np.array([instant.forces[name] for instant in read])
            for name in read[0].forces
        }
        turned = (
            np.remainder(theta[:, 0] - command.theta_2 + np.pi, 2.0 * np.pi) - np.pi
        )
        made = Command(command.theta_2 + turned, command.branch, moved[0], moved[1])
        gap = readings.gap / max(scene.linkage.lengths)
        return Answer(
            self.name,
            setting,
            made,
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


def run_through(
    scene: Scene,
    course: Course,
    advance: Callable[[int], Any],
    read: Callable[[Any], Instant],
    clock: Callable[[], float] = time.process_time,
) -> Readings:
    """Run through a course.

    `advance`: so many steps further, by the clock; what it returns is read.
    `clock`: of the processor; of a GPU that of the wall.
    """
    readings = Readings()
    done = 0
    for stop in course.stops:
        began = clock()
        reached = advance(stop - done)
        readings.seconds += clock() - began
        done = stop
        readings.read(scene, read(reached))
    return readings


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
        scene.linkage,
        theta[0],
        np.array([omega_2]),
        np.zeros(1),
        *theta[1:],
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
    fields = [
        find_field(effect) for effect in scene.effects if isinstance(effect, Gravity)
    ]
    if fields:
        return (*fields[0], 0.0)
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


def compute_gap_at_B(scene: Scene, theta: tuple[float, float, float]) -> float:
    """Compute the distance of B on bar 3 from B on bar 4 at the bars' directions, m."""
    linkage = scene.linkage
    a, b, c = (
        bar.length * np.exp(1j * angle)
        for bar, angle in zip(
            (linkage.input, linkage.coupler, linkage.output),
            theta,
            strict=True,
        )
    )
    return float(abs(a + b - c - linkage.ground * np.exp(1j * linkage.ground_angle)))
