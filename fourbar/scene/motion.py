"""The command to the input bar: angles, a sweep, a limit position, a law over time, or release."""

import math
import sys
from dataclasses import dataclass

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.linkage import A_BRANCH, require, require_numbers, require_whole
from fourbar.scene.motion_law import STEPS, Law
from fourbar.solution import Array

OPEN, CROSSED = 1, -1
BRANCH_NAMES = {OPEN: "open", CROSSED: "crossed"}
FASTEST = math.sqrt(sys.float_info.max)
"""rad/s. The square of any greater speed is beyond the range of a double, and with it every acceleration."""
DEFAULT_STEPS = 360
"""Of the default range, where a motion names no angle."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """theta_2 from `start` to `stop` (rad) in `steps` equal intervals, both ends included."""

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
    """theta_2 = limit position number `limit` of the input (1, 2, ... from theta_1 on) + `offset` (rad)."""

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
        object.__setattr__(self, "duration", require("motion.free.duration", self.duration, "s", positive=True))
        object.__setattr__(self, "steps", require_whole("motion.free.steps", self.steps, *STEPS))


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The command to the input bar; each number may be a text with a unit instead, like "60 rpm".

    Parameters
    ----------
    theta_2 : one angle, an array of them (n,), a Sweep, a FromLimit, or None (the default range), rad.
    omega_2 : rad/s; None: positions only.
    alpha_2 : rad/s^2.
    branch : "open" or +1 (B left of the diagonal A to O4), "crossed" or -1.
    through : at a change point keep the "sign" of the branch, or "follow" the smooth path.
    free : released motion instead of a prescribed one.
    law : theta_2 over time instead of theta_2, omega_2 and alpha_2.
    """

    theta_2: float | Array | Sweep | FromLimit | None = None
    omega_2: float | None = None
    alpha_2: float = 0.0
    branch: int = OPEN
    through: str = "sign"
    free: Free | None = None
    law: Law | None = None

    def __post_init__(self) -> None:
        if self.theta_2 is not None and not isinstance(self.theta_2, (Sweep, FromLimit)):
            angles = require_numbers("motion.theta_2", self.theta_2, "must be finite angles", "rad")
            if angles.size == 0:
                raise InputError("motion.theta_2", self.theta_2, "must be one angle or more")
            angles.flags.writeable = False
            object.__setattr__(self, "theta_2", float(angles) if angles.ndim == 0 else angles)
        if self.omega_2 is not None:
            object.__setattr__(self, "omega_2", require("motion.omega_2", self.omega_2, "rad/s"))
            if not math.isfinite(self.omega_2 * self.omega_2):
                allowed = f"must be below {FASTEST:.4g} rad/s: every acceleration has its square"
                raise InputError("motion.omega_2", self.omega_2, allowed)
        object.__setattr__(self, "alpha_2", require("motion.alpha_2", self.alpha_2, "rad/s^2"))
        if isinstance(self.branch, str):
            words = {name: number for number, name in BRANCH_NAMES.items()}
            object.__setattr__(self, "branch", words.get(self.branch, self.branch))
        for name, kinds in (("branch", (int, np.integer, str)), ("through", (str,))):
            expect(f"motion.{name}", getattr(self, name), *kinds)
        expect("motion.free", self.free, Free, type(None))
        expect("motion.law", self.law, Law, type(None))
        if self.branch not in (OPEN, CROSSED):
            raise InputError("motion.branch", self.branch, A_BRANCH)
        given = (self.free, self.theta_2, self.omega_2, self.alpha_2 or None)
        if self.law is not None and any(value is not None for value in given):
            raise InputError("motion.law", self.law.ends, "stands alone: it gives theta_2, omega_2 and alpha_2")
        if self.through not in ("sign", "follow"):
            raise InputError("motion.through", self.through, 'must be "sign" or "follow"')

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Motion):
            return NotImplemented
        one, two = self.theta_2, other.theta_2
        if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
            return bool(np.array_equal(one, two)) and self._rest() == other._rest()  # type: ignore[arg-type]
        return one == two and self._rest() == other._rest()

    def __hash__(self) -> int:
        return hash(self._rest())

    def _rest(self) -> tuple[object, ...]:
        """Everything but the angles."""
        return (self.omega_2, self.alpha_2, self.branch, self.through, self.free, self.law)
