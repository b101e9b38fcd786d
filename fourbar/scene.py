"""A scene: linkage, motion, drive, loads and effects; `solve` evaluates only the stages asked for."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Friction, Gravity, Load, Viscous
from fourbar.errors import FourBarError, InputError
from fourbar.kinematics import Array, State, Vector, add_accelerations, add_velocities, centre_in_bar, close_loop
from fourbar.kinetostatics import solve_pins
from fourbar.linkage import MOVING_BARS, FourBar, require
from fourbar.mobility import default_range, limit_positions, on_smooth_path
from fourbar.solution import NOT_ASSEMBLED, OK, SINGULAR, STAGE_OF, STAGES, VECTORS, Solution, unwrap

Effect = Gravity | Viscous | Friction
OPEN, CROSSED = 1, -1


@dataclass(frozen=True, slots=True)
class Sweep:
    """theta_2 from `start` to `stop` (rad) in `steps` equal intervals, both ends included."""

    start: float
    stop: float
    steps: int

    def __post_init__(self) -> None:
        require("motion.theta_2.from", self.start)
        require("motion.theta_2.to", self.stop)
        if isinstance(self.steps, bool) or not isinstance(self.steps, int) or not 1 <= self.steps <= 100_000_000:
            raise InputError("motion.theta_2.steps", self.steps, "must be a whole number from 1 to 100 000 000")


@dataclass(frozen=True, slots=True)
class FromLimit:
    """theta_2 = limit position number `limit` of the input (1, 2, ... counter-clockwise from theta_1) + `offset` (rad)."""

    limit: int
    offset: float = 0.0

    def __post_init__(self) -> None:
        require("motion.theta_2.offset", self.offset)
        if isinstance(self.limit, bool) or not isinstance(self.limit, int) or self.limit < 1:
            raise InputError("motion.theta_2.limit", self.limit, "must be a whole number, 1 or more")


@dataclass(frozen=True, slots=True)
class Free:
    """Released motion: moved by loads and effects alone for `duration` (s), reported at `steps` equal intervals."""

    duration: float
    steps: int

    def __post_init__(self) -> None:
        require("motion.free.duration", self.duration, positive=True)
        if isinstance(self.steps, bool) or not isinstance(self.steps, int) or not 1 <= self.steps <= 100_000_000:
            raise InputError("motion.free.steps", self.steps, "must be a whole number from 1 to 100 000 000")


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The command to the input bar.

    Parameters
    ----------
    theta_2 : one angle, an array of them (n,), a Sweep, a FromLimit, or None (the default range), rad.
    omega_2 : rad/s; None: only positions are asked for.
    alpha_2 : rad/s^2.
    branch : +1 open (B left of the diagonal A to O4), -1 crossed.
    through : at a change point keep the "sign" of the branch, or "follow" the smooth path.
    free : released motion instead of a prescribed one.
    """

    theta_2: float | Array | Sweep | FromLimit | None = None
    omega_2: float | None = None
    alpha_2: float = 0.0
    branch: int = OPEN
    through: str = "sign"
    free: Free | None = None

    def __post_init__(self) -> None:
        if self.theta_2 is not None and not isinstance(self.theta_2, (Sweep, FromLimit)):
            angles = np.array(self.theta_2, dtype=float)
            if not np.all(np.isfinite(angles)) or angles.ndim > 1 or angles.size == 0:
                raise InputError("motion.theta_2", self.theta_2, "must be finite angles, shape () or (n,)")
            angles.flags.writeable = False
            object.__setattr__(self, "theta_2", float(angles) if angles.ndim == 0 else angles)
        if self.omega_2 is not None:
            object.__setattr__(self, "omega_2", require("motion.omega_2", self.omega_2))
        object.__setattr__(self, "alpha_2", require("motion.alpha_2", self.alpha_2))
        if self.branch not in (OPEN, CROSSED):
            raise InputError("motion.branch", self.branch, "must be +1 (open) or -1 (crossed)")
        if self.through not in ("sign", "follow"):
            raise InputError("motion.through", self.through, 'must be "sign" or "follow"')


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that is asked of a linkage; `effects` and `loads` hold only what acts."""

    linkage: FourBar
    motion: Motion = field(default_factory=Motion)
    drive_bar: int = 2
    loads: tuple[Load, ...] = ()
    effects: tuple[Effect, ...] = ()
    title: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if self.drive_bar not in MOVING_BARS or isinstance(self.drive_bar, bool):
            raise InputError("drive.bar", self.drive_bar, "must be 2, 3 or 4")
        object.__setattr__(self, "loads", tuple(self.loads))
        object.__setattr__(self, "effects", tuple(self.effects))


class Command(NamedTuple):
    """What the input bar is told to do at each of n independent positions."""

    theta_2: Array
    """(n,), rad."""
    branch: NDArray[np.int8]
    """(n,), +1 or -1."""
    omega_2: float | Array | None
    """rad/s; None: positions only."""
    alpha_2: float | Array
    """rad/s^2."""


DEFAULT_STEPS = 360
BLOCK = 2048
"""Positions evaluated at a time: their arrays stay in the second-level cache."""


def command(scene: Scene) -> Command:
    """The positions that the scene's motion names, each with its branch."""
    motion, linkage = scene.motion, scene.linkage
    asked = motion.theta_2
    if asked is None:
        asked = Sweep(*default_range(linkage), DEFAULT_STEPS)
    if isinstance(asked, Sweep):
        theta_2 = np.linspace(asked.start, asked.stop, asked.steps + 1)
    elif isinstance(asked, FromLimit):
        limits = limit_positions(linkage)
        if not limits:
            raise InputError("motion.theta_2.limit", asked.limit, "the input of this linkage has no limit positions")
        if asked.limit > len(limits):
            raise InputError("motion.theta_2.limit", asked.limit, f"must be from 1 to {len(limits)}")
        theta_2 = np.array([limits[asked.limit - 1].theta_2 + asked.offset])
    else:
        theta_2 = np.atleast_1d(np.asarray(asked, dtype=float))
    branch = np.full(theta_2.shape, motion.branch, dtype=np.int8)
    if motion.through == "follow":
        branch = on_smooth_path(linkage, theta_2, motion.branch)
    return Command(theta_2, branch, motion.omega_2, motion.alpha_2)


def solve(scene: Scene, stage: str | None = None, *, at: Command | None = None) -> Solution:
    """Evaluate a scene with the closed formulas, no further than asked.

    Parameters
    ----------
    stage : "position", "velocity", "acceleration" or "force"; each includes those before it.
        Left out: "force", or "position" where the scene states no omega_2.
    at : other positions, velocities and accelerations of the input than the scene's own.

    Raises
    ------
    InputError : the stage is unknown, or needs an omega_2 that the scene does not state.
    """
    where = command(scene) if at is None else at
    if stage is None:
        stage = "position" if where.omega_2 is None else "force"
    if stage not in STAGES:
        raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
    if stage != "position" and where.omega_2 is None:
        raise InputError("motion.omega_2", None, f"is needed for the stage {stage!r}")
    if scene.motion.free is not None and at is None:
        raise FourBarError("a free motion is not evaluated position by position")
    wanted = STAGES.index(stage)
    n = len(where.theta_2)
    names = [name for name, of in STAGE_OF.items() if STAGES.index(of) <= wanted]
    out = {name: np.empty((n, 2) if name in VECTORS else n) for name in names}
    code = np.empty(n, dtype=np.uint8)
    for start in range(0, n, BLOCK):
        part = slice(start, start + BLOCK)
        code[part] = _solve_block(scene, where, part, wanted, out)
    for name in ("theta_3", "theta_4"):
        out[name] = unwrap(out[name])
    return Solution(scene.title, scene.drive_bar, code, np.asarray(where.branch), where.theta_2, **out)


def _solve_block(scene: Scene, where: Command, part: slice, wanted: int, out: dict[str, Array]) -> NDArray[np.uint8]:
    """Evaluate one block of positions into the result arrays; its status codes."""

    def put(name: str, value: Array | Vector | float | None) -> None:
        target = out[name]
        if isinstance(value, tuple):
            target[part, 0], target[part, 1] = value
        else:
            assert value is not None
            target[part] = value

    state = close_loop(scene.linkage, where.theta_2[part], where.branch[part])
    bars = {number: scene.linkage.bar(number) for number in MOVING_BARS}
    _put_positions(state, put)
    if wanted >= 1:
        omega_2 = _piece(where.omega_2, part)
        add_velocities(state, omega_2)
        for name, value in (("omega_2", omega_2), ("omega_3", state.omega_3), ("omega_4", state.omega_4)):
            put(name, value)
    if wanted >= 2:
        alpha_2 = _piece(where.alpha_2, part)
        add_accelerations(state, alpha_2)
        for name, value in (("alpha_2", alpha_2), ("alpha_3", state.alpha_3), ("alpha_4", state.alpha_4)):
            put(name, value)
        put("a_A", state.acceleration(2, scene.linkage.input.length, 0.0))
        put("a_B", state.acceleration(4, scene.linkage.output.length, 0.0))
        for number, bar in bars.items():
            put(f"a_G{number}", state.acceleration(number, *centre_in_bar(bar)))
    if wanted >= 3:
        pins = solve_pins(state, (*scene.loads, *scene.effects), scene.drive_bar)
        for name in ("F12", "F32", "F43", "F14", "torque"):
            put(name, getattr(pins, name))
        put("drive_condition", np.abs(pins.drive_sine))
    return np.where(state.assembled, np.where(state.singular, SINGULAR, OK), NOT_ASSEMBLED).astype(np.uint8)


def _put_positions(state: State, put: Callable[[str, Array | Vector | float | None], None]) -> None:
    linkage = state.linkage
    put("theta_3", state.angle(3))
    put("theta_4", state.angle(4))
    put("sin_mu", state.sin_mu)
    put("condition", np.abs(state.sin_mu))
    put("A", state.pin("A"))
    put("B", state.pin("B"))
    for number in MOVING_BARS:
        put(f"G{number}", state.point(number, *centre_in_bar(linkage.bar(number))))


def _piece(value: float | Array | None, part: slice) -> float | Array:
    """A number for all positions, or the part of an array that belongs to a block."""
    assert value is not None
    return value if np.ndim(value) == 0 else value[part]  # type: ignore[index]
