"""MJCF of robots with loops of known lengths, written from points in a plane."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.robots.loop import RobotFile
from fourbar_validation.engines.mujoco.theirs import Examined, examine

Point = tuple[float, float]
TILT = (0.3, -0.2, 0.7, 0.5)
"""Quaternion of the ground's body, not normalized."""


def examine_text(scene: Scene, text: str | None, names: Mapping[str, str]) -> Examined:
    """Examine a text as a file that names no other; None: the file generated from the scene."""
    file = None if text is None else RobotFile(Path("theirs.xml"), text)
    return examine(scene, file, names)


@dataclass
class Planar:
    """A four-bar in the pose of its pins, and how the tree of its bodies is cut."""

    pins: dict[str, Point] = field(
        default_factory=lambda: {
            "O2": (0.0, 0.0),
            "A": (0.03, 0.08),
            "B": (0.25, 0.17),
            "O4": (0.3, 0.02),
        }
    )
    cut: str = "B"
    by: str = "anchor"
    """How the loop is closed: anchor, site, or weld within the coupler."""
    joint: str = ""
    """Further attributes of every hinge."""
    equality: str = ""
    """Further attributes of the equality."""
    base: str = "<freejoint/>"
    ground: str = ""
    """Further elements of the ground's body."""
    on_coupler: str = ""
    """Further elements of the coupler's body."""
    axes: dict[str, str] = field(default_factory=dict)
    """Axis of a pin where it is not z."""
    drive: str = "O2"
    more: str = ""
    """Further elements of the file."""

    def body(self, name: str, pin: str, at: Point, inside: str = "") -> str:
        """Return a body on a hinge at a pin, its frame there, in a parent whose frame is at `at`."""
        x, y = np.subtract(self.pins[pin], at).tolist()
        axis = self.axes.get(pin, "0 0 1")
        return (
            f'<body name="{name}" pos="{x!r} {y!r} 0">'
            f'<joint name="{pin}" axis="{axis}" {self.joint}/>'
            f'<inertial pos="0.01 0.02 0.003" mass="0.3" diaginertia="1e-3 1e-3 1e-3"/>'
            f"{inside}</body>"
        )

    def end(self, name: str, bar_at: Point) -> str:
        """Return a site at the cut pin on a body whose frame is at `bar_at`."""
        x, y = np.subtract(self.pins[self.cut], bar_at).tolist()
        return f'<site name="{name}" pos="{x!r} {y!r} 0"/>'

    def text(self) -> str:
        """Write the MJCF."""
        p = self.pins
        if self.by == "weld":
            half = self.body("coupler_half", "B", p["O4"])
            coupler = self.body("coupler", "A", p["O2"], self.on_coupler)
            bodies = self.body("input", "O2", (0.0, 0.0), coupler)
            bodies += self.body("output", "O4", (0.0, 0.0), half)
            closed = f'<weld body1="coupler" body2="coupler_half" {self.equality}/>'
            return self._wrap(bodies, closed)
        if self.cut == "B":
            inside = self.end("one", p["A"]) + self.on_coupler
            coupler = self.body("coupler", "A", p["O2"], inside)
            bodies = self.body("input", "O2", (0.0, 0.0), coupler)
            bodies += self.body("output", "O4", (0.0, 0.0), self.end("two", p["O4"]))
            first, second, at = "coupler", "output", p["A"]
        elif self.cut == "A":
            inside = self.end("one", p["B"]) + self.on_coupler
            coupler = self.body("coupler", "B", p["O4"], inside)
            bodies = self.body("output", "O4", (0.0, 0.0), coupler)
            bodies += self.body("input", "O2", (0.0, 0.0), self.end("two", p["O2"]))
            first, second, at = "coupler", "input", p["B"]
        else:  # at O4, on the ground
            output = self.body("output", "B", p["A"], self.end("one", p["B"]))
            coupler = self.body("coupler", "A", p["O2"], output + self.on_coupler)
            bodies = self.body("input", "O2", (0.0, 0.0), coupler)
            bodies += self.end("two", (0.0, 0.0))
            first, second, at = "output", "ground", p["B"]
        x, y = np.subtract(p[self.cut], at).tolist()
        closed = (
            f'<connect site1="one" site2="two" {self.equality}/>'
            if self.by == "site"
            else f'<connect body1="{first}" body2="{second}" anchor="{x!r} {y!r} 0" '
            f"{self.equality}/>"
        )
        return self._wrap(bodies, closed)

    def _wrap(self, bodies: str, closed: str) -> str:
        quat = " ".join(map(repr, TILT))
        motor = f'<actuator><motor name="motor" joint="{self.drive}"/></actuator>'
        return (
            '<mujoco><compiler angle="radian"/><worldbody>'
            f'<body name="ground" pos="1 2 3" quat="{quat}">{self.base}'
            '<inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>'
            f"{self.ground}{bodies}</body></worldbody>"
            f"<equality>{closed}</equality>{motor if self.drive else ''}{self.more}"
            "</mujoco>"
        )

    def lengths(self) -> tuple[float, ...]:
        """Return the lengths of ground, input, coupler and output, m."""
        p = self.pins
        pairs = (("O2", "O4"), ("O2", "A"), ("A", "B"), ("O4", "B"))
        return tuple(math.dist(p[one], p[other]) for one, other in pairs)


def rotation(quaternion: Sequence[float]) -> np.ndarray:
    """Return the matrix of a quaternion (w, x, y, z), which is normalized first."""
    w, x, y, z = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
