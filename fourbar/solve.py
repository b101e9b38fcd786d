"""Solver of a scene: block by block over the positions, stage by stage, no further than last_stage."""

import cmath
from collections.abc import Iterable, Iterator, KeysView, Mapping
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError, expect
from fourbar.evaluation.case import BLOCK, Case, Evaluated
from fourbar.evaluation.evaluate import ERROR, FORCE, evaluate, withhold_infinite
from fourbar.linkage import A_BRANCH, require, require_bar, require_whole
from fourbar.quantities import (
    ANGLES,
    COUPLE,
    DRY_FRICTION_QUANTITIES,
    LINE_QUANTITIES,
    PIN_LOAD_QUANTITIES,
    SCALARS,
    STAGE_OF,
    STAGES,
    UNITS,
)
from fourbar.scene import Command, Scene, command
from fourbar.scene.motion import COMMANDS
from fourbar.scene.numbers import POINT_STAGES
from fourbar.scene.scene import Independent
from fourbar.solution import Array, Solution, unwrap

LONG_BLOCK = BLOCK // 4
"""Positions with error bars evaluated at a time: longer numbers fill the cache sooner."""
Part = tuple[Any, ...]
"""Index of some positions in the arrays of all."""


class Members(Protocol):
    """Scenes of m linkages, whose numbers are arrays (`fourbar.vary`); `solve` takes them in place of one scene."""

    @property
    def scene(self) -> Scene:
        """Return the scene, whose other numbers do not vary."""

    @property
    def at(self) -> Command:
        """Return the command, (m, n)."""

    def members(
        self, rows: slice | None, count: int, begins: Scene | None = None
    ) -> Scene:
        """Make the scene of some members, or of all as columns, each repeated for `count` positions."""

    def begin(self, rows: slice) -> Scene:
        """Make the scene with effects that begin where each member's motion does."""

    def refuse(self, arrays: Mapping[str, Array], code: NDArray[np.uint8]) -> None:
        """Mark the members that no scene could be."""


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
    study: Members | None = None
    stopped_at = None
    if not isinstance(scene, Scene):
        if not hasattr(scene, "members"):
            raise InputError("scene", scene, "must be a Scene, or a Study of `vary`")
        if at is not None:
            raise InputError(
                "at",
                "a command",
                "a study states its own positions: vary the commanded angle",
            )
        study = scene
        scene, commanded = study.scene, study.at
    elif at is not None:
        _refuse(at)
        commanded = at
    elif scene.motion.free is not None:
        from fourbar.evaluation.free_motion import release

        released = release(scene)
        commanded, stopped_at = released.command, released.stopped_at
    else:
        commanded = command(scene)
    shape = commanded.angle.shape
    last_stage, names = find_requested(scene, shape, commanded, stage, out)
    code = np.zeros(shape, dtype=np.uint8)
    with np.errstate(all="ignore"):
        arrays = None
        if (
            shape == (1,)
            and study is None
            and commanded.independent is None
            and out is None
        ):
            arrays = _solve_alone(
                _begin(scene, commanded, last_stage, side),
                commanded,
                last_stage,
                names,
                code,
            )
        if arrays is None:
            arrays, evaluated = make_arrays(names, shape, out), None
            blocks = (
                _list_members(study, last_stage, side)
                if study
                else _list_blocks(scene, commanded, last_stage, side)
            )
            for part, case, block in blocks:
                # kept until the next block is evaluated, so that its memory is used again
                evaluated = evaluate(case, block, last_stage, names)
                _store_block(case, evaluated, arrays, code, part)
    unwrap_angles(arrays, commanded.bar)
    if commanded.stroke is not None:
        for name in {
            "stroke",
            "stroke_speed",
        } & arrays.keys():  # as commanded, wherever it has a value
            arrays[name][...] = getattr(commanded, name) + 0.0 * arrays[name]
    if study is not None:
        study.refuse(arrays, code)
    solution = make_solution(
        scene if study is None else study.members(None, 1), commanded, code, arrays
    )
    solution.scene = scene if study is None else None
    solution.time, solution.stopped_at = commanded.time, stopped_at
    return solution


def _begin(scene: Scene, commanded: Command, last_stage: int, side: int) -> Case:
    """Make the case of one linkage, with effects that count turns from where the motion begins."""
    case = Case.of(scene, commanded.bar)._replace(side=side)
    if last_stage < FORCE or not scene.counts_turns:
        return case
    if commanded.independent is not None:
        return case.with_start(commanded.part(slice(0, 1)))
    stated = command(scene)
    return case.with_start(stated if stated.bar == commanded.bar else commanded)


def _list_blocks(
    scene: Scene, commanded: Command, last_stage: int, side: int
) -> Iterator[tuple[Part, Case, Command]]:
    """List the positions of one linkage block by block, those of a released one by their independent angle."""
    case, free = _begin(scene, commanded, last_stage, side), commanded.independent
    if free is None:
        for part in _split(
            len(commanded.angle), BLOCK if last_stage < ERROR else LONG_BLOCK
        ):
            yield (part,), case, commanded.part(part)
        return
    for bar in (2, 4):
        index = np.flatnonzero(free.bar == bar)
        if index.size:
            yield (index,), case.freed(bar, free.side[index]), commanded.part(index)


def _list_members(
    study: Members, last_stage: int, side: int
) -> Iterator[tuple[Part, Case, Command]]:
    """List the positions of many linkages block by block, each number repeated for the positions of its member."""
    (m, n), size = study.at.angle.shape, BLOCK if last_stage < ERROR else LONG_BLOCK
    for rows in _split(m, max(1, size // n)):
        begins = study.begin(rows) if last_stage >= FORCE else study.scene
        for columns in _split(n, size):
            scene = study.members(rows, columns.stop - columns.start, begins)
            yield (
                (rows, columns),
                Case.of(scene, study.at.bar)._replace(side=side),
                take_members(study.at, rows, columns),
            )


def _split(size: int, most: int) -> Iterator[slice]:
    """Split so many into slices of as many at most."""
    return (slice(start, min(start + most, size)) for start in range(0, size, most))


def take_members(commanded: Command, rows: slice, columns: slice) -> Command:
    """Take some positions of some members, one after the other, (k,)."""
    count = columns.stop - columns.start

    def flat(value: Any) -> Any:
        if np.ndim(value) < 2:
            return value
        if value.shape[1] == 1:
            return value[rows, 0] if count == 1 else np.repeat(value[rows, 0], count)
        return value[rows, columns].reshape(-1, *value.shape[2:])

    return Command(*(flat(value) for value in commanded))


def _store_block(
    case: Case,
    evaluated: Evaluated,
    arrays: Mapping[str, Array],
    code: NDArray[np.uint8],
    part: Part,
) -> None:
    """Write what was evaluated into the arrays of all positions, where it is no number with the status that says so."""
    codes, values, _ = evaluated
    withhold_infinite(case, evaluated)
    shape = code[part].shape
    code[part] = codes.reshape(shape)
    for name, value in values.items():
        if len(shape) > 1 and np.ndim(value):
            value = value.reshape(shape)  # noqa: PLW2901
        if name in SCALARS:
            arrays[name][part] = value
        else:
            array = arrays[name]
            if (
                array.strides[-1] == array.itemsize
            ):  # x and y next to each other: one copy
                array.view(complex)[*part, 0] = value
            else:
                array[*part, 0], array[*part, 1] = value.real, value.imag


def _refuse(commanded: Command) -> None:
    """Raise an InputError where a command is none."""
    expect("at", commanded, Command)
    require_bar("at.bar", commanded.bar)
    angle, speed, acceleration = COMMANDS[commanded.bar]
    expect(f"at.{angle}", commanded.angle, np.ndarray)
    expect("at.independent", commanded.independent, Independent, type(None))
    n = commanded.angle.size
    arrays: dict[str, Any] = {angle: commanded.angle, "branch": commanded.branch}
    arrays |= {
        name: getattr(commanded, name)
        for name in ("condition", "stroke", "time", "lost")
    }
    if commanded.independent is not None:
        arrays |= {
            f"independent.{name}": values
            for name, values in commanded.independent._asdict().items()
        }
    for key, value in arrays.items():
        if value is None and key != "branch":
            continue
        expect(f"at.{key}", value, np.ndarray)
        shape = (n, 3) if key == "lost" else (n,)
        if value.shape != shape or value.dtype.kind not in "iuf":
            raise InputError(f"at.{key}", value, f"must be numbers, shape {shape}")
    branch = commanded.branch
    if not (branch.item() in (1, -1) if n == 1 else (np.abs(branch) == 1).all()):
        raise InputError("at.branch", branch, f"{A_BRANCH} at each position")
    rates: dict[str, Any] = {acceleration: commanded.acceleration}
    if commanded.speed is not None:
        rates |= {speed: commanded.speed, "stroke_speed": commanded.stroke_speed}
    for name, value in rates.items():
        if isinstance(value, np.ndarray):
            if value.shape not in ((), (n,)) or value.dtype.kind not in "iuf":
                raise InputError(
                    f"at.{name}", value, f"must be numbers, shape () or {(n,)}"
                )
        elif not isinstance(value, float) and not (
            value is None and name == "stroke_speed"
        ):
            expect(f"at.{name}", value, float, int, np.integer, np.floating)
            require(f"at.{name}", value)
    if commanded.remainder is not None:
        require("at.remainder", commanded.remainder)


def find_last_stage(scene: Scene) -> str:
    """Return the last stage that a scene states enough for: error bars and all, or positions only."""
    motion = scene.motion
    return (
        "position"
        if motion.speed is None and motion.law is None and motion.free is None
        else STAGES[-1]
    )


def find_requested(
    scene: Scene,
    shape: tuple[int, ...],
    commanded: Command,
    stage: str | None,
    out: Mapping[str, Array] | None,
) -> tuple[int, KeysView[str]]:
    """Return the number of the last stage evaluated, and the names of the quantities; an InputError as of `solve`.

    `shape`: of the positions. If `commanded` is a bar other than the input, theta_2 and sin_mu, whose sign is the
    branch, are evaluated too.
    """
    if out is None:
        if stage is None:
            stage = "position" if commanded.speed is None else "force"
        if not isinstance(stage, str) or stage not in STAGES:
            raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
        last_stage = STAGES.index(stage)
        names = _list_names(
            last_stage, _list_absent(scene), tuple(point.name for point in scene.points)
        )
    else:
        expect("out", out, Mapping)
        names = out.keys()
        foreign, stages = (
            _list_foreign(scene),
            _list_stages(tuple(point.name for point in scene.points)),
        )
        stages = {
            name: stage_of for name, stage_of in stages.items() if name not in foreign
        }
        for name, array in out.items():
            if name not in stages:
                raise InputError("out", name, "must be among " + ", ".join(stages))
            wanted_shape = shape if name in SCALARS else (*shape, 2)
            expect(f"out.{name}", array, np.ndarray)
            if (
                array.shape != wanted_shape
                or array.dtype != np.float64
                or not array.flags.writeable
            ):
                allowed = f"must be float64 of shape {wanted_shape}, writeable"
                raise InputError(
                    f"out.{name}", (array.shape, str(array.dtype)), allowed
                )
        last_stage = max((STAGES.index(stages[name]) for name in out), default=0)
    if last_stage > 0 and commanded.speed is None:
        raise InputError(
            f"motion.omega_{commanded.bar}",
            None,
            f"is needed for the stage {STAGES[last_stage]!r}",
        )
    return last_stage, names if commanded.bar == 2 else {
        **dict.fromkeys(names),
        "theta_2": None,
        "sin_mu": None,
    }.keys()


def make_arrays(
    names: Iterable[str], shape: tuple[int, ...], out: Mapping[str, Array] | None
) -> dict[str, Array]:
    """Return the arrays to write into: the given ones, and new ones for the rest."""
    stated = {} if out is None else out
    return {
        name: stated[name]
        if name in stated
        else np.empty(shape if name in SCALARS else (*shape, 2))
        for name in names
    }


def _list_stages(points: tuple[str, ...]) -> dict[str, str]:
    """List every quantity of a scene, those of its own points too, and its stage."""
    return STAGE_OF | {
        start + name: stage for name in points for start, stage in POINT_STAGES.items()
    }


@cache
def _list_names(
    last_stage: int, absent: tuple[str, ...], points: tuple[str, ...]
) -> KeysView[str]:
    """List the quantities of the stages up to the last one last_stage."""
    before = STAGES[: last_stage + 1]
    return {
        name: stage
        for name, stage in _list_stages(points).items()
        if stage in before and name not in absent
    }.keys()


def make_solution(
    scene: Scene,
    commanded: Command,
    code: NDArray[np.uint8],
    quantities_by_name: Mapping[str, Array],
) -> Solution:
    """Put the arrays of a solution in their places."""
    of_points: dict[str, dict[str, Array]] = {start: {} for start in POINT_STAGES}
    for point in scene.points:
        for start, arrays in of_points.items():
            if (array := quantities_by_name.get(start + point.name)) is not None:
                arrays[point.name] = array
    quantities: Mapping[str, Any] = quantities_by_name
    if scene.points:
        quantities = {
            name: array for name, array in quantities_by_name.items() if name in UNITS
        }
    branch, theta_2 = np.asarray(commanded.branch), commanded.angle
    if commanded.bar != 2:
        theta_2, sine = quantities["theta_2"], quantities["sin_mu"]
        quantities = {
            name: array for name, array in quantities.items() if name != "theta_2"
        }
        branch = np.where(np.abs(sine) > 0.0, np.sign(sine), branch).astype(np.int8)
    solution = Solution(
        scene.title, scene.drive_bar, code, branch, theta_2=theta_2, **quantities
    )
    solution.drive, solution.at = scene.drive, commanded
    solution.points, solution.velocity, solution.acceleration = (
        of_points[""],
        of_points["v_"],
        of_points["a_"],
    )
    solution.ground = (scene.linkage.ground, scene.linkage.ground_angle)
    return solution


def unwrap_angles(arrays: Mapping[str, Array], bar: int) -> None:
    """Make every angle that was found continuous along its sweep; the commanded one is as it is stated."""
    commanded = COMMANDS[bar][0]
    for name in ("theta_2", *ANGLES):
        if name in arrays and name != commanded:
            unwrap(arrays[name])


def _solve_alone(
    case: Case,
    commanded: Command,
    last_stage: int,
    names: KeysView[str],
    code: NDArray[np.uint8],
) -> dict[str, Array] | None:
    """Solve a single position in plain numbers, for arrays of one entry cost several times as much.

    None where any is no number: there NumPy goes on with inf and NaN, and statuses follow.
    """
    try:
        codes, values, _ = evaluate(case, commanded.part((0,)), last_stage, names)
    except ArithmeticError:
        return None
    code[0] = codes
    table = np.array([*values.values()], dtype=complex)
    if not cmath.isfinite(np.vdot(table, table)):
        return None
    vectors = table.view(float).reshape(-1, 1, 2)
    scalars = vectors[:, :, 0]
    return {
        name: (scalars if name in SCALARS else vectors)[i]
        for i, name in enumerate(values)
    }


def _list_foreign(scene: Scene) -> tuple[str, ...]:
    """List quantities of the kind of drive that the scene lacks."""
    return LINE_QUANTITIES if scene.drive is None else COUPLE


def _list_absent(scene: Scene) -> tuple[str, ...]:
    """List quantities of the other kind of drive, and those of dry or load-dependent friction where there is none."""
    absent = _list_foreign(scene)
    if not any(effect.dry for effect in scene.effects):
        absent = (*absent, *DRY_FRICTION_QUANTITIES)
    return (
        absent
        if any(effect.loaded_pins for effect in scene.effects)
        else (*absent, *PIN_LOAD_QUANTITIES)
    )
