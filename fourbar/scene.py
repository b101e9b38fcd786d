"""A scene: linkage, motion, drive, loads and effects; `solve` evaluates only the stages asked for."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.blocks import BLOCK, solve_block, warm_heap
from fourbar.errors import InputError, LimitError
from fourbar.kinematics import close_loop
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.mobility import default_range, limit_positions, on_smooth_path
from fourbar.motion import DEFAULT_STEPS, FromLimit, Motion, Sweep
from fourbar.solution import ANGLES, OF_DRY_FRICTION, OF_PIN_LOADS, STAGE_OF, STAGES, VECTORS, Solution, Unwrapped
from fourbar.state import Array

if TYPE_CHECKING:
    from decimal import Decimal

    from fourbar.effects import Effect, Load
    from fourbar.half_angles import HalfAngles
    from fourbar.pictures import Picture


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
    pictures: "tuple[Picture, ...]" = ()

    def __post_init__(self) -> None:
        if self.drive_bar not in MOVING_BARS or isinstance(self.drive_bar, bool):
            raise InputError("drive.bar", self.drive_bar, "must be 2, 3 or 4")
        object.__setattr__(self, "loads", tuple(self.loads))
        object.__setattr__(self, "effects", tuple(self.effects))
        object.__setattr__(self, "pictures", tuple(self.pictures))
        if len({picture.bar for picture in self.pictures}) < len(self.pictures):
            raise InputError("pictures", [picture.bar for picture in self.pictures], "a bar has one picture")

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
    out : arrays to write into, by name, (n,) or (n, 2), which share no memory; only the quantities named are evaluated,
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
    if stage in STAGES[3:] and any(effect.counts_turns for effect in scene.effects):
        scene = _begun(scene)
    code = np.zeros(n, dtype=np.uint8)
    alone = 0 < len(result) == len(result.keys() & set(ANGLES))
    halves = _half_angles(scene.linkage, where) if alone or n > BLOCK else None
    lid = warm_heap() if n > BLOCK else None
    unwrapped = {name: Unwrapped() for name in ANGLES if name in result and halves is None}
    for start in range(0, n, BLOCK):
        part = slice(start, min(start + BLOCK, n))
        arrays = {name: array[part] for name, array in result.items()}
        if alone and halves is not None:
            halves.write(where.theta_2[part], arrays)
        else:
            code[part] = solve_block(scene, where, part, wanted, arrays)
        for name, turns in unwrapped.items():
            turns.extend(result[name][part])
    del lid
    solution = Solution(scene.title, scene.drive_bar, code, np.asarray(where.branch), where.theta_2, **result)
    solution.time = where.time
    return solution


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
    if any(effect.counts_turns for effect in scene.effects):
        _refuse_wound(scene, at, moved.time)
    solution = solve(scene, stage, at=at, out=out)
    solution.time, solution.stopped_at = moved.time, moved.stopped_at
    return solution


def _begun(scene: Scene) -> Scene:
    """The scene with effects that know where its motion begins."""
    begins = command(scene)
    start = close_loop(scene.linkage, begins.theta_2, begins.branch)
    return replace(scene, effects=tuple(effect.begun(start) for effect in scene.effects))


def _refuse_wound(scene: Scene, at: Command, time: Array) -> None:
    """A LimitError where a free motion winds a spring: from there on it is no longer the spring's."""
    state = close_loop(scene.linkage, at.theta_2, at.branch)
    for effect in _begun(scene).effects:
        codes = effect.unsettled(state) if effect.counts_turns else None
        if codes is not None and codes.any():
            raise LimitError(
                f"effects.{effect.key}: at {time[np.argmax(codes)]:.6g} s the free motion has turned a pin "
                "by more than half a turn from the rest of its spring, which is not modelled"
            )


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


def _half_angles(linkage: FourBar, where: Command) -> "HalfAngles | None":
    """Of a linkage whose theta_3, theta_4 need no second look and no unwrapping at any position; None for others."""
    branch = where.branch
    if where.remainder is not None or (any(branch.strides) and branch.min() != branch.max()):
        return None
    from fourbar.half_angles import half_angles

    return half_angles(linkage, int(branch[0]))
