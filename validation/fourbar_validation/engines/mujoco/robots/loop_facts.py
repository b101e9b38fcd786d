"""Questions to a robot's file, facts on its closed loops, and MuJoCo's results on them.

Everything here is plain data, without MuJoCo.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fourbar.linkage import BAR_NAMES, MOVING_BARS, record
from fourbar.quantities import PIN_FORCES, Array
from fourbar.scene import Command, Scene, command
from fourbar_validation.compare.tolerance import WELL_CONDITIONED, divide, magnitude
from fourbar_validation.engines.description import ModelEntry, list_unknowns

BAR_ROLES = {BAR_NAMES[bar]: bar for bar in MOVING_BARS}
"""Number of each moving bar, by its name."""
SITE_ROLES = ("B3", "B4")
"""Roles of the sites of pin B on the coupler and on the output."""
DRIVEN_PINS = {2: "O2", 4: "O4"}
"""Pin between the ground and a commanded bar, where a motor turns it."""
FOLLOWING = {bar: tuple(b for b in MOVING_BARS if b != bar) for bar in MOVING_BARS}
"""The two moving bars that follow a commanded one."""
FLAT = 2e-3
"""rad; where the outputs of both assemblies are nearer the pose does not tell which it
is: a loop that is closed to 1e-12 m leaves about half as much open where its bars are
in line.
"""
DIGITS_OF_A_MODEL = 12
"""Significant digits of a number of the scene. Those beyond are round-off of the
compiler.
"""
HIDING = ("contacts", ".range")
"""Ends of the keys of differences whose cost hides that of others."""
SETTINGS_OF_AN_SDF = (
    "an SDF or a URDF states neither softness nor solver: MuJoCo's defaults act, and"
    " only an MJCF of the robot can state others"
)


@record
class RobotFile:
    """Screened text of a robot's file with its includes, and its meshes."""

    path: Path
    text: str
    kind: str = "MJCF"
    """Format of the file: MJCF, SDF or URDF."""
    assets: Mapping[str, bytes] = field(default_factory=dict)
    """Contents of each mesh file, by its name in the text."""
    missing: Mapping[str, str] = field(default_factory=dict)
    """Mesh files that are not there, by the names of their meshes."""
    notes: tuple[str, ...] = ()


@record
class PoseOptions:
    """Pose of a robot, and the joints that are held or drive in it."""

    joints: Mapping[str, str] = field(default_factory=dict)
    """Position of each joint that is stated, with its unit."""
    key: str | None = None
    """Keyframe that the pose is taken from; None: the rest pose of the file."""
    held: tuple[str, ...] = ()
    """Joints that are fixed where they stand, as if their bodies were one bar."""
    drive: str | None = None
    """Joint that is driven; None: that of a motor."""


@record
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


@record
class RobotLoop:
    """Planar four-bar in a robot's model; ids are those of MuJoCo's compiled model.

    Three of the pins are hinges and the equality is the fourth, or all four are
    hinges and the equality, a weld, joins the two halves of a bar.
    """

    name: str
    equality: int
    """Equality that closes the loop."""
    closures: tuple[int, ...]
    """All equalities that hold the closing pin: `equality`, and others along it."""
    cut: str | None
    """Pin that the equality is; None where it is a weld within a bar."""
    bodies: Mapping[int, tuple[int, ...]]
    """Bodies of each bar, 1 to 4: one, or the two that a weld joins. Each is the body
    of the file that the others of the bar are fixed to.
    """
    bars: tuple[int | None, ...]
    """Bar, 1 to 4, that each body of the model belongs to, (nbody,); None: it belongs
    to none. What hangs on a bar by joints that are held belongs to it.
    """
    ground: str
    """Name of the body that carries both branches of the loop: part of bar 1."""
    hinges: Mapping[str, int]
    """Joint of each pin that is a hinge, in the order of PINS."""
    senses: Mapping[str, float]
    """+1 where the joint's angle grows as the second bar of the pin turns
    counter-clockwise against the first; else -1."""
    cut_bars: tuple[int | None, ...]
    """Bars that the two ends of the equality are on; empty where it is a weld."""
    axes: Array
    """x, from which angles are counted, y, and the normal of the plane, (3, 3).

    All three are unit vectors in the frame of the ground's first body.
    """
    misaligned: float
    """Largest angle between two axes, rad."""
    qpos: Array
    """Joint positions of the whole model in the pose, (nq,)."""
    held: tuple[int, ...]
    """Joints of the model that are no pin of this loop and stay where they are."""
    lengths: tuple[float, ...] = ()
    """Lengths of ground, input, coupler and output, m."""
    angles: tuple[float, ...] = ()
    """theta_1 to theta_4 in the pose from the x of `axes`, with whole turns, rad."""
    stated_angles: tuple[float, ...] = ()
    """Directions of the bars before the loops were closed, rad."""
    other_equalities: tuple[int, ...] = ()
    """Active equalities that act on its moving bars and are no closure of it."""
    chosen: tuple[str, ...] = ()
    """Why its driven hinge is taken, where neither a motor nor an option tells."""
    cylinder: int | None = None
    """Motor between sites of two of its bars that drives it, if no hinge does."""
    remarks: tuple[str, ...] = ()
    met: tuple[float, ...] = ()
    """Lengths as they are read, m. Beyond round-off they differ from its own where the
    digits of the file cannot tell the linkage from one with a change point.
    """
    from_other_end: "RobotLoop | None" = None
    """The loop with its output for its input, in the same plane."""

    @property
    def joint(self) -> int:
        """Joint that is driven; pin O2 of a loop as its file has it is a hinge."""
        return self.hinges["O2"]

    @property
    def rounding(self) -> float:
        """Sum by which the lengths that are read differ from its own, m.

        The round-off of the compiler is no part of it.
        """
        own = map(round_off, self.lengths)
        return sum(abs(x - y) for x, y in zip(self.met, own, strict=True))

    @property
    def longest(self) -> float:
        """Longest moving bar, m."""
        return max(self.lengths[1:])

    def is_flat(self, bar: int) -> bool:
        """Tell whether the bars that follow one were in line before closing.

        The pose then does not tell the assembly.
        """
        return is_in_line(self.stated_angles, bar)

    def seen_from_behind(self) -> "RobotLoop":
        """Return the loop with the other normal of its plane.

        All angles then turn the other way.
        """
        return replace(
            self,
            axes=self.axes * [[1.0], [-1.0], [-1.0]],
            angles=tuple(-angle for angle in self.angles),
            senses={pin: -sense for pin, sense in self.senses.items()},
        )

    def turn(self, angle: float) -> "RobotLoop":
        """Return the loop in axes that are turned by an angle in its plane, rad."""
        cos = math.cos(angle)
        sin = math.sin(angle)
        turned = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        angles = tuple(np.array(self.angles) - angle)
        return replace(self, axes=turned @ self.axes, angles=angles)

    def describe_lengths(self) -> str:
        """Write the four lengths with four significant digits, in mm."""
        texts = (
            f"{name} {write_length(length)}"
            for name, length in zip(BAR_NAMES.values(), self.lengths, strict=True)
        )
        return ", ".join(texts) + " mm"


@record
class RobotClosure:
    """One equality of a robot: the four-bar that it closes, or why it closes none."""

    name: str
    loop: RobotLoop | None
    reason: str
    """Why it is no planar four-bar; empty where it is one."""
    text: str
    """Kind, ground, joints, lengths, gap and softness, or the reason."""


@record
class RobotReport:
    """Closures of a robot, and what was done to the file and its pose to see them."""

    closures: tuple[RobotClosure, ...]
    notes: tuple[str, ...]


@record
class LoopScene:
    """A scene from a loop, and what it does not hold."""

    scene: Scene
    loop: RobotLoop
    parts: tuple[str, ...]
    """Sentences that say which joint is which pin, and which body which bar. They say
    too what is held.
    """
    remarks: tuple[str, ...]
    """Sentences on what was chosen, and on what the scene leaves out, with its size."""
    notes: tuple[str, ...]
    """Sentences on what was done to the file and its pose."""


def round_off(number: float) -> float:
    """Round to the digits that a compiled model has."""
    return float(f"{number:.{DIGITS_OF_A_MODEL}g}")


def is_in_line(angles: Sequence[float], bar: int) -> bool:
    """Tell whether the bars that follow one are in line, by theta_1 to theta_4, rad."""
    first, second = (angles[other - 1] for other in FOLLOWING[bar])
    return abs(math.sin(second - first)) <= FLAT


def name_following(bar: int) -> str:
    """Name the two bars that follow a commanded one."""
    return " and ".join(BAR_NAMES[other] for other in FOLLOWING[bar])


def write_length(metres: float) -> str:
    """Write a length in mm with four significant digits."""
    return f"{1e3 * metres:#.4g}".rstrip(".")


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


_FORCES = np.dtype([("torque", float), *((name, float, 2) for name in PIN_FORCES)])
"""Couple of the drive, N m, or its force, N, and pin forces in the scene's axes, N."""
MOTION_OF_BARS = [f"{rate}_{b}" for rate in ("theta", "omega") for b in MOVING_BARS]
"""Angles (rad) and speeds (rad/s) of the moving bars in the scene's axes."""
STATE = np.dtype(
    [
        ("angle", float),
        ("speed", float),
        ("acceleration", float),
        ("joint", float),
        ("soft", _FORCES),
        ("rigid", _FORCES),
        ("gap", float),
        ("bars", [(name, float) for name in MOTION_OF_BARS]),
        ("sine", float),
    ]
)
"""One state of a loop in its robot.

Angle, speed and acceleration are those of the commanded bar, rad, and the joint is the
position of the driven one as the file counts it, rad. Soft are torque and pin forces as
MuJoCo has them, rigid those with rigid pins at the closed state of the same command.
The gap is the distance of the ends of the closure, m, and the bars are those of the
state that MuJoCo evaluates. The sine is that of the angle from the first bar that
follows to the second in that closed state.
"""


def record_states(rows: Sequence[Any]) -> Any:
    """Return states as a record array of STATE, (n,)."""
    return np.array(rows, STATE).view(np.recarray)


def make_motion(angles: Iterable[float], rates: Iterable[float]) -> Array:
    """Return a motion at one speed, rad/s, and one acceleration, rad/s^2, (n, 3).

    Columns are angle, speed and acceleration of the commanded bar in the scene's axes.
    `angles`: (n,), rad.
    """
    return np.array([(angle, *rates) for angle in angles])


def varies(motion: Array) -> bool:
    """Tell whether speed or acceleration differ from position to position."""
    return bool(np.ptp(motion[:, 1:], axis=0).any())


def thin_out(motion: Array, most: int) -> Array:
    """Return a motion with at most so many positions, spread evenly.

    Both ends are among them.
    """
    places = np.linspace(0, len(motion) - 1, min(len(motion), most))
    return np.asarray(motion[places.round().astype(int)])


def measure_sizes(quantities: Iterable[Array]) -> Array:
    """Return the sizes of k quantities, numbers (n,) or vectors (n, 2), (n, k)."""
    return np.column_stack([*map(magnitude, quantities)])


def find_scales(sizes: Array, conditions: Array, lever: float) -> Array:
    """Return what the errors of torque and pin forces are divided by, (5,), N m and N.

    The scale of each is its largest size. One that is the round-off of its terms at
    every well-conditioned state is a sum that cancels: its scale is that of the terms,
    the largest pin force, for the torque times the longest moving bar.

    Parameters
    ----------
    sizes : sizes of FORCE_QUANTITIES at each state, (n, 5), N m and N.
    conditions : |sin| of the angle between the bars that follow at each state, (n,).
    lever : longest moving bar, m; 1 where the drive is a force.
    """
    levers = [lever, *(1.0 for _ in PIN_FORCES)]
    terms = np.outer(sizes[:, 1:].max(axis=1), levers)
    well = conditions >= WELL_CONDITIONED
    cancels = sizes <= ROUND_OFF_OF_A_FILE * terms
    vanishes = well.any() & cancels[well].all(axis=0)
    return np.asarray(np.where(vanishes, terms, sizes).max(axis=0, initial=0.0))


class WorstState(NamedTuple):
    """State at which one of the torque and the pin forces has the worst error."""

    error: float
    """Error over the scale of the quantity; infinite without an answer."""
    quantity: str = ""
    joint: float = math.nan
    """Position of the driven joint, rad."""
    angle: float = math.nan
    """Angle of the commanded bar in the plane of the loop, rad."""


@dataclass(slots=True)
class InsideAnswer:
    """Results of MuJoCo on a loop at some states of the whole robot."""

    rows: Any = field(default_factory=lambda: record_states([]))
    """Record array of STATE, (n,)."""
    in_line: list[float] = field(default_factory=list)
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
    seconds_per_step: float = math.inf
    """Processor time of a step of the whole robot between two states, the least, s."""

    def errors(self) -> Array:
        """Return the sizes of the errors of FORCE_QUANTITIES, (n, 5), N m and N.

        An error is infinite without an answer.
        """
        rows = self.rows
        errors = measure_sizes(rows.soft[q] - rows.rigid[q] for q in FORCE_QUANTITIES)
        return np.where(np.isfinite(errors), errors, math.inf)

    def sizes(self) -> Array:
        """Return the sizes of FORCE_QUANTITIES of rigid pins, (n, 5), N m and N."""
        return measure_sizes(self.rows.rigid[name] for name in FORCE_QUANTITIES)

    def scales(self, lever: float) -> Array:
        """Return what errors are divided by, from rigid pins, as `find_scales` does."""
        return find_scales(self.sizes(), np.abs(self.rows.sine), lever)

    def find_worst(self, scales: Array) -> WorstState:
        """Return the state of the worst error of torque and pin forces over its scale.

        The error is infinite without an answer.
        """
        if self.lost or not len(self.rows):
            return WorstState(math.inf)
        parts = divide(self.errors(), scales)
        state, column = np.unravel_index(parts.argmax(), parts.shape)
        row = self.rows[state]
        quantity = FORCE_QUANTITIES[column]
        return WorstState(float(parts[state, column]), quantity, row.joint, row.angle)


@record
class TornState:
    """State of the largest gap under a motor's torque."""

    joint: float
    """Position of the driven joint, rad."""
    gap: float
    """m; infinite where MuJoCo lost the motion."""
    forces: Array
    """Of PIN_FORCES in the scene's axes, (4, 2), N; empty without an answer."""


@record
class TriedSettings:
    """Settings and what they reach in the robot's file."""

    changes: Mapping[str, str]
    """Attributes of MJCF that differ from the file's, as they are typed."""
    states: WorstState
    """Worst single state."""
    through_time: WorstState
    """Worst state of a simulation."""
    gap: float
    """Largest gap of the simulation, m."""
    seconds_per_step: float
    """Processor time of a step of the whole robot, s; infinite if it was not stepped.
    """
    cost: float
    """Processor time of a simulated second, s."""

    @property
    def deciding(self) -> WorstState:
        """State of the greater of the two errors."""
        return max(self.states, self.through_time)

    @property
    def error(self) -> float:
        """The greater of the two errors."""
        return self.deciding.error


@record
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


@record
class LoopMeasurement:
    """Results of MuJoCo on one loop in its whole robot."""

    name: str
    joint: str
    """Joint that is driven."""
    scene: Scene
    """Scene of the loop, in which the formulas are asked."""
    remarks: tuple[str, ...]
    setting: str
    """Integrator and timestep of the file."""
    rounding: float
    """Sum by which the lengths of the scene differ from the file's within its digits,
    m.
    """
    held: int
    """Number of degrees of freedom that are held."""
    switched_off: tuple[str, ...]
    """Equalities between its moving bars and joints that are held."""
    states: InsideAnswer
    scales: Array
    """Scales of the errors of FORCE_QUANTITIES, (5,), N m and N."""
    through_time: InsideAnswer | None
    refusal: str
    """Why it was not simulated; empty where it was."""
    torn: list[TornState]
    advice: SettingsAdvice | None
    as_it_is: bool
    """True if contacts, joint limits and other motors acted as in the file."""
    parts: tuple[str, ...]
    """Sentences that say which joint is which pin, and which body which bar."""
    described: Mapping[str, ModelEntry]
    """Entries of the model by their keys. Stops that ended no state are none."""

    def command(self, answer: InsideAnswer) -> Command:
        """Return the command of an answer.

        The states that are answered come first, then the angles that are open.
        """
        rows = answer.rows
        more = (0, len(answer.open))
        return Command(
            np.append(rows.angle, answer.open),
            np.full(len(rows) + len(answer.open), self.scene.motion.branch, np.int8),
            np.pad(rows.speed, more, "edge"),
            np.pad(rows.acceleration, more, "edge"),
            bar=command(self.scene).bar,
        )

    def collect(self, answer: InsideAnswer, which: str) -> dict[str, Array]:
        """Return what the drive exerts (n,), and the pin forces (n, 2), of an answer.

        The names are those of the scene, N m and N. `which`: "soft" or "rigid".
        """
        forces = answer.rows[which]
        names = list_unknowns(self.scene, FORCE_QUANTITIES)
        pairs = zip(names, FORCE_QUANTITIES, strict=True)
        return {name: np.asarray(forces[field]) for name, field in pairs}

    def find_vanishing(self) -> dict[str, float]:
        """Return the scale of the terms of each quantity that is their rounding.

        The names are those of the scene.
        """
        vanishes = self.scales != self.states.sizes().max(axis=0)
        names = list_unknowns(self.scene, FORCE_QUANTITIES)
        scales = zip(names, self.scales.tolist(), strict=True)
        return dict(compress(scales, vanishes))


@record
class RobotMeasurement:
    """Results of MuJoCo on the loops of a robot's file."""

    loops: tuple[LoopMeasurement, ...]
    notes: tuple[str, ...]
