"""Equations that the formulas' own numbers must satisfy, summed over the whole linkage.

They use the printed results alone (forces, accelerations, torque) and none of the elimination
that produced them: closure, the sum of forces on the three bars, and the sum of moments about O2.
"""

import numpy as np

from fourbar.effects import Actions
from fourbar.effects.actions import bodies
from fourbar.formulas.pin_forces import Wrenches
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import OK, OVERFLOW
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solve import state_at
from validation.compare.answer import Answer
from validation.compare.compare import closure, turned
from validation.compare.reversals import reversing
from validation.compare.rows import AGREES, FAILS, UNDECIDED, Row
from validation.compare.scales import magnitude
from validation.compare.tolerance import IDENTITY, Array

FORMULAS = "formulas"
IDENTITIES = ("closure", "force_sum", "moment_sum")
"""Quantities of the rows made here: the formulas against themselves."""


def identities(name: str, scene: Scene, at: Command, solution: Solution) -> list[Row]:
    """One row per identity that the stage of the solution allows."""
    angles = {"theta_3": solution.theta_3, "theta_4": solution.theta_4}
    closing = solution.assembled & (solution.status_code != OVERFLOW)
    rows = [closure(name, scene, Answer(FORMULAS, "exact", at, closing, angles))]
    if solution.torque is not None and (solution.status_code == OK).any():
        rows += _sums(name, scene, at, solution)
    return rows


def _sums(name: str, scene: Scene, at: Command, solution: Solution) -> list[Row]:
    """F12 + F14 + sum of loads = sum of m a_G, and the moments of the same about O2 with the torque."""
    assert at.omega_2 is not None and solution.F12 is not None and solution.F14 is not None
    assert solution.torque is not None and solution.F32 is not None and solution.F43 is not None
    state = state_at(scene, at)
    # what acts at the speeds that were answered, not at another evaluation of them
    state = state._replace(moving=state.moving._replace(omega_3=solution.omega_3, omega_4=solution.omega_4))
    actions = Actions(state, bodies(scene.linkage, scene.effects))
    with np.errstate(all="ignore"):
        for term in (*scene.loads, *scene.effects):
            term.act(actions, state)
            if term.loaded_pins:
                term.act_known(actions, {name: getattr(solution, name) for name in PIN_FORCE.values()})
    acting = actions.wrenches(Wrenches())
    n, foot = len(solution), complex(np.ravel(state.foot(4))[0])
    O4 = np.array([foot.real, foot.imag])
    force = solution.F12 + solution.F14
    force_terms = magnitude(solution.F12) + magnitude(solution.F14)
    moment = solution.torque + _cross(O4, solution.F14)
    moment_terms = np.abs(solution.torque) + np.hypot(*O4) * magnitude(solution.F14)
    # the moments of the forces inside, which cancel
    moment_terms = moment_terms + _reach(solution.A) * magnitude(solution.F32)
    moment_terms = moment_terms + _reach(solution.B) * magnitude(solution.F43)
    first_pins = {2: np.zeros(2), 3: solution.A, 4: O4}
    for number in MOVING_BARS:
        bar = scene.linkage.bar(number)
        resultant = np.broadcast_to(acting[number - 2], n)
        load, couple = np.stack([resultant.real, resultant.imag], axis=1), acting[number + 1]
        centre, acceleration = getattr(solution, f"G{number}"), getattr(solution, f"a_G{number}")
        alpha = getattr(solution, f"alpha_{number}")
        force = force + load - bar.mass * acceleration
        force_terms = force_terms + magnitude(load) + bar.mass * magnitude(acceleration)
        if scene.drive_bar == 4 and number != 4:  # F32 and F43 are solved apart, from the moments of bars 2 and 3
            swung = np.abs(couple) + bar.mass * magnitude(centre - first_pins[number]) * magnitude(acceleration)
            sine = np.abs(np.sin(solution.theta_3 - solution.theta_2))
            with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 where nothing is judged: at a change point
                force_terms = force_terms + (swung + actions.bodies[number - 2].I * np.abs(alpha)) / (bar.length * sine)
        turned = couple + _cross(first_pins[number], load)
        swept = bar.mass * _cross(centre, acceleration) + actions.bodies[number - 2].I * alpha
        moment = moment + turned - swept
        moment_terms = (
            moment_terms
            + (np.abs(couple) + _reach(first_pins[number]) * magnitude(load))
            + bar.mass * _reach(centre) * magnitude(acceleration)
            + actions.bodies[number - 2].I * np.abs(alpha)
        )
    # the torque is that of virtual work, the forces are those of the free bodies: both err as the two conditions say
    assert solution.drive_condition is not None
    with np.errstate(divide="ignore", invalid="ignore"):
        moment_terms = moment_terms / (solution.condition**2 * solution.drive_condition)
    where = solution.status_code == OK
    # the sense of dry friction at a pin at rest is decided by rounding: not the same here as in the answer
    where &= ~reversing(scene, solution, IDENTITY.factor)
    return [
        _row(name, "force_sum", magnitude(force), force_terms, where, solution, "F12 + F14 + loads = sum of m a_G"),
        _row(name, "moment_sum", np.abs(moment), moment_terms, where, solution, "moments about O2, with the torque"),
    ]


def _row(
    name: str, quantity: str, error: Array, terms: Array, where: np.ndarray, solution: Solution, equation: str
) -> Row:
    relative = np.where(where, error / np.where(terms == 0.0, np.nextafter(0.0, 1.0), terms), 0.0)
    worst = int(np.argmax(np.where(np.isnan(relative), np.inf, relative)))
    condition = 1.0 / turned(solution.theta_2)
    allowed = IDENTITY.factor / condition
    holds = bool(relative[worst] <= allowed)
    return Row(
        scene=name,
        engine=FORMULAS,
        setting="exact",
        quantity=quantity,
        error=float(relative[worst]),
        allowed=allowed,
        verdict=(AGREES if holds else FAILS) if where.any() else UNDECIDED,
        reason=f"identity: {equation}" if where.any() else "no position at which it is demanded",
        theta_2=float(solution.theta_2[worst]),
        condition=condition,
    )


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _reach(point: Array) -> Array:
    return np.asarray(np.hypot(point[..., 0], point[..., 1]))
