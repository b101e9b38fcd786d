"""What every form of the report says, computed once from the pages."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from heapq import nlargest
from statistics import median

from validation.machine import machine, versions
from validation.page import Page
from validation.published.command import LadderRow
from validation.results import FAILS, REFUSES, VERDICTS, Row
from validation.tolerance import EPS, EQUIVALENCE, IDENTITY, NOTHING_TO_TELL, SIMULATED, K, Tolerance


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
    scenes: int
    counts: dict[str, int]
    versions: dict[str, str]
    machine: str
    worst: list[Worst]
    failures: list[Row]
    refusals: list[tuple[str, str, int]]
    """(engine, reason, number of scenes): declared limits that were met."""
    measured_k: dict[str, float]
    """Largest error*condition/eps of each exact engine: what K would have sufficed."""
    independence: list[tuple[str, str, str]]
    """(engine, shared with the formulas, found alone)."""
    costs: list[Cost]
    orders: list[tuple[str, dict[str, float]]]
    """(scene, errors at 4h and 2h and observed order) of the simulated engine."""
    ladder: list[LadderRow]
    """The thesis's errors one by one, from the right answer to the printed ones; empty where not asked for."""
    tolerances: list[Tolerance]
    """What the witnesses were held to."""
    missing: list[tuple[str, str]]
    """(engine, why it could not be asked here)."""
    pages: list[Page]
    """The scenes shown one by one: those that fail first, at most SCENES_SHOWN."""


SCENES_SHOWN = 200
KEPT = 1000
"""Rows listed at the most; all of them are in results.csv."""
TIMED = 1000
TOLERANCES = (IDENTITY, EQUIVALENCE, SIMULATED)
"""Of a run with the standing witnesses."""
STATEMENT = (
    f"K = {K:g} for every exact comparison; where eps/condition > {NOTHING_TO_TELL:g} the row says that nothing can be "
    "told. Errors are relative to the largest magnitude over the positions whose condition is at least 0.1; below that "
    "to the position's own magnitude; angles modulo 2 pi, in rad."
)


def summarise(
    pages: Iterable[Page],
    ladder: Sequence[LadderRow] = (),
    tolerances: Sequence[Tolerance] = TOLERANCES,
    missing: Sequence[tuple[str, str]] = (),
) -> Summary:
    """Condense a run in one pass; what is kept does not grow with the number of scenes."""
    counts: Counter[str] = Counter()
    failures: list[Row] = []
    refusals: Counter[tuple[str, str]] = Counter()
    worst: list[Worst] = []
    measured_k: dict[str, float] = {}
    independence: dict[str, tuple[str, str]] = {}
    costs: dict[tuple[str, str], list[tuple[float, float]]] = {}
    failing: list[Page] = []
    holding: list[Page] = []
    scenes = 0
    for page in pages:
        scenes += 1
        counts.update(row.verdict for row in page.rows)
        bad = [row for row in page.rows if row.verdict == FAILS]
        failures += bad[: KEPT - len(failures)]
        refusals.update(_left_out(page))
        worst += _worst(page.rows)
        if len(worst) > 2 * KEPT:
            worst = _sorted(nlargest(KEPT, worst, key=lambda w: w.used))
        _measure_k(page.rows, measured_k)
        independence.update(page.independence)
        _add_costs(page, costs)
        keep = failing if bad else holding
        if len(keep) < SCENES_SHOWN:
            keep.append(page)
    total, failed = sum(counts.values()), counts[FAILS]
    many = f"{scenes} scene{'s' if scenes != 1 else ''}"
    if failed:
        verdict = f"FAILS: {failed} of {total} comparisons on {many} do not hold"
    else:
        verdict = f"All {total} comparisons on {many} hold"
    if missing:
        verdict += f"; not asked: {', '.join(engine for engine, _ in missing)}"
    shown = sorted([*failing, *holding[: SCENES_SHOWN - len(failing)]], key=lambda page: page.name)
    return Summary(
        verdict=verdict,
        scenes=scenes,
        counts={name: counts[name] for name in VERDICTS},
        versions=versions(),
        machine=machine(),
        worst=_sorted(nlargest(KEPT, worst, key=lambda w: w.used)),
        failures=failures,
        refusals=[(engine, reason, count) for (engine, reason), count in sorted(refusals.items())],
        measured_k=measured_k,
        independence=[(engine, *independence[engine]) for engine in sorted(independence)],
        costs=[
            Cost(engine, setting, median(r for r, _ in values), median(m for _, m in values))
            for (engine, setting), values in sorted(costs.items())
        ],
        orders=[
            (page.name, evidence)
            for page in shown
            for evidence in page.evidence.values()
            if "observed_order" in evidence
        ],
        ladder=list(ladder),
        tolerances=list(tolerances),
        missing=list(missing),
        pages=shown,
    )


def _left_out(page: Page) -> set[tuple[str, str]]:
    """What was not asked, or refused to answer: (engine, reason)."""
    told = {(row.engine, row.reason) for row in page.rows if row.verdict == REFUSES}
    for line in page.left_out:
        engine, _, reason = line.partition(": ")
        told.add((engine, reason))
    return told


def used(row: Row) -> float:
    """error/allowed; infinite for a row without an answer, 0 for one that allows nothing and errs by nothing."""
    if math.isnan(row.error):
        return 0.0 if row.passed else math.inf
    if row.allowed == 0.0:
        return 0.0 if row.error == 0.0 else math.inf
    return row.error / row.allowed


def _worst(rows: Sequence[Row]) -> list[Worst]:
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.verdict != REFUSES:
            groups.setdefault((row.engine, row.setting), []).append(row)
    return [Worst(max(group, key=used), len(group), sum(not row.passed for row in group)) for group in groups.values()]


def _sorted(worst: Iterable[Worst]) -> list[Worst]:
    return sorted(worst, key=lambda w: (w.row.scene, w.row.engine, w.row.setting))


def _measure_k(rows: Sequence[Row], largest: dict[str, float]) -> None:
    for row in rows:
        if row.reason.startswith(EQUIVALENCE.name) and math.isfinite(row.error):
            largest[row.engine] = max(largest.get(row.engine, 0.0), row.error * row.condition / EPS)


def _add_costs(page: Page, costs: dict[tuple[str, str], list[tuple[float, float]]]) -> None:
    formulas = page.timings[0].seconds if page.timings else math.nan
    refused = {row.engine for row in page.rows if row.verdict == REFUSES}
    for t in page.timings:
        kept = costs.setdefault((t.engine, t.setting), [])
        if t.engine not in refused and len(kept) < TIMED:
            kept.append((t.seconds / formulas, 1e6 * t.seconds / t.positions))
    for key in [key for key, values in costs.items() if not values]:
        del costs[key]
