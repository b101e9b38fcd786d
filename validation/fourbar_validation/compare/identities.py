"""Equations that the formulas' own numbers must satisfy, summed over the whole linkage.

They use the printed results alone (forces, accelerations, torque) and none of the elimination
that produced them: closure, the sum of forces on the three bars, and the sum of moments about O2.
"""

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Actions
from fourbar.effects.actions import bodies
from fourbar.evaluation.case import state_at
from fourbar.formulas.pin_forces import Wrenches
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import OK, OVERFLOW
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import closing_margin, turned
from fourbar_validation.compare.error import magnitude, relative, worst
from fourbar_validation.compare.reversals import reversing
from fourbar_validation.compare.rows import AGREES, FAILS, UNDECIDED, Row
from fourbar_validation.compare.scales import of_length
from fourbar_validation.compare.tolerance import IDENTITY, SIMULATED, Array, ErrorBound, condition_of, lever

FORMULAS = "formulas"
IDENTITIES = (
    *("closure", "force_sum", "moment_sum", "status", "blocks", "points", "law", "sweep"),
    *("torque", "torque_error", "force_error", "friction_residual"),
)
"""Rows of the formulas that no engine answers: they do not count as compared."""


def identities(name: str, scene: Scene, at: Command, solution: Solution) -> list[Row]:
    """One row per identity that the stage of the solution allows."""
    angles = {"theta_2": solution.theta_2, "theta_3": solution.theta_3, "theta_4": solution.theta_4}
    closing = solution.assembled & (solution.status_code != OVERFLOW)
    ours = Answer(FORMULAS, "exact", at, closing, angles)
    rows = [closure(name, scene, ours)]
    if scene.motion.angle is None and scene.motion.law is None and at.bar == 2:
        rows.append(_sweep(name, scene, at))
    if solution.torque is not None and (solution.status_code == OK).any():
        rows += _sums(name, scene, at, solution, ours)
    return rows


def _sweep(name: str, scene: Scene, at: Command) -> Row:
    """Check a sweep that the scene leaves open: a whole turn, or one degree short of where the loop just closes.

    At the end of an interval narrower than four degrees it leaves out a quarter of that, which is half of the sweep.
    """
    start, stop = float(at.theta_2[0]), float(at.theta_2[-1])
    if (start, stop) == (0.0, 2.0 * np.pi):
        missed = np.maximum(-closing_margin(scene, at.theta_2), 0.0)
    else:
        left_out = min(np.radians(1.0), 0.5 * (stop - start))
        missed = np.abs(closing_margin(scene, np.array([start - left_out, stop + left_out])))
    error, allowed = float(missed.max()), IDENTITY.factor * turned(scene.linkage.ground_angle, at.theta_2)
    reason = "one degree short of where the loop just closes, or a whole turn"
    return Row(
        name, FORMULAS, "exact", "sweep", error, allowed, AGREES if error <= allowed else FAILS, reason, start, 1.0
    )


def closure(name: str, scene: Scene, answer: Answer, simulated: ErrorBound = SIMULATED) -> Row:
    """Do the own angles of an engine close the loop? Relative to the sum of the lengths."""
    d, a, b, c = scene.linkage.lengths
    assert answer.at is not None and answer.assembled is not None
    theta_3, theta_4 = answer.quantities["theta_3"], answer.quantities["theta_4"]
    ground = d * np.exp(1j * scene.linkage.ground_angle)
    theta_2 = answer.at.angle if answer.at.bar == 2 else answer.quantities["theta_2"]
    gap = np.abs(a * np.exp(1j * theta_2) + b * np.exp(1j * theta_3) - ground - c * np.exp(1j * theta_4))
    tolerance = IDENTITY if answer.setting == "exact" else simulated
    equation = "a e^{i theta_2} + b e^{i theta_3} = d e^{i theta_1} + c e^{i theta_4}"
    return _row(name, scene, answer, "closure", equation, gap, of_length(scene), answer.assembled, tolerance.factor)


def _sums(name: str, scene: Scene, at: Command, solution: Solution, ours: Answer) -> list[Row]:
    """F12 + F14 + sum of loads = sum of m a_G, and the moments of the same about O2 with the torque."""
    assert at.speed is not None and solution.F12 is not None and solution.F14 is not None
    assert solution.torque is not None and solution.F32 is not None and solution.F43 is not None
    state = state_at(scene, at)
    # what acts at the speeds that were answered, not at another evaluation of them
    speeds = {f"omega_{bar}": getattr(solution, f"omega_{bar}") for bar in MOVING_BARS if bar != at.bar}
    state = state._replace(moving=state.moving._replace(**speeds))
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
        force_on, couple = acting.on(number)
        resultant = np.broadcast_to(force_on, n)
        load = np.stack([resultant.real, resultant.imag], axis=1)
        centre, acceleration = getattr(solution, f"G{number}"), getattr(solution, f"a_G{number}")
        alpha = getattr(solution, f"alpha_{number}")
        force = force + load - bar.mass * acceleration
        force_terms = force_terms + magnitude(load) + bar.mass * magnitude(acceleration)
        turned = couple + _cross(first_pins[number], load)
        swept = bar.mass * _cross(centre, acceleration) + actions.bodies[number - 2].I * alpha
        moment = moment + turned - swept
        moment_terms = (
            moment_terms
            + (np.abs(couple) + _reach(first_pins[number]) * magnitude(load))
            + bar.mass * _reach(centre) * magnitude(acceleration)
            + actions.bodies[number - 2].I * np.abs(alpha)
        )
    # the forces of the bars that are not driven are solved apart, and the torque is that of virtual work
    assert solution.drive_condition is not None
    with np.errstate(divide="ignore", invalid="ignore"):
        force_terms = force_terms / (lever(scene.linkage) * solution.drive_condition)
        moment_terms = moment_terms / condition_of("torque", scene.linkage, solution)
    where = solution.status_code == OK
    # the sense of dry friction at a pin at rest is decided by rounding: not the same here as in the answer
    where &= ~reversing(scene, solution, IDENTITY.factor)
    return [
        _row(name, scene, ours, "force_sum", "F12 + F14 + loads = sum of m a_G", magnitude(force), force_terms, where),
        _row(name, scene, ours, "moment_sum", "moments about O2, with the torque", np.abs(moment), moment_terms, where),
    ]


def _row(
    name: str,
    scene: Scene,
    answer: Answer,
    quantity: str,
    equation: str,
    gap: Array,
    terms: Array | float,
    where: NDArray[np.bool_],
    factor: float = IDENTITY.factor,
) -> Row:
    """By how much an equation is missed, in parts of its terms, where it is worst; NaN is beyond all."""
    assert answer.at is not None
    theta_2 = answer.at.angle
    error = np.where(where, relative(gap, terms), 0.0)
    index = worst(error)
    condition = 1.0 / turned(scene.linkage.ground_angle, theta_2)
    allowed = factor / condition
    verdict = UNDECIDED if not where.any() else AGREES if error[index] <= allowed else FAILS
    return Row(
        scene=name,
        engine=answer.engine,
        setting=answer.setting,
        quantity=quantity,
        error=float(error[index]),
        allowed=allowed,
        verdict=verdict,
        reason=f"identity: {equation}" if where.any() else "no position at which it is demanded",
        theta_2=float(theta_2[index]),
        condition=condition,
    )


def _cross(u: Array, v: Array) -> Array:
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _reach(point: Array) -> Array:
    return np.asarray(np.hypot(point[..., 0], point[..., 1]))
