"""Compute once, from the scenes, what every form of the report says."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import nlargest
from operator import attrgetter, itemgetter
from statistics import median
from typing import TypeVar

import numpy as np

from fourbar.errors import HOLDS, write_count
from fourbar_validation.compare.rows import (
    DEGRADED,
    FORMULAS,
    REFUSES,
    Counts,
    Row,
)
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    IDENTITY,
    MOST_ALLOWED,
    SIMULATED,
    ErrorBound,
    K,
    find_used,
)
from fourbar_validation.engines.registry import WORK
from fourbar_validation.report.machine import list_versions, name_machine
from fourbar_validation.report.overview import Overview, OverviewLine
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.words import NUMBERS_IN_A_REASON

T = TypeVar("T")
_ALLOWANCE = attrgetter("allowed")
_USED = attrgetter("used")


@dataclass(frozen=True, slots=True)
class Worst:
    """The row of one scene and engine with the largest error/allowed.

    A failing row has a ratio beyond 1.
    """

    row: Row
    used: float
    """error/allowed of that row."""
    rows: int
    failed: int


@dataclass(slots=True)
class _EngineLine:
    """Counts of one independent engine, or of our own consistency; its worst row."""

    name: str
    version: str = ""
    counts: Counts = field(default_factory=Counts)
    worst: Row | None = None
    """The row that used most of its allowance."""
    used: float = -1.0
    """error/allowed of that row."""
    undecided: float = 0.0
    """Largest share of the numbers of a scene that are undecided."""
    microseconds: float = math.nan
    """Time per position, median over the scenes; our own is that of the formulas."""
    times_formulas: float = math.nan
    """Time over that of the formulas on the same scene, median over the scenes. Both
    are of the same process.
    """
    work: str = ""
    """Work that it did in that time."""

    def add(self, row: Row, used: float) -> None:
        """Count a row; a share of undecided numbers is no error, unless it fails."""
        self.counts.add([row])
        if row.quantity == "undecided":
            self.undecided = max(self.undecided, row.error)
        is_error = row.quantity != "undecided" or row.failed
        if row.compared and is_error and used > self.used:
            self.worst = row
            self.used = used


OWN_CONSISTENCY = "our own consistency"
SCENES_SHOWN = 200
SKETCHED = 60
"""Scenes with small pictures."""
PICTURED = 24
"""Scenes with pictures, if fewer fail. Drawing one takes ten times as long as judging
it by an exact engine.
"""
_WORST_SHOWN = 80
_LOOSEST_SHOWN = 5
_ORDERS_SHOWN = 20
_FAILURES_KEPT = 1000
"""Lines of a table at the most; everything is in results.csv."""
_TIMED = 1000
STATEMENT = (
    "Errors are relative to the largest magnitude over the positions whose condition is"
    " at least 0.1, below that to the position's own; angles modulo 2 pi, in rad."
    f" Allowed is the tolerance times max(1, N/K), K = {K:g}, N the largest sum of"
    " absolute terms over the largest magnitude. Size and N are those of the formulas"
    " or of the answer, whichever pair of error and allowed error is stricter. Where"
    f" condition and N raise it above {MOST_ALLOWED:g} and above what the engine"
    " declares, the position is undecided."
)


class Summary:
    """The report in data: a run condensed scene by scene.

    What is kept does not grow with their number.
    """

    def __init__(self) -> None:
        self.counts = Counts()
        self.overview = Overview()
        self.date = ""
        """Date on which it was made."""
        self.commit = ""
        """Commit of the harness at which it was made."""
        self.asked = ""
        """Name of the scene that was asked for; empty if there are several."""
        self.versions = list_versions()
        self.machine = name_machine()
        self.failures: list[Row] = []
        """Failures, at most _FAILURES_KEPT of them."""
        self.pairs = 0
        """Number of quantities of a scene that were compared."""
        self.loose = 0
        """Number of those that no row judges tighter than degraded."""
        self._loosest: list[Row] = []
        self.judged = 0
        """Pairs of scene and engine of which `worst` shows the worst."""
        self.measured_k: dict[str, float] = {}
        """Largest error*condition/eps of each exact engine: the K that would have
        sufficed.
        """
        self.independence: dict[str, tuple[str, str]] = {}
        """engine: (shared with the formulas, found alone)."""
        self.tolerances: Sequence[ErrorBound] = (IDENTITY, EQUIVALENCE, SIMULATED)
        """Tolerances of the engines."""
        self.stated: Mapping[str, str] = {}
        """Version that each guest states of itself, nothing where it states none."""
        self.missing: Sequence[tuple[str, str]] = ()
        """(engine, why it could not run here)."""
        self._engines: dict[str, _EngineLine] = {}
        self._refusals: Counter[tuple[str, str]] = Counter()
        self._first_reason: dict[tuple[str, str], str] = {}
        self._worst: list[Worst] = []
        self._times: dict[str, list[tuple[float, float]]] = {}
        """Microseconds per position, and the ratio to the formulas, of at most _TIMED
        scenes of each engine.
        """
        self._orders: list[tuple[str, dict[str, float]]] = []
        self._failing: list[Record] = []
        self._holding: list[tuple[float, Record]] = []

    def add(self, scene: Record) -> None:
        """Add one more scene."""
        self.counts.add_scene(scene.rows)
        self.overview.add(scene)
        bad = [row for row in scene.rows if row.failed]
        self.failures += bad[: _FAILURES_KEPT - len(self.failures)]
        for row, used in zip(scene.rows, compute_shares(scene.rows), strict=True):
            name = OWN_CONSISTENCY if row.engine == FORMULAS else row.engine
            line = self._engines.setdefault(name, _EngineLine(name))
            line.add(row, used)
        compared, loose = _count_compared(scene.rows)
        self.pairs += compared
        self.loose += len(loose)
        _keep_largest(_LOOSEST_SHOWN, self._loosest, loose, _ALLOWANCE)
        for engine, reason in sorted(_list_left_out(scene)):
            kind = (engine, NUMBERS_IN_A_REASON.sub("#", reason))
            self._refusals[kind] += 1
            self._first_reason.setdefault(kind, reason)
        worst = _find_worst_row(scene.rows)
        self.judged += len(worst)
        _keep_largest(_WORST_SHOWN, self._worst, worst, _USED)
        for row in scene.rows:
            if row.reason.startswith(EQUIVALENCE.cause) and math.isfinite(row.error):
                k = row.error * row.condition / EPS
                largest = self.measured_k.get(row.engine, 0.0)
                self.measured_k[row.engine] = max(largest, k)
        self.independence.update(scene.independence)
        self._add_times(scene)
        self._add_orders(scene)
        if bad:
            self._failing += [scene][: SCENES_SHOWN - len(self._failing)]
        else:
            most = max((w.used for w in worst), default=0.0)
            _keep_largest(SCENES_SHOWN, self._holding, [(most, scene)], itemgetter(0))

    def picture(self, drawn: Record) -> None:
        """Add what was drawn and measured of a scene that is shown."""
        for scene in self.shown:
            if scene.name == drawn.name:
                scene.figure = drawn.figure
                scene.thumbnail = drawn.thumbnail
        self._add_orders(drawn)

    def _add_times(self, scene: Record) -> None:
        refused = {row.engine for row in scene.rows if row.verdict == REFUSES}
        for timing in scene.timings:
            times = self._times.setdefault(timing.engine, [])
            if timing.engine not in refused and len(times) < _TIMED:
                microseconds = 1e6 * timing.seconds / timing.positions
                ratio = timing.seconds / scene.timings[0].seconds
                times.append((microseconds, ratio))

    def _add_orders(self, scene: Record) -> None:
        orders = [
            (scene.name, evidence)
            for evidence in scene.evidence.values()
            if "observed_order" in evidence
        ]
        _keep_largest(_ORDERS_SHOWN, self._orders, orders, _find_lowest)

    @property
    def not_run(self) -> str:
        """Return the end of the verdict that names the engines that are missing."""
        names = ", ".join(engine for engine, _ in self.missing)
        return f"; not run: {names}" * bool(names)

    @property
    def verdict(self) -> str:
        """Return the verdict of the run as one sentence."""
        return self.counts.sentence() + self.not_run

    @property
    def headline(self) -> str:
        """Say the verdict in plain words: where it is not green, whose fault it is."""
        words = self._say_first_cause()
        overview = self.overview
        against = f", against {overview.baseline}"
        for heading, lost, end in (
            ("NOT CHECKED", overview.unchecked, ""),
            ("WORSE", overview.worse, against),
            ("WEAKER RULE", overview.weaker, against),
            ("GONE", overview.gone, against),
        ):
            if lost:
                more = f", and {len(lost) - 1} more" * (len(lost) > 1)
                head = f"{heading}: {lost[0]}{more}{end}."
                words = f"{head} {words}"
        return words

    def _say_first_cause(self) -> str:
        causes = self.overview.causes
        if not causes:
            return self.counts.headline + self.not_run
        first = causes[0]
        more = len(causes) - 1
        others = f", and {write_count(more, 'more cause')}" * bool(more)
        named = "fourbar itself" if first.engine == FORMULAS else first.engine
        scenes = write_count(first.scenes, "scene")
        worst = f"worst {first.worst.quantity} of "
        worst *= not math.isnan(first.worst.error)
        since = f" {self.overview.since}".rstrip()
        what = f"{named} is wrong: {first.text}, in {scenes}; {worst}"
        return f"FAILS: {what}{first.place}{others}.{since}"

    @property
    def lines(self) -> list[OverviewLine]:
        """Return the engines of the first screen, with their names and versions."""
        versions = {name: self._find_version(name) for name in self._engines}
        return self.overview.name_lines(versions)

    def _find_version(self, engine: str) -> str:
        """Return the version to be shown with an engine; empty if its name has it."""
        versions = {name.lower(): version for name, version in self.versions.items()}
        ours = versions.get(engine.partition("-")[0], "")
        version = self.stated.get(engine, ours)
        return "" if engine.endswith(f" {version}") else version

    @property
    def loosest(self) -> str:
        """Say how many quantities no engine judges tighter than degraded.

        Examples are the rows that allow most.
        """
        if not self.loose:
            return ""
        worst = nlargest(_LOOSEST_SHOWN, self._loosest, key=_ALLOWANCE)
        examples = ", ".join(
            f"{row.quantity} of {row.scene} (allowed {row.allowed:.1e})"
            for row in worst
        )
        return (
            f"{self.loose} of {self.pairs} quantities of a scene are at best"
            f' "{DEGRADED}"; the widest: {examples}'
        )

    @property
    def good(self) -> bool:
        """Return whether everything that was to be compared holds.

        All was compared, by no weaker rule, and nothing is gone or got worse.
        """
        of = self.overview
        if of.unchecked or of.weaker or of.gone or of.worse:
            return False
        return self.counts.status == HOLDS and not self.missing

    @property
    def engines(self) -> list[_EngineLine]:
        """Return every independent engine by name, then our own consistency."""
        for line in self._engines.values():
            line.version = self._find_version(line.name)
            engine = FORMULAS if line.name == OWN_CONSISTENCY else line.name
            if times := self._times.get(engine):
                line.microseconds, line.times_formulas = map(
                    median, zip(*times, strict=True)
                )
                line.work = WORK.get(engine, "")
        return sorted(
            self._engines.values(),
            key=lambda line: (line.name == OWN_CONSISTENCY, line.name),
        )

    @property
    def worst(self) -> list[Worst]:
        """Return the worst rows by scene and engine.

        More than _WORST_SHOWN are reduced to those that used most, in that order.
        """
        if self.judged > _WORST_SHOWN:
            return nlargest(_WORST_SHOWN, self._worst, key=_USED)
        by_name = attrgetter("row.scene", "row.engine", "row.setting")
        return sorted(self._worst, key=by_name)

    @property
    def refusals(self) -> list[tuple[str, str, int]]:
        """Return (engine, reason, number of scenes) of declared limits that were met.

        Reasons that differ by their numbers alone are one, with the numbers of the
        first scene.
        """
        return [
            (kind[0], self._first_reason[kind], count)
            for kind, count in sorted(self._refusals.items())
        ]

    @property
    def orders(self) -> list[tuple[str, dict[str, float]]]:
        """Return (scene, errors at 4h and 2h and observed order) of simulations.

        At most _ORDERS_SHOWN are returned, the lowest orders first.
        """
        if len(self._orders) <= _ORDERS_SHOWN:
            return self._orders
        return nlargest(_ORDERS_SHOWN, self._orders, key=_find_lowest)

    @property
    def shown(self) -> list[Record]:
        """Return the scenes shown, by name, at most SCENES_SHOWN.

        Scenes that fail come before those that used most of what is allowed.
        """
        return sorted(self._find_most_used(SCENES_SHOWN), key=lambda scene: scene.name)

    @property
    def pictured(self) -> list[Record]:
        """Return the scenes that have pictures.

        All that fail have one, then those that used most of their allowed error.
        """
        return self._find_most_used(PICTURED)

    @property
    def sketched(self) -> list[Record]:
        """Return the scenes with small pictures.

        Scenes that fail come first, then those nearest to it.
        """
        scenes = self._find_most_used(SCENES_SHOWN)
        return [scene for scene in scenes if scene.thumbnail][:SKETCHED]

    @property
    def first(self) -> Record | None:
        """Return the scene of the large figure, None if no scene has one.

        A scene that fails goes before the first of those shown.
        """
        drawn = [scene for scene in self.shown if scene.figure]
        failing = [scene for scene in self._failing if scene.figure]
        return next(iter([*failing, *drawn]), None)

    def _find_most_used(self, most: int) -> list[Record]:
        left = most - len(self._failing)
        holding = nlargest(left, self._holding, key=itemgetter(0))
        return [*self._failing, *(scene for _, scene in holding)]


def _list_left_out(scene: Record) -> set[tuple[str, str]]:
    """List what was not run, or refused to answer: (engine, reason)."""
    left_out = (line.partition(": ") for line in scene.left_out)
    refused = {(row.engine, row.reason) for row in scene.rows if row.verdict == REFUSES}
    return refused | {(engine, reason) for engine, _, reason in left_out}


def compute_shares(rows: Sequence[Row]) -> list[float]:
    """Return error/allowed of each row.

    The ratio is infinite without an answer, 0 if the error is 0 or nothing was
    compared.
    """
    of_all = find_used(
        np.array([row.error for row in rows]), np.array([row.allowed for row in rows])
    )
    return [
        share if row.compared else 0.0
        for row, share in zip(rows, of_all.tolist(), strict=True)
    ]


def _count_compared(rows: Sequence[Row]) -> tuple[int, list[Row]]:
    """Return the number of quantities compared, and the tightest degraded rows.

    Each quantity that every row calls degraded has one such row: the one that allows
    least.
    """
    by_quantity: dict[str, list[Row]] = {}
    for row in rows:
        if row.compared:
            by_quantity.setdefault(row.quantity, []).append(row)
    loose = [
        min(of_one, key=_ALLOWANCE)
        for of_one in by_quantity.values()
        if all(row.verdict == DEGRADED for row in of_one)
    ]
    return len(by_quantity), loose


def _find_worst_row(rows: Sequence[Row]) -> list[Worst]:
    groups: dict[tuple[str, str], list[tuple[float, Row]]] = {}
    for share, row in zip(compute_shares(rows), rows, strict=True):
        if row.compared:
            groups.setdefault((row.engine, row.setting), []).append((share, row))
    worst = []
    for group in groups.values():
        share, row = max(group, key=itemgetter(0))
        failed = sum(one.failed for _, one in group)
        worst.append(Worst(row, share, len(group), failed))
    return worst


def _keep_largest(
    most: int,
    entries: list[T],
    further: Iterable[T],
    key: Callable[[T], float],
) -> None:
    """Add further entries to a list; it is cut to the largest once it is too long."""
    entries += further
    if len(entries) > 2 * most:
        entries[:] = nlargest(most, entries, key=key)


def _find_lowest(order: tuple[str, dict[str, float]]) -> float:
    return -order[1]["observed_order"]
