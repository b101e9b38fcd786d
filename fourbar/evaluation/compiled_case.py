"""A case through the compiled loop: its numbers in rows, and the quantities from what the loop writes."""

import threading
from collections.abc import KeysView
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Flywheel, Gravity, Load, Viscous
from fourbar.evaluation.case import BLOCK, NO_MOTION, Case, Evaluated, change_numbers
from fourbar.evaluation.compiled import ROWS, compile_loop, run, scatter
from fourbar.evaluation.error_bars import draw_signs
from fourbar.evaluation.stages import ERROR, Part, evaluate_command, find_sign, list_kinematics, take_piece
from fourbar.evaluation.withheld import is_finite, withhold_in_place
from fourbar.formulas.arithmetic import cross, is_any, polar, split_sum
from fourbar.formulas.motion import Rates, State
from fourbar.formulas.position import HalfAngle, Position
from fourbar.linkage import MOVING_BARS, PINS
from fourbar.quantities import PIN_FORCES, UNKNOWNS
from fourbar.scene import Command
from fourbar.solution import Array

NO_HALF_ANGLE = HalfAngle(*[np.nan] * 5)
"""Of positions whose motion and forces are known."""
CARRIED = (Load, Gravity, Viscous, Flywheel)
"""Effects that the loop knows; a flywheel is in the inertia of its bar."""


class Loads(NamedTuple):
    """Everything that pushes on one bar, summed: at its mass centre, and as couples."""

    world: Any = 0j
    """Forces with constant directions, N."""
    turning: Any = 0j
    """Forces that turn with the bar, in its frame, N."""
    couple: Any = 0.0
    """Couples, and moments of both kinds of forces about the mass centre, N m."""
    of_world: Any = 0.0
    """Sums of the sizes of the terms, for the error bars."""
    of_turning: Any = 0.0
    of_couple: Any = 0.0

    def with_force(self, force: Any, at: Any, turns: bool, factor: Any = 1.0, size: Any = 1.0) -> "Loads":
        """One force more, times a factor, with its arm from the mass centre, both complex and in the same frame.

        `size`: of the terms of the factor.
        """
        force, size = factor * force, size * np.abs(force)
        moment = cross(at, force)
        more = self._replace(
            couple=self.couple + moment, of_couple=self.of_couple + size * (np.abs(at.real) + np.abs(at.imag))
        )
        if turns:
            return more._replace(turning=more.turning + force, of_turning=more.of_turning + size)
        return more._replace(world=more.world + force, of_world=more.of_world + size)


def can_carry(case: Case) -> bool:
    """Whether the loop can evaluate a case."""
    plain = case.path.bar == 2 and case.drive is None and not case.path.may_stay_parallel
    return plain and all(type(term) in CARRIED for term in case.terms)


def pack_numbers(case: Case, theta_2: Array, branch: Any, omega_2: Any, alpha_2: Any) -> Any:
    """Pack what `run` reads of a case and the motion of some positions: (ROWS,) numbers, or an array (ROWS BLOCK,).

    Lengths in their unit with E1 and E2; lengths, m; u1; omega_2, alpha_2, branch, what theta_2 - theta_1 loses;
    bodies; viscous pins; loads.
    """
    of_bodies = [number for body in case.bodies for number in (body.m, body.I, body.z.real, body.z.imag)]
    of_pins: dict[str, Any] = dict.fromkeys(PINS, 0.0)
    loads = dict.fromkeys(MOVING_BARS, Loads())
    for term in case.terms:
        if isinstance(term, Viscous):
            of_pins |= dict(term.coefficients)
        elif isinstance(term, Gravity):
            for bar, body in zip(MOVING_BARS, case.bodies, strict=True):
                loads[bar] = loads[bar].with_force(body.m * term.field, 0j, False)
        elif isinstance(term, Load):
            before, gained = (1.0, 0.0) if term.table is None else term.table.from_point(theta_2)
            factor, size = before + gained, np.abs(before) + np.abs(gained)
            if term.force is not None:
                force, at = polar(*term.force), polar(*term.at)
                loads[term.bar] = loads[term.bar].with_force(force, at, term.frame == "bar", factor, size)
            own, moment = loads[term.bar], term.moment
            own = own._replace(couple=own.couple + factor * moment, of_couple=own.of_couple + size * np.abs(moment))
            loads[term.bar] = own
    of_loads = [
        number
        for load in loads.values()
        for number in (load.world.real, load.world.imag, load.turning.real, load.turning.imag, *load[2:])
    ]
    theta_1 = case.path.theta_1
    u1 = polar(1.0, theta_1)
    lost = split_sum(theta_2, -theta_1)[1] if is_any(theta_1 != 0.0) else 0.0
    found = [*case.path.lengths, *case.lengths[:4], u1.real, u1.imag, omega_2, alpha_2, branch, lost]
    found += [*of_bodies, *of_pins.values(), *of_loads]
    if not any(isinstance(number, np.ndarray) and number.size > 1 for number in found):
        return tuple(float(np.ravel(number)[0]) for number in found)
    rows = np.empty((ROWS, BLOCK))
    for row, number in zip(rows, found, strict=True):
        row[: np.size(theta_2)] = number
    return rows.ravel()


SPACE = threading.local()
"""Of each thread, what the loop writes of a block: fresh pages for each would cost a tenth of the time."""


class LoopResult(NamedTuple):
    """What the loop writes, for n positions; the next call of the same thread writes over it."""

    vectors: NDArray[np.complex128]
    scalars: Array


def run_loop(case: Case, theta_2: Array, branch: Any, omega_2: Any, alpha_2: Any, *, error_bars: bool) -> LoopResult:
    """Up to BLOCK positions of a case that the loop carries; for the parameters see `run`."""
    n, theta_1 = len(theta_2), case.path.theta_1
    of_theta_2 = np.tan(0.5 * theta_2) if is_any(theta_1 != 0.0) else np.empty(0)
    rows = pack_numbers(case, theta_2, branch, omega_2, alpha_2)
    if not hasattr(SPACE, "found"):
        SPACE.found = LoopResult(np.empty((7, BLOCK), dtype=complex), np.empty((15, BLOCK)))
    vectors, scalars = SPACE.found
    given = np.tan(0.5 * (theta_2 - theta_1)), of_theta_2, rows, case.drive_bar, vectors.ravel(), scalars.ravel()
    _call_loop(run, *given)
    if error_bars:
        _call_loop(scatter, *given, draw_signs())
    return LoopResult(vectors[:, :n], scalars[:, :n])


def _call_loop(function: Any, *given: Any) -> None:
    try:
        compile_loop(function)(*given)
    except OSError:  # the disk is full
        compile_loop(function, False)(*given)


def evaluate_compiled(case: Case, where: Command, part: Part, wanted: int, names: KeysView[str]) -> Evaluated:
    """Evaluate some positions of a command by the compiled loop, and through `evaluate_command` what it leaves open."""
    theta_2, branch = where.theta_2[part], find_sign(where.branch[part])
    omega_2, alpha_2 = take_piece(where.omega_2, part), take_piece(where.alpha_2, part)
    found = run_loop(case, theta_2, branch, omega_2, alpha_2, error_bars=wanted == ERROR)
    u2, u3, u4, *pins = found.vectors
    sin_mu, omega_3, omega_4, alpha_3, alpha_4, torque, sine, left, *errors = found.scalars[:10]
    at = Position(polar(1.0, case.path.theta_1), u2, u3, u4, sin_mu, np.nan, np.nan, np.nan, NO_HALF_ANGLE)
    moving = Rates(omega_2, omega_3, omega_4, alpha_2, alpha_3, alpha_4)
    state = State(case.lengths, case.path.theta_1, theta_2, at, NO_MOTION, omega_2, moving)
    values = list_kinematics(case, state, names)
    others = dict(zip((*PIN_FORCES, "torque", "torque_error", "force_error"), (*pins, torque, *errors), strict=True))
    others["drive_condition"] = np.abs(sine)
    others["power"] = torque * moving[case.drive_bar - 2]
    values |= {name: value for name, value in others.items() if name in names}
    codes = np.zeros(theta_2.shape, dtype=np.uint8)
    if left.any():
        index = np.flatnonzero(left)

        def own(number: Any) -> Any:
            return number[index] if np.ndim(number) else number

        alone = change_numbers(case, own)
        where = Command(theta_2[index], own(where.branch[part]), own(omega_2), own(alpha_2))
        rest = evaluate_command(alone, where, (...,), wanted, names)
        withhold_in_place(alone, rest)
        codes[index] = rest[0]
        for name, value in rest[1].items():
            whole = np.array(np.broadcast_to(values[name], theta_2.shape))
            whole[index] = value
            values[name] = whole
    elif is_finite({name: value for name, value in values.items() if name not in UNKNOWNS}):  # the loop saw to these
        return codes, values, None
    withhold_in_place(case, (codes, values, None))
    return codes, values, None
