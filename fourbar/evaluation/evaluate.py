"""Positions of a case, evaluated stage by stage.

The stages are kinematics, forces and error bars; what has no value has a status. The
error bar of a force is its distance to the value that the same formulas give in longer
numbers, or what these do not resolve there, if that is more. The stated numbers of
bars, loads, effects and command are taken as exact; everything else is computed again,
in numbers that round at most a thousandth as much as doubles.
"""

import cmath
from collections.abc import Callable, Iterable, Set
from functools import reduce
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import InputError
from fourbar.evaluation.case import Case, Couple, Dynamics
from fourbar.formulas import longer as longer_numbers
from fourbar.formulas.arithmetic import U, angle, is_any, is_zero, select
from fourbar.formulas.longer import lengthen, shorten
from fourbar.formulas.mobility import TURN
from fourbar.formulas.motion import Frame, State
from fourbar.formulas.path import NO_DIGIT_LEFT, LoopPath
from fourbar.quantities import (
    CHANGE_POINT,
    LINE_QUANTITIES,
    NO_DIRECTION,
    NO_LEVER,
    NO_TORQUE,
    NOT_ASSEMBLED,
    OK,
    OVERFLOW,
    PIN_FORCES,
    RATES,
    SEVERAL,
    SINGULAR,
    STAGES,
    WOUND,
    Codes,
    Indices,
    find_quantity,
)
from fourbar.scene import Command
from fourbar.scene.motion import COMMAND_NAMES

FORCE = STAGES.index("force")
ERROR = STAGES.index("error")
_LONG_EPS = float(np.finfo(np.longdouble).eps)
"""Spacing of long doubles next to 1."""
ROUNDINGS_IN_FULL = 16.0
"""Roundings of a chain of formulas that count in full. Some fifty move a result by
sqrt(50) = 7, as a random walk; 16 is a little more than twice that.
"""
SLOPE_STEP = 2.0**-14
"""Part of s^2 by which an angle is moved for a slope. A force then changes by about
that part, so that its change has some 40 bits of a double left.
"""
_LEAST_STEP = 2.0**-46
"""Step as a part of the angle, at least of 1 rad. A shorter step is rounded to less
than two digits.
"""
_FAR = 2.0**26
"""Angle, rad, beyond which a step that is short against s^2 may be too short."""
_WITHOUT_FORCES = (NO_DIRECTION, WOUND, NO_LEVER)
"""Statuses of positions without forces, because an effect or the drive has no value."""


class Evaluated(NamedTuple):
    """Some positions as they were evaluated."""

    codes: Codes
    """Status codes."""
    values: dict[str, Any]
    """Quantities by name, vectors as x + i y."""
    state: State
    """Positions and motion."""


def evaluate(
    case: Case,
    command: Command,
    last_stage: int,
    wanted: Set[str],
) -> Evaluated:
    """Evaluate the named quantities at the positions of a command.

    The evaluation ends with the last stage that they need.

    `command`: positions (n,), or one in plain numbers.
    """
    half, refined_rows = case.half_angle(command)
    state = case.assemble(command, half, moving=last_stage > 0)
    values = list_kinematics(case, state, wanted)
    if "condition" in wanted:
        values["condition"] = values["condition"] * command.condition
    codes = _find_codes_of_loop(case.path, state, command)
    # points of the commanded bar, and the stroke of a cylinder on it, would go on
    stated = {*COMMAND_NAMES[command.bar], *command.names}
    _blank(values, values.keys() - stated, codes == NOT_ASSEMBLED)
    if last_stage < FORCE:
        return Evaluated(codes, values, state)
    dynamics = case.dynamics(state)
    forces, jammed = _list_forces(case, state, dynamics, wanted)
    if last_stage == ERROR:
        forces |= _list_error_bars(case, command, state, dynamics, refined_rows)
    statuses = [term.status(state, command.branch) for term in case.terms]
    statuses += [case.drive.status(state, case.path), dynamics.status, jammed]
    stated_codes = [status for status in statuses if status is not None]
    if stated_codes:
        of_effects = np.max(stated_codes, axis=0)
        codes = np.where(codes == OK, of_effects, codes).astype(np.uint8)
    if is_any(codes > SINGULAR):
        of_forces = forces.keys() - {"drive_condition"}
        of_pins = of_forces & {*PIN_FORCES, "force_error"}
        if any(term.loaded_pins for term in case.terms):
            of_pins = of_forces  # the drive balances friction of those forces
        _blank(forces, of_forces, np.isin(codes, _WITHOUT_FORCES))
        _blank(forces, of_pins, codes == CHANGE_POINT)
    values |= {name: value for name, value in forces.items() if name in wanted}
    return Evaluated(codes, values, state)


def _blank(values: dict[str, Any], names: Iterable[str], missing: Any) -> None:
    """Put NaN in place of the named values where a mask holds."""
    if not is_any(missing):
        return
    for name in names:
        value = values[name]
        nothing = complex(np.nan, np.nan) if np.iscomplexobj(value) else np.nan
        values[name] = np.where(missing, nothing, value)


def evaluate_released(
    case: Case,
    command: Command,
    last_stage: int,
    wanted: Set[str],
) -> Evaluated:
    """Evaluate instants of a released motion, whose drive exerts nothing.

    Results are those of a command of theta_2, in whichever bar's angle they are read.
    """
    released = case._replace(drive=Couple(command.bar))
    codes, values, state = evaluate(released, command, last_stage, wanted)
    by_input = state._replace(bar=2, sine=state.position.sin_mu)
    others = wanted & {"theta_4", "condition", *LINE_QUANTITIES}
    values |= list_kinematics(case, by_input, others)
    if last_stage >= FORCE:
        of_drive = {"power", *case.drive.names}
        values |= {name: np.zeros(codes.shape) for name in of_drive & wanted}
    return Evaluated(codes, values, state)


def _find_codes_of_loop(path: LoopPath, state: State, command: Command) -> Any:
    """Find the status of each position from the sine of the transmission angle."""
    half = state.position.half
    sine = state.sine
    margin = command.margin
    is_determined = command.condition > margin
    size = abs(sine)
    if type(size) is float and size > margin and is_determined:
        return OK
    size = np.minimum(size, command.condition)
    codes = np.zeros(np.shape(sine), dtype=np.uint8)
    codes[size <= margin] = SINGULAR
    codes[(abs(sine) <= margin) & path.passes_zero(half) & is_determined] = CHANGE_POINT
    codes[np.isnan(sine)] = NOT_ASSEMBLED
    # theta_2 - theta_1 overflows, so the loop cannot be evaluated
    codes[np.isnan(half.kk)] = OVERFLOW
    return codes


def _list_forces(
    case: Case, state: State, dynamics: Dynamics, wanted: Set[str]
) -> tuple[dict[str, Any], Any]:
    """List the quantities of the force stage.

    The second result has the status `JAMMED` where friction jams a motion that would
    begin; None: nowhere.
    """
    names = case.drive.names
    values = {**dynamics.pins._asdict(), names.value: dynamics.effort}
    jammed = None
    if "power" in wanted:
        values["power"] = dynamics.effort * case.drive_speed(state)
    if "drive_condition" in wanted:
        values["drive_condition"] = case.drive_condition(state) * dynamics.from_jamming
    if "friction_residual" in wanted:
        values["friction_residual"] = dynamics.residual
    if names.low in wanted or names.high in wanted:
        values[names.low], values[names.high], jammed = case.drive_interval(
            state, dynamics.effort
        )
    return values, jammed


def _list_error_bars(
    case: Case,
    command: Command,
    state: State,
    dynamics: Dynamics,
    refined_rows: Indices,
) -> dict[str, Any]:
    """List the error bars of the drive (N m or N) and of the pin forces (N), (n,).

    The error bar of the pin forces is the worst of the four.

    Parameters
    ----------
    state, dynamics : evaluation in doubles, to which the error bars belong.
    refined_rows : indices of the positions whose half angle is evaluated in many
        digits.
    """
    longer = case.lengthened()
    lost = command.lost
    remainder = command.remainder
    doubles = (state.q, state.speed, command.acceleration)
    q, speed, acceleration = (
        lengthen(number) + lost[..., column] for column, number in enumerate(doubles)
    )
    half = longer.path.half_angle(q)
    if refined_rows.size:
        from fourbar.formulas.many_digits import decide_half_angles

        half = decide_half_angles(
            case.linkage,
            case.path,
            half,
            refined_rows,
            state.q,
            remainder,
            lost[..., 0] if remainder is None else 0.0,
        )
    motion = command._replace(angle=q, speed=speed, acceleration=acceleration)
    near = longer.assemble(motion, half)
    gaps = _compute_gaps(dynamics, longer.dynamics(near))
    if longer_numbers.HAS_LONG_DOUBLES and remainder is None:
        gaps = np.fmax(gaps, _compute_unresolved(case, command, state, dynamics))
    sizes = (reduce(np.maximum, map(np.abs, dynamics.pins)), np.abs(dynamics.effort))
    bars = []
    for gap, size in zip(gaps, sizes, strict=True):
        # the value itself was rounded by as much
        width = np.maximum(gap, U * size)
        # where the longer number is not finite as a double no digit is left
        bars.append(select(np.isfinite(width), width, size))
    return {"force_error": bars[0], case.drive.names.error: bars[1]}


def _compute_gaps(one: Dynamics, other: Dynamics) -> Any:
    """Compute the differences of two results: the largest of the pin forces, the drive.

    The units are N, and N m or N.
    """
    pairs = zip((*one.pins, one.effort), (*other.pins, other.effort), strict=True)
    *gaps, of_drive = (np.abs(shorten(after - before)) for before, after in pairs)
    return np.array(np.broadcast_arrays(reduce(np.maximum, gaps), of_drive))


def _compute_unresolved(
    case: Case,
    command: Command,
    state: State,
    dynamics: Dynamics,
) -> Any:
    """Return the part of pin forces and drive that long doubles do not resolve.

    The units are N, and N m or N.

    Near a limit, or beside a spring's free length, their own rounding shows in a
    double's digits. Where a double is as far off by coincidence, its distance to the
    long double is no bound. What rounding does follows from the slope:
        dF = (dF/dq) max(|q|, 1) _LONG_EPS ROUNDINGS_IN_FULL,
    where q less a ground angle of 0 is exact, so that |q| counts up to two turns alone;
    dF/dq by a step that is short against the distance to the limit, which is some s^2
    (s the sine of the command). NaN where no double lies a step away. Beyond ten
    million turns, where none may do so anywhere, doubles decide the step.
    """
    size = np.fmax(np.abs(state.q), 1.0)
    least = (size > _FAR) * 2.0 * _LEAST_STEP * size
    step = np.fmax(SLOPE_STEP * (state.sine * state.sine), least)
    moved = state.q + step
    step = moved - state.q
    shifted = case.assemble(
        command._replace(angle=moved),
        case.path.half_angle(moved),
    )
    try:
        there = case.dynamics(shifted)
    except InputError:  # a load's table ends here
        return np.nan
    most = np.where(is_zero(case.linkage.ground_angle), 2.0 * TURN, np.inf)
    rounding = ROUNDINGS_IN_FULL * _LONG_EPS * np.fmin(size, most)
    share = rounding / np.where(step >= _LEAST_STEP * size, step, np.nan)
    return _compute_gaps(dynamics, there) * share


def withhold_infinite(case: Case, evaluated: Evaluated) -> None:
    """Set the status of each position at which a promised quantity is not finite.

    From that stage on the quantities become NaN.
    """
    code, values, state = evaluated
    # where the sum of squares overflows, each number is looked at
    suspects = [
        name
        for name, value in values.items()
        if not cmath.isfinite(np.vdot(value, value))
    ]
    if not suspects:
        return
    has_motion = (code != NOT_ASSEMBLED) & (code != SINGULAR)
    has_forces = (code == OK) | (code == SEVERAL)
    # number of the first stage that fails, at each position
    first = np.full(code.shape, len(STAGES))
    for name in suspects:
        infinite = ~np.isfinite(values[name])
        _blank(values, [name], infinite)
        stage = find_quantity(name).stage_number
        fails = infinite & (has_forces if stage >= FORCE else has_motion)
        first[fails] = np.minimum(first[fails], stage)
    gone = first < len(STAGES)
    code[gone] = OVERFLOW
    if isinstance(case.drive, Couple):
        # where the two bars that are not driven are in line, no finite forces hold
        # them in balance
        sine, _ = case.drive.leverage(state, case.path)
        in_line = np.abs(sine) <= NO_DIGIT_LEFT
        code[gone & (first >= FORCE) & in_line] = NO_TORQUE
    for name in values.keys() - {"drive_condition"}:
        _blank(values, [name], first <= find_quantity(name).stage_number)


SCALAR_FORMULAS: dict[str, Callable[[State], Any]] = {
    "theta_2": lambda state: state.theta_2,
    "theta_3": lambda state: state.q if state.bar == 3 else angle(state.position.u3),
    "theta_4": lambda state: state.q if state.bar == 4 else angle(state.position.u4),
    "sin_mu": lambda state: state.position.sin_mu,
    "condition": lambda state: abs(state.sine),
    **{name: attrgetter(f"moving.{name}") for name in RATES},
}
"""Formulas of the scalars that come before the forces, by name."""


def list_kinematics(case: Case, state: State, wanted: Set[str]) -> dict[str, Any]:
    """List the named quantities before the forces."""
    values = {
        name: formula(state)
        for name, formula in SCALAR_FORMULAS.items()
        if name in wanted
    }
    if not (isinstance(case.drive, Couple) or wanted.isdisjoint(LINE_QUANTITIES)):
        stroke, direction = case.drive.line(state)
        if "drive_line" in wanted:
            values["drive_line"] = direction
        if "stroke_speed" in wanted:
            values["stroke_speed"] = case.drive_speed(state)
        if "stroke" in wanted and case.drive.has_stroke:
            values["stroke"] = stroke
    frames: dict[int, Frame] = {}
    for name, bar, z in case.points:
        velocity = f"v_{name}"
        acceleration = f"a_{name}"
        if wanted.isdisjoint((name, velocity, acceleration)):
            continue
        if bar not in frames:
            frames[bar] = state.frame(bar)
        frame = frames[bar]
        r = z * frame.u
        if name in wanted:
            values[name] = frame.pin + r
        if velocity in wanted:
            values[velocity] = frame.velocity(r)
        if acceleration in wanted:
            values[acceleration] = frame.acceleration(r)
    return values
