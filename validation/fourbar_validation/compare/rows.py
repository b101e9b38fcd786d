"""The flat sorted table that joins run and report.

A row is of one scene, engine, setting and quantity.
"""

import csv
import io
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from fourbar.errors import FAILED, HOLDS, LimitError, write_count
from fourbar.quantities import Array
from fourbar.writing import write_text
from fourbar_validation.compare.answer import EngineError
from fourbar_validation.compare.tolerance import Mask, find_used

AGREES, DEGRADED, UNDECIDED, REFUSES, FAILS = (
    "agrees",
    "degraded as predicted",
    "undecided",
    "refuses",
    "fails",
)
VERDICTS = (AGREES, DEGRADED, UNDECIDED, REFUSES, FAILS)
"""Verdicts from the best to the worst."""
HOLDING_VERDICTS = (AGREES, DEGRADED)
COMPARED_VERDICTS = (*HOLDING_VERDICTS, FAILS)
"""Verdicts of comparisons that took place. In the others no digit is left to decide by,
the engine declared a limit, or the formulas state no value.
"""

FORMULAS = "formulas"
"""Engine of the rows that no engine answers: identities of the formulas."""
LONGEST_REASON = 500
"""Characters of what somebody else's code gives as a reason."""
QUOTED = "; it said: "
"""Words of a reason before what an engine said, by which reasons do not differ."""


@dataclass(frozen=True, slots=True, order=True)
class Row:
    """One comparison at the position where error/allowed is worst.

    >>> who = ("press", "free-body", "exact")
    >>> errors = np.array([2e-16, 8e-15])
    >>> row = Row.judged(who, "torque", errors, 1e-14, "rounding", np.array([0.0, 0.1]))
    >>> row.verdict, row.error, row.theta_2
    ('agrees', 8e-15, 0.1)
    >>> Row.judged(who, "torque", math.nan, 1e-14, "rounding").verdict
    'fails'
    """

    scene: str
    engine: str
    setting: str
    quantity: str
    error: float
    """Error relative to the scale of the quantity (angles: rad). NaN if there is no
    answer.
    """
    allowed: float
    passed: bool = field(init=False)
    """True if it was compared and holds; the verdict decides."""
    verdict: str
    reason: str
    theta_2: float
    condition: float

    def __post_init__(self) -> None:
        """Raise ValueError if the verdict is unknown, or holds without a number."""
        if self.verdict not in VERDICTS or (
            self.verdict in HOLDING_VERDICTS and math.isnan(self.error)
        ):
            raise ValueError(
                f"{self.verdict!r} is no verdict on an error of {self.error!r}"
            )
        object.__setattr__(self, "passed", self.verdict in HOLDING_VERDICTS)

    @classmethod
    def unmeasured(
        cls,
        scene: str,
        engine: str,
        setting: str,
        quantity: str,
        verdict: str,
        reason: str,
    ) -> "Row":
        """Return a row with a verdict and no numbers.

        The verdict is a refusal, a breakdown, or an answer that is missing.
        """
        nan = math.nan
        return cls(
            scene,
            engine,
            setting or "-",
            quantity,
            nan,
            nan,
            verdict,
            escape_controls(reason),
            nan,
            nan,
        )

    @classmethod
    def judged(
        cls,
        who: tuple[str, str, str],
        quantity: str,
        error: Array | float,
        allowed: Array | float,
        reason: str,
        theta_2: Array | float = math.nan,
        condition: Array | float = 1.0,
        where: Mask | None = None,
    ) -> "Row":
        """Judge errors by the one rule of agreement.

        The position is that where they use most of what is allowed.

        Parameters
        ----------
        who : scene, engine and setting.
        error : each a number, or an array over the positions, (n,), as `allowed`,
            `theta_2` and `condition`; one that is no finite number fails.
        where : positions that are held to it; undecided where there are none.
        """
        errors = np.array(error, dtype=float, ndmin=1)
        if where is not None:
            errors = np.where(where, errors, 0.0)
        numbers = np.broadcast_arrays(errors, allowed, theta_2, condition)
        index = int(find_used(*numbers[:2]).argmax())
        worst, bound, place, sound = (float(each.flat[index]) for each in numbers)
        verdict = AGREES if math.isfinite(worst) and worst <= bound else FAILS
        if where is not None and not where.any():
            verdict = UNDECIDED
        why = escape_controls(reason)
        return cls(*who, quantity, worst, bound, verdict, why, place, sound)

    @property
    def compared(self) -> bool:
        """Return whether anything was compared."""
        return self.verdict in COMPARED_VERDICTS

    @property
    def failed(self) -> bool:
        """Return whether the quantity does not hold.

        An answer that was due and is missing fails too.
        """
        return self.verdict == FAILS

    @property
    def used(self) -> float:
        """Return error/allowed.

        The ratio is infinite without an answer, 0 if the error is 0 or nothing was
        compared.
        """
        if not self.compared or self.error == 0.0:
            return 0.0
        share = self.error / self.allowed if self.allowed else math.inf
        return share if math.isfinite(share) else math.inf


def make_breakdown(
    scene: str,
    engine: str,
    error: BaseException,
    setting: str = "",
) -> Row:
    """Return the row of an engine that broke down.

    An engine breaks down if it raises, takes its process with it, or never comes back.
    A declared limit that it raises is no breakdown: it refuses. A check of the formulas
    has no limit.

    `setting`: of the row; names what it broke down in, where it is no answer.
    """
    verdict = FAILS
    if isinstance(error, LimitError) and (engine != FORMULAS or not setting):
        verdict = REFUSES
        reason = str(error)
    elif isinstance(error, TimeoutError):
        reason = "the engine hung and was stopped"
    elif type(error).__name__ == "ProcessExpired":  # raised by Pebble
        reason = (
            "the engine crashed its process (exit code"
            f" {getattr(error, 'exitcode', None) or 0})"
        )
    elif isinstance(error, EngineError):
        reason = str(error)
    else:
        reason = say_error(error)
    return Row.unmeasured(scene, engine, setting, "all", verdict, reason)


def say_error(error: BaseException) -> str:
    """Say kind and message of an error, whatever its message raises."""
    try:
        message = str(error)
    except BaseException as another:
        message = f"its message raises {type(another).__name__}"
    return write_one_line(f"{type(error).__name__}: {message}")


def write_one_line(text: str) -> str:
    """Write somebody's text in one line that prints.

    The middle of a long text is left out.
    """
    line = escape_controls(" ".join(text.split()))
    if len(line) <= LONGEST_REASON:
        return line
    return f"{line[: LONGEST_REASON // 2]} ... {line[-LONGEST_REASON // 2 :]}"


def escape_controls(text: str) -> str:
    """Write every character that does not print as its escape.

    Ends of lines are kept. Characters that would steer a terminal or a reader are
    shown, not sent.
    """
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode()
        for c in text
    )


_FORMULA = ("=", "+", "-", "@")
"""Characters that a spreadsheet takes for the beginning of a formula."""


def _write_cell_text(cell: str) -> str:
    """Write a cell that stays text in a spreadsheet.

    An apostrophe stands before what begins a formula.
    """
    if cell.startswith(_FORMULA) and len(cell) > 1:
        return f"'{cell}"
    return cell


def read_cell_text(cell: str) -> str:
    """Give back what `_write_cell_text` was given."""
    if cell.startswith(tuple("'" + first for first in _FORMULA)):
        return cell[1:]
    return cell


RESULT_COLUMNS = tuple(column.name for column in fields(Row))


def sort_rows(rows: Iterable[Row]) -> list[Row]:
    """Sort rows by scene, engine, setting and quantity."""
    return sorted(
        rows,
        key=lambda row: (row.scene, row.engine, row.setting, row.quantity),
    )


def write_rows(rows: Iterable[Row]) -> str:
    """Write the table as text, sorted, floats as repr, a missing number left empty."""
    return write_csv_rows(
        RESULT_COLUMNS,
        (
            [_write_csv_cell(getattr(row, name)) for name in RESULT_COLUMNS]
            for row in sort_rows(rows)
        ),
    )


def write_csv_rows(columns: Sequence[str], rows: Iterable[Iterable[object]]) -> str:
    """Write a table as CSV.

    Floats are written as repr, None as nothing, and no text that a spreadsheet would
    calculate.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([columns] if columns else [])
    writer.writerows(
        [_write_cell_text(cell) if isinstance(cell, str) else cell for cell in row]
        for row in rows
    )
    return text.getvalue()


def _write_csv_cell(value: object) -> object:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


COLUMN_TYPES = {column.name: column.type for column in fields(Row) if column.init}
"""Columns that make a row, with their types: whether it passed follows from them."""


def write_results(rows: Iterable[Row], path: Path) -> None:
    """Write the table, all of it or nothing."""
    write_text(path, write_rows(rows))


_PLURALS = {AGREES: "agree", FAILS: "fail", REFUSES: "refuse"}
"""Verdicts of several comparisons, where they are other words than of one."""


class Counts:
    """Rows by verdict.

    What no engine answered is not compared, even if the formulas' own identities hold.
    """

    def __init__(self, rows: Iterable[Row] = ()) -> None:
        self._answers: Counter[str] = Counter()
        self._identities: Counter[str] = Counter()
        self.scenes = self.scenes_compared = 0
        self.add(rows)

    def __getitem__(self, verdict: str) -> int:
        return self._answers[verdict] + self._identities[verdict]

    def add(self, rows: Iterable[Row]) -> None:
        """Take in rows."""
        self.add_counted(Counter((row.engine, row.verdict) for row in rows))

    def add_counted(self, counts: Mapping[tuple[str, str], int]) -> None:
        """Take in rows that are counted by engine and verdict."""
        for (engine, verdict), count in counts.items():
            of = self._identities if engine == FORMULAS else self._answers
            of[verdict] += count

    def add_scene(self, rows: Iterable[Row]) -> None:
        """Take in all rows of one scene."""
        before = self.compared
        self.add(rows)
        self.scenes += 1
        self.scenes_compared += self.compared > before

    @property
    def total(self) -> int:
        """Return the number of all rows."""
        return self._answers.total() + self._identities.total()

    @property
    def compared(self) -> int:
        """Comparisons with an engine's answer that were made."""
        return sum(self._answers[verdict] for verdict in COMPARED_VERDICTS)

    @property
    def nothing(self) -> bool:
        """Return whether nothing was compared and no answer that was due is missing."""
        return not self.compared and not self[FAILS]

    @property
    def status(self) -> int:
        """Exit status: nothing compared is no success."""
        return FAILED if self[FAILS] or self.nothing else HOLDS

    @property
    def word(self) -> str:
        """Return the verdict for a cell of a table."""
        if self[FAILS]:
            return f"{self[FAILS]} fail"
        if self.nothing:
            return "nothing compared"
        return "holds"

    @property
    def headline(self) -> str:
        """Return the verdict alone, for what does not fail.

        Where nothing was compared, the text says what was done instead.
        """
        if self.nothing:
            return self.sentence()
        hold = f"All {self.compared} comparisons{self._write_where()} hold"
        if self[DEGRADED]:
            hold += f"; {self[DEGRADED]} of them with larger errors, as predicted"
        return hold

    def sentence(self) -> str:
        """Give the verdict in one sentence.

        "all hold" is stated only of what was compared.
        """
        failed = []
        if self._answers[FAILS]:
            failed.append(f"{self._answers[FAILS]} of {self.compared} comparisons")
        if wrong := self._identities[FAILS]:
            failed.append(f"{wrong} identities of the formulas")
        if failed:
            verdict = f"FAILS: {' and '.join(failed)}{self._write_where()} do not hold"
        elif self.nothing:
            verdict = f"Nothing was compared{self._write_where()}"
        else:
            verdict = f"All {self.compared} comparisons{self._write_where()} hold"
        held = self._write_worded(COMPARED_VERDICTS)
        if self.nothing and (true := self._identities[AGREES]):
            held = [f"{true} of the formulas' own identities hold"]
        apart = self._write_worded((UNDECIDED, REFUSES))
        if apart and not self.nothing:
            apart[0] = "not compared: " + apart[0]
        parts = "; ".join(", ".join(part) for part in (held, apart) if part)
        return f"{verdict}: {parts}" if parts else verdict

    def _write_where(self) -> str:
        if not self.scenes:
            return ""
        if self.nothing or self.scenes_compared == self.scenes:
            share = ""
        else:
            share = f"{self.scenes_compared} of "
        return f" on {share}{write_count(self.scenes, 'scene')}"

    def _write_worded(self, verdicts: Iterable[str]) -> list[str]:
        return [
            f"{count} {verdict if count == 1 else _PLURALS.get(verdict, verdict)}"
            for verdict in verdicts
            if (count := self._answers[verdict])
        ]


def keep_worst(rows: Iterable[Row]) -> list[Row]:
    """Keep the worst of several rows of a quantity."""
    worst: dict[tuple[str, str], Row] = {}

    def badness(row: Row) -> tuple[int, float]:
        return VERDICTS.index(row.verdict), float(find_used(row.error, row.allowed))

    for row in sorted(rows, key=badness, reverse=True):
        worst.setdefault((row.setting, row.quantity), row)
    return list(worst.values())
