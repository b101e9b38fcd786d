"""Solver of a scene: block by block over the positions, stage by stage.

The evaluation ends after the stage that is asked for.
"""

import cmath
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import Any, Protocol

import numpy as np

from fourbar.errors import InputError, expect
from fourbar.evaluation.case import POSITIONS_OF_A_BLOCK, Case
from fourbar.evaluation.evaluate import (
    ERROR,
    FORCE,
    Evaluated,
    evaluate,
    evaluate_released,
    withhold_infinite,
)
from fourbar.formulas.mobility import TURN
from fourbar.linkage import A_BRANCH, require_bar, require_whole
from fourbar.quantities import (
    ANGLES,
    COUPLE,
    DRY_FRICTION_QUANTITIES,
    LINE_QUANTITIES,
    OF_POINTS,
    PIN_LOAD_QUANTITIES,
    SCALARS,
    STAGE_OF,
    STAGES,
    STROKE,
    Array,
    find_quantity,
)
from fourbar.scene import (
    Command,
    LimitOrigin,
    ReleaseOrigin,
    Scene,
    StrokeOrigin,
    command,
    find_signs,
)
from fourbar.scene.motion import COMMAND_NAMES
from fourbar.solution import Solution, unwrap

_LONG_BLOCK = POSITIONS_OF_A_BLOCK // 4
"""Positions with error bars evaluated at a time. Longer numbers fill the cache sooner.
"""
PositionIndex = tuple[Any, ...]
"""Index of some positions in the arrays of all; of a study, of some members too."""


class ManyScenes(Protocol):
    """Scenes of many linkages (`fourbar.vary`), which `solve` takes in place of one."""

    def solve(
        self,
        stage: str | None = None,
        *,
        out: Mapping[str, Array] | None = None,
        side: int = 0,
    ) -> Solution:
        """Evaluate all of them, as `solve` does."""


def solve(
    scene: Scene | ManyScenes,
    stage: str | None = None,
    *,
    at: Command | None = None,
    out: Mapping[str, Array] | None = None,
    side: int = 0,
) -> Solution:
    """Evaluate a scene, or a study of m linkages, with the closed formulas.

    The evaluation ends after the stage that is asked for.

    Parameters
    ----------
    stage : "position", "velocity", "acceleration", "force" or "error"; each includes
        those before it. Left out: "force", or "position" where the scene states no
        omega_2.
    at : other positions, velocities and accelerations than the scene's own, of a bar of
        its own.
    out : arrays to write into, by name, (n,) or (n, 2), of a study (m, n) or (m, n, 2).
        No two share memory. Only the quantities named are evaluated, with the stages
        they need, and the others are None in the result.
    side : in which sense pins at rest are about to turn where dry friction acts: +1 as
        the commanded angle grows, -1 as it falls, 0 neither.

    Raises
    ------
    InputError : the stage or a name in `out` is unknown, its array has the wrong shape,
        the scene does not state the omega_2 that is needed, or a study, which states
        its own positions, is given others.
    """
    require_whole("side", side, (-1, 0, 1), "must be -1, 0 or 1")
    if not isinstance(scene, Scene):
        if not hasattr(scene, "solve"):
            raise InputError("scene", scene, "must be a Scene, or a Study of `vary`")
        if at is not None:
            allowed = "a study states its own positions: vary the commanded angle"
            raise InputError("at", "a command", allowed)
        return scene.solve(stage, out=out, side=side)
    of_release: dict[str, Any] = {}
    if at is not None:
        _require_command_at(at)
    elif scene.motion.free is not None:
        from fourbar.evaluation.free_motion import release

        released = release(scene)
        at = released.command
        for name in ("change_points", "with_extremes", "command_at"):
            of_release[name] = getattr(released, name)
    else:
        at = command(scene)
    results = Results(scene, at, stage, out)
    with np.errstate(all="ignore"):
        if isinstance(at.origin, ReleaseOrigin):
            results.fill_released(scene, at.origin)
        else:
            case = Case.of(scene, at.bar, side)
            if results.asks_forces and scene.counts_turns:
                stated = command(scene)
                case = case.begin_with(stated if stated.bar == at.bar else at)
            if not results.fill_alone(case, at):
                results.allocate()
                for rows in split(len(at.angle), results.block):
                    results.fill(case, at.part(rows), (rows,))
    return make_solution(scene, at, results, **of_release)


class Results:
    """What is evaluated at the positions of a command, and the arrays of it.

    Status codes and arrays are filled block by block.
    """

    def __init__(
        self,
        scene: Scene,
        at: Command,
        stage: str | None,
        out: Mapping[str, Array] | None,
    ) -> None:
        """Take the arguments of `solve`; an InputError as there.

        If a bar other than the input is commanded, theta_2 and sin_mu, whose sign is
        the branch, are evaluated too.
        """
        self.shape = at.angle.shape
        self.out = {} if out is None else out
        points = tuple(point.name for point in scene.points)
        stages = _list_stages(points, _list_foreign(scene))
        if out is None:
            if stage is None:
                stage = "position" if at.speed is None else "force"
            if not isinstance(stage, str) or stage not in STAGES:
                raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
            self.last_stage = STAGES.index(stage)
            reached = {name for name in stages if stages[name] <= self.last_stage}
            self.wanted = reached.difference(_list_absent(scene))
        else:
            _require_out(out, self.shape, stages)
            self.wanted = {*out}
            self.last_stage = max((stages[name] for name in out), default=0)
        if self.last_stage > 0 and at.speed is None:
            raise InputError(
                f"motion.omega_{at.bar}",
                None,
                f"is needed for the stage {STAGES[self.last_stage]!r}",
            )
        if at.bar != 2:
            self.wanted |= {"theta_2", "sin_mu"}
        self.codes = np.zeros(0, dtype=np.uint8)
        self.arrays: dict[str, Array] = {}

    @property
    def block(self) -> int:
        """Number of positions evaluated at a time."""
        return POSITIONS_OF_A_BLOCK if self.last_stage < ERROR else _LONG_BLOCK

    @property
    def asks_forces(self) -> bool:
        """Return True if forces are evaluated."""
        return self.last_stage >= FORCE

    def allocate(self) -> None:
        """Make the arrays, those of the caller's apart."""
        self.codes = np.zeros(self.shape, dtype=np.uint8)
        for name in self.wanted:
            shape = self.shape if name in SCALARS else (*self.shape, 2)
            given = self.out.get(name)
            self.arrays[name] = np.empty(shape) if given is None else given

    def fill(self, case: Case, at: Command, index: PositionIndex) -> None:
        """Evaluate some positions."""
        # kept until the next block is evaluated: its memory is used again
        self.kept = evaluate(case, at, self.last_stage, self.wanted)
        self._store(case, self.kept, index)

    def _store(self, case: Case, evaluated: Evaluated, index: PositionIndex) -> None:
        """Store what was evaluated at some positions.

        Values that are no number have the status that says so.
        """
        withhold_infinite(case, evaluated)
        self.codes[index] = evaluated.codes
        for name, value in evaluated.values.items():
            array = self.arrays[name]
            if name in SCALARS:
                array[index] = value
            else:
                array[*index, 0] = value.real
                array[*index, 1] = value.imag

    def fill_alone(self, case: Case, at: Command) -> bool:
        """Evaluate a single position in plain numbers.

        Arrays of one entry cost several times as much. False for several positions, and
        where any result is no number: there NumPy goes on with inf and NaN, and
        statuses follow.
        """
        if self.shape != (1,) or self.out:
            return False
        # Python's own numbers halve a formula's time
        angle: Any = at.angle.item()
        position = at.part((0,))._replace(angle=angle)
        try:
            codes, values, _ = evaluate(case, position, self.last_stage, self.wanted)
        except ArithmeticError:
            return False
        table = np.array([*values.values()], dtype=complex)
        if not cmath.isfinite(np.vdot(table, table)):
            return False
        self.codes = np.array([codes], dtype=np.uint8)
        vectors = table.view(float).reshape(-1, 1, 2)
        scalars = vectors[:, :, 0]
        for row, name in enumerate(values):
            self.arrays[name] = scalars[row] if name in SCALARS else vectors[row]
        return True

    def fill_released(self, scene: Scene, released: ReleaseOrigin) -> None:
        """Evaluate a released motion, as the commands that it is made of."""
        self.allocate()
        for index, at, side in released.commands():
            case = Case.of(scene, at.bar, side)
            evaluated = evaluate_released(case, at, self.last_stage, self.wanted)
            self._store(case, evaluated, (index,))


def _require_out(out: Any, shape: tuple[int, ...], allowed: Iterable[str]) -> None:
    """Raise InputError for arrays that quantities cannot be written into."""
    expect("out", out, Mapping)
    for name, array in out.items():
        if name not in allowed:
            raise InputError("out", name, f"must be among {', '.join(allowed)}")
        wanted = shape if name in SCALARS else (*shape, 2)
        expect(f"out.{name}", array, np.ndarray)
        fits = array.shape == wanted and array.dtype == np.float64
        if not fits or not array.flags.writeable:
            raise InputError(
                f"out.{name}",
                (array.shape, str(array.dtype)),
                f"must be float64 of shape {wanted}, writeable",
            )


def split(size: int, most: int) -> Iterator[slice]:
    """Return slices of at most `most` that cover `size` entries."""
    return (slice(start, min(start + most, size)) for start in range(0, size, most))


def _require_command_at(at: Command) -> None:
    """Raise an InputError unless a command is well formed."""
    expect("at", at, Command)
    require_bar("at.bar", at.bar)
    expect("at.origin", at.origin, LimitOrigin, StrokeOrigin, ReleaseOrigin, type(None))
    theta, omega, alpha = COMMAND_NAMES[at.bar]
    expect(f"at.{theta}", at.angle, np.ndarray)
    each = (at.angle.size,)
    stated = {
        theta: at.angle,
        "branch": at.branch,
        "time": at.time,
        omega: at.speed,
        alpha: at.acceleration,
    }
    for name, value in stated.items():
        if value is None and name in ("time", omega):
            continue
        is_number = isinstance(value, np.ndarray | np.number | float | int)
        numbers = np.asarray(value if is_number else None)
        is_one_rate = name in (omega, alpha) and not numbers.shape
        fits = numbers.shape == each or is_one_rate
        if numbers.dtype.kind not in "iuf" or not fits:
            raise InputError(f"at.{name}", value, f"must be numbers, shape {each}")
    if (np.abs(at.branch) != 1).any():
        raise InputError("at.branch", at.branch, f"{A_BRANCH} at each position")


def find_last_stage(scene: Scene) -> str:
    """Return the last stage for which a scene states enough.

    A scene without speed, law or release has positions alone; all others have every
    stage.
    """
    motion = scene.motion
    if motion.speed is None and motion.law is None and motion.free is None:
        return "position"
    return STAGES[-1]


@cache
def _list_stages(points: tuple[str, ...], foreign: tuple[str, ...]) -> dict[str, int]:
    """List the quantities of a scene, those of its points too, with their stages."""
    names = [*STAGE_OF]
    for name in points:
        names += [start + name for start in OF_POINTS]
    return {
        name: find_quantity(name).stage_number for name in names if name not in foreign
    }


def make_solution(
    scene: Scene,
    at: Command,
    results: Results,
    **of_release: Any,
) -> Solution:
    """Put the arrays of a solution in their places.

    `of_release`: fields of a free motion, `change_points`, `with_extremes` and
    `command_at`.
    """
    quantities: dict[str, Any] = dict(results.arrays)
    commanded = COMMAND_NAMES[at.bar][0]
    for name in ("theta_2", *ANGLES):
        if name in quantities and name != commanded:  # which stays as it is stated
            unwrap(quantities[name])
    theta_2 = at.angle
    if at.moves_stroke:
        # as commanded, wherever it has a value
        for name, value in zip(at.names[:2], at.stated, strict=False):
            if name in quantities:
                quantities[name][...] = value + 0.0 * quantities[name]
        theta_2 = turn_first(theta_2)
        if commanded in quantities:
            quantities[commanded][...] = theta_2 + 0.0 * quantities[commanded]
    of_points: dict[str, dict[str, Array]] = {start: {} for start in OF_POINTS}
    for point in scene.points:
        for start, arrays in of_points.items():
            if start + point.name in quantities:
                arrays[point.name] = quantities.pop(start + point.name)
    sine = quantities.get("sin_mu")
    if sine is None:
        branch = find_signs(scene.linkage, at.angle, at.branch, at.bar)
    else:
        branch = np.where(np.abs(sine) > 0.0, np.sign(sine), at.branch)
    return Solution.of(
        status_code=results.codes,
        branch=np.array(branch, dtype=np.int8),
        theta_2=quantities.pop("theta_2", theta_2),
        time=at.time,
        **quantities,
        points=of_points[""],
        velocity=of_points["v_"],
        acceleration=of_points["a_"],
        scene=scene if theta_2.ndim == 1 else None,
        stated=scene,
        **of_release,
        at=at,
    )


def turn_first(angle: Array) -> Array:
    """Turn an angle that follows from a command to (-pi, pi] where it begins."""
    finite = angle[np.isfinite(angle)]
    if not finite.size:
        return angle
    return np.asarray(angle - TURN * np.ceil((finite.flat[0] - np.pi) / TURN))


def _list_foreign(scene: Scene) -> tuple[str, ...]:
    """List quantities of the kind of drive that the scene lacks."""
    if scene.drive is None:
        return LINE_QUANTITIES
    if scene.drive.has_stroke:
        return COUPLE
    return (*COUPLE, STROKE)


def _list_absent(scene: Scene) -> tuple[str, ...]:
    """List the quantities of dry friction and of pin loads that no effect needs."""
    absent: tuple[str, ...] = ()
    if not any(effect.dry for effect in scene.effects):
        absent = DRY_FRICTION_QUANTITIES
    if any(effect.loaded_pins for effect in scene.effects):
        return absent
    return (*absent, *PIN_LOAD_QUANTITIES)
