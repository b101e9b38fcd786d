"""Questions to a robot's file, and facts on its closed loops.

Everything here is plain data, without MuJoCo.
"""

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.quantities import Array
from fourbar.scene import Scene

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
SETTINGS_OF_AN_SDF = (
    "an SDF or a URDF states neither softness nor solver: MuJoCo's defaults act, and"
    " only an MJCF of the robot can state others"
)


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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


@dataclass(frozen=True, slots=True)
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
    ground: str
    """Name of the body that carries both branches of the loop: part of bar 1."""
    hinges: Mapping[str, int]
    """Joint of each pin that is a hinge."""
    senses: Mapping[str, float]
    """+1 where the joint's angle grows as the second bar of the pin turns
    counter-clockwise against the first; else -1."""
    points: Mapping[tuple[int, str], Array]
    """(bar, pin): the pin in the frame of the bar's first body, (3,), m."""
    axis: Array
    """Unit normal of the plane in the frame of the ground's first body, (3,)."""
    along: Array
    """Unit vector of the plane that angles are counted from, same frame, (3,)."""
    misaligned: float
    """Largest angle between two axes, rad."""
    qpos: Array
    """Joint positions of the whole model in the pose, (nq,)."""
    held: tuple[int, ...]
    """Joints of the model that are no pin of this loop and stay where they are."""
    lines: tuple[complex, ...] = ()
    """Lines of bars 1 to 4 in the plane, from their first pin to the second, m."""
    stated_lines: tuple[complex, ...] = ()
    """The same before the loops were closed, m."""
    other_equalities: tuple[int, ...] = ()
    """Active equalities that act on its moving bars and are no closure of it."""
    chosen: tuple[str, ...] = ()
    """Why its driven hinge is taken, where neither a motor nor an option tells."""
    remarks: tuple[str, ...] = ()
    read_lengths: tuple[float, ...] = ()
    """Lengths of its scene, m; empty where they are its own. They differ where the
    digits of the file cannot tell the linkage from one with a change point.
    """

    turned: float = 0.0
    """Angle of the axes of its scene in the plane, with whole turns, rad."""
    from_other_end: "RobotLoop | None" = None
    """The loop with its output for its input, in the same plane."""

    @property
    def joint(self) -> int:
        """Joint that is driven; pin O2 of a loop as its file has it is a hinge."""
        return self.hinges["O2"]

    @property
    def lengths(self) -> tuple[float, ...]:
        """Lengths of ground, input, coupler and output, m."""
        return tuple(map(abs, self.lines))

    @property
    def angles(self) -> tuple[float, ...]:
        """theta_1 to theta_4 in the pose, in the axes of its scene, rad."""
        return tuple(cmath.phase(line) - self.turned for line in self.lines)

    @property
    def met(self) -> tuple[float, ...]:
        """Lengths of ground, input, coupler and output as they are read, m."""
        return self.read_lengths or self.lengths

    @property
    def rounding(self) -> float:
        """Sum by which the lengths that are read differ from its own, m."""
        return sum(abs(x - y) for x, y in zip(self.met, self.lengths, strict=True))

    @property
    def longest(self) -> float:
        """Longest moving bar, m."""
        return max(self.lengths[1:])

    def is_flat(self, bar: int) -> bool:
        """Tell whether the bars that follow one were in line before closing.

        The pose then does not tell the assembly.
        """
        return is_in_line(tuple(map(cmath.phase, self.stated_lines)), bar)

    def seen_from_behind(self) -> "RobotLoop":
        """Return the loop with the other normal of its plane.

        All angles then turn the other way.
        """
        return replace(
            self,
            axis=-self.axis,
            lines=tuple(line.conjugate() for line in self.lines),
            stated_lines=tuple(line.conjugate() for line in self.stated_lines),
            senses={pin: -sense for pin, sense in self.senses.items()},
        )

    def describe_lengths(self) -> str:
        """Write the four lengths with four significant digits, in mm."""
        texts = (
            f"{name} {write_length(length)}"
            for name, length in zip(BAR_NAMES.values(), self.lengths, strict=True)
        )
        return ", ".join(texts) + " mm"


@dataclass(frozen=True, slots=True)
class RobotClosure:
    """One equality of a robot: the four-bar that it closes, or why it closes none."""

    name: str
    loop: RobotLoop | None
    reason: str
    """Why it is no planar four-bar; empty where it is one."""
    text: str
    """Kind, ground, joints, lengths, gap and softness, or the reason."""


@dataclass(frozen=True, slots=True)
class RobotReport:
    """Closures of a robot, and what was done to the file and its pose to see them."""

    closures: tuple[RobotClosure, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
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
