"""Results of MuJoCo on the loops of a robot, as plain data."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.quantities import COUPLE, PIN_FORCES, Array
from fourbar.scene import Command, Scene, command
from fourbar_validation.compare.tolerance import WELL_CONDITIONED
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.mujoco.robots.loop_facts import PoseOptions

FORCE_QUANTITIES = ("torque", *PIN_FORCES)
OTHER_ASSEMBLY = (
    "MuJoCo goes over to the other assembly before the loop has settled; the motion of"
    " a SCENE may start elsewhere"
)
"""Why a motion has no state that counts."""
ROUND_OFF_OF_A_FILE = 1e-5
"""Part of its terms below which a torque or a pin force is the rounding of a file.
MuJoCo saves six significant digits: half of the last is up to 5e-6 of a length, and the
difference of two lengths is off by twice as much.
"""


class LoopMotion(NamedTuple):
    """Motion of the commanded bar in the plane of a loop."""

    angle: tuple[float, ...]
    """rad."""
    speed: float | tuple[float, ...]
    """rad/s, one of all positions or one of each."""
    acceleration: float | tuple[float, ...]
    """rad/s^2."""

    @property
    def varies(self) -> bool:
        """Tell whether speed or acceleration differ from position to position."""
        return bool(np.ptp(self.speed) or np.ptp(self.acceleration))

    def states(self) -> Iterator[tuple[float, float, float]]:
        """Iterate over angle, speed and acceleration of each position."""
        yield from np.column_stack(np.broadcast_arrays(*self)).tolist()

    def thin_out(self, most: int) -> "LoopMotion":
        """Return the motion with at most so many positions, spread evenly.

        Both ends are among them.
        """
        count = min(len(self.angle), most)
        keep = np.linspace(0, len(self.angle) - 1, count).round().astype(int)
        parts: list[Any] = [
            tuple(np.array(part)[keep].tolist()) if isinstance(part, tuple) else part
            for part in self
        ]
        return LoopMotion(*parts)


@dataclass(frozen=True, slots=True)
class PinsAndTorque:
    """Drive of a state, and its pin forces in the axes of the plane, (2,) each, N."""

    torque: float
    """Couple of the drive, N m, or its force, N."""
    forces: dict[str, Array]

    def values(self) -> dict[str, Any]:
        """Return the drive as "torque", and the pin forces, by their names."""
        return {"torque": self.torque, **self.forces}


def measure_sizes(values: Any) -> Array:
    """Return the sizes of numbers (n,) or of vectors (n, 2), (n,)."""
    numbers = np.asarray(values, dtype=float)
    return np.asarray(np.abs(numbers) if numbers.ndim == 1 else np.hypot(*numbers.T))


def find_scales(
    sizes: Mapping[str, Array],
    conditions: Array,
    lever: float,
) -> dict[str, float]:
    """Return what the errors of torque and pin forces are divided by, N m and N.

    The scale of each is its largest size. One that is the round-off of its terms at
    every well-conditioned state is a sum that cancels: its scale is that of the terms,
    the largest pin force, for the torque times the longest moving bar.

    Parameters
    ----------
    sizes : size of the torque and of each pin force at each state, (n,), N m and N.
    conditions : |sin| of the angle between the bars that follow at each state, (n,).
    lever : longest moving bar, m; 1 where the drive is a force.
    """
    force = np.max([sizes[name] for name in PIN_FORCES], axis=0)
    well = conditions >= WELL_CONDITIONED
    scales = {}
    for name in FORCE_QUANTITIES:
        terms = force
        if name == "torque":
            terms = force * lever
        cancels = sizes[name] <= ROUND_OFF_OF_A_FILE * terms
        vanishes = well.any() and cancels[well].all()
        scale = terms if vanishes else sizes[name]
        scales[name] = float(scale.max())
    return scales


def divide(error: float, scale: float) -> float:
    """Return an error over its scale; without a scale it is infinite, or zero."""
    if scale and math.isfinite(error):
        return error / scale
    return math.inf if error else 0.0


class WorstState(NamedTuple):
    """State at which one of the torque and the pin forces has the worst error."""

    error: float
    """Error over the scale of the quantity; infinite without an answer."""
    quantity: str = ""
    joint: float = math.nan
    """Position of the driven joint, rad."""
    angle: float = math.nan
    """Angle of the commanded bar in the plane of the loop, rad."""


class BarMotion(NamedTuple):
    """Angles (rad) and speeds (rad/s) of the moving bars in the plane of a loop."""

    theta_2: float
    theta_3: float
    theta_4: float
    omega_2: float
    omega_3: float
    omega_4: float


@dataclass(frozen=True, slots=True)
class InsideRow:
    """One state of a loop in its robot."""

    angle: float
    """Angle of the commanded bar, rad."""
    speed: float
    acceleration: float
    joint: float
    """Position of the driven joint as the file counts it, rad."""
    soft: PinsAndTorque
    """Torque and pin forces as MuJoCo has them."""
    rigid: PinsAndTorque
    """Values with rigid pins at the closed state of the same command."""
    gap: float
    """Distance of the ends of the closure, m."""
    bars: BarMotion
    """Motion of the state that MuJoCo evaluates."""
    condition: float
    """|sin| of the angle between the bars that follow in that closed state."""


@dataclass(slots=True)
class InsideAnswer:
    """Results of MuJoCo on a loop at some states of the whole robot."""

    rows: list[InsideRow] = field(default_factory=list)
    in_line: tuple[float, ...] = ()
    """Positions of the driven joint that are left out, because the bars that follow are
    in line there, rad.
    """
    open: list[float] = field(default_factory=list)
    """Angles of the commanded bar at which the loop does not close, rad."""
    settling: float = 0.0
    """Time after the start in which no state is judged, because the loop yields, s."""
    skipped: int = 0
    """Angles that the motion passes in this time."""
    lost: str = ""
    """Why the run ended early; empty where it did not."""
    other_assembly: float | None = None
    """Position of the driven joint from which on the simulated loop is in the other
    assembly, rad: no state counts from there on.
    """
    seconds_per_step: float = math.nan
    """Processor time of a step of the whole robot between two states, the least, s."""

    def collect(self, which: str) -> dict[str, Array]:
        """Return torque (n,) and pin forces (n, 2), N m and N: "soft" or "rigid"."""
        states = [getattr(row, which).values() for row in self.rows]
        return {
            name: np.array([state[name] for state in states], dtype=float)
            for name in FORCE_QUANTITIES
        }

    def differences(self) -> dict[str, Array]:
        """Return soft less rigid torque (n,) and pin forces (n, 2), N m and N."""
        rigid = self.collect("rigid")
        return {name: soft - rigid[name] for name, soft in self.collect("soft").items()}

    def errors(self) -> dict[str, Array]:
        """Return the size of the error of torque and pin forces, (n,), N m and N."""
        errors = self.differences().items()
        return {name: measure_sizes(error) for name, error in errors}

    def sizes(self) -> dict[str, Array]:
        """Return the sizes of torque and pin forces of rigid pins, (n,), N m and N."""
        forces = self.collect("rigid").items()
        return {name: measure_sizes(force) for name, force in forces}

    def scales(self, lever: float) -> dict[str, float]:
        """Return what errors are divided by, from rigid pins, as `find_scales` does."""
        conditions = np.array([row.condition for row in self.rows])
        return find_scales(self.sizes(), conditions, lever)

    def find_worst(self, scales: Mapping[str, float]) -> WorstState:
        """Return the state of the worst error of torque and pin forces over its scale.

        The error is infinite without an answer.
        """
        if self.lost or not self.rows:
            return WorstState(math.inf)
        return max(
            WorstState(divide(float(error), scales[name]), name, row.joint, row.angle)
            for name, errors in self.errors().items()
            for row, error in zip(self.rows, errors, strict=True)
        )


@dataclass(frozen=True, slots=True)
class TornState:
    """State of the largest gap under a motor's torque."""

    joint: float
    """Position of the driven joint, rad."""
    gap: float
    """m; infinite where MuJoCo lost the motion."""
    forces: dict[str, Array]


@dataclass(frozen=True, slots=True)
class RobotSettings:
    """Settings, by MJCF's names, of one loop's closures and of its robot's stepping."""

    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    timestep: float
    integrator: str
    solver: str
    iterations: int
    tolerance: float
    solreffriction: tuple[float, ...] | None = None
    """Of the loop's hinges with dry friction; None: as each has it in the file."""
    solimpfriction: tuple[float, ...] | None = None

    def list_changes(self, other: "RobotSettings") -> dict[str, str]:
        """List the attributes in which this differs from another, as MJCF has them."""
        return {
            name: _write_attribute(getattr(self, name))
            for name in self.__slots__
            if getattr(self, name) != getattr(other, name)
        }


@dataclass(frozen=True, slots=True)
class TriedSettings:
    """Settings and what they reach in the robot's file."""

    settings: RobotSettings
    changes: dict[str, str]
    """Attributes that differ from the file's."""
    states: WorstState
    """Worst single state."""
    through_time: WorstState
    """Worst state of a simulation."""
    gap: float
    """Largest gap of the simulation, m."""
    seconds_per_step: float
    """Processor time of a step of the whole robot, s."""

    @property
    def deciding(self) -> WorstState:
        """State of the greater of the two errors."""
        return max(self.states, self.through_time)

    @property
    def error(self) -> float:
        """The greater of the two errors."""
        return self.deciding.error

    @property
    def is_simulated(self) -> bool:
        """Tell whether any time was simulated."""
        return math.isfinite(self.seconds_per_step)

    @property
    def cost(self) -> float:
        """Processor time of a simulated second, s."""
        return self.seconds_per_step / self.settings.timestep


@dataclass(frozen=True, slots=True)
class SettingsAdvice:
    """Settings and errors of one loop, for one wanted error."""

    wanted: float
    positions: int
    """Number of positions at which settings are tried."""
    before: TriedSettings
    alone: tuple[TriedSettings, ...]
    """Each setting changed by itself, the one that helps most first."""
    best: TriedSettings
    """Cheapest combination within the wanted error, or the most accurate one tried."""
    tried: int
    typed: tuple[str, ...]
    """The best combination as elements of MJCF."""
    within: tuple[float, float] | None
    """Widest range of the driven joint found, rad, in which the best combination is
    within the wanted error. None where it is so everywhere, or in no range tried.
    """

    @property
    def reached(self) -> bool:
        """Tell whether the best combination is within the wanted error."""
        return self.best.error <= self.wanted


@dataclass(frozen=True, slots=True)
class MeasureOptions:
    """Request for measurements of the loops of a robot."""

    pose: PoseOptions
    loop: str | None = None
    """Name of a closure; None: all four-bars."""
    speed: float | None = None
    """Speed of the driven bar, rad/s; None: that of the scene."""
    torque: float | None = None
    """Torque of the motor under which the loop may come apart, N m. None: it is not
    asked.
    """
    error: float | None = None
    """Error for which settings are looked for; None: none are."""
    span: tuple[float, float] | None = None
    """Range of the driven joint, rad; None: that of the scene."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Bodies of the bars and sites of pin B that are stated, by their roles."""

    def state_speed(self, scene: Scene) -> Scene:
        """Return a scene at the speed that is stated, if one is."""
        if self.speed is None:
            return scene
        return replace(scene, motion=scene.motion.replace(speed=self.speed))


@dataclass(frozen=True, slots=True)
class LoopMeasurement:
    """Results of MuJoCo on one loop in its whole robot."""

    name: str
    joint: str
    """Joint that is driven."""
    scene: Scene
    """Scene of the loop, in which the formulas are asked."""
    turned: float
    """Angle of the scene's axes in the plane of the loop, rad."""
    remarks: tuple[str, ...]
    settings: RobotSettings
    rounding: float
    """Sum by which the lengths of the scene differ from the file's within its digits,
    m.
    """
    held: int
    """Number of degrees of freedom that are held."""
    switched_off: tuple[str, ...]
    """Equalities between its moving bars and joints that are held."""
    states: InsideAnswer
    scales: dict[str, float]
    """Scale of the errors of torque and of each pin force, N m and N."""
    through_time: InsideAnswer | None
    refusal: str
    """Why it was not simulated; empty where it was."""
    torn: list[TornState]
    advice: SettingsAdvice | None
    as_it_is: bool
    """True if contacts, joint limits and other motors acted as in the file."""
    flywheel: float
    """Armature of the driven hinge that drives, kg m^2."""
    unmet_stops: list[int]
    """Hinges of the loop whose stops ended no state."""

    @property
    def left_assembly(self) -> bool:
        """Tell whether the simulation went over to the other assembly."""
        through = self.through_time
        left = through is not None and through.other_assembly is not None
        return left or self.refusal == OTHER_ASSEMBLY

    def command(self, answer: InsideAnswer) -> Command:
        """Return the command of an answer in the axes of the scene.

        The states that are answered come first, then the angles that are open.
        """
        rows = [*answer.rows, *answer.rows[:1] * len(answer.open)]
        angles = [*(row.angle for row in answer.rows), *answer.open]
        return Command(
            np.array(angles) - self.turned,
            np.full(len(rows), self.scene.motion.branch, dtype=np.int8),
            np.array([row.speed for row in rows]),
            np.array([row.acceleration for row in rows]),
            bar=command(self.scene).bar,
        )

    def collect(self, answer: InsideAnswer, which: str) -> dict[str, Array]:
        """Return what the drive exerts (n,), and the pin forces (n, 2), of an answer.

        The names and axes are those of the scene, N m and N. `which`: "soft" or
        "rigid".
        """
        forces = answer.collect(which)
        drive = forces.pop(COUPLE.value)
        turned = np.exp(-1j * self.turned)
        axes = np.array([[turned.real, turned.imag], [-turned.imag, turned.real]])
        values = {name: force @ axes for name, force in forces.items()}
        return {name_driving(self.scene): drive, **values}

    def find_vanishing(self, quantity: str) -> float | None:
        """Return the scale of the terms of a quantity that is their rounding."""
        sizes = self.states.sizes()
        scale = self.scales.get(quantity)
        if scale is None or scale == float(sizes[quantity].max()):
            return None
        return scale

    @property
    def moves(self) -> bool:
        """Tell whether the scene names a motion and not a few states at rest."""
        speeds = [row.speed for row in self.states.rows]
        return any(speeds) and len(speeds) + len(self.states.open) > 1


@dataclass(frozen=True, slots=True)
class RobotMeasurement:
    """Results of MuJoCo on the loops of a robot's file."""

    loops: tuple[LoopMeasurement, ...]
    notes: tuple[str, ...]


def _write_attribute(value: object) -> str:
    """Write a value as MJCF does."""
    if isinstance(value, tuple):
        return " ".join(f"{number:.6g}" for number in value)
    if isinstance(value, str):
        return value
    return f"{value:.6g}"
