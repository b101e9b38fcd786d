"""Known mistakes that explain the numbers of an engine that fails a scene."""

import numpy as np

from fourbar.errors import FourBarError
from fourbar.quantities import OK, UNITS
from fourbar_validation.check.judge_table import Judge, JudgedColumn
from fourbar_validation.check.mistakes import Explanation, explain
from fourbar_validation.check.row_commands import RowCommands
from fourbar_validation.check.theirs import (
    NOT_JUDGED,
    TheirColumn,
    TheirTable,
    Unit,
)
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import Predicted
from fourbar_validation.compare.pins import state_from_pins
from fourbar_validation.compare.tolerance import (
    MOST_ALLOWED,
    TIMES_PREDICTED,
    ErrorBound,
    Mask,
    divide,
)
from fourbar_validation.run.question import Question

MOST_POSITIONS_SEARCHED = 400
"""Positions, in a row, by which a mistake is looked for."""
MOST_POSITIONS_OF_FRICTION = 30
"""The same, about the first that differs, where each trial looks for friction that
balances the forces it follows.
"""
SAME_NUMBERS = 1e-9
"""Part of a quantity's largest value within which a mistake must give an exact engine's
numbers: it was made in another order of summation than the hypothesis.
"""


def find_causes(
    question: Question,
    answer: Answer,
    tolerance: ErrorBound,
    predicted: Predicted | None = None,
) -> list[str] | None:
    """List the mistakes that explain all that differs in an answer, the simplest first.

    None if none could be looked for. The scene is stated as an engine is told it, with
    every place from the bar's first pin.
    """
    at = answer.at
    if at is None or answer.assembled is None:
        return None
    scene = state_from_pins(question.scene)
    slack = max(SAME_NUMBERS, tolerance.factor * (not tolerance.conditioned))
    try:
        regular = question.solution.status_code == OK

        def judge_rows(rows: slice) -> tuple[Judge, dict[JudgedColumn, Mask]]:
            table = make_answer_table(answer, regular, rows)
            judge = Judge(scene, table, rows=RowCommands(at.part(rows)), slack=slack)
            if predicted is not None:
                hold_to_prediction(judge, predicted, rows, len(at.angle))
            columns = judge.columns.values()
            return judge, {column: column.wrong & judge.ok for column in columns}

        judge, wrong = judge_rows(slice(MOST_POSITIONS_SEARCHED))
        labels = [column.label for column, rows in wrong.items() if rows.any()]
        if any(effect.loaded_pins for effect in scene.effects):
            any_wrong = np.logical_or.reduce(list(wrong.values()))
            judge, wrong = judge_rows(
                choose_rows(any_wrong, MOST_POSITIONS_OF_FRICTION)
            )
        differing = [column for column, rows in wrong.items() if rows.any()]
        if not differing:
            return None
        found = explain(judge, differing)
    except FourBarError:
        return None
    return _say_causes(found, labels)


def _say_causes(found: list[Explanation], differing: list[str]) -> list[str]:
    """Say what each mistake explains, and which quantities it leaves.

    Mistakes in columns are made together, each in the columns that it explains first.
    """
    causes = [(one.text, set(one.quantities)) for one in found if one.whole]
    columns = []
    explained: set[str] = set()
    for one in found:
        if not one.whole and not explained.issuperset(one.quantities):
            columns.append(f"{one.text}: {', '.join(one.quantities)}")
            explained.update(one.quantities)
    if columns:
        causes.append(("; ".join(columns), explained))
    causes.sort(key=lambda cause: -len(cause[1]))
    said = []
    for text, names in causes:
        rest = [name for name in differing if name not in names]
        left = f"but {', '.join(rest)} differ{'s' * (len(rest) < 2)}"
        said.append(f"{text}, {left if rest else 'all else agrees'}")
    return said


def choose_rows(wrong: Mask, most: int) -> slice:
    """Choose the rows by which mistakes are looked for, about the first wrong one."""
    latest = max(0, len(wrong) - most)
    start = min(max(0, int(np.argmax(wrong)) - most // 2), latest)
    return slice(start, start + most)


def hold_to_prediction(judge: Judge, predicted: Predicted, rows: slice, n: int) -> None:
    """Allow the predicted error at those of n positions where the law leaves no digit.

    A run fails an answer by the same prediction.
    """
    for key, column in judge.columns.items():
        exact = column.exact
        beyond = np.zeros(n, dtype=bool)
        beyond[rows] = ~(exact <= MOST_ALLOWED)
        if beyond.any() and (expected := predicted(key, beyond)) is not None:
            share = divide(TIMES_PREDICTED * expected[rows], column.size)
            column.exact = np.where(beyond[rows], share, exact)


def make_answer_table(
    answer: Answer, regular: Mask, rows: slice = slice(MOST_POSITIONS_SEARCHED)
) -> TheirTable:
    """Return a table of an engine's numbers, as if they had been read from a file.

    `regular`: positions that are looked at; beside a change point numbers are anything.
    """
    assert answer.at is not None and answer.assembled is not None
    angle = np.asarray(answer.at.angle[rows], dtype=float)
    blank = ~(answer.assembled & regular)[rows]
    exact = np.zeros(len(angle))
    place = TheirColumn(angle, exact, exact, Unit("rad", 1.0))
    columns = {}
    for name, numbers in answer.quantities.items():
        # quantities by which no mistake is looked for: under friction the condition
        # follows the forces
        if name in UNITS and name not in {*NOT_JUDGED, "drive_condition"}:
            values = np.array(numbers[rows], dtype=float)
            values[blank] = np.nan
            columns[name] = TheirColumn(values, exact, exact, Unit(UNITS[name], 1.0))
    lines = list(range(1, len(angle) + 1))
    return TheirTable(place, columns, lines, {})
