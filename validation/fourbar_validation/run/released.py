"""Free motions of every engine against the formulas.

An engine's error is predicted by itself: it runs twice, with its step and with twice
its step, and the difference is what the coarser motion errs by. The finer one must not
err by more than ten times that.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fourbar.effects import Friction, Load
from fourbar.linkage import PINS
from fourbar.quantities import UNKNOWNS, Indices
from fourbar.scene import Command, Scene, with_signs
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Comparison
from fourbar_validation.compare.rows import (
    DEGRADED,
    FAILS,
    FORMULAS,
    REFUSES,
    UNDECIDED,
    Row,
    keep_worst,
)
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    TIMES_PREDICTED,
    ErrorBound,
    divide,
    replace_zero_size,
)
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.guests import Guest
from fourbar_validation.engines.registry import (
    ENGINES_PACKAGE,
    Engine,
    Later,
    ask_at,
    find_missing,
    make_demands,
)
from fourbar_validation.report.scene_record import Timing
from fourbar_validation.run.judge_engines import find_agreement
from fourbar_validation.run.question import Question, select_positions, take_member

FORWARD = {
    "mujoco-forward": (
        Later(f"{ENGINES_PACKAGE}.mujoco.runner:MujocoForward"),
        "mujoco",
    ),
    "pinocchio-forward": (
        Later(f"{ENGINES_PACKAGE}.pinocchio:PinocchioReleased"),
        "pinocchio",
    ),
}
"""Engines that integrate by themselves. Each has a function that starts it with a step,
and its library.
"""
LONGEST_TIMESTEP = 1e-3
"""s, of an engine of `FORWARD`."""
LONGEST_OF_A_GUEST = 2e-3
"""s."""
RELEASED_ERRORS = {"theta_2": 1e-9, "omega_2": 1e-8, "energy": 1e-10}
"""Errors (rad, of the greatest speed, of the greatest energies) at which a free motion
agrees: the formulas hold theta_2 to 1e-9 rad over 5 s; a motion of 100 s may amplify
that by its duration, so 5 s is the unit.
"""
DURATION_OF_FULL_ACCURACY = 5.0
"""s; of a longer motion the errors grow with its duration."""


def check_released(question: Question) -> Iterator[Row]:
    """Compare every forward engine's free motion with that of the formulas.

    The forces of each instant are compared too. The motion goes on through limit
    positions and change points.
    """
    scene = question.scene
    solution = question.solution
    free = scene.motion.free
    assert free is not None and solution.omega_2 is not None
    times = np.linspace(0.0, free.duration, free.steps + 1)
    yield from _compare_forces(question)

    def rows(
        start: Callable[[float], Any], longest: float, tolerance: ErrorBound
    ) -> list[Row]:
        interval = free.duration / free.steps
        # two of them, or more, from one instant to the next
        step = interval / (2.0 * math.ceil(interval / (2.0 * longest) - 1e-6))
        begin = time.perf_counter()
        fine = start(step).release(scene, times)
        seconds = time.perf_counter() - begin
        who = (question.name, fine.engine, fine.setting)
        question.timings.append(Timing(*who, len(times), seconds))
        if fine.refusal is not None:
            question.leave_out(fine.engine, fine.refusal)
            return [Row.unmeasured(*who, "all", REFUSES, fine.refusal)]
        coarse = start(2.0 * step).release(scene, times)
        return _make_rows(question, fine, coarse, tolerance)

    for engine in question.engines:
        if isinstance(engine, Guest) and "release" in engine.effects:
            judge = partial(rows, engine.at_step, LONGEST_OF_A_GUEST, engine.tolerance)
            yield from question.attempt(judge, engine.name)
    for adapter, (start, library) in FORWARD.items():
        if reason := find_missing(library):
            question.leave_out(adapter, reason)
        else:
            judge = partial(rows, start, LONGEST_TIMESTEP, EQUIVALENCE)
            yield from question.attempt(judge, adapter)


def _compare_forces(question: Question) -> Iterator[Row]:
    """Compare motion, pin forces and torque of every instant.

    The torque is zero; engines that answer one by one are asked. They are given
    theta_2, omega_2 and alpha_2; that these balance without a torque is the equation of
    motion.
    """
    name = question.name
    solution = question.solution
    none = solution.torque if solution.drive is None else solution.drive_force
    what = "a released linkage has no drive"
    who = (name, FORMULAS, "exact")
    yield Row.judged(who, "torque", np.abs(none), 0.0, what, solution.theta_2)
    driven = list(_prescribe(question))
    rows: list[Row] = []
    for engine in question.engines:
        if (
            engine.tolerance == EQUIVALENCE
            and "theta_3" in engine.answers
            and not engine.missing()
        ):
            compare = partial(_compare_forces_by, engine, driven)
            rows += question.attempt(compare, engine.name, "forces")
    for part in driven:
        question.against |= find_agreement(part, rows)
    yield from rows


def _compare_forces_by(engine: Engine, driven: list[Question]) -> list[Row]:
    """Compare what one engine answers to the motion as a prescribed one, in parts.

    Keep the worst row of each quantity.
    """
    return keep_worst(row for part in driven for row in _compare_part(engine, part))


def _compare_part(engine: Engine, driven: Question) -> list[Row]:
    answer = driven.answer(engine)
    scene = driven.scene
    if answer.refusal is not None:
        who = (driven.name, answer.engine, answer.setting)
        return [Row.unmeasured(*who, "all", REFUSES, answer.refusal)]
    reference = make_reference(scene, answer)
    assert reference is not None
    # the formulas are conditioned by the angle that is independent there, an engine by
    # theta_2
    conditioned = replace(
        driven.solution,
        condition=reference.condition,
        drive_condition=reference.drive_condition,
        at=driven.at,
    )
    names = tuple(name for name in UNKNOWNS if name in engine.answers)
    # nor are theta_2, omega_2 and alpha_2 more than that angle's, rounded: what that
    # costs there is computed
    held = make_demands(replace(engine, answers=names), scene, driven.at, answer)
    rows = Comparison(driven.name, scene, answer, conditioned, held, reference).rows()
    return [row for row in rows if row.quantity != "undecided"]


def _prescribe(question: Question) -> Iterator[Question]:
    """Yield the motion as scenes that prescribe it, each at its positions.

    A standstill is prescribed with the couples of dry friction there, because an engine
    has no friction at rest. A standstill that lasts is held: every pin takes the same
    part of its torque, and no more than all of it; one that ends begins to move against
    the whole torque.
    """
    solution = question.solution
    scene = question.scene
    motion = scene.motion.replace(free=None, acceleration=0.0)
    scene = replace(scene, motion=motion, drive_bar=2, drive=None)
    told = (solution.theta_2, solution.branch, solution.omega_2, solution.alpha_2)
    command = with_signs(scene.linkage, Command(*told))

    def ask(scene: Scene, indices: Indices) -> Question:
        at = select_positions(command, indices)
        of_engines = (question.engines, question.output)
        driven = Question(question.name, scene, at, *of_engines)
        driven.solution = take_member(solution, indices)
        return driven

    friction = next((one for one in scene.effects if isinstance(one, Friction)), None)
    assert command.omega_2 is not None
    rests = np.equal(command.omega_2, 0.0) & (friction is not None)
    if not rests.all():
        yield ask(scene, np.flatnonzero(~rests))
    if friction is None:
        return
    others = [effect for effect in scene.effects if effect is not friction]
    bare = replace(scene, effects=tuple(others))
    resting = np.flatnonzero(rests)
    numbers = np.stack((command.theta_2, command.alpha_2), axis=1)[resting]
    _, different = np.unique(numbers, axis=0, return_index=True)
    for first in different:
        index = resting[first : first + 1]
        here = select_positions(command, index)
        loads = _hold_by_friction(bare, here, friction)
        yield ask(replace(bare, loads=(*scene.loads, *loads)), index)


def _hold_by_friction(
    bare: Scene,
    here: Command,
    friction: Friction,
) -> list[Load]:
    """Return the couples of dry friction at a standstill, as loads.

    `bare`: the scene without this friction.
    """
    needed = ask_at(FreeBody(), bare, here).quantities["torque"][0]
    begins = float(np.sign(here.alpha_2)[0])
    at_one = here._replace(speed=np.ones(1))
    turning = ask_at(FreeBody(), bare, at_one).quantities
    rate = (0.0, 1.0, turning["omega_3"][0], turning["omega_4"][0])
    slips = {}
    for pin, _ in friction.torques:
        i, j = PINS[pin]
        slips[pin] = rate[j - 1] - rate[i - 1]
    most = sum(torque * abs(slips[pin]) for pin, torque in friction.torques)
    part = -begins or float(np.clip(needed / most, -1.0, 1.0))
    loads = []
    for pin, torque in friction.torques:
        couple = part * torque * float(np.sign(slips[pin]))
        for bar, moment in zip(PINS[pin], (-couple, couple), strict=True):
            if bar != 1:
                loads.append(Load(bar, moment=moment))
    return loads


def _make_rows(
    question: Question,
    fine: Answer,
    coarse: Answer,
    tolerance: ErrorBound,
) -> list[Row]:
    """Judge the motion by that of the formulas, and by that of twice the step.

    An engine may err by as much as it declares.
    """
    free = question.scene.motion.free
    omega_2 = question.solution.omega_2
    assert free is not None and omega_2 is not None
    n = len(omega_2)
    who = (question.name, fine.engine, fine.setting)
    made = len(fine.quantities["theta_2"])
    if made < n:
        why = f"it stopped after {made} of {n} instants"
        return [Row.unmeasured(*who, "all", FAILS, why)]
    compared = {
        "theta_2": (question.solution.theta_2, 1.0),
        "omega_2": (omega_2, np.abs(omega_2).max()),
        "energy": (np.zeros(n), fine.quantities["terms"][:n].max()),
    }
    rows = []
    for name, (right, largest) in compared.items():
        values, other = (answer.quantities[name] for answer in (fine, coarse))
        if name == "energy":  # that of the start is anything
            values = values - values[0]
            other = other - other[0]
        size = replace_zero_size(np.array(float(largest)))
        error = divide(np.abs(values[:n] - right), size)
        expected = math.nan
        if len(other) >= n:
            expected = float(divide(np.abs(values[:n] - other[:n]).max(), size))
        full = RELEASED_ERRORS[name]
        full *= max(1.0, free.duration / DURATION_OF_FULL_ACCURACY)
        reason = f"a free motion of {free.duration:g} s"
        if tolerance.factor > full:
            full, reason = tolerance.factor, tolerance.reason
        allowed = max(full, TIMES_PREDICTED * expected)
        row = Row.judged(
            who, name, error, allowed, reason, fine.quantities["theta_2"][:n]
        )
        if not row.error <= full:
            reason = f"{row.error:.1e} where {expected:.1e} was predicted"
            verdict = UNDECIDED if expected >= 1.0 else DEGRADED
            if not (row.passed and math.isfinite(expected)):
                verdict = FAILS
            row = replace(row, verdict=verdict, reason=f"{reason} from twice the step")
        rows.append(row)
    return rows
