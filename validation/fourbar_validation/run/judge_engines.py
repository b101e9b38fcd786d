"""Judge each engine's answer.

Rows are on the scene's motion, on the linkage, and on the inertial part of the torque.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fourbar.linkage import copy_with
from fourbar.quantities import COUPLE, UNITS, Array
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Comparison
from fourbar_validation.compare.rows import FAILS, REFUSES, VERDICTS, Row
from fourbar_validation.compare.scales import make_reference
from fourbar_validation.compare.tolerance import compute_difference
from fourbar_validation.engines.description import name_driving
from fourbar_validation.engines.registry import (
    Engine,
    make_demands,
    make_prediction,
)
from fourbar_validation.run.causes import find_causes
from fourbar_validation.run.question import Question

EXACT = "exact"
"""Setting of an engine whose errors are round-off."""
CLOSES = "assembled"
"""Quantity of where the loop closes."""
_TIMES_NEARER = 10.0
"""Factor by which two engines are nearer to each other than to us if they agree against
us: two that miss what they declare by as much do not.
"""


def compare_answers(question: Question) -> Iterator[Row]:
    """Compare every engine's answer with the formulas."""
    rows: list[Row] = []
    for engine in question.engines:
        answer = partial(_answer_of_engine, question, engine)
        rows += question.attempt(answer, engine.name)
    question.against = find_agreement(question, rows)
    for row in rows:
        if row.failed:
            question.failing.setdefault(row.engine, set()).add(row.quantity)
    yield from rows


def find_agreement(question: Question, rows: Sequence[Row]) -> dict[str, list[str]]:
    """Find the quantities in which engines agree with each other, and not with us.

    Returned are the engines of each such quantity: two at least, and more than agree
    with us. Two versions of one engine count once.
    """
    against: dict[str, list[str]] = {}
    versions = {
        engine.name: getattr(engine, "stated_name", "") or engine.name
        for engine in question.engines
    }
    exact: dict[str, list[Row]] = {}
    for row in rows:
        if row.setting == EXACT and (row.quantity in UNITS or row.quantity == CLOSES):
            exact.setdefault(row.quantity, []).append(row)
    for quantity, of_quantity in exact.items():
        right = {versions[row.engine] for row in of_quantity if row.passed}
        failing = [row for row in of_quantity if row.failed]
        for row in failing:
            alike = [one.engine for one in failing if _agree(question, row, one)]
            names = {versions[name] for name in alike}
            if len(names) > max(1, len(right), len(against.get(quantity, ()))):
                against[quantity] = alike
    return against


def _agree(question: Question, row: Row, other: Row) -> bool:
    """Return whether two engines that differ from us have one number.

    The position is that where the first one is worst, and the two may differ by the
    larger error that either is allowed, and by a tenth of what they differ from us.
    """
    quantity = row.quantity
    ours = getattr(question.solution, quantity)
    answers = [_values_of(question, one.engine, quantity) for one in (row, other)]
    if ours is None or not math.isfinite(row.error):
        return False
    theta_2 = np.nan_to_num(question.solution.theta_2 - row.theta_2, nan=np.inf)
    position = np.abs(theta_2).argmin()
    here = [1.0 * ours[position : position + 1]]
    for values in answers:
        if values is None or len(values) != len(ours):
            return False
        here.append(values[position : position + 1])
    (apart,) = compute_difference(quantity, *here[1:])
    (from_us,) = compute_difference(quantity, *here[:2])
    allowed = 2.0 * max(row.allowed, other.allowed)
    near = apart * row.error <= allowed * from_us
    return bool(near and apart * _TIMES_NEARER <= from_us)


def _values_of(question: Question, engine: str, quantity: str) -> Array | None:
    """Return what an engine answers, or what follows from its answer; None if nothing.

    Where the loop closes is told by 1, elsewhere 0.
    """
    answer, _ = question.answered[engine]
    if quantity == CLOSES and answer.assembled is not None:
        return np.asarray(answer.assembled, dtype=float)
    values = answer.quantities.get(quantity)
    if values is None:
        values = getattr(make_reference(question.scene, answer), quantity, None)
    return values


def _answer_of_engine(question: Question, engine: Engine) -> Iterator[Row]:
    answer = question.answer(engine)
    if answer.refusal is not None:
        question.leave_out(answer.engine, answer.refusal)
    rows = compare_answer(question, engine, answer)
    if any(row.failed for row in rows):
        _note_causes(question, question, engine, answer)
    yield from rows


def _note_causes(
    question: Question,
    asked: Question,
    engine: Engine,
    answer: Answer,
) -> None:
    """Look for the mistakes behind an answer; nothing is noted if none can be."""
    predicted = make_prediction(engine, asked.scene, asked.at, answer)
    causes = find_causes(asked, answer, engine.tolerance, predicted)
    if causes is not None:
        where = "without loads and effects: " * (asked is not question)
        question.causes[engine.name] = [f"{where}{cause}" for cause in causes]


def compare_answer(
    question: Question,
    engine: Engine,
    answer: Answer,
) -> list[Row]:
    """Compare one answer with the formulas.

    The motion is the one that the engine really made.
    """
    if answer.at is not None and answer.at is not question.at:
        question = Question(question.name, question.scene, answer.at)
    scene = question.scene
    formulas = question.solution
    held = make_demands(engine, scene, question.at, answer, formulas)
    reference = question.reference
    # conditions of an answer that is its own reference are its own
    further = (reference, {} if reference is None else question.scales)
    comparison = Comparison(question.name, scene, answer, formulas, held, *further)
    rows = comparison.rows()
    assembled = answer.assembled
    # an answer of another length has a row that fails
    whole = assembled is not None and len(assembled) == len(formulas)
    if whole and answer.theta is not None:
        rows.append(comparison.closure())
    return rows


def compare_inertia(question: Question) -> Iterator[Row]:
    """Compare the inertial part of the torque by itself.

    Loads can hide an inertia that is 24 times wrong. An exact engine answers it in the
    same assembly; another one is started once more.
    """
    scene = question.scene
    if question.at.speed is None or not (scene.loads or scene.effects):
        return
    drive = name_driving(scene)
    part = f"{drive}_inertia"
    unloaded = copy_with(scene, loads=(), effects=())
    bare = Question(question.name, unloaded, question.at, output=question.output)
    for name, (answer, seconds) in question.answered.items():
        if part in answer.quantities:
            quantities = {**answer.quantities, drive: answer.quantities[part]}
            # it says how near loads and friction are to jamming
            quantities.pop("drive_condition", None)
            alone = replace(answer, quantities=quantities, evidence={}, alarms=[])
            bare.answered[name] = alone, seconds
    for engine in question.engines:
        # one that broke down has its row
        if COUPLE.value in engine.answers and engine.name in question.answered:
            rows = partial(_check_inertia, question, bare, engine)
            yield from question.attempt(rows, engine.name, "inertia alone")


def _check_inertia(question: Question, bare: Question, engine: Engine) -> Iterator[Row]:
    answer = bare.answer(engine)
    loaded, _ = question.answered[engine.name]
    if answer.refusal is not None and loaded.refusal is not None:
        return  # the refusal has its row
    drive = name_driving(question.scene)
    rows = compare_answer(bare, replace(engine, answers=(drive,)), answer)
    told = question.failing.get(engine.name, set()) | {"undecided"}
    rows = [
        row
        for row in rows
        if row.quantity == drive
        or (row.verdict in (REFUSES, FAILS) and row.quantity not in told)
    ]
    if any(row.failed for row in rows) and engine.name not in question.causes:
        _note_causes(question, bare, engine, answer)
    if rows:  # a failure besides the torque, or in place of it, is not left out
        worst = max(rows, key=lambda row: VERDICTS.index(row.verdict))
        reason = worst.reason
        if worst.quantity not in (drive, "all"):
            reason = f"{worst.quantity}: {reason}"
        yield replace(worst, quantity=f"{drive}_inertia", reason=reason)


def compare_shipped_mjcf(question: Question) -> Iterator[Row]:
    """Check the generated MJCF as it is shipped, if the engine that runs it is in."""
    for engine in question.engines:
        if engine.generated:
            from fourbar_validation.engines.mujoco.shipped import compare_shipped

            def rows() -> list[Row]:
                row = compare_shipped(question.name, question.scene, question.at)
                return [] if row is None else [row]

            yield from question.attempt(rows, engine.name, "MJCF as shipped")
