"""From a scene to its solution: block by block over the positions, stage by stage, no further than wanted."""

import cmath
from collections.abc import Iterable, KeysView, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError, expect
from fourbar.evaluation.blocks import choose_block_size, keep
from fourbar.evaluation.case import Case
from fourbar.evaluation.stages import FORCE, Part, evaluate_command, evaluate_freely
from fourbar.linkage import A_BRANCH, require, require_bar, require_whole
from fourbar.quantities import (
    ANGLES,
    COUPLE,
    OF_DRY_FRICTION,
    OF_LINE,
    OF_PIN_LOADS,
    SCALARS,
    STAGE_OF,
    STAGES,
    UNITS,
)
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion_law import COMMANDS
from fourbar.scene.point import OF_POINTS
from fourbar.solution import Array, Solution, unwrap

if TYPE_CHECKING:
    from fourbar.evaluation.free_motion import FreeMotion


class Members(Protocol):
    """What else can be solved: many linkages, which evaluate themselves block by block (`fourbar.vary`)."""

    def solved(self, stage: str | None, *, out: Mapping[str, Array] | None, side: int) -> Solution:
        """Every quantity as (m, n) or (m, n, 2)."""


def solve(
    scene: Scene | Members,
    stage: str | None = None,
    *,
    at: Command | None = None,
    out: Mapping[str, Array] | None = None,
    side: int = 0,
) -> Solution:
    """Evaluate a scene, or a study of m linkages, with the closed formulas as far as a stage.

    Parameters
    ----------
    stage : "position", "velocity", "acceleration", "force" or "error"; each includes those before
        it. Left out: "force", or "position" where the scene states no omega_2.
    at : other positions, velocities and accelerations than the scene's own, of a bar of its own.
    out : arrays to write into, by name, (n,) or (n, 2), of a study (m, n) or (m, n, 2), which share no memory; only the
        quantities named are evaluated, with the stages they need, and the others are None in the result.
    side : in which sense pins at rest are about to turn where dry friction acts: +1 as the commanded angle grows, -1 as
        it falls, 0 neither.

    Raises
    ------
    InputError : the stage or a name in `out` is unknown, its array has the wrong shape, the scene does not state
        the omega_2 that is needed, or a study, which states its own positions, is given others.
    """
    require_whole("side", side, (-1, 0, 1), "must be -1, 0 or 1")
    if not isinstance(scene, Scene):
        if not hasattr(scene, "solved"):
            raise InputError("scene", scene, "must be a Scene, or a Study of `vary`")
        if at is not None:
            raise InputError("at", "a command", "a study states its own positions: vary the commanded angle")
        return scene.solved(stage, out=out, side=side)
    if at is not None:
        _refuse(at)
    moved = _solve_released(scene) if scene.motion.free is not None and at is None else None
    where = moved.command if moved is not None else command(scene) if at is None else at
    n = len(where.angle)
    wanted, names = find_requested(scene, (n,), where, stage, out)
    code = np.zeros(n, dtype=np.uint8)
    with np.errstate(all="ignore"):
        case = Case.of(scene, where.bar)._replace(side=side)
        if wanted >= FORCE and scene.counts_turns:
            case = case.with_start(_find_beginning(scene, where, moved))
        result = None
        if n == 1 and moved is None and out is None:
            result = _solve_alone(case, where, wanted, names, code)
    if result is None:
        result = make_arrays(names, (n,), out)
        _solve_by_parts(case, where, moved, wanted, names, result, code)

    unwrap_angles(result, where.bar)
    solution = make_solution(scene, where, code, result)
    solution.time, solution.stopped_at = where.time, None if moved is None else moved.stopped_at
    return solution


RATES = ("acceleration", "speed", "stroke_speed")
"""Of a command: a number for all positions, or an array."""


def _refuse(at: Command) -> None:
    """Raise an InputError where a command is none."""
    expect("at", at, Command)
    require_bar("at.bar", at.bar)
    named = dict(zip(("angle", "speed", "acceleration", "branch"), (*COMMANDS[at.bar], "branch"), strict=True))
    named |= {name: name for name in ("stroke", "lever", "stroke_speed") if getattr(at, name) is not None}
    for name in (name for name in named if name not in RATES):
        value = getattr(at, name)
        expect(f"at.{named[name]}", value, np.ndarray)
        if value.ndim != 1 or value.shape != at.angle.shape or value.dtype.kind not in "iuf":
            allowed = f"must be numbers, shape (n,), as many of {at.commanded} as of branch"
            raise InputError(f"at.{named[name]}", value, allowed)
    branch = at.branch
    if not (branch.item() in (1, -1) if branch.size == 1 else (np.abs(branch) == 1).all()):
        raise InputError("at.branch", branch, f"{A_BRANCH} at each position")
    for name in RATES[:1] if at.speed is None else (name for name in RATES if name in named):
        value, key = getattr(at, name), f"at.{named[name]}"
        if isinstance(value, np.ndarray):
            if value.shape not in ((), at.angle.shape) or value.dtype.kind not in "iuf":
                raise InputError(key, value, f"must be numbers, shape () or {at.angle.shape}")
        elif not isinstance(value, float):
            expect(key, value, float, int, np.integer, np.floating)
            require(key, value)
    if at.remainder is not None:
        require("at.remainder", at.remainder)
    expect("at.time", at.time, np.ndarray, type(None))


def find_last_stage(scene: Scene) -> str:
    """Return the last stage that a scene states enough for: error bars and all, or positions only."""
    motion = scene.motion
    return "position" if motion.speed is None and motion.law is None and motion.free is None else STAGES[-1]


def find_requested(
    scene: Scene, shape: tuple[int, ...], at: Command, stage: str | None, out: Mapping[str, Array] | None
) -> tuple[int, KeysView[str]]:
    """Return the number of the last stage evaluated, and the names of the quantities; an InputError as of `solve`.

    `shape`: of the positions. `at`: the command; of a bar other than the input theta_2 and sin_mu, whose sign is the
    branch, are found too.
    """
    if out is None:
        if stage is None:
            stage = "position" if at.speed is None else "force"
        if not isinstance(stage, str) or stage not in STAGES:
            raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
        wanted = STAGES.index(stage)
        names = _list_names(wanted, _list_absent(scene), tuple(point.name for point in scene.points))
    else:
        expect("out", out, Mapping)
        names = out.keys()
        foreign, stages = _list_foreign(scene), _list_stages(tuple(point.name for point in scene.points))
        stages = {name: of for name, of in stages.items() if name not in foreign}
        for name, array in out.items():
            if name not in stages:
                raise InputError("out", name, "must be among " + ", ".join(stages))
            wanted_shape = shape if name in SCALARS else (*shape, 2)
            expect(f"out.{name}", array, np.ndarray)
            if array.shape != wanted_shape or array.dtype != np.float64 or not array.flags.writeable:
                allowed = f"must be float64 of shape {wanted_shape}, writeable"
                raise InputError(f"out.{name}", (array.shape, str(array.dtype)), allowed)
        wanted = max((STAGES.index(stages[name]) for name in out), default=0)
    if wanted > 0 and at.speed is None:
        raise InputError(f"motion.omega_{at.bar}", None, f"is needed for the stage {STAGES[wanted]!r}")
    return wanted, names if at.bar == 2 else {**dict.fromkeys(names), "theta_2": None, "sin_mu": None}.keys()


def make_arrays(names: Iterable[str], shape: tuple[int, ...], out: Mapping[str, Array] | None) -> dict[str, Array]:
    """To write into: new ones, or those given."""
    given = {} if out is None else out
    return {
        name: given[name] if name in given else np.empty(shape if name in SCALARS else (*shape, 2)) for name in names
    }


def _list_stages(points: tuple[str, ...]) -> dict[str, str]:
    """Every quantity of a scene, those of its own points too, and its stage."""
    return STAGE_OF | {start + name: stage for name in points for start, stage in OF_POINTS.items()}


@cache
def _list_names(wanted: int, absent: tuple[str, ...], points: tuple[str, ...]) -> KeysView[str]:
    """List the quantities of the stages up to the last one wanted."""
    before = STAGES[: wanted + 1]
    return {name: of for name, of in _list_stages(points).items() if of in before and name not in absent}.keys()


def make_solution(scene: Scene, at: Command, code: NDArray[np.uint8], result: Mapping[str, Array]) -> Solution:
    """Put the arrays of a solution in their places."""
    own: dict[str, dict[str, Array]] = {start: {} for start in OF_POINTS}
    for point in scene.points:
        for start, arrays in own.items():
            if (array := result.get(start + point.name)) is not None:
                arrays[point.name] = array
    known: Mapping[str, Any] = result
    if scene.points:
        known = {name: array for name, array in result.items() if name in UNITS}
    branch, theta_2 = np.asarray(at.branch), at.angle
    if at.bar != 2:
        theta_2, sine = known["theta_2"], known["sin_mu"]
        known = {name: array for name, array in known.items() if name != "theta_2"}
        branch = np.where(np.abs(sine) > 0.0, np.sign(sine), branch).astype(np.int8)
    solution = Solution(scene.title, scene.drive_bar, code, branch, theta_2=theta_2, **known)
    solution.drive, solution.at = scene.drive, at
    solution.points, solution.velocity, solution.acceleration = own[""], own["v_"], own["a_"]
    solution.ground = (scene.linkage.ground, scene.linkage.ground_angle)
    return solution


def unwrap_angles(result: Mapping[str, Array], bar: int) -> None:
    """Make every angle that was found continuous along its sweep; the commanded one is as it is stated."""
    commanded = COMMANDS[bar][0]
    for name in ("theta_2", *ANGLES):
        if name in result and name != commanded:
            unwrap(result[name])


def _solve_by_parts(
    case: Case,
    where: Command,
    moved: "FreeMotion | None",
    wanted: int,
    names: KeysView[str],
    result: Mapping[str, Array],
    code: NDArray[np.uint8],
) -> None:
    """Evaluate all positions block by block, those of a free motion by their independent angle."""
    size = choose_block_size(wanted)
    parts: list[Part] = [(slice(start, start + size),) for start in range(0, len(code), size)]
    if moved is not None:
        parts = [(np.flatnonzero(moved.bar == bar),) for bar in (2, 4)]
    found = None  # freed when the next part has its own: else the memory of each goes back to the system
    with np.errstate(all="ignore"):
        for part in parts:
            if moved is not None:
                found = evaluate_freely(case, moved, part, wanted, names)
            else:
                found = evaluate_command(case, where, part, wanted, names)
            keep(case, found, result, code, part)


def _solve_alone(
    case: Case, where: Command, wanted: int, names: KeysView[str], code: NDArray[np.uint8]
) -> dict[str, Array] | None:
    """Solve a single position in plain numbers, for arrays of one entry cost several times as much.

    None where any is no number: there NumPy goes on with inf and NaN, and statuses follow.
    """
    try:
        codes, values, _ = evaluate_command(case, where, (0,), wanted, names)
    except ArithmeticError:
        return None
    code[0] = codes
    table = np.array([*values.values()], dtype=complex)
    if not cmath.isfinite(np.vdot(table, table)):
        return None
    vectors = table.view(float).reshape(-1, 1, 2)
    scalars = vectors[:, :, 0]
    return {name: (scalars if name in SCALARS else vectors)[i] for i, name in enumerate(values)}


def _solve_released(scene: Scene) -> "FreeMotion":
    """Compute the motion that the linkage makes when it is released."""
    from fourbar.evaluation.free_motion import release

    free, start = scene.motion.free, command(scene)
    assert free is not None
    if len(start.angle) != 1:
        raise InputError(f"motion.{start.commanded}", scene.motion.angle, "a free motion is released at one angle")
    moved = release(
        scene.linkage,
        (*scene.loads, *scene.effects),
        float(start.angle[0]),
        scene.motion.speed or 0.0,
        int(start.branch[0]),
        np.linspace(0.0, free.duration, free.steps + 1),
        follow=scene.motion.through == "follow",
        bar=start.bar,
    )
    if scene.counts_turns:
        with np.errstate(all="ignore"):
            Case.of(scene).with_start(_find_beginning(scene, moved.command, moved)).refuse_wound(moved.command)
    return moved


def _find_beginning(scene: Scene, where: Command, moved: "FreeMotion | None") -> Command:
    """Return the positions among which effects that count turns find where the motion begins, of the bar of `where`."""
    if moved is not None:
        return Command(where.angle[:1], where.branch[:1], 0.0, 0.0)
    own = command(scene)
    return own if own.bar == where.bar else where


def _list_foreign(scene: Scene) -> tuple[str, ...]:
    """Quantities of the kind of drive that the scene has not."""
    return OF_LINE if scene.drive is None else COUPLE


def _list_absent(scene: Scene) -> tuple[str, ...]:
    """Those, and what does not exist without dry friction, or without friction that depends on the pin forces."""
    absent = _list_foreign(scene)
    if not any(effect.dry for effect in scene.effects):
        absent = (*absent, *OF_DRY_FRICTION)
    return absent if any(effect.loaded_pins for effect in scene.effects) else (*absent, *OF_PIN_LOADS)
