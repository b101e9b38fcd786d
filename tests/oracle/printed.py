"""Check error bars, the residual of friction, laws and long sweeps, which no engine
answers.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Springs, Torsion
from fourbar.evaluation.case import POSITIONS_OF_A_BLOCK
from fourbar.linkage import MOVING_BARS, PIN_FORCE
from fourbar.quantities import FORCE_NAMES, OK, PIN_FORCES
from fourbar.solving import solve
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.rows import FAILS, FORMULAS, UNDECIDED, Row
from fourbar_validation.compare.scales import (
    TermSizes,
    find_scale_of_answer,
    make_reference,
    take_strictest_conditions,
)
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    NOTHING_TO_TELL,
    K,
    compute_differences,
    count_half_turns,
    divide,
    find_condition,
    find_conditions,
    find_error,
    find_worst,
    join_components,
    magnitude,
    magnitudes,
    sum_lengths,
)
from fourbar_validation.engines.asking import ask_at
from fourbar_validation.engines.description import list_speeds
from fourbar_validation.engines.exact import BallArithmetic, find_refusal
from fourbar_validation.engines.free_body import speeds_and_accelerations
from fourbar_validation.engines.free_body_effects import sum_acting
from fourbar_validation.engines.prediction import predict_from_data
from fourbar_validation.engines.registry import find_missing
from fourbar_validation.run.question import (
    select_positions,
    spread_evenly,
)

POSITIONS_OF_ERROR_BARS = 5
"""Positions of a scene at which the error bars are held to the true error. Those
nearest to a rest are added.
"""
ERROR_BARS = 10.0
"""Error bars: 2 in 100 million normal errors exceed ten of them."""
_BALLS_EXACT_TO = 2.0**-256
"""Part of a size that 320-bit balls may leave of an exact zero, whose error bar is 0. A
torque is the sum of terms that cancel; 64 bits are left for that.
"""
_ROUNDED_SOMEWHERE = 20
"""Positions with loaded friction of which one at least leaves a residual. By rounding
half of them do.
"""


def points(question):
    """Check the scene's own points."""
    if (
        question.scene.points
        and question.reference is not None
        and question.at.speed is not None
    ):
        yield compare_points(
            question,
            question.scene,
            question.solution,
            question.reference,
        )


def compare_points(question, scene, solution, reference, least=0.0):
    """Compare places, velocities and accelerations of a scene's own points with
    those that follow from the angles of another derivation.

    `least`: the condition from which on they are judged.
    """
    link = scene.linkage
    error = np.zeros(len(reference))
    sizes = TermSizes(scene, reference)
    usable = (solution.status_code == OK) & (reference.condition >= least)
    usable &= find_condition("F12", link, reference) * NOTHING_TO_TELL > EPS
    tables = (solution.points, solution.velocity, solution.acceleration)
    like = ("B", "v_B", "a_B")
    for name, (arms, feet) in move_points(scene, reference).items():
        for ours, kind, arm, at_foot in zip(tables, like, arms, feet, strict=True):
            if name in ours:
                theirs = join_components((arm + at_foot).real, (arm + at_foot).imag)
                size = np.abs(arm) + np.abs(at_foot) + sum_lengths(scene.linkage)
                if kind != "B":
                    size = np.abs(arm) + np.abs(at_foot) + sizes.sum_terms(kind)
                apart = find_error(
                    kind,
                    ours[name],
                    theirs,
                    size,
                ) * find_condition(kind, link, reference)
                error = np.where(
                    usable,
                    np.maximum(error, np.where(np.isnan(apart), np.inf, apart)),
                    error,
                )
    allowed = EQUIVALENCE.factor * count_half_turns(link.ground_angle, solution.theta_2)
    what = f"the {len(scene.points)} points of the scene"
    return question.row(
        "points",
        error,
        allowed,
        what,
        usable,
        theta_2=solution.theta_2,
    )


class PointMotion(NamedTuple):
    """Motion of a point over the positions, as x + i y: place, velocity and
    acceleration of the bar's first pin, from O2, and of the point against that pin.
    """

    arms: list[NDArray[np.complex128]]
    feet: list[NDArray[np.complex128]]


def move_points(scene, reference):
    """Move a scene's own points as the angles of another derivation have them."""
    link = scene.linkage
    n = len(reference)
    zero = np.zeros(n)
    theta = {
        1: zero + link.ground_angle,
        2: reference.theta_2,
        3: reference.theta_3,
        4: reference.theta_4,
    }
    speed = {
        bar: zero if bar == 1 else _find_true_value(reference, f"omega_{bar}", n)
        for bar in theta
    }
    growth = {
        bar: zero if bar == 1 else _find_true_value(reference, f"alpha_{bar}", n)
        for bar in theta
    }

    def swing(bar, distance, angle):
        arm = distance * np.exp(1j * (theta[bar] + angle))
        return [arm, 1j * speed[bar] * arm, (1j * growth[bar] - speed[bar] ** 2) * arm]

    first_pins = {
        3: swing(2, link.input.length, 0.0),
        4: [link.ground * np.exp(1j * theta[1]), 0.0 * zero, 0.0 * zero],
    }
    moved = {}
    for point in state_from_pins(scene).points:
        arms = swing(point.bar, *point.place.polar_from_pin())
        feet = first_pins.get(point.bar, [zero, zero, zero])
        moved[point.name] = PointMotion(arms, feet)
    return moved


def _find_true_value(reference, quantity, n):
    values = getattr(reference, quantity)
    return np.zeros(n) if values is None else values


def blocks(question):
    """Check a sweep of more than one block of positions.

    The ends of its blocks are held against the scene's own sweep.
    """
    scene = question.scene
    command = question.at
    solution = question.solution
    if command.speed is None or command.remainder is not None:
        return
    n = len(command.angle)
    ok = np.flatnonzero(solution.status_code == OK)
    answered = ok if len(ok) else np.arange(n)
    filling = np.resize(answered, POSITIONS_OF_A_BLOCK)
    rows = np.concatenate((filling, np.arange(n)))
    last = len(rows) - 1
    ends = np.unique([0, POSITIONS_OF_A_BLOCK - 1, POSITIONS_OF_A_BLOCK, last])
    repeated = select_positions(command, rows)
    loaded_pins = sum(len(effect.loaded_pins) for effect in scene.effects)
    if loaded_pins > 1:  # each may take a search
        repeated.angle[1 : POSITIONS_OF_A_BLOCK - 1] = np.nan
    # every other quantity of thousands of positions would cost as much again
    expected = {}
    together = {}
    for name in ("sin_mu", "B", "alpha_3", *FORCE_NAMES):
        values = getattr(solution, name)
        if values is not None:
            expected[name] = values
            together[name] = np.empty((len(rows), *values.shape[1:]))
    status = solve(scene, at=repeated, out=together).status_code
    at_ends = rows[ends]
    error = (status[ends] != solution.status_code[at_ends]).astype(float)
    with np.errstate(all="ignore"):  # beyond the range of doubles there is no size
        scale = TermSizes(scene, solution).scales([*expected], [*expected.values()])
    due = [values[at_ends] for values in expected.values()]
    at_once = [values[ends] for values in together.values()]
    finite_due = np.isfinite(magnitudes(due))
    finite_at_once = np.isfinite(magnitudes(at_once))
    conditions = find_conditions([*expected], scene.linkage, solution)[:, at_ends]
    conditions[np.isnan(conditions)] = 1.0  # decided by the command: nothing closes
    # evaluated by the same code, but not in the same company of a processor's registers
    differences = compute_differences([*expected], at_once, due)
    errors = divide(differences, scale.of_terms[:, at_ends]) * conditions
    errors[~finite_due] = 0.0
    errors[finite_due != finite_at_once] = np.inf
    error = np.maximum(error, errors.max(axis=0))
    alone = {angle: np.empty(n) for angle in ("theta_3", "theta_4")}
    solve(scene, at=command, out=alone)  # they are found without vectors then
    half_turns = count_half_turns(scene.linkage.ground_angle, command.angle)
    names = [*alone]
    angles = [getattr(solution, name) for name in names]
    apart = compute_differences(names, [*alone.values()], angles)
    apart *= find_conditions(names, scene.linkage, solution) / half_turns
    largest = np.nan_to_num(apart[:, ok], nan=np.inf).max(initial=0.0)
    error[-1] = max(error[-1], largest)
    reason = f"{len(rows)} positions at once against {n}"
    theta_2 = solution.theta_2[at_ends]
    yield question.row("blocks", error, EQUIVALENCE.factor, reason, theta_2=theta_2)


def error_bars(question):
    """Check the error bars by the true error, in 320 bits.

    No bar may be larger than what a comparison is allowed.
    """
    scene = question.scene
    command = question.at
    solution = question.solution
    if (
        command.omega_2 is None
        or command.remainder is not None
        or find_refusal(scene)
        or find_missing("flint")
    ):
        return
    # the sense of dry friction at a pin at rest is no question of rounding
    usable = np.flatnonzero(
        (solution.status_code == OK) & ~question.reversing(EQUIVALENCE.factor)
    )
    if not len(usable):
        return
    nearest = [
        usable[np.argmin(pull[usable])]
        for pull in _compute_pulls(scene, command, solution)
    ]
    indices = np.union1d(
        spread_evenly(usable, POSITIONS_OF_ERROR_BARS), nearest
    ).astype(int)
    sampled = select_positions(command, indices)
    exact = ask_at(BallArithmetic(), scene, sampled)
    ours = solve(scene, "error", at=sampled)
    reference = make_reference(scene, exact)
    turns = np.maximum(
        count_half_turns(scene.linkage.ground_angle), np.abs(sampled.theta_2) / np.pi
    )
    names = ("torque", *PIN_FORCES)
    differences = magnitudes([getattr(ours, q) - exact.quantities[q] for q in names])
    scale = TermSizes(scene, ours).scales(names, [getattr(ours, q) for q in names])
    if reference is not None:
        theirs = find_scale_of_answer(names, scene, reference)
        scale = scale if theirs is None else scale.take_strictest(theirs)
    sizes = scale.of_terms
    conditions = take_strictest_conditions(names, scene.linkage, ours, reference)
    for bar, rows in (("torque_error", slice(0, 1)), ("force_error", slice(1, None))):
        width = getattr(ours, bar)
        true = differences[rows].max(axis=0)
        size = sizes[rows].max(axis=0)
        condition = conditions[rows][0]
        tells = condition * NOTHING_TO_TELL > EPS
        wide = divide(width, size) * condition / (K * EPS * turns)
        if (
            beyond := tells & (wide > 1.0)
        ).any():  # allowed is only what rounding the data does
            expected = np.max(
                [
                    predict_from_data(scene, sampled, quantity, beyond)
                    for quantity in names[rows]
                ],
                axis=0,
            )
            wide = np.where(beyond, divide(width, expected), wide)
        allowed = ERROR_BARS * width + _BALLS_EXACT_TO * size
        share = np.where(
            tells,
            np.maximum(divide(true, allowed), wide),
            0.0,
        )
        share[tells & ~np.isfinite(width)] = np.inf
        index = find_worst(share)
        reason = (
            f"the error is {true[index]:.1e}, the bar {width[index]:.1e}, of"
            f" {size[index]:.1e}"
        )
        yield question.row(
            bar,
            share,
            1.0,
            reason,
            tells,
            float(condition[index]),
            sampled.theta_2,
        )


def _compute_pulls(scene, command, solution):
    """Compute from free bodies what springs, torsion springs and loads over a table
    do, N and N m, (n,).
    """
    motion = speeds_and_accelerations(
        scene.linkage,
        command.theta_2,
        *list_speeds(command),
        solution.theta_3,
        solution.theta_4,
    )
    scene = state_from_pins(scene)
    alone = [
        replace(scene, loads=(load,), effects=())
        for load in scene.loads
        if load.table is not None
    ]
    for effect in scene.effects:
        if isinstance(effect, (Springs, Torsion)):
            kind = type(effect)
            alone += [
                replace(scene, loads=(), effects=(kind((one,)),))
                for one in effect.springs
            ]
    for one in alone:
        wrenches = sum_acting(one, motion)
        yield sum(
            np.abs(wrenches.force[bar]) + np.abs(wrenches.moment[bar])
            for bar in MOVING_BARS
        )


def friction_residual(question):
    """Check that what remains of friction couples is rounding, and somewhere not
    less.
    """
    scene = question.scene
    solution = question.solution
    residual = solution.friction_residual
    terms = np.zeros(len(solution))
    if question.at.speed is None or residual is None:
        return
    for effect in scene.effects:
        for pin, mu, r in getattr(effect, "pins", ()):
            terms = np.fmax(
                terms, mu * r * magnitude(getattr(solution, PIN_FORCE[pin]))
            )
    sliding = np.isfinite(terms) & (terms > 0.0) & (solution.status_code == OK)
    if np.any(solution.omega_2 == 0.0) or not sliding.any():
        yield Row.unmeasured(
            question.name,
            FORMULAS,
            "exact",
            "friction_residual",
            UNDECIDED,
            "no pin slides under load",
        )
        return
    error = np.where(
        sliding,
        residual / np.where(sliding, terms, 1.0) * solution.drive_condition,
        0.0,
    )
    reason = "couples of mu r |F|, relative to the largest"
    row = question.row(
        "friction_residual",
        error,
        K * EPS,
        reason,
        theta_2=solution.theta_2,
    )
    if np.count_nonzero(sliding) >= _ROUNDED_SOMEWHERE and not residual[sliding].any():
        row = replace(
            row,
            verdict=FAILS,
            reason="not even rounding is left at any position",
        )
    yield row
