"""Positions of a case evaluated stage by stage: kinematics, forces, error bars, and what has no value.

The error bar of a force is its distance to the value that the same formulas give in longer numbers. The stated numbers
of bars, loads, effects and command are taken as exact; everything else is computed again, in numbers that round at
most a thousandth as much as doubles.
"""

import cmath
from collections.abc import Callable, KeysView, Mapping
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import NO_POSITIONS, Case, Dynamics, Evaluated
from fourbar.formulas.arithmetic import U, angle, is_any, select
from fourbar.formulas.longer import lengthen, shorten
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.formulas.position import HalfAngle
from fourbar.quantities import (
    ANGLES,
    JAMMED,
    LINE_QUANTITIES,
    NO_DIRECTION,
    NO_LEVER,
    NO_TORQUE,
    NOT_ASSEMBLED,
    OK,
    OVERFLOW,
    SEVERAL,
    SINGULAR,
    STAGE_OF,
    STAGES,
    WOUND,
)
from fourbar.scene import Command
from fourbar.scene.numbers import POINT_STAGES

FORCE, ERROR = STAGES.index("force"), STAGES.index("error")
WITHOUT_FORCES = (NO_DIRECTION, WOUND, NO_LEVER)
"""Statuses of positions at which an effect or the drive has no value, and so the forces have none."""


def evaluate(
    case: Case, command: Command, last_stage: int, names: KeysView[str]
) -> Evaluated:
    """Evaluate the named quantities at the positions of a command, up to the last stage that they need.

    `command`: positions (n,), or one in plain numbers. In a released motion the independent angle fixes the position,
    and the drive exerts nothing.
    """
    free, branch = command.independent, find_sign(command.branch)
    q: Any = command.angle
    speed, acceleration = command.speed, command.acceleration
    if free is not None:
        q, speed, acceleration, branch = (
            free.angle,
            free.speed,
            free.acceleration,
            free.sign,
        )
    elif q.ndim == 0:
        q = q.item()  # with Python's own numbers a formula takes half the time
    speed = 0.0 if speed is None else speed
    if free is None:
        half, refined_rows = case.half_angle(q, command.remainder)
    else:
        half, refined_rows = case.path.half_angle(q), NO_POSITIONS
    of_angles = (
        command.bar == 2 and len(names) <= len(ANGLES) and set(names) <= set(ANGLES)
    )
    if (
        of_angles
        and free is None
        and command.remainder is None
        and not case.path.may_stay_parallel
    ):
        return _evaluate_angles(case, half, branch, names)
    position = case.path.position(q, half, branch)
    codes = (
        _compute_codes(position.sin_mu, half, command)
        if free is None
        else np.zeros(q.shape, dtype=np.uint8)
    )
    if is_any(codes):  # velocities are 0/0
        position = position._replace(
            root=np.where(codes == SINGULAR, np.nan, position.root)
        )
    state = case.state(q, position, branch, speed, acceleration, moving=last_stage > 0)
    if free is not None:
        state = state._replace(theta_2=command.angle)
    values = list_kinematics(
        case, state if free is None else state._replace(bar=2), names
    )
    if command.condition is not None and "condition" in names:
        values["condition"] = values["condition"] * command.condition
    if last_stage >= FORCE:
        acting = case if free is None else case._replace(drive=None)
        dynamics = acting.dynamics(state, acceleration, case.side)
        counted = command.branch if free is None else None
        error_bars = {}
        if last_stage == ERROR:
            error_bars = compute_error_bars(
                acting, command, state, acceleration, branch, dynamics, refined_rows
            )
        codes, forces = _list_forces(
            acting, state, acceleration, counted, codes, names, dynamics, error_bars
        )
        if free is not None:
            forces |= {name: np.zeros(codes.shape) for name in (*case.names, "power")}
        values |= {name: value for name, value in forces.items() if name in names}
    return codes, values, state.position


def _compute_codes(
    sine: Any, half: HalfAngle, command: Command | None, unit: float = 1.0
) -> Any:
    """Compute the status of each position from the sine of the transmission angle, times `unit`."""
    size, margin = abs(sine), NO_DIGIT_LEFT * unit
    if command is not None and command.remainder is not None:
        margin = 0.0  # known in many digits
    elif command is not None and command.condition is not None:
        size = np.where(np.isnan(size), size, np.minimum(size, command.condition))
    if type(size) is float and size > margin:
        return OK
    codes = np.zeros(np.shape(sine), dtype=np.uint8)
    if not np.min(size, initial=np.inf) > margin:  # NaN where the loop does not close
        codes[size <= margin] = SINGULAR
        codes[np.isnan(sine)] = NOT_ASSEMBLED
        codes[np.isnan(half.kk)] = (
            OVERFLOW  # theta_2 - theta_1 overflows, so the loop cannot be evaluated
        )
    return codes


def find_sign(branch: NDArray[np.int8]) -> Any:
    """Return the branch of each position, or one number where all have the same."""
    if branch.ndim == 0 or (branch.size and branch.min() == branch.max()):
        return float(branch.flat[0]) if branch.ndim else float(branch)
    return branch


def _evaluate_angles(
    case: Case, half: HalfAngle, branch: Any, names: KeysView[str]
) -> Evaluated:
    """Evaluate theta_3 and theta_4 alone, without the vectors of the bars."""
    theta_3, theta_4, root = case.path.angles(half, branch)
    codes = _compute_codes(
        root, half, None, 2.0 * case.path.lengths.b * case.path.lengths.c
    )
    angles = {"theta_3": theta_3, "theta_4": theta_4}
    return codes, {name: angles[name] for name in names}, None


def _list_forces(
    case: Case,
    state: State,
    acceleration: Any,
    branch: NDArray[np.int8] | None,
    codes: Any,
    names: KeysView[str],
    dynamics: Dynamics,
    error_bars: dict[str, Any],
) -> tuple[Any, dict[str, Any]]:
    """List the quantities of the force stage, error bars included, and the statuses with those of the effects.

    `branch`: the branch of each position, by which effects count turns; None for a released motion.
    """
    drive_names = case.names
    values: dict[str, Any] = {
        **dynamics.pins._asdict(),
        drive_names.value: dynamics.drive,
        **error_bars,
    }
    if "power" in names:
        values["power"] = dynamics.drive * case.drive_speed(state)
    if "drive_condition" in names:
        condition = case.drive_condition(state)
        values["drive_condition"] = (
            condition
            if dynamics.from_jamming is None
            else condition * dynamics.from_jamming
        )
    if "friction_residual" in names:
        values["friction_residual"] = (
            0.0 if dynamics.residual is None else dynamics.residual
        )
    if drive_names.low in names or drive_names.high in names:
        *ends, held = case.drive_interval(state, acceleration, dynamics.drive)
        values |= zip(drive_names[2:], ends, strict=True)
        if held is not None and dynamics.status is not None:
            dynamics = dynamics._replace(
                status=np.where(held & (dynamics.status == OK), JAMMED, dynamics.status)
            )
    without: list[Any] = [
        status
        for term in case.terms
        if (status := term.status(state, branch)) is not None
    ]
    if dynamics.status is not None:
        without.append(dynamics.status)
    if (
        case.drive is not None
        and (status := case.drive.status(state, case.sines(state.position))) is not None
    ):
        without.append(status)
    if without:
        codes = np.where(codes == OK, np.max(without, axis=0), codes).astype(np.uint8)
    if is_any(codes > SINGULAR):
        gone = np.isin(codes, WITHOUT_FORCES)
        values |= {
            name: np.where(gone, make_no_value(value), value)
            for name, value in values.items()
            if name != "drive_condition"
        }
    return codes, values


def compute_error_bars(
    case: Case,
    command: Command,
    state: State,
    acceleration: Any,
    sign: Any,
    dynamics: Dynamics,
    refined_rows: NDArray[np.intp],
) -> dict[str, Any]:
    """Compute the error bars of the drive (N m or N) and of the pin forces (N, the worst of the four), by name, (n,).

    Parameters
    ----------
    state, acceleration, dynamics : evaluation in doubles, to which the error bars belong.
    sign : branch, the sign of the root.
    refined_rows : indices of the positions whose half angle is evaluated in many digits.
    """
    longer, driven_angle = (
        case.lengthened(),
        state.theta_2 if state.q is None else state.q,
    )
    lost, remainder = command.lost, command.remainder
    if lost is None:
        lost = np.array([0.0 if remainder is None else float(remainder), 0.0, 0.0])
    numbers = enumerate((driven_angle, state.speed, acceleration))
    q, speed, longer_acceleration = (
        lengthen(number) + lost[..., place] for place, number in numbers
    )
    half = longer.path.half_angle(q)
    if refined_rows.size:
        from fourbar.formulas.many_digits import decide_half_angles

        left_out = 0.0 if remainder is not None else lost[..., 0]
        half = decide_half_angles(
            case.linkage,
            case.path.unit,
            half,
            refined_rows,
            driven_angle,
            remainder,
            case.path.bar,
            left_out,
        )
    near = longer.assemble(q, half, sign, speed, longer_acceleration)
    longer_dynamics = longer.dynamics(near, longer_acceleration, case.side)
    pairs = zip(
        (*dynamics.pins, dynamics.drive),
        (*longer_dynamics.pins, longer_dynamics.drive),
        strict=True,
    )
    *gaps, drive_gap = (np.abs(shorten(after - before)) for before, after in pairs)
    drive_error = compute_error_bar(drive_gap, np.abs(dynamics.drive))
    force_error = compute_error_bar(
        reduce(np.maximum, gaps), reduce(np.maximum, map(np.abs, dynamics.pins))
    )
    return {case.names.error: drive_error, "force_error": force_error}


def compute_error_bar(gap: Any, size: Any) -> Any:
    """Compute the error bar from the distance to the longer number and the size of the value.

    The error bar is the size of the value, so that no digit is left, where the longer number is not finite as a double.
    """
    width = np.maximum(gap, U * size)  # the value itself was rounded by as much
    return select(np.isfinite(width), width, size)


def is_finite(values: Mapping[str, Any]) -> bool:
    """Return True if the sum of the squares of each quantity is finite: False too where a square overflows."""
    squares = (
        np.vdot(value, value) if isinstance(value, np.ndarray) else value
        for value in values.values()
    )
    return all(cmath.isfinite(square) for square in squares)


def withhold_infinite(case: Case, evaluated: Evaluated) -> None:
    """Apply `withhold` to evaluated positions if any of their values is not finite."""
    codes, values, driven = evaluated
    if not is_finite(values):
        in_line: Any = False
        if driven is not None and case.drive is None:
            in_line = (
                np.abs(case.path.drive_sine(driven, case.drive_bar)) <= NO_DIGIT_LEFT
            )
        withhold(values, codes, np.broadcast_to(in_line, codes.shape))


def withhold(
    values: dict[str, Any], code: NDArray[np.uint8], in_line: NDArray[np.bool_]
) -> None:
    """Set the status of each position at which a promised quantity is not finite, and NaN from that stage on.

    `code`: status of each position, changed in place. `in_line`: True where the two bars that are not driven are in
    line, so that no finite forces hold them in balance.
    """
    gone = np.zeros(code.shape, dtype=bool)
    for stage in STAGES:
        names = [
            name
            for name in values
            if STAGE_OF.get(name, POINT_STAGES.get(name[:2], "position")) == stage
        ]
        of_forces = stage in STAGES[3:]
        promised = (
            np.isin(code, (OK, SEVERAL))
            if of_forces
            else ~np.isin(code, (NOT_ASSEMBLED, SINGULAR))
        )
        infinite = np.zeros_like(gone)
        for name in names:
            infinite |= ~np.isfinite(values[name])
            values[name] = np.where(
                np.isfinite(values[name]), values[name], make_no_value(values[name])
            )
        infinite &= promised & ~gone
        code[infinite] = OVERFLOW
        if of_forces:
            code[infinite & in_line] = NO_TORQUE
        gone |= infinite
        for name in names:
            if name != "drive_condition":
                values[name] = np.where(gone, make_no_value(values[name]), values[name])


def make_no_value(quantity: Any) -> complex:
    """Return NaN; of a vector in both components."""
    return complex(np.nan, np.nan) if np.iscomplexobj(quantity) else np.nan


SCALAR_FORMULAS: dict[str, Callable[[State], Any]] = {
    "theta_2": lambda state: state.theta_2,
    "theta_3": lambda state: state.q if state.bar == 3 else angle(state.position.u3),
    "theta_4": lambda state: state.q if state.bar == 4 else angle(state.position.u4),
    "sin_mu": lambda state: state.position.sin_mu,
    "condition": lambda state: abs(
        state.position.sin_mu if state.bar == 2 else state.sine
    ),
    "omega_2": lambda state: state.moving.omega_2,
    "omega_3": lambda state: state.moving.omega_3,
    "omega_4": lambda state: state.moving.omega_4,
    "alpha_2": lambda state: state.moving.alpha_2,
    "alpha_3": lambda state: state.moving.alpha_3,
    "alpha_4": lambda state: state.moving.alpha_4,
}
"""Formulas of the scalars that come before the forces, by name."""
PLACES = frozenset(
    start + name for start in POINT_STAGES for name in ("A", "B", "G2", "G3", "G4")
)
"""Names of the vectors that come before the forces, at the pins and mass centres of the linkage."""


def list_kinematics(case: Case, state: State, names: KeysView[str]) -> dict[str, Any]:
    """List the named quantities that come before the forces, those of the scene's own points included."""
    values = {
        name: formula(state)
        for name, formula in SCALAR_FORMULAS.items()
        if name in names
    }
    if case.drive is not None and not names.isdisjoint(LINE_QUANTITIES):
        stroke, unit = case.drive.line(state)
        of_line = {
            "stroke": stroke,
            "drive_line": unit,
            "stroke_speed": case.drive_speed(state),
        }
        values |= {name: value for name, value in of_line.items() if name in names}
    if not case.points and names.isdisjoint(PLACES):
        return values
    lengths, (two, three, four) = case.lengths, case.bodies
    places: dict[int, list[tuple[str, Any]]] = {
        2: [("A", lengths.a), ("G2", two.z)],
        3: [("G3", three.z)],
        4: [("B", lengths.c), ("G4", four.z)],
    }
    for name, bar, z in case.points:
        places.setdefault(bar, []).append((name, z))
    for bar, of_bar in places.items():
        frame = state.frame(bar)
        for name, z in of_bar:
            r = z * frame.u
            if name in names:
                values[name] = frame.pin + r
            if (velocity := f"v_{name}") in names:
                values[velocity] = frame.velocity(r)
            if (acceleration := f"a_{name}") in names:
                values[acceleration] = frame.acceleration(r)
    return values
