"""The command to one moving bar: angles, a sweep, a limit position, a law over time, or release."""

import math
import sys
from dataclasses import dataclass, field

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.linkage import A_BRANCH, POSITIVE, require, require_numbers, require_whole
from fourbar.quantities import Array
from fourbar.scene.motion_law import COMMANDS, STEPS, Law, find_bar

OPEN, CROSSED = 1, -1
BRANCH_NAMES = {OPEN: "open", CROSSED: "crossed"}
FASTEST = math.sqrt(sys.float_info.max)
"""rad/s. The square of any greater speed is beyond the range of a double, and with it every acceleration."""
OF_STROKE = ("stroke", "stroke_speed", "stroke_acceleration")
"""Names of the commanded stroke, speed and acceleration of a cylinder."""
DEFAULT_STEPS = 360
"""Number of steps of the default range, which is swept if a motion names no angle."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """The commanded angle from `start` to `stop` (rad) in `steps` equal intervals, both ends included."""

    start: float
    stop: float
    steps: int

    def __post_init__(self) -> None:
        set_field = object.__setattr__  # the class is frozen; this is its constructor
        set_field(self, "start", require("motion.theta_2.from", self.start, "rad"))
        set_field(self, "stop", require("motion.theta_2.to", self.stop, "rad"))
        if not math.isfinite(self.stop - self.start):
            raise InputError("motion.theta_2.to", self.stop, f"must be within the range of doubles from {self.start!r}")
        set_field(self, "steps", require_whole("motion.theta_2.steps", self.steps, *STEPS))


@dataclass(frozen=True, slots=True)
class FromLimit:
    """Limit position number `limit` of the commanded bar (1, 2, ... from theta_1 on) + `offset` (rad)."""

    limit: int
    offset: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "offset", require("motion.theta_2.offset", self.offset, "rad"))
        limit = require_whole(
            "motion.theta_2.limit", self.limit, range(1, sys.maxsize), "must be a whole number, 1 or more"
        )
        object.__setattr__(self, "limit", limit)


@dataclass(frozen=True, slots=True)
class Free:
    """Released motion: moved by loads and effects alone for `duration` (s), reported at `steps` equal intervals."""

    duration: float
    steps: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration", require("motion.free.duration", self.duration, "s", POSITIVE))
        object.__setattr__(self, "steps", require_whole("motion.free.steps", self.steps, *STEPS))


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The command to one moving bar, the input unless numbers of bar 3 or 4 are stated.

    Each number may be a text with a unit instead, like "60 rpm".

    Parameters
    ----------
    theta_2 : one angle, an array of them (n,), a Sweep, a FromLimit, or None (the default range), rad.
    omega_2 : rad/s; None: positions only.
    alpha_2 : rad/s^2.
    branch : "open" or +1 (B left of the diagonal A to O4), "crossed" or -1: the sign of sin(theta_4 - theta_3); where
        bar 3 or 4 is commanded that of sin(theta_4 - theta_2) or sin(theta_3 - theta_2), +1 "open".
    through : at a change point keep the "sign" of the branch, or "follow" the smooth path.
    free : released motion instead of a prescribed one.
    law : an angle over time instead of theta_2, omega_2 and alpha_2.
    theta_3, omega_3, alpha_3, theta_4, omega_4, alpha_4 : of the coupler or the output instead.
    stroke, stroke_speed, stroke_acceleration : of the scene's cylinder between the ground and bar 2 or 4 instead: one
        stroke, an array of them or a Sweep, m; m/s; m/s^2.
    side : "left" or "right", with a stroke: on which side of the line from the bar's ground pin to the cylinder's end
        on the ground, seen towards that end, its end on the bar lies.
    """

    theta_2: float | Array | Sweep | FromLimit | None = None
    omega_2: float | None = None
    alpha_2: float = 0.0
    branch: int = OPEN
    through: str = "sign"
    free: Free | None = None
    law: Law | None = None
    theta_3: float | Array | Sweep | FromLimit | None = None
    omega_3: float | None = None
    alpha_3: float = 0.0
    theta_4: float | Array | Sweep | FromLimit | None = None
    omega_4: float | None = None
    alpha_4: float = 0.0
    stroke: float | Array | Sweep | None = None
    stroke_speed: float | None = None
    stroke_acceleration: float = 0.0
    side: str | None = None
    bar: int = field(default=2, init=False)
    """Number of the commanded bar, 2, 3 or 4; if a stroke is commanded, the scene's drive determines it."""

    def __post_init__(self) -> None:
        expect("motion.law", self.law, Law, type(None))
        stated = find_bar("motion", self, COMMANDS)
        object.__setattr__(self, "bar", (stated or 2) if self.law is None else self.law.bar)
        if self.stroke is not None or self.side is not None or self.stroke_speed is not None:
            self._require_stroke(stated)
        theta, omega, alpha = self.names
        if self.law is not None and (stated is not None or self.free is not None):
            allowed = f"stands alone: it gives {theta}, {omega} and {alpha}"
            raise InputError("motion.law", self.law.ends, allowed)
        unit = "rad" if self.stroke is None else "m"
        if self.angle is not None and not isinstance(self.angle, (Sweep, FromLimit)):
            angles = require_numbers(f"motion.{theta}", self.angle, "must be finite angles", unit)
            if angles.size == 0:
                raise InputError(f"motion.{theta}", self.angle, "must be one angle or more")
            angles.flags.writeable = False
            object.__setattr__(self, theta, float(angles) if angles.ndim == 0 else angles)
        if self.speed is not None:
            object.__setattr__(self, omega, speed := require(f"motion.{omega}", self.speed, f"{unit}/s"))
            if not math.isfinite(speed * speed):
                allowed = f"must be below {FASTEST:.4g} rad/s: every acceleration has its square"
                raise InputError(f"motion.{omega}", speed, allowed)
        object.__setattr__(self, alpha, require(f"motion.{alpha}", self.acceleration, f"{unit}/s^2"))
        if isinstance(self.branch, str):
            words = {name: number for number, name in BRANCH_NAMES.items()}
            object.__setattr__(self, "branch", words.get(self.branch, self.branch))
        for name, kinds in (("branch", (int, np.integer, str)), ("through", (str,))):
            expect(f"motion.{name}", getattr(self, name), *kinds)
        expect("motion.free", self.free, Free, type(None))
        if self.branch not in (OPEN, CROSSED):
            raise InputError("motion.branch", self.branch, A_BRANCH)
        if self.through not in ("sign", "follow"):
            raise InputError("motion.through", self.through, 'must be "sign" or "follow"')

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Motion):
            return NotImplemented
        one, two = self.angle, other.angle
        if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
            return bool(np.array_equal(one, two)) and self._check_rest() == other._check_rest()  # type: ignore[arg-type]
        return one == two and self._check_rest() == other._check_rest()

    def __hash__(self) -> int:
        return hash(self._check_rest())

    def _check_rest(self) -> tuple[object, ...]:
        """Everything but the angles."""
        return (self.names, self.side, self.speed, self.acceleration, self.branch, self.through, self.free, self.law)

    def _require_stroke(self, stated: int | None) -> None:
        """InputError where the stroke is not what alone is commanded, or is none."""
        if self.stroke is None or stated is not None or self.law is not None or self.free is not None:
            raise InputError("motion.stroke", self.stroke, "is commanded alone: no angle, law or release besides")
        if not isinstance(self.stroke, Sweep):
            strokes = require_numbers("motion.stroke", self.stroke, "must be finite lengths", "m")
            object.__setattr__(self, "stroke", strokes)
        ends = (self.stroke.start, self.stroke.stop) if isinstance(self.stroke, Sweep) else self.stroke
        if not np.all(np.asarray(ends) > 0.0):
            raise InputError("motion.stroke", self.stroke, "must be above 0 m")
        if self.side not in ("left", "right"):
            raise InputError("motion.side", self.side, 'must be "left" or "right", as a stroke has two angles')

    @property
    def names(self) -> tuple[str, str, str]:
        """Names of the commanded position, speed and acceleration: of bar 2, 3 or 4, or of the stroke."""
        return COMMANDS[self.bar] if self.stroke is None else OF_STROKE

    @property
    def angle(self) -> float | Array | Sweep | FromLimit | None:
        """Angle or stroke that is commanded, as it is stated."""
        return getattr(self, self.names[0])  # type: ignore[no-any-return]

    @property
    def speed(self) -> float | None:
        """Commanded speed, rad/s, or m/s for a stroke."""
        return getattr(self, self.names[1])  # type: ignore[no-any-return]

    @property
    def acceleration(self) -> float:
        """Commanded acceleration, rad/s^2, or m/s^2 for a stroke."""
        return getattr(self, self.names[2])  # type: ignore[no-any-return]


def require_steps(motion: Motion, most: int, where: str, file: str) -> None:
    """Raise InputError for as many steps or more: of a sweep, a law or a release each is a position in the memory."""
    for name, stated in ((motion.names[0], motion.angle), ("law", motion.law), ("free", motion.free)):
        if isinstance(stated, (Sweep, Law, Free)) and stated.steps >= most:
            raise InputError(f"motion.{name}.steps", stated.steps, f"must be below {most} {where}", file)
