"""What every form of the report says, computed once from the records."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from validation.judge import Record
from validation.machine import machine, versions
from validation.results import FAILS, REFUSES, VERDICTS, Row
from validation.tolerance import EPS, EQUIVALENCE, IDENTITY, NOTHING_TO_TELL, SIMULATED, K


@dataclass(frozen=True, slots=True)
class Worst:
    """The row of one scene and engine that comes nearest to, or goes furthest beyond, its allowance."""

    row: Row
    rows: int
    failed: int

    @property
    def used(self) -> float:
        """error/allowed of the worst row."""
        return used(self.row)


@dataclass(frozen=True, slots=True)
class Cost:
    """Time of one engine, as a ratio to the formulas on the same scene in the same process."""

    engine: str
    setting: str
    times_formulas: float
    microseconds_per_position: float


@dataclass(frozen=True, slots=True)
class Summary:
    """The report in data."""

    verdict: str
    counts: dict[str, int]
    versions: dict[str, str]
    machine: str
    worst: list[Worst]
    failures: list[Row]
    refusals: list[Row]
    measured_k: dict[str, float]
    """Largest error*condition/eps of each exact engine: what K would have sufficed."""
    independence: list[tuple[str, str, str]]
    """(engine, shared with the formulas, found alone)."""
    costs: list[Cost]
    left_out: list[tuple[str, str]]
    evidence: list[tuple[str, str, dict[str, float]]]


TOLERANCES = (IDENTITY, EQUIVALENCE, SIMULATED)
STATEMENT = (
    f"K = {K:g} for every exact comparison; where eps/condition > {NOTHING_TO_TELL:g} the row says that nothing can be "
    "told. Errors are relative to the largest magnitude over the positions whose condition is at least 0.1; below that "
    "to the position's own magnitude; angles modulo 2 pi, in rad."
)


def summarise(records: Sequence[Record]) -> Summary:
    """Condense the records of a run."""
    rows = [row for record in records for row in record.rows]
    counts = Counter(row.verdict for row in rows)
    failures = [row for row in rows if row.verdict == FAILS]
    scenes = len({row.scene for row in rows})
    if failures:
        verdict = f"FAILS: {len(failures)} of {len(rows)} comparisons on {scenes} scenes do not hold"
    else:
        verdict = f"All {len(rows)} comparisons on {scenes} scenes hold"
    return Summary(
        verdict=verdict,
        counts={name: counts.get(name, 0) for name in VERDICTS},
        versions=versions(),
        machine=machine(),
        worst=_worst(rows),
        failures=failures,
        refusals=[row for row in rows if row.verdict == REFUSES],
        measured_k=_measured_k(rows),
        independence=_independence(records),
        costs=_costs(records),
        left_out=[(record.name, line) for record in records for line in record.left_out],
        evidence=[
            (record.name, answer.engine, answer.evidence)
            for record in records
            for answer in record.answers
            if answer.evidence
        ],
    )


def used(row: Row) -> float:
    """error/allowed; infinite for a row without an answer, 0 for one that allows nothing and errs by nothing."""
    if math.isnan(row.error):
        return 0.0 if row.passed else math.inf
    if row.allowed == 0.0:
        return 0.0 if row.error == 0.0 else math.inf
    return row.error / row.allowed


def _worst(rows: Sequence[Row]) -> list[Worst]:
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        if row.verdict != REFUSES:
            groups.setdefault((row.scene, row.engine, row.setting), []).append(row)
    return [
        Worst(max(group, key=used), len(group), sum(not row.passed for row in group))
        for _, group in sorted(groups.items())
    ]


def _measured_k(rows: Sequence[Row]) -> dict[str, float]:
    largest: dict[str, float] = {}
    for row in rows:
        exact = row.reason.startswith(EQUIVALENCE.name) and math.isfinite(row.error)
        if exact:
            largest[row.engine] = max(largest.get(row.engine, 0.0), row.error * row.condition / EPS)
    return largest


def _independence(records: Sequence[Record]) -> list[tuple[str, str, str]]:
    table = {
        answer.engine: (answer.engine, answer.shared, answer.own)
        for record in records
        for answer in record.answers
        if answer.own
    }
    return [table[engine] for engine in sorted(table)]


def _costs(records: Sequence[Record]) -> list[Cost]:
    groups: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for record in records:
        formulas = record.timings[0].seconds if record.timings else math.nan
        refused = {answer.engine for answer in record.answers if answer.refusal is not None}
        for t in record.timings:
            if t.engine not in refused:
                each = (t.seconds / formulas, 1e6 * t.seconds / t.positions)
                groups.setdefault((t.engine, t.setting), []).append(each)
    return [
        Cost(engine, setting, median(r for r, _ in values), median(m for _, m in values))
        for (engine, setting), values in sorted(groups.items())
    ]
