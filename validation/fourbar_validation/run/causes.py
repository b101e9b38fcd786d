"""Known mistakes that explain the numbers of an engine that fails a scene."""

import numpy as np

from fourbar.errors import FourBarError
from fourbar.quantities import OK, UNITS, Array
from fourbar_validation.check.judge import Judge
from fourbar_validation.check.mistakes import explain
from fourbar_validation.check.rows import RowCommands
from fourbar_validation.check.theirs import NOT_JUDGED, TheirTable, Unit
from fourbar_validation.check.variants import Wanted, always
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.tolerance import ErrorBound, Mask, magnitude
from fourbar_validation.run.question import Question

MOST_POSITIONS_SEARCHED = 400
"""Positions, in a row, by which a mistake is looked for."""
FIRST_ROWS = 30
"""Rows, about the first that differs, by which mistakes are tried first. One that these
do not contradict is held to all rows.
"""
FIRST_ROWS_OF_FRICTION = 8
"""The same where each trial looks for friction that balances the forces it follows."""
_NO_CAUSE = {*NOT_JUDGED, "drive_condition"}
"""Quantities by which no mistake is looked for: under friction the condition follows
the forces.
"""
SAME_NUMBERS = 1e-9
"""Part of a quantity's largest value within which a mistake must give an exact engine's
numbers: it was made in another order of summation than the hypothesis."""


def find_causes(
    question: Question,
    answer: Answer,
    tolerance: ErrorBound,
) -> list[str] | None:
    """List the mistakes that explain all that differs in an answer, the simplest first.

    None if none could be looked for. The scene is stated as an engine is told it, with
    every place from the bar's first pin.
    """
    at = answer.at
    if at is None or answer.assembled is None:
        return None
    scene = state_from_pins(question.scene)
    try:
        regular = question.solution.status_code == OK
        table = make_answer_table(answer, tolerance, regular)
        judge = Judge(scene, table, rows=RowCommands(at.part(slice(len(table.places)))))
        wrong = {key: find_wrong(judge, key) for key in judge.table.values}
        differing = [key for key, rows in wrong.items() if rows.any()]
        if not differing:
            return []
        wanted: Wanted = always
        most = FIRST_ROWS
        if any(effect.loaded_pins for effect in scene.effects):
            most = FIRST_ROWS_OF_FRICTION
        if len(table.places) > most:
            rows = choose_rows(np.logical_or.reduce(list(wrong.values())), most)
            few = Judge(scene, table.part(rows), rows=RowCommands(judge.at.part(rows)))
            differing_there = [key for key in differing if wrong[key][rows].any()]
            tried = explain(few, differing_there)
            if not tried:
                return []
            wanted = {explanation.text for explanation in tried}.__contains__
        return [
            explanation.text
            if explanation.whole
            else f"{explanation.text}: {', '.join(explanation.quantities)}"
            for explanation in explain(judge, differing, wanted)
        ]
    except FourBarError:
        return None


def choose_rows(wrong: Mask, most: int) -> slice:
    """Choose the rows by which mistakes are tried first, about the first wrong one."""
    latest = max(0, len(wrong) - most)
    start = min(max(0, int(np.argmax(wrong)) - most // 2), latest)
    return slice(start, start + most)


def make_answer_table(
    answer: Answer,
    tolerance: ErrorBound,
    regular: Mask,
) -> TheirTable:
    """Return a table of an engine's numbers, as if they had been read from a file.

    Numbers are taken to be rounded to what the engine is held to, so that a mistake
    need not explain more of it.

    `regular`: positions that are looked at; beside a change point numbers are anything.
    """
    assert answer.at is not None and answer.assembled is not None
    rows = slice(MOST_POSITIONS_SEARCHED)
    angle = np.asarray(answer.at.angle[rows], dtype=float)
    blank = ~(answer.assembled & regular)[rows]
    if not tolerance.conditioned:
        slack = tolerance.factor
    else:
        slack = SAME_NUMBERS
    values: dict[str, Array] = {}
    rounding: dict[str, Array] = {}
    for name, numbers in answer.quantities.items():
        if name not in UNITS or name in {*_NO_CAUSE, answer.at.commanded}:
            continue
        kept = np.array(numbers[rows], dtype=float)
        kept[blank] = np.nan
        size = magnitude(kept)
        if len(size):
            largest = float(np.nanmax(size, initial=0.0))
        else:
            largest = 0.0
        if UNITS[name] in ("rad", "1"):
            scale = 1.0
        else:
            scale = largest
        values[name] = kept
        rounding[name] = np.full(len(angle), max(slack, SAME_NUMBERS) * scale)
    units = {name: Unit(UNITS[name], 1.0) for name in values}
    lines = list(range(1, len(angle) + 1))
    exact = np.zeros(len(angle))
    return TheirTable(
        angle,
        values,
        rounding,
        units,
        lines,
        exact,
        {},
    )


def find_wrong(judge: Judge, key: str) -> Mask:
    """Mark the rows in which a quantity is beyond what is allowed, (n,)."""
    error, allowed, _ = judge.judged_right(key)
    return np.asarray(judge.where(key) & judge.ok & ~(error <= allowed))
