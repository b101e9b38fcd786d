"""Positions of a case evaluated stage by stage, of a command or along a free motion."""

from collections.abc import Callable, Iterable, KeysView
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import NOWHERE, Case, Evaluated
from fourbar.evaluation.withheld import make_no_value
from fourbar.formulas.arithmetic import angle, is_any
from fourbar.formulas.motion import State
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.formulas.position import HalfAngle, Position
from fourbar.quantities import (
    ANGLES,
    JAMMED,
    NO_DIRECTION,
    NO_LEVER,
    NOT_ASSEMBLED,
    OF_LINE,
    OK,
    OVERFLOW,
    SINGULAR,
    STAGES,
    WOUND,
)
from fourbar.scene import Command
from fourbar.scene.point import OF_POINTS
from fourbar.solution import Array

if TYPE_CHECKING:
    from fourbar.evaluation.free_motion import FreeMotion


FORCE, ERROR = STAGES.index("force"), STAGES.index("error")
Part = tuple[Any, ...]
"""Index of some positions in the arrays of all."""
WITHOUT_FORCES = (NO_DIRECTION, WOUND, NO_LEVER)
"""Statuses of positions at which an effect or the drive has no value, and so the forces have none."""


def evaluate_command(case: Case, where: Command, part: Part, wanted: int, names: KeysView[str]) -> Evaluated:
    """Evaluate some positions of a command.

    `wanted`: number of the last stage that the quantities named need.
    """
    q: Any = where.angle[part]
    if q.ndim == 0:
        q = q.item()  # with Python's own numbers a formula takes half the time
    branch = find_sign(where.branch[part])
    half, exact = case.half_angle(q, where.remainder)
    of_angles = where.bar == 2 and len(names) <= len(ANGLES) and set(names) <= set(ANGLES)
    if of_angles and where.remainder is None and not case.path.may_stay_parallel:
        return _evaluate_angles(case, half, branch, names)
    at = case.path.position(q, half, branch)
    codes = _compute_codes(at.sin_mu, half, NO_DIGIT_LEFT if where.remainder is None else 0.0)
    if where.lever is not None:
        codes = np.where(codes == OK, np.where(where.lever[part] <= NO_DIGIT_LEFT, SINGULAR, OK), codes)
    if is_any(codes):  # velocities are 0/0
        at = at._replace(root=np.where(codes == SINGULAR, np.nan, at.root))
    speed, acceleration = take_piece(where.speed, part), take_piece(where.acceleration, part)
    state = case.state(case.path, q, at, branch, speed, acceleration, moving=wanted > 0)
    values = list_kinematics(case, state, names)
    if where.bar != 2:
        values |= {name: value for name, value in name_of_command(case, at, state, q).items() if name in names}
    for name, own in (("stroke", where.stroke), ("stroke_speed", where.stroke_speed)):
        if own is not None and name in values:  # as commanded, wherever the other numbers have a value
            values[name] = take_piece(own, part) + 0.0 * values[name]
    if where.lever is not None and "condition" in values:
        values["condition"] = values["condition"] * where.lever[part]
    if wanted >= FORCE:
        known = (exact, where.remainder, None if where.lost is None else where.lost[part]) if wanted == ERROR else None
        codes, forces = _evaluate_forces(case, state, acceleration, branch, branch, codes, names, known)
        values |= forces
    return codes, values, state.at


def name_of_command(case: Case, at: Position, state: State, q: Any) -> dict[str, Any]:
    """Quantities that a command of bar 3 or 4 has in the place of others: its angle as commanded, theta_2, its sine.

    `at`: in the order in which the path reads the loop.
    """
    if case.path.bar == 2:
        return {}
    return {f"theta_{case.path.bar}": q, "theta_2": state.theta_2, "condition": abs(at.sin_mu)}


def _compute_codes(sine: Any, half: HalfAngle, margin: float) -> Any:
    """Statuses of positions from the sine of the transmission angle, or a multiple of it."""
    size = abs(sine)
    if type(size) is float and size > margin:
        return OK
    codes = np.zeros(np.shape(sine), dtype=np.uint8)
    if not np.min(size, initial=np.inf) > margin:  # NaN where the loop does not close
        codes[size <= margin] = SINGULAR
        codes[np.isnan(sine)] = NOT_ASSEMBLED
        codes[np.isnan(half.kk)] = OVERFLOW  # of theta_2 - theta_1: not even where it closes is known
    return codes


def find_sign(branch: NDArray[np.int8]) -> Any:
    """Return the branch of each position, or one number where all have the same."""
    if branch.ndim == 0 or (branch.size and branch.min() == branch.max()):
        return float(branch.flat[0]) if branch.ndim else float(branch)
    return branch


def _evaluate_angles(case: Case, half: HalfAngle, branch: Any, names: Iterable[str]) -> Evaluated:
    """Evaluate the two angles only: without vectors and the rest of the triangle."""
    theta_3, theta_4, root = case.path.angles(half, branch)
    codes = _compute_codes(root, half, NO_DIGIT_LEFT * 2.0 * case.path.lengths.b * case.path.lengths.c)
    found = {"theta_3": theta_3, "theta_4": theta_4}
    return codes, {name: found[name] for name in names}, None


def evaluate_freely(case: Case, moved: "FreeMotion", part: Part, wanted: int, names: KeysView[str]) -> Evaluated:
    """Evaluate instants of a free motion that have one independent angle; the drive does nothing."""
    codes = np.zeros(len(part[0]), dtype=np.uint8)
    if not codes.size:
        return codes, {}, None
    bar = int(moved.bar[part][0])
    free = case._replace(drive_bar=bar, drive=None, path=moved.paths[bar], side=moved.side[part])
    q, speed, growth, branch = (x[part] for x in (moved.q, moved.speed, moved.acceleration, moved.sign))
    at = free.path.position(q, free.path.half_angle(q), branch)
    state = free.state(free.path, q, at, branch, speed, growth)._replace(theta_2=moved.command.angle[part])
    values = list_kinematics(case, state, names)
    if wanted >= FORCE:
        known = (NOWHERE, None, None) if wanted == ERROR else None
        codes, forces = _evaluate_forces(free, state, growth, None, branch, codes, names, known)
        values |= forces
        values |= {name: np.zeros(codes.shape) for name in (*case.names, "power") if name in names}
    return codes, values, None


def _evaluate_forces(
    case: Case,
    state: State,
    acceleration: Any,
    branch: NDArray[np.int8] | None,
    sign: Any,
    codes: Any,
    names: KeysView[str],
    known: tuple[NDArray[np.intp], Any, Any] | None,
) -> tuple[Any, dict[str, Any]]:
    """Evaluate the force stage: the statuses with those of the effects, and its quantities.

    Parameters
    ----------
    branch : of each position; None where no effect counts turns by it.
    sign : of the path's root.
    known : indices of the positions known in many digits, and what the command leaves out as doubles; None: no error
        bars.
    """
    found, own = case.dynamics(state, acceleration, case.side), case.names
    values: dict[str, Any] = {**found.pins._asdict(), own.value: found.drive}
    if "power" in names:
        values["power"] = found.drive * case.drive_speed(state)
    if "drive_condition" in names:
        condition = case.drive_condition(state)
        values["drive_condition"] = condition if found.from_jamming is None else condition * found.from_jamming
    if "friction_residual" in names:
        values["friction_residual"] = 0.0 if found.residual is None else found.residual
    if own.low in names or own.high in names:
        *ends, held = case.drive_interval(state, acceleration, found.drive)
        values |= zip(own[2:], ends, strict=True)
        if held is not None and found.status is not None:
            found = found._replace(status=np.where(held & (found.status == OK), JAMMED, found.status))
    if known is not None:
        from fourbar.evaluation.error_bars import compute_error_bars

        values |= compute_error_bars(case, state, acceleration, sign, found, *known)
    without: list[Any] = [status for term in case.terms if (status := term.status(state, branch)) is not None]
    if found.status is not None:
        without.append(found.status)
    if case.drive is not None and (status := case.drive.status(state, case.sines(state.at))) is not None:
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
    return codes, {name: value for name, value in values.items() if name in names}


def take_piece(value: float | Array | None, part: Part) -> float | Array:
    """Return a number for all positions, or the part of an array that belongs to a block."""
    return value[part] if isinstance(value, np.ndarray) and value.ndim else value or 0.0


OF_BARS: dict[str, Callable[[State], Any]] = {
    "theta_3": lambda state: angle(state.at.u3),
    "theta_4": lambda state: angle(state.at.u4),
    "sin_mu": lambda state: state.at.sin_mu,
    "condition": lambda state: abs(state.at.sin_mu),
    "omega_2": lambda state: state.moving.omega_2,
    "omega_3": lambda state: state.moving.omega_3,
    "omega_4": lambda state: state.moving.omega_4,
    "alpha_2": lambda state: state.moving.alpha_2,
    "alpha_3": lambda state: state.moving.alpha_3,
    "alpha_4": lambda state: state.moving.alpha_4,
}
"""The scalars before the forces."""
PLACES = frozenset(start + name for start in OF_POINTS for name in ("A", "B", "G2", "G3", "G4"))
"""The vectors before the forces, of the linkage's own points."""


def list_kinematics(case: Case, state: State, wanted: KeysView[str]) -> dict[str, Any]:
    """Those of the quantities that come before the forces, a scene's own points among them."""
    values = {name: evaluate(state) for name, evaluate in OF_BARS.items() if name in wanted}
    if case.drive is not None and not wanted.isdisjoint(OF_LINE):
        stroke, unit = case.drive.line(state)
        own = {"stroke": stroke, "drive_line": unit, "stroke_speed": case.drive_speed(state)}
        values |= {name: value for name, value in own.items() if name in wanted}
    if not case.points and wanted.isdisjoint(PLACES):
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
            if name in wanted:
                values[name] = frame.pin + r
            if (velocity := f"v_{name}") in wanted:
                values[velocity] = frame.velocity(r)
            if (acceleration := f"a_{name}") in wanted:
                values[acceleration] = frame.acceleration(r)
    return values
