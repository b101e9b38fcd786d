"""A scene: linkage, motion, drive, loads and effects; `solve` evaluates only the stages asked for."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.kinematics import Array, State, Vector, add_accelerations, add_velocities, centre_in_bar, close_loop
from fourbar.kinetostatics import drive_sine, solve_pins, torque_interval
from fourbar.linkage import MOVING_BARS, FourBar, require
from fourbar.margins import U, diagonal_to_O4
from fourbar.mobility import default_range, limit_positions, on_smooth_path
from fourbar.more_digits import needing_more_digits, restated, rounded
from fourbar.solution import (
    NOT_ASSEMBLED,
    OF_DRY_FRICTION,
    OF_PIN_LOADS,
    SINGULAR,
    STAGE_OF,
    STAGES,
    VECTORS,
    Solution,
    Unwrapped,
)

if TYPE_CHECKING:
    from decimal import Decimal

    from fourbar.effects import Effect, Load
    from fourbar.motion_law import Law

OPEN, CROSSED = 1, -1
ALL = slice(None)


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
    """theta_2 = limit position number `limit` of the input (1, 2, ... from theta_1 on) + `offset` (rad)."""

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
    law : theta_2 over time instead of theta_2, omega_2 and alpha_2.
    """

    theta_2: float | Array | Sweep | FromLimit | None = None
    omega_2: float | None = None
    alpha_2: float = 0.0
    branch: int = OPEN
    through: str = "sign"
    free: Free | None = None
    law: "Law | None" = None

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
        given = (self.free, self.theta_2, self.omega_2, self.alpha_2 or None)
        if self.law is not None and any(value is not None for value in given):
            raise InputError("motion.law", self.law.ends, "stands alone: it gives theta_2, omega_2 and alpha_2")
        if self.through not in ("sign", "follow"):
            raise InputError("motion.through", self.through, 'must be "sign" or "follow"')


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that is asked of a linkage; `effects` and `loads` hold only what acts."""

    linkage: FourBar
    motion: Motion = field(default_factory=Motion)
    drive_bar: int = 2
    loads: "tuple[Load, ...]" = ()
    effects: "tuple[Effect, ...]" = ()
    title: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if self.drive_bar not in MOVING_BARS or isinstance(self.drive_bar, bool):
            raise InputError("drive.bar", self.drive_bar, "must be 2, 3 or 4")
        object.__setattr__(self, "loads", tuple(self.loads))
        object.__setattr__(self, "effects", tuple(self.effects))

    def _repr_html_(self) -> str:
        from fourbar.notebook import scene_html

        return scene_html(self)


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
    remainder: "Decimal | None" = None
    """What theta_2 as a double leaves out of the one angle meant, rad: a limit position plus its offset."""
    time: Array | None = None
    """(n,), s; where the motion is given over time."""


DEFAULT_STEPS = 360
BLOCK = 15 * 1024
"""Positions evaluated at a time, measured: fewer pay for calls; from 128 KiB an array on, the C library maps fresh
pages for each."""

LIVE_ARRAYS = 96
"""More than a block ever holds at once."""


def command(scene: Scene) -> Command:
    """The positions that the scene's motion names, each with its branch."""
    motion, linkage = scene.motion, scene.linkage
    asked, remainder, time = motion.theta_2, None, None
    omega_2: float | Array | None = motion.omega_2
    alpha_2: float | Array = motion.alpha_2
    if motion.law is not None:
        time = motion.law.times()
        theta_2, omega_2, alpha_2 = motion.law.at(time)
    elif asked is None:
        theta_2 = np.linspace(*default_range(linkage), DEFAULT_STEPS + 1)
    elif isinstance(asked, Sweep):
        theta_2 = np.linspace(asked.start, asked.stop, asked.steps + 1)
    elif isinstance(asked, FromLimit):
        limits = limit_positions(linkage)
        if not limits:
            raise InputError("motion.theta_2.limit", asked.limit, "the input of this linkage has no limit positions")
        if asked.limit > len(limits):
            raise InputError("motion.theta_2.limit", asked.limit, f"must be from 1 to {len(limits)}")
        from fourbar.sixty_digits import limit_remainder

        limit = limits[asked.limit - 1].theta_2
        theta_2 = np.array([limit + asked.offset])
        remainder = limit_remainder(linkage, limit, float(theta_2[0]), asked.offset)
    else:
        theta_2 = np.atleast_1d(np.asarray(asked, dtype=float))
    branch = np.full(theta_2.shape, motion.branch, dtype=np.int8)
    if motion.through == "follow":
        branch = on_smooth_path(linkage, theta_2, motion.branch)
    return Command(theta_2, branch, omega_2, alpha_2, remainder, time)


def solve(
    scene: Scene, stage: str | None = None, *, at: Command | None = None, out: Mapping[str, Array] | None = None
) -> Solution:
    """Evaluate a scene with the closed formulas, no further than asked.

    Parameters
    ----------
    stage : "position", "velocity", "acceleration", "force" or "error"; each includes those before
        it. Left out: "error", or "position" where the scene states no omega_2.
    at : other positions, velocities and accelerations of the input than the scene's own.
    out : arrays to write into, by name, (n,) or (n, 2); only the quantities named are evaluated,
        with the stages they need, and the others are None in the result.

    Raises
    ------
    InputError : the stage or a name in `out` is unknown, its array has the wrong shape, or the
        scene does not state the omega_2 that is needed.
    """
    if scene.motion.free is not None and at is None:
        return _solve_free(scene, stage, out)
    where = command(scene) if at is None else at
    n = len(where.theta_2)
    if out is None:
        if stage is None:
            stage = "position" if where.omega_2 is None else STAGES[-1]
        if stage not in STAGES:
            raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
        wanted = STAGES.index(stage)
        absent = _absent(scene)
        names = [name for name, of in STAGE_OF.items() if STAGES.index(of) <= wanted and name not in absent]
        # vectors component by component in memory: each is written and read in one piece
        result = {name: np.empty((2, n)).T if name in VECTORS else np.empty(n) for name in names}
    else:
        result = dict(out)
        wanted = _highest_stage(result, n)
        stage = STAGES[wanted]
    if stage != "position" and where.omega_2 is None:
        raise InputError("motion.omega_2", None, f"is needed for the stage {stage!r}")
    code = np.empty(n, dtype=np.uint8)
    lid = _warm_heap() if n > BLOCK else None
    unwrapped = {name: Unwrapped() for name in ("theta_3", "theta_4") if name in result}
    for start in range(0, n, BLOCK):
        part = slice(start, min(start + BLOCK, n))
        code[part] = _solve_block(scene, where, part, wanted, {name: array[part] for name, array in result.items()})
        for name, turns in unwrapped.items():
            turns.extend(result[name][part])
    del lid
    solution = Solution(scene.title, scene.drive_bar, code, np.asarray(where.branch), where.theta_2, **result)
    solution.time = where.time
    return solution


def _warm_heap() -> Array:
    """Memory for the arrays of a block, freed below a small array that is kept.

    The C library returns the free top of its heap to the system, and the next block would fault
    every page in again: three times the cost of the arithmetic. The array on top prevents that.
    """
    ballast = [np.empty(BLOCK) for _ in range(LIVE_ARRAYS)]
    lid = np.empty(BLOCK)  # too large for a hole further down
    del ballast
    return lid


def _solve_free(scene: Scene, stage: str | None, out: Mapping[str, Array] | None) -> Solution:
    """Release the linkage, then evaluate the motion it makes instant by instant, with its times."""
    from fourbar.free_motion import release

    free, start = scene.motion.free, command(scene)
    assert free is not None
    if len(start.theta_2) != 1:
        raise InputError("motion.theta_2", scene.motion.theta_2, "a free motion is released at one angle")
    moved = release(
        scene.linkage,
        (*scene.loads, *scene.effects),
        float(start.theta_2[0]),
        scene.motion.omega_2 or 0.0,
        int(start.branch[0]),
        np.linspace(0.0, free.duration, free.steps + 1),
        follow=scene.motion.through == "follow",
    )
    at = Command(moved.theta_2, moved.branch, moved.omega_2, moved.alpha_2)
    solution = solve(scene, stage, at=at, out=out)
    solution.time = moved.time
    return solution


def _absent(scene: Scene) -> tuple[str, ...]:
    """Quantities that do not exist without dry friction, or without friction that depends on the pin forces."""
    absent = () if any(effect.dry for effect in scene.effects) else OF_DRY_FRICTION
    return absent if any(effect.loaded_pins for effect in scene.effects) else (*absent, *OF_PIN_LOADS)


def _highest_stage(out: Mapping[str, Array], n: int) -> int:
    """The last stage that the quantities named need; an InputError where one cannot be written."""
    for name, array in out.items():
        if name not in STAGE_OF:
            raise InputError("out", name, "must be among " + ", ".join(STAGE_OF))
        shape = (n, 2) if name in VECTORS else (n,)
        if array.shape != shape or array.dtype != np.float64:
            raise InputError(f"out.{name}", (array.shape, str(array.dtype)), f"must be float64 of shape {shape}")
    return max((STAGES.index(STAGE_OF[name]) for name in out), default=0)


KINEMATIC: dict[str, Callable[[State], Array | Vector | float | None]] = {
    "theta_3": lambda state: state.angle(3),
    "theta_4": lambda state: state.angle(4),
    "sin_mu": lambda state: state.sin_mu,
    "condition": lambda state: np.abs(state.sin_mu),
    "A": lambda state: state.pin("A"),
    "B": lambda state: state.pin("B"),
    "G2": lambda state: state.point(2, *centre_in_bar(state.linkage.input)),
    "G3": lambda state: state.point(3, *centre_in_bar(state.linkage.coupler)),
    "G4": lambda state: state.point(4, *centre_in_bar(state.linkage.output)),
    "omega_2": lambda state: state.omega_2,
    "omega_3": lambda state: state.omega_3,
    "omega_4": lambda state: state.omega_4,
    "alpha_2": lambda state: state.alpha_2,
    "alpha_3": lambda state: state.alpha_3,
    "alpha_4": lambda state: state.alpha_4,
    "a_A": lambda state: state.acceleration(2, state.linkage.input.length, 0.0),
    "a_B": lambda state: state.acceleration(4, state.linkage.output.length, 0.0),
    "a_G2": lambda state: state.acceleration(2, *centre_in_bar(state.linkage.input)),
    "a_G3": lambda state: state.acceleration(3, *centre_in_bar(state.linkage.coupler)),
    "a_G4": lambda state: state.acceleration(4, *centre_in_bar(state.linkage.output)),
}
"""The quantities up to the acceleration, from the state of the stage that they belong to."""


def _solve_block(scene: Scene, where: Command, part: slice, wanted: int, out: Mapping[str, Array]) -> NDArray[np.uint8]:
    """Evaluate one block of positions into the result arrays; its status codes."""
    theta_2, branch = where.theta_2[part], where.branch[part]
    motion = (_piece(where.omega_2, part), _piece(where.alpha_2, part))
    if where.remainder is None:
        state = close_loop(scene.linkage, theta_2, branch)
    else:
        exact = diagonal_to_O4(scene.linkage, theta_2, where.remainder)
        state = close_loop(scene.linkage, theta_2, branch, exact)
    friction = np.zeros(theta_2.shape, dtype=np.uint8)
    for name, value in _evaluate(scene, state, *motion, wanted, out):
        if name == "status":
            friction[:] = value
        else:
            _put(out[name], value)
    if (hard := needing_more_digits(state)).size:
        for name, value in _evaluate(scene, *restated(state, *motion, hard), wanted, out):
            if name == "status":
                friction[hard] = value
                continue
            # what doubles lost is lost again, 53 bits further down
            left = out[name][hard] * U if STAGE_OF[name] == "error" else 0.0
            _put(out[name], value, hard)
            out[name][hard] += left
    if state.assembled.all() and not state.singular.any():
        return friction
    return np.where(state.assembled, np.where(state.singular, SINGULAR, friction), NOT_ASSEMBLED).astype(np.uint8)


def _evaluate(
    scene: Scene, state: State, omega_2: Array | float, alpha_2: Array | float, wanted: int, names: Mapping[str, Array]
) -> Iterator[tuple[str, Any]]:
    """The quantities named, stage by stage, and the "status" that friction leaves."""
    if wanted >= 1:
        add_velocities(state, omega_2)
    if wanted >= 2:
        add_accelerations(state, alpha_2)
    for name in names:
        if name in KINEMATIC:
            yield name, KINEMATIC[name](state)
    if wanted >= 3:
        terms = (*scene.loads, *scene.effects)
        pins = solve_pins(state, terms, scene.drive_bar)
        for name in ("F12", "F32", "F43", "F14", "torque"):
            if name in names:
                yield name, getattr(pins, name)
        if pins.unsettled is not None:
            yield "status", pins.unsettled
        if "drive_condition" in names:
            condition = np.abs(drive_sine(state, scene.drive_bar))
            yield "drive_condition", condition if pins.from_jamming is None else condition * pins.from_jamming
        if "friction_residual" in names:
            yield "friction_residual", 0.0 if pins.residual is None else pins.residual
        if "torque_low" in names or "torque_high" in names:
            ends = torque_interval(state, terms, scene.drive_bar, pins.torque)
            yield from ((name, end) for name, end in zip(OF_DRY_FRICTION, ends, strict=True) if name in names)
        if wanted >= 4:
            from fourbar.error_bars import error_bars

            for name, value in error_bars(state, pins, terms, scene.drive_bar).items():
                if name in names:
                    yield name, value


def _put(target: Array, value: Array | Vector | float | None, where: slice | NDArray[np.intp] = ALL) -> None:
    if isinstance(value, tuple):
        target[where, 0], target[where, 1] = (rounded(component) for component in value)
    else:
        assert value is not None
        target[where] = rounded(value)


def _piece(value: float | Array | None, part: slice) -> float | Array:
    """A number for all positions, or the part of an array that belongs to a block."""
    if value is None or np.ndim(value) == 0:
        return value or 0.0
    return value[part]  # type: ignore[index]
