"""From a scene to its solution: block by block over the positions, stage by stage, no further than wanted."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError, LimitError
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.formulas.position import HalfAngle, Position
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import (
    ANGLES,
    JAMMED,
    NO_DIRECTION,
    NO_TORQUE,
    NOT_ASSEMBLED,
    OF_DRY_FRICTION,
    OF_PIN_LOADS,
    OK,
    OVERFLOW,
    SEVERAL,
    SINGULAR,
    STAGE_OF,
    STAGES,
    VECTORS,
    WOUND,
)
from fourbar.scene import Command, Scene, command
from fourbar.scene.case import Case
from fourbar.solution import Array, Solution, unwrap

if TYPE_CHECKING:
    from fourbar.free_motion import FreeMotion

BLOCK = 8192
"""Positions evaluated at a time, measured: fewer pay for calls, more leave the cache."""


def solve(
    scene: Scene,
    stage: str | None = None,
    *,
    at: Command | None = None,
    out: Mapping[str, Array] | None = None,
    side: int = 0,
) -> Solution:
    """Evaluate a scene with the closed formulas, as far as a stage.

    Parameters
    ----------
    stage : "position", "velocity", "acceleration", "force" or "error"; each includes those before
        it. Left out: "error", or "position" where the scene states no omega_2.
    at : other positions, velocities and accelerations of the input than the scene's own.
    out : arrays to write into, by name, (n,) or (n, 2), which share no memory; only the quantities named are evaluated,
        with the stages they need, and the others are None in the result.
    side : in which sense pins at rest are about to turn where dry friction acts: +1 as theta_2 grows, -1 as it falls, 0
        neither.

    Raises
    ------
    InputError : the stage or a name in `out` is unknown, its array has the wrong shape, or the
        scene does not state the omega_2 that is needed.
    """
    moved = _released(scene) if scene.motion.free is not None and at is None else None
    where = moved.command if moved is not None else command(scene) if at is None else at
    n = len(where.theta_2)
    if out is None:
        if stage is None:
            stage = "position" if where.omega_2 is None else STAGES[-1]
        if stage not in STAGES:
            raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
        wanted = STAGES.index(stage)
        absent = _absent(scene)
        names = [name for name, of in STAGE_OF.items() if STAGES.index(of) <= wanted and name not in absent]
        result = {name: np.empty((n, 2) if name in VECTORS else n) for name in names}
    else:
        result = dict(out)
        wanted = _highest_stage(result, n)
        stage = STAGES[wanted]
    if stage != "position" and where.omega_2 is None:
        raise InputError("motion.omega_2", None, f"is needed for the stage {stage!r}")
    code = np.zeros(n, dtype=np.uint8)
    with np.errstate(all="ignore"):
        case = Case.of(_started(scene) if wanted >= STAGES.index("force") else scene)._replace(side=side)
        size = BLOCK
        if wanted == len(STAGES) - 1:
            from fourbar.error_bars import EVALUATIONS

            size = BLOCK // EVALUATIONS  # each position is evaluated so many times at once
        parts: Iterable[Any] = (slice(start, min(start + size, n)) for start in range(0, n, size))
        if moved is not None:
            parts = (np.flatnonzero(moved.bar == bar) for bar in (2, 4))
        for part in parts:
            if moved is None:
                codes, values, driven = _commanded(case, where, part, wanted, result.keys())
            else:
                codes, values = _freely(case, moved, part, wanted, result.keys())
                driven = None
            if not all_finite(values):
                in_line = driven is not None and np.abs(case.drive_sine(driven)) <= NO_DIGIT_LEFT
                withhold(values, codes, np.broadcast_to(in_line, codes.shape))
            code[part] = codes
            for name, value in values.items():
                if name in VECTORS:
                    result[name][part, 0], result[name][part, 1] = value.real, value.imag
                else:
                    result[name][part] = value
    for name in ANGLES:
        if name in result:
            unwrap(result[name])
    solution = Solution(scene.title, scene.drive_bar, code, np.asarray(where.branch), where.theta_2, **result)
    solution.time, solution.stopped_at = where.time, None if moved is None else moved.stopped_at
    return solution


def all_finite(values: Mapping[str, Any]) -> bool:
    """Whether every entry is a number, from their squares; False also where a square leaves the range of doubles."""
    return all(np.isfinite(np.vdot(value, value)) for value in values.values())


def withhold(values: dict[str, Any], code: NDArray[np.uint8], in_line: NDArray[np.bool_]) -> None:
    """Where a quantity is no number and the status promises one: the status that says so, and NaN from that stage on.

    Parameters
    ----------
    code : status of each position, changed in place.
    in_line : where the two bars that are not driven are in line: there no forces hold them in balance.
    """
    gone = np.zeros(code.shape, dtype=bool)
    for stage in STAGES:
        names = [name for name in values if STAGE_OF[name] == stage]
        of_forces = stage in STAGES[3:]
        promised = np.isin(code, (OK, SEVERAL)) if of_forces else ~np.isin(code, (NOT_ASSEMBLED, SINGULAR))
        found = np.zeros_like(gone)
        for name in names:
            found |= ~np.isfinite(values[name])
            values[name] = np.where(np.isfinite(values[name]), values[name], _no_value(values[name]))
        found &= promised & ~gone
        code[found] = OVERFLOW
        if of_forces:
            code[found & in_line] = NO_TORQUE
        gone |= found
        for name in names:
            if name != "drive_condition":
                values[name] = np.where(gone, _no_value(values[name]), values[name])


def _no_value(quantity: Any) -> complex:
    """NaN; of a vector in both components."""
    return complex(np.nan, np.nan) if np.iscomplexobj(quantity) else np.nan


def _commanded(
    case: Case, where: Command, part: slice, wanted: int, names: Iterable[str]
) -> tuple[NDArray[np.uint8], dict[str, Any], Position | None]:
    """Status codes and quantities of some positions of a command to the input, and where the drive must balance."""
    theta_2, branch = where.theta_2[part], _sign(where.branch[part])
    half, exact = case.half_angle(theta_2, where.remainder)
    if set(names) <= set(ANGLES) and where.remainder is None and not case.path.may_stay_parallel:
        return _angles(case, half, branch, names)
    at = case.path.position(theta_2, half, branch)
    codes = _codes(at.sin_mu, half, NO_DIGIT_LEFT if where.remainder is None else 0.0)
    if codes.any():  # velocities are 0/0
        at = at._replace(root=np.where(codes == SINGULAR, np.nan, at.root))
    omega_2, alpha_2 = _piece(where.omega_2, part), _piece(where.alpha_2, part)
    state = case.state(case.path, theta_2, at, branch, omega_2, alpha_2, moving=wanted > 0)
    values = {name: KINEMATIC[name](case, state) for name in names if name in KINEMATIC}
    if wanted >= STAGES.index("force"):
        known = exact if wanted == len(STAGES) - 1 else None
        values |= _forces(case, state, alpha_2, branch, branch, codes, names, known)
    return codes, values, at


def _codes(sine: Array, half: HalfAngle, margin: float) -> NDArray[np.uint8]:
    """Statuses of positions from the sine of the transmission angle, or a multiple of it."""
    codes, size = np.zeros(sine.shape, dtype=np.uint8), np.abs(sine)
    if not size.min(initial=np.inf) > margin:  # NaN where the loop does not close
        codes[size <= margin] = SINGULAR
        codes[np.isnan(sine)] = NOT_ASSEMBLED
        codes[np.isnan(half.kk)] = OVERFLOW  # of theta_2 - theta_1: not even where it closes is known
    return codes


def _sign(branch: NDArray[np.int8]) -> Any:
    """The branch of each position, or one number where all have the same."""
    return float(branch[0]) if branch.size and branch.min() == branch.max() else branch


def _angles(
    case: Case, half: HalfAngle, branch: Any, names: Iterable[str]
) -> tuple[NDArray[np.uint8], dict[str, Any], None]:
    """The same where two angles alone are wanted: without vectors and the rest of the triangle."""
    theta_3, theta_4, root = case.path.angles(half, branch)
    codes = _codes(root, half, NO_DIGIT_LEFT * 2.0 * case.path.lengths.b * case.path.lengths.c)
    found = {"theta_3": theta_3, "theta_4": theta_4}
    return codes, {name: found[name] for name in names}, None


def _freely(
    case: Case, moved: "FreeMotion", part: NDArray[np.intp], wanted: int, names: Iterable[str]
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """The same at instants of a free motion that have one independent angle; there is no driving torque."""
    codes = np.zeros(len(part), dtype=np.uint8)
    if not len(part):
        return codes, {}
    bar = int(moved.bar[part[0]])
    free = case._replace(drive_bar=bar, path=moved.paths[bar])
    q, speed, growth, branch = (x[part] for x in (moved.q, moved.speed, moved.acceleration, moved.sign))
    at = free.path.position(q, free.path.half_angle(q), branch)
    state = free.state(free.path, q, at, branch, speed, growth)._replace(theta_2=moved.command.theta_2[part])
    values = {name: KINEMATIC[name](case, state) for name in names if name in KINEMATIC}
    if wanted >= STAGES.index("force"):
        exact = np.empty(0, dtype=np.intp) if wanted == len(STAGES) - 1 else None
        values |= _forces(free, state, growth, None, branch, codes, names, exact)
        values |= {name: np.zeros(len(part)) for name in values if name in ("torque", "torque_error", *OF_DRY_FRICTION)}
    return codes, values


def _forces(
    case: Case,
    state: State,
    alpha_2: Any,
    branch: NDArray[np.int8] | None,
    sign: Any,
    codes: NDArray[np.uint8],
    names: Iterable[str],
    exact: NDArray[np.intp] | None,
) -> dict[str, Any]:
    """The quantities of the force stage; statuses of effects go into the codes.

    Parameters
    ----------
    branch : of each position; None where no effect counts turns by it.
    sign : of the path's root.
    exact : indices of the positions known in many digits; None: no error bars.
    """
    found = case.dynamics(state, alpha_2, case.side)
    values: dict[str, Any] = {**found.pins._asdict(), "torque": found.torque}
    if "drive_condition" in names:
        condition = np.abs(case.drive_sine(state.at))
        values["drive_condition"] = condition if found.from_jamming is None else condition * found.from_jamming
    if "friction_residual" in names:
        values["friction_residual"] = 0.0 if found.residual is None else found.residual
    if "torque_low" in names or "torque_high" in names:
        *ends, held = case.torque_interval(state, alpha_2, found.torque)
        values |= zip(OF_DRY_FRICTION, ends, strict=True)
        if held is not None and found.status is not None:
            found = found._replace(status=np.where(held & (found.status == OK), JAMMED, found.status))
    if exact is not None:
        from fourbar.error_bars import error_bars

        values |= error_bars(case, state, alpha_2, sign, found, exact)
    without = [status for term in case.terms if (status := term.status(state, branch)) is not None]
    if found.status is not None:
        without.append(found.status)
    if without:
        status = np.max(without, axis=0)
        codes[:] = np.where(codes == OK, status, codes)
    if (codes > SINGULAR).any():
        gone = np.isin(codes, WITHOUT_FORCES)
        values |= {
            name: np.where(gone, _no_value(value), value) for name, value in values.items() if name != "drive_condition"
        }
    return {name: value for name, value in values.items() if name in names}


WITHOUT_FORCES = (NO_DIRECTION, WOUND)
"""Statuses of positions at which an effect has no value, and so the forces have none."""
Quantity = Callable[[Case, State], Any]


def _of_bar(evaluate: Callable[[Case, State, int], Any], bar: int) -> Quantity:
    return lambda case, state: evaluate(case, state, bar)


def _of_bars(name: str, evaluate: Callable[[Case, State, int], Any]) -> dict[str, Quantity]:
    return {name.format(bar): _of_bar(evaluate, bar) for bar in MOVING_BARS}


KINEMATIC: dict[str, Quantity] = {
    "theta_3": lambda case, state: np.angle(state.at.u3),
    "theta_4": lambda case, state: np.angle(state.at.u4),
    "sin_mu": lambda case, state: state.at.sin_mu,
    "condition": lambda case, state: np.abs(state.at.sin_mu),
    "A": lambda case, state: state.point(2, case.lengths.a),
    "B": lambda case, state: state.point(4, case.lengths.c),
    **_of_bars("G{}", lambda case, state, bar: state.point(bar, case.bodies[bar - 2].z)),
    **_of_bars("omega_{}", lambda case, state, bar: state.omega(bar)),
    **_of_bars("alpha_{}", lambda case, state, bar: state.alpha(bar)),
    "a_A": lambda case, state: state.acceleration(2, case.lengths.a),
    "a_B": lambda case, state: state.acceleration(4, case.lengths.c),
    **_of_bars("a_G{}", lambda case, state, bar: state.acceleration(bar, case.bodies[bar - 2].z)),
}
"""The quantities before the forces."""


def _released(scene: Scene) -> "FreeMotion":
    """The motion that the linkage makes when it is released."""
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
    _refuse_wound(scene, moved.command)
    return moved


def state_at(scene: Scene, at: Command) -> State:
    """The positions of a command and their motion, for what shows them."""
    with np.errstate(all="ignore"):
        case = Case.of(scene)
        half, _ = case.half_angle(at.theta_2, at.remainder)
        found = case.path.position(at.theta_2, half, at.branch)
        omega_2 = 0.0 if at.omega_2 is None else at.omega_2
        return case.state(case.path, at.theta_2, found, at.branch, omega_2, at.alpha_2)


def _started(scene: Scene) -> Scene:
    """The scene with effects that know where its motion begins."""
    if not any(effect.counts_turns for effect in scene.effects):
        return scene
    begins = command(scene)
    state = state_at(scene, begins)
    half = state.at.half
    assembled = (half.outer >= 0.0) & (half.inner >= 0.0)
    return replace(
        scene, effects=tuple(effect.counted_from(state, assembled, begins.branch) for effect in scene.effects)
    )


def _refuse_wound(scene: Scene, at: Command) -> None:
    """A LimitError where a free motion winds a spring: from there on it is no longer the spring's."""
    if not any(effect.counts_turns for effect in scene.effects):
        return
    with np.errstate(all="ignore"):
        state = state_at(scene, at)
        for effect in _started(scene).effects:
            codes = effect.status(state, at.branch) if effect.counts_turns else None
            if codes is not None and codes.any():
                assert at.time is not None
                raise LimitError(
                    f"effects.{effect.key}: at {at.time[np.argmax(codes)]:.6g} s the free motion has turned a pin "
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


def _piece(value: float | Array | None, part: slice) -> float | Array:
    """A number for all positions, or the part of an array that belongs to a block."""
    if value is None or np.ndim(value) == 0:
        return value or 0.0
    return value[part]  # type: ignore[index]
