"""From a scene to its solution: block by block over the positions, stage by stage, no further than wanted."""

import cmath
import os
from collections.abc import Callable, Collection, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import DependencyError, InputError, LimitError, installing
from fourbar.formulas.motion import Rates, State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.formulas.position import HalfAngle, Position, anywhere, polar
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
    PIN_FORCES,
    QUANTITIES,
    SEVERAL,
    SINGULAR,
    STAGE_OF,
    STAGES,
    UNKNOWNS,
    WOUND,
)
from fourbar.scene import Command, Scene, command
from fourbar.scene.case import NO_MOTION, NOWHERE, Case, changed
from fourbar.scene.point import OF_POINTS
from fourbar.solution import Array, Solution, unwrap

if TYPE_CHECKING:
    from fourbar.free_motion import FreeMotion

BLOCK = 8192
"""Positions evaluated at a time, measured: fewer pay for calls, more leave the cache."""
WORTH_COMPILING = 2_000_000
"""Evaluations of the forces, one a position, with error bars 17: loading numba and the compiled loop costs as much."""
PARTS_FOR_THREADS = 4
FORCE, ERROR = STAGES.index("force"), STAGES.index("error")
NO_HALF_ANGLE = HalfAngle(*[np.nan] * 5)
"""Of positions whose motion and forces are known."""
Part = tuple[Any, ...]
"""Index of some positions in the arrays of all."""
Evaluated = tuple[NDArray[np.uint8], dict[str, Any], Position | None]
"""Status codes and quantities of some positions, vectors as x + i y, and where the drive must balance."""


class Members(Protocol):
    """What else can be solved: many linkages, which evaluate themselves block by block (`fourbar.vary`)."""

    def solved(
        self, stage: str | None, *, out: Mapping[str, Array] | None, side: int, compiled: bool | None
    ) -> Solution:
        """Every quantity as (m, n) or (m, n, 2)."""


def solve(
    scene: Scene | Members,
    stage: str | None = None,
    *,
    at: Command | None = None,
    out: Mapping[str, Array] | None = None,
    side: int = 0,
    compiled: bool | None = None,
) -> Solution:
    """Evaluate a scene, or a study of m linkages, with the closed formulas as far as a stage.

    Parameters
    ----------
    stage : "position", "velocity", "acceleration", "force" or "error"; each includes those before
        it. Left out: "force", or "position" where the scene states no omega_2.
    at : other positions, velocities and accelerations of the input than the scene's own.
    out : arrays to write into, by name, (n,) or (n, 2), of a study (m, n) or (m, n, 2), which share no memory; only the
        quantities named are evaluated, with the stages they need, and the others are None in the result.
    side : in which sense pins at rest are about to turn where dry friction acts: +1 as theta_2 grows, -1 as it falls, 0
        neither.

    compiled : False: by NumPy. True: by the compiled formulas (numba, extra "fast"), as far as they carry the scene;
        left out: likewise, where numba is installed and the work is at least WORTH_COMPILING.

    Raises
    ------
    DependencyError : compiled is True and numba is not installed.
    InputError : the stage or a name in `out` is unknown, its array has the wrong shape, the scene does not state
        the omega_2 that is needed, or a study, which states its own positions, is given others.
    """
    if not isinstance(scene, Scene):
        if at is not None:
            raise InputError("at", "a command", "a study states its own positions: vary motion.theta_2")
        return scene.solved(stage, out=out, side=side, compiled=compiled)
    moved = _released(scene) if scene.motion.free is not None and at is None else None
    where = moved.command if moved is not None else command(scene) if at is None else at
    n = len(where.theta_2)
    wanted, names = requested(scene, (n,), where.omega_2, stage, out)
    alone = n == 1 and moved is None and out is None
    result = arrays(names, (n,), out) if not alone or compiled else {}
    code = np.zeros(n, dtype=np.uint8)
    with np.errstate(all="ignore"):
        case = Case.of(_started(scene) if wanted >= FORCE else scene)._replace(side=side)
        quick = moved is None and where.remainder is None and is_compiled(case, wanted, n, compiled)
        parts: Iterable[Part]
        if moved is not None:
            parts = ((np.flatnonzero(moved.bar == bar),) for bar in (2, 4))
        elif n == 1 and not quick:  # in plain numbers: arrays of one entry cost several times as much
            parts = ((0,),)
        else:
            size = BLOCK if quick else positions_at_once(wanted)
            parts = [(slice(start, start + size),) for start in range(0, n, size)]

    def evaluate(part: Part) -> None:
        nonlocal result
        if quick:
            found = evaluated(case, where, part, wanted, names)
        elif moved is None:
            found = commanded(case, where, part, wanted, names)
        else:
            found = _freely(case, moved, part, wanted, names)
        if alone and not quick:
            code[0], result = _of_one(case, found)
        else:
            keep(case, found, result, code, part, seen=quick)

    each(evaluate, parts, at_once=quick)
    for name in ANGLES:
        if name in result:
            unwrap(result[name])
    solution = solved(scene, where, code, result)
    solution.time, solution.stopped_at = where.time, None if moved is None else moved.stopped_at
    return solution


def is_compiled(case: Case, wanted: int, count: int, compiled: bool | None) -> bool:
    """Whether some positions go through the compiled loop; for the parameters see `solve` and `commanded`."""
    if compiled is False or wanted < FORCE:
        return False
    size = count * (BLOCK // positions_at_once(wanted))
    if compiled is None and (size < WORTH_COMPILING or not find_spec("numba")):
        return False
    from fourbar.scene.compiled import carries

    if not find_spec("numba"):
        raise DependencyError(f"compiled=True needs numba, which is not installed: {installing('fast')}")
    return carries(case)


def threads() -> int:
    """As many as this process may use cores, or as OMP_NUM_THREADS states."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, int(stated)) if stated.isdecimal() and int(stated) else cores


def each(evaluate: Callable[[Any], None], parts: Iterable[Any], *, at_once: bool) -> None:
    """Evaluate the parts, one after the other or on all cores: compiled code holds no lock of the interpreter."""

    def quietly(part: Any) -> None:
        with np.errstate(all="ignore"):  # which each thread has of its own
            evaluate(part)

    parts = iter(parts)
    for part in parts:  # compiled by the first
        quietly(part)
        if at_once:
            break
    rest, cores = list(parts) if at_once else [], threads()
    if cores == 1 or len(rest) < PARTS_FOR_THREADS:
        for part in rest:
            quietly(part)
        return
    with ThreadPoolExecutor(cores) as pool:
        for _ in pool.map(quietly, rest):
            pass


def last_stage(scene: Scene) -> str:
    """The last stage that a scene states enough for: error bars and all, or positions alone."""
    motion = scene.motion
    return "position" if motion.omega_2 is None and motion.law is None and motion.free is None else STAGES[-1]


def requested(
    scene: Scene, shape: tuple[int, ...], omega_2: Any, stage: str | None, out: Mapping[str, Array] | None
) -> tuple[int, Collection[str]]:
    """The number of the last stage that is evaluated, and the names of the quantities; an InputError as of `solve`.

    Parameters
    ----------
    shape : of the positions.
    omega_2 : None where the scene states none.
    """
    if out is None:
        if stage is None:
            stage = "position" if omega_2 is None else "force"
        if stage not in STAGES:
            raise InputError("stage", stage, "must be one of " + ", ".join(STAGES))
        wanted, absent = STAGES.index(stage), _absent(scene)
        before = STAGES[: wanted + 1]
        names: Collection[str] = {
            name: None for name, of in _stages(scene).items() if of in before and name not in absent
        }.keys()
    else:
        names = out.keys()
        wanted = _highest_stage(out, shape, _stages(scene))
    if wanted > 0 and omega_2 is None:
        raise InputError("motion.omega_2", None, f"is needed for the stage {STAGES[wanted]!r}")
    return wanted, names


def arrays(names: Iterable[str], shape: tuple[int, ...], out: Mapping[str, Array] | None) -> dict[str, Array]:
    """To write into: new ones, or those given."""
    if out is not None:
        return dict(out)
    return {name: np.empty(shape if is_scalar(name) else (*shape, 2)) for name in names}


def is_scalar(name: str) -> bool:
    """Whether a quantity is a number at each position; the others, a scene's own points too, are vectors."""
    return KIND.get(name) == "scalar"


KIND = {q.name: q.kind for q in QUANTITIES}


def _stages(scene: Scene) -> dict[str, str]:
    """Every quantity of a scene, those of its own points too, and its stage."""
    if not scene.points:
        return STAGE_OF
    return STAGE_OF | {f"{start}{p.name}": stage for p in scene.points for start, stage in OF_POINTS.items()}


def solved(scene: Scene, at: Command, code: NDArray[np.uint8], result: Mapping[str, Array]) -> Solution:
    """The solution with its arrays in their places."""
    own: dict[str, dict[str, Array]] = {start: {} for start in OF_POINTS}
    for point in scene.points:
        for start, arrays in own.items():
            if (array := result.get(start + point.name)) is not None:
                arrays[point.name] = array
    known = {name: array for name, array in result.items() if name in STAGE_OF}
    solution = Solution(scene.title, scene.drive_bar, code, np.asarray(at.branch), at.theta_2, **known)
    solution.points, solution.velocity, solution.acceleration = own[""], own["v_"], own["a_"]
    return solution


def positions_at_once(wanted: int) -> int:
    """Of a stage: for the error bars each position is evaluated many times."""
    if wanted < ERROR:
        return BLOCK
    from fourbar.scene.error_bars import EVALUATIONS

    return BLOCK // EVALUATIONS


def keep(
    case: Case,
    found: Evaluated,
    result: Mapping[str, Array],
    code: NDArray[np.uint8],
    part: Part,
    shape: tuple[int, ...] | None = None,
    *,
    seen: bool = False,
) -> None:
    """Write what was evaluated into the arrays of all positions, where it is no number with the status that says so.

    Parameters
    ----------
    seen : whether what is no number has its status already.
    shape : of the part of the arrays; None: that of what was evaluated.
    """
    codes, values, _ = found
    if not seen:
        withheld(case, found)
    code[part] = codes if shape is None else codes.reshape(shape)
    for name, value in values.items():
        if shape is not None and np.ndim(value):
            value = value.reshape(shape)  # noqa: PLW2901
        if is_scalar(name):
            result[name][part] = value
        else:
            result[name][*part, 0], result[name][*part, 1] = value.real, value.imag


def _of_one(case: Case, found: Evaluated) -> tuple[Any, dict[str, Array]]:
    """The same of a single position: its status code, and all of its arrays at once."""
    codes, values, driven = found
    if not all_finite(values):
        withhold(values, codes, np.asarray(driven is not None and np.abs(case.drive_sine(driven)) <= NO_DIGIT_LEFT))
    numbers = [name for name in values if KIND.get(name) == "scalar"]
    vectors = [name for name in values if KIND.get(name) != "scalar"]
    rows = np.array([values[name] for name in numbers], dtype=float)[:, None]
    pairs = np.array([values[name] for name in vectors], dtype=complex)[:, None].view(float).reshape(-1, 1, 2)
    return codes, dict(zip((*numbers, *vectors), (*rows, *pairs), strict=True))


def all_finite(values: Mapping[str, Any]) -> bool:
    """Whether every entry is a number, from their squares; False also where a square leaves the range of doubles."""
    squares = (np.vdot(value, value) if isinstance(value, np.ndarray) else value for value in values.values())
    return all(cmath.isfinite(square) for square in squares)


def withheld(case: Case, found: Evaluated) -> None:
    """What was evaluated with `withhold` where anything is no number, changed in place."""
    codes, values, driven = found
    if not all_finite(values):
        in_line = driven is not None and np.abs(case.drive_sine(driven)) <= NO_DIGIT_LEFT
        withhold(values, codes, np.broadcast_to(in_line, codes.shape))


def withhold(values: dict[str, Any], code: NDArray[np.uint8], in_line: NDArray[np.bool_]) -> None:
    """Where a quantity is no number and the status promises one: the status that says so, and NaN from that stage on.

    Parameters
    ----------
    code : status of each position, changed in place.
    in_line : where the two bars that are not driven are in line: there no forces hold them in balance.
    """
    gone = np.zeros(code.shape, dtype=bool)
    for stage in STAGES:
        names = [name for name in values if STAGE_OF.get(name, OF_POINTS.get(name[:2], "position")) == stage]
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


def commanded(case: Case, where: Command, part: Part, wanted: int, names: Collection[str]) -> Evaluated:
    """Some positions of a command to the input, evaluated.

    Parameters
    ----------
    wanted : number of the last stage that the quantities named need.
    """
    theta_2, branch = where.theta_2[part], _sign(where.branch[part])
    half, exact = case.half_angle(theta_2, where.remainder)
    of_angles = len(names) <= len(ANGLES) and set(names) <= set(ANGLES)
    if of_angles and where.remainder is None and not case.path.may_stay_parallel:
        return _angles(case, half, branch, names)
    at = case.path.position(theta_2, half, branch)
    codes = _codes(at.sin_mu, half, NO_DIGIT_LEFT if where.remainder is None else 0.0)
    if anywhere(codes):  # velocities are 0/0
        at = at._replace(root=np.where(codes == SINGULAR, np.nan, at.root))
    omega_2, alpha_2 = _piece(where.omega_2, part), _piece(where.alpha_2, part)
    state = case.state(case.path, theta_2, at, branch, omega_2, alpha_2, moving=wanted > 0)
    values = kinematics(case, state, names)
    if wanted >= FORCE:
        known = exact if wanted == ERROR else None
        values |= _forces(case, state, alpha_2, branch, branch, codes, names, known)
    return codes, values, at


def evaluated(case: Case, where: Command, part: Part, wanted: int, names: Collection[str]) -> Evaluated:
    """The same through the compiled loop; what it leaves open as of `commanded`."""
    from fourbar.scene import compiled

    theta_2, branch = where.theta_2[part], _sign(where.branch[part])
    omega_2, alpha_2 = _piece(where.omega_2, part), _piece(where.alpha_2, part)
    found = compiled.evaluate(case, theta_2, branch, omega_2, alpha_2, error_bars=wanted == ERROR)
    u2, u3, u4, *pins = found.vectors
    sin_mu, omega_3, omega_4, alpha_3, alpha_4, torque, sine, *errors = found.scalars
    at = Position(polar(1.0, case.path.theta_1), u2, u3, u4, sin_mu, np.nan, np.nan, np.nan, NO_HALF_ANGLE)
    moving = Rates(omega_2, omega_3, omega_4, alpha_2, alpha_3, alpha_4)
    state = State(case.lengths, case.path.theta_1, theta_2, at, NO_MOTION, omega_2, moving)
    values = kinematics(case, state, names)
    others = dict(zip((*PIN_FORCES, "torque", "torque_error", "force_error"), (*pins, torque, *errors), strict=True))
    others["drive_condition"] = np.abs(sine)
    values |= {name: value for name, value in others.items() if name in names}
    codes = np.zeros(theta_2.shape, dtype=np.uint8)
    if found.left.any():
        index = np.flatnonzero(found.left)

        def own(number: Any) -> Any:
            return number[index] if np.ndim(number) else number

        left = changed(case, own)
        where = Command(theta_2[index], own(where.branch[part]), own(omega_2), own(alpha_2))
        rest = commanded(left, where, (...,), wanted, names)
        withheld(left, rest)
        codes[index] = rest[0]
        for name, value in rest[1].items():
            whole = np.array(np.broadcast_to(values[name], theta_2.shape))
            whole[index] = value
            values[name] = whole
    elif all_finite({name: value for name, value in values.items() if name not in UNKNOWNS}):  # the loop saw to these
        return codes, values, None
    withheld(case, (codes, values, None))
    return codes, values, None


def _codes(sine: Any, half: HalfAngle, margin: float) -> NDArray[np.uint8]:
    """Statuses of positions from the sine of the transmission angle, or a multiple of it."""
    codes, size = np.zeros(np.shape(sine), dtype=np.uint8), np.abs(sine)
    if not (size.min(initial=np.inf) if codes.ndim else size) > margin:  # NaN where the loop does not close
        codes[size <= margin] = SINGULAR
        codes[np.isnan(sine)] = NOT_ASSEMBLED
        codes[np.isnan(half.kk)] = OVERFLOW  # of theta_2 - theta_1: not even where it closes is known
    return codes


def _sign(branch: NDArray[np.int8]) -> Any:
    """The branch of each position, or one number where all have the same."""
    if branch.ndim == 0 or (branch.size and branch.min() == branch.max()):
        return float(branch.flat[0]) if branch.ndim else float(branch)
    return branch


def _angles(case: Case, half: HalfAngle, branch: Any, names: Iterable[str]) -> Evaluated:
    """The same where two angles alone are wanted: without vectors and the rest of the triangle."""
    theta_3, theta_4, root = case.path.angles(half, branch)
    codes = _codes(root, half, NO_DIGIT_LEFT * 2.0 * case.path.lengths.b * case.path.lengths.c)
    found = {"theta_3": theta_3, "theta_4": theta_4}
    return codes, {name: found[name] for name in names}, None


def _freely(case: Case, moved: "FreeMotion", part: Part, wanted: int, names: Collection[str]) -> Evaluated:
    """The same at instants of a free motion that have one independent angle; there is no driving torque."""
    codes = np.zeros(len(part[0]), dtype=np.uint8)
    if not codes.size:
        return codes, {}, None
    bar = int(moved.bar[part][0])
    free = case._replace(drive_bar=bar, path=moved.paths[bar])
    q, speed, growth, branch = (x[part] for x in (moved.q, moved.speed, moved.acceleration, moved.sign))
    at = free.path.position(q, free.path.half_angle(q), branch)
    state = free.state(free.path, q, at, branch, speed, growth)._replace(theta_2=moved.command.theta_2[part])
    values = kinematics(case, state, names)
    if wanted >= FORCE:
        exact = NOWHERE if wanted == ERROR else None
        values |= _forces(free, state, growth, None, branch, codes, names, exact)
        values |= {
            name: np.zeros(codes.shape) for name in values if name in ("torque", "torque_error", *OF_DRY_FRICTION)
        }
    return codes, values, None


def _forces(
    case: Case,
    state: State,
    alpha_2: Any,
    branch: NDArray[np.int8] | None,
    sign: Any,
    codes: NDArray[np.uint8],
    names: Collection[str],
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
        from fourbar.scene.error_bars import error_bars

        values |= error_bars(case, state, alpha_2, sign, found, exact)
    without = [status for term in case.terms if (status := term.status(state, branch)) is not None]
    if found.status is not None:
        without.append(found.status)
    if without:
        status = np.max(without, axis=0)
        codes[...] = np.where(codes == OK, status, codes)
    if anywhere(codes > SINGULAR):
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
    "theta_3": lambda case, state: np.arctan2(state.at.u3.imag, state.at.u3.real),
    "theta_4": lambda case, state: np.arctan2(state.at.u4.imag, state.at.u4.real),
    "sin_mu": lambda case, state: state.at.sin_mu,
    "condition": lambda case, state: np.abs(state.at.sin_mu),
    "A": lambda case, state: state.point(2, case.lengths.a),
    "B": lambda case, state: state.point(4, case.lengths.c),
    **_of_bars("G{}", lambda case, state, bar: state.point(bar, case.bodies[bar - 2].z)),
    **_of_bars("omega_{}", lambda case, state, bar: state.omega(bar)),
    **_of_bars("alpha_{}", lambda case, state, bar: state.alpha(bar)),
    "v_A": lambda case, state: state.velocity(2, case.lengths.a),
    "v_B": lambda case, state: state.velocity(4, case.lengths.c),
    **_of_bars("v_G{}", lambda case, state, bar: state.velocity(bar, case.bodies[bar - 2].z)),
    "a_A": lambda case, state: state.acceleration(2, case.lengths.a),
    "a_B": lambda case, state: state.acceleration(4, case.lengths.c),
    **_of_bars("a_G{}", lambda case, state, bar: state.acceleration(bar, case.bodies[bar - 2].z)),
}
"""The quantities before the forces."""


def kinematics(case: Case, state: State, names: Collection[str]) -> dict[str, Any]:
    """Those of the quantities that come before the forces, a scene's own points among them."""
    values = {name: KINEMATIC[name](case, state) for name in names if name in KINEMATIC}
    for name, bar, z in case.points:
        for start, evaluate in (("", state.point), ("v_", state.velocity), ("a_", state.acceleration)):
            if start + name in names:
                values[start + name] = evaluate(bar, z)
    return values


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
    """The scene with effects that know where its motion begins: where it first assembles, if it keeps its branch."""
    if not any(effect.counts_turns for effect in scene.effects):
        return scene
    at = command(scene)
    half, _ = Case.of(scene).half_angle(at.theta_2, at.remainder)
    assembled = (half.outer >= 0.0) & (half.inner >= 0.0)
    if not assembled.any() or np.ptp(at.branch) != 0:
        return scene
    first = int(np.argmax(assembled))
    return started(scene, Command(at.theta_2[first], at.branch[first], 0.0, 0.0, at.remainder))


def started(scene: Scene, at: Command) -> Scene:
    """The scene with effects that know that its motion begins at a position, of as many linkages as there are."""
    state = state_at(scene, at)
    return replace(scene, effects=tuple(effect.counted_from(state, at.branch) for effect in scene.effects))


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


def _highest_stage(out: Mapping[str, Array], positions: tuple[int, ...], stages: Mapping[str, str]) -> int:
    """The last stage that the quantities named need; an InputError where one cannot be written."""
    for name, array in out.items():
        if name not in stages:
            raise InputError("out", name, "must be among " + ", ".join(stages))
        shape = positions if is_scalar(name) else (*positions, 2)
        if array.shape != shape or array.dtype != np.float64:
            raise InputError(f"out.{name}", (array.shape, str(array.dtype)), f"must be float64 of shape {shape}")
    return max((STAGES.index(stages[name]) for name in out), default=0)


def _piece(value: float | Array | None, part: Part) -> float | Array:
    """A number for all positions, or the part of an array that belongs to a block."""
    if value is None or np.ndim(value) == 0:
        return value or 0.0
    return value[part]  # type: ignore[index]
