"""Compare two runs as one table, a line for each scene, engine, setting, quantity."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import FAILED, HOLDS, write_count
from fourbar_validation.compare.rows import (
    COMPARED_VERDICTS,
    FAILS,
    FORMULAS,
    HOLDING_VERDICTS,
    REFUSES,
    VERDICTS,
    Counts,
)
from fourbar_validation.compare.tolerance import (
    EPS,
    EQUIVALENCE,
    IDENTITY,
    SIMULATED,
    K,
)
from fourbar_validation.regression.engines import move_engines, pair_engines
from fourbar_validation.regression.record import About
from fourbar_validation.regression.rules import (
    Weakening,
    list_grown_rows,
    list_weakened,
)
from fourbar_validation.regression.scenes import (
    SceneChange,
    find_renamed,
    list_scene_changes,
)
from fourbar_validation.report.words import NUMBERS_IN_A_REASON

if TYPE_CHECKING:
    from pandas import DataFrame, Series

FREE_ROUND_OFFS = K
"""Errors of an exact comparison move freely by this many eps/condition: another
compiler, another order of summation. A move beyond it is a change of the numbers
themselves.
"""
_NOTICEABLE = 1.25
"""An error that is not round-off has changed where it grew or shrank by this factor."""
WHOLE_ENGINE = ("all", "watch")
"""Rows of what went wrong with an engine as a whole. Once it is mended they are gone.
"""
KEY = ["scene", "engine", "setting", "quantity"]
WITHOUT_SETTING = ["scene", "engine", "quantity"]
MOST_ONE_BY_ONE = 50
"""Scenes and engines listed by name that were not run or not compared. The others are
counted.
"""
EXACT_SETTING = "exact"
"""Setting of an engine that is held to round-off, and sees what is wrong by more."""

_HELD_TO = tuple(bound.cause for bound in (EQUIVALENCE, IDENTITY, SIMULATED))
"""Beginnings of the reasons that say what is allowed, and not what went wrong."""


class Kind(StrEnum):
    """What happened to a row; the value is the heading in the report."""

    ENGINE_GONE = "gone with their engine"
    SCENE_GONE = "gone with their scene"
    REFUSED = "newly refused"
    VERDICT_WORSE = "verdict got worse"
    NEW_FAILURE = "new, and fails"
    STILL_FAILS = "fails as before"
    WORSE = "worse"
    GREW = "grew within its allowance"
    NEW = "new"
    GONE = "gone"
    VERDICT_BETTER = "verdict got better"
    BETTER = "better"
    GONE_FAILURE = "gone, and had failed"
    NOT_COMPARED = "not compared"
    NOT_RUN = "not run"
    SAME = "same"


WHOLE = (Kind.ENGINE_GONE, Kind.SCENE_GONE, Kind.REFUSED)
"""Kinds of what is missing as a whole, which is named once and not row by row."""
_DISAGREEING = (Kind.VERDICT_WORSE, Kind.NEW_FAILURE, Kind.WORSE)
REGRESSIONS = (*WHOLE, *_DISAGREEING, Kind.GONE)
_OF_ONE_RUN = (
    Kind.ENGINE_GONE,
    Kind.SCENE_GONE,
    Kind.GONE,
    Kind.NOT_RUN,
    Kind.GONE_FAILURE,
    Kind.NEW,
    Kind.NEW_FAILURE,
)


@dataclass(frozen=True, slots=True)
class Group:
    """Rows of one engine to which the same happened, for one cause."""

    kind: Kind
    worst: Any
    """The line of the table that is worst."""
    rows: int
    scenes: int
    of_scenes: int
    """Number of scenes in which the engine has rows."""
    quantities: Counter[str]

    def __str__(self) -> str:
        names = ", ".join(
            name if n == 1 else f"{name} {n}"
            for name, n in self.quantities.most_common(6)
        )
        more = ", ..." if len(self.quantities) > 6 else ""
        cause = f", {self.worst.cause}" if self.worst.cause else ""
        return (
            f"{self.worst.engine}, {self.scenes} of {self.of_scenes} scenes,"
            f" {self.rows} row{'s' * (self.rows > 1)} ({names}{more}){cause}"
        )


@dataclass(slots=True)
class Differences:
    """Everything that differs between two runs."""

    table: "DataFrame"
    """A line for each row of either run, in the order of KEY: the columns of both runs,
    the kind of change, `round_off`, the change of the error that has no meaning, and
    `since`, the accepted run since which it fails.
    """
    surroundings: list[tuple[str, str, str]]
    """(what, old, new) of versions, machine and settings."""
    scenes: list[SceneChange]
    """Scenes that ask something else."""
    weakened: list[Weakening]
    """Rules that are weaker than they were; reported first, and a regression."""
    notes: list[str]
    """Engines and scenes of another name, and what neither record says."""
    baseline: str = ""
    """The old run in words: where it lies, of which date and commit."""
    picture: str = ""
    """Error of the first row that fails, over the accepted runs, as SVG."""
    caption: str = ""

    def of(self, *kinds: Kind) -> "DataFrame":
        """Return the lines of some kinds, the worst first."""
        lines = self.table[self.table.kind.isin(kinds)]
        return lines.sort_values(
            ["fails", "grown"], ascending=False, kind="stable", na_position="first"
        )

    @property
    def failing(self) -> "DataFrame":
        """Return the lines of rows that fail, in the order in which they are shown."""
        lines = self.of(*REGRESSIONS, Kind.STILL_FAILS)
        order = [*Kind]
        shown = lines.kind.map(order.index).sort_values(kind="stable").index
        lines = lines.loc[shown]
        return lines[lines.fails]

    @property
    def kinds(self) -> Counter[Kind]:
        """Return how many rows there are of each kind."""
        counts = self.table.kind.value_counts()
        return Counter({kind: int(counts.get(kind, 0)) for kind in Kind})

    @property
    def rows(self) -> int:
        """Return how many rows there are."""
        return len(self.table)

    @property
    def regressed(self) -> int:
        """Return how many rows and rules a run fails for."""
        return len(self.of(*REGRESSIONS)) + len(self.weakened)

    @property
    def counts(self) -> Counts:
        """Return the rows of the new run by verdict."""
        return _count_new_rows(self.table[self.table.verdict_new != ""])

    @property
    def shared(self) -> int:
        """Return how many rows stand in both runs, whatever question they answer."""
        return len(self.table[~self.table.kind.isin(_OF_ONE_RUN)])

    @property
    def _counterparts(self) -> Counts:
        answered = (self.table.verdict_old != "") & (self.table.verdict_new != "")
        return _count_new_rows(self.table[answered & (self.table.why == "")])

    @property
    def compared(self) -> int:
        """Return how many rows of the new run have a counterpart in the old one."""
        return self._counterparts.total

    @property
    def nothing(self) -> bool:
        """Return whether no comparison of the new run has a counterpart."""
        return self._counterparts.nothing

    @property
    def strange(self) -> bool:
        """Return whether the old run has fewer than half of the new one's rows.

        Not counted are engines and scenes that the new one does not have. The old one
        is then of another suite.
        """
        missing = (Kind.NOT_RUN, Kind.ENGINE_GONE, Kind.SCENE_GONE)
        return 2 * self.shared < self.rows - len(self.of(*missing))

    @property
    def status(self) -> int:
        """Exit status: 1 on a regression, and where nothing was compared."""
        return FAILED if self.regressed or self.nothing else HOLDS

    @property
    def gone(self) -> list[str]:
        """Name what is missing as a whole: engines, scenes, and scenes now refused."""
        return self.name_whole(*WHOLE)

    @property
    def left_out(self) -> list[str]:
        """Name the engines and scenes that the new run does not have."""
        return self.name_whole(Kind.ENGINE_GONE, Kind.SCENE_GONE)

    def name_whole(self, *kinds: Kind) -> list[str]:
        """Name what is missing as a whole, by the kinds of WHOLE."""
        lines = self.of(*kinds)
        names = np.select(
            [lines.kind == Kind.ENGINE_GONE, lines.kind == Kind.SCENE_GONE],
            [
                "engine " + lines.engine + " is gone",
                "scene " + lines.scene + " is gone",
            ],
            "scene " + lines.scene + " is newly refused by " + lines.engine,
        )
        return _name(lines.assign(name=names)["name"])

    @property
    def not_run(self) -> list[str]:
        """Name the scenes and engines that the new run was not asked for."""
        lines = self.of(Kind.NOT_RUN)
        run = lines.scene.isin(self.table[self.table.verdict_new != ""].scene)
        scenes = "scene " + lines.scene[~run]
        return [*_name(scenes), *_name(lines.engine[run])]

    @property
    def not_compared(self) -> list[str]:
        """Name the scenes and settings of rows that answer different questions."""
        return _name(self.of(Kind.NOT_COMPARED).why)

    @property
    def grown(self) -> list[str]:
        """Name the rows whose allowed error grew by a factor above NOTABLE."""
        return list_grown_rows(self.table)

    def groups(self, kinds: Iterable[Kind]) -> list[Group]:
        """Return the rows of some kinds by engine and cause, the worst groups first."""
        lines = self.of(*kinds)
        in_scenes = (
            self.table[self.table.kind != Kind.NOT_RUN]
            .groupby("engine")
            .scene.nunique()
        )
        same = lines.cause.str.replace(NUMBERS_IN_A_REASON, "#", regex=True)
        groups = [
            Group(
                Kind(some.kind.iloc[0]),
                next(some.itertuples()),
                len(some),
                some.scene.nunique(),
                int(in_scenes.get(engine, 0)),
                Counter(some.sort_values("quantity").quantity),
            )
            for (engine, _, _), some in lines.groupby(
                [lines.engine, lines.kind, same], sort=False
            )
        ]
        order = list(Kind)
        return sorted(groups, key=lambda group: order.index(group.kind))

    @property
    def sentences(self) -> list[str]:
        """Say who disagrees, and in how many scenes; the most frequent first."""
        lines = self.table
        exact = (lines.setting == EXACT_SETTING) & (lines.engine != FORMULAS)
        exact &= lines.verdict_old.isin(COMPARED_VERDICTS) | lines.verdict_new.isin(
            COMPARED_VERDICTS
        )
        worse = lines[lines.kind.isin(_DISAGREEING)].groupby("scene").engine.agg(set)
        of_scene = lines[exact].groupby("scene").engine.agg(set)
        counts = Counter(
            write_fault_sentence(engines, of_scene.get(scene, set()))
            for scene, engines in worse.items()
        )
        total = lines[lines.verdict_new != ""].scene.nunique()
        return [f"{text}, {n} of {total} scenes" for text, n in counts.most_common()]


def _count_new_rows(lines: "DataFrame") -> Counts:
    """Count the rows of the new run among lines."""
    counts = Counts()
    counts.add_counted(lines.groupby(["engine", "verdict_new"]).size().to_dict())
    return counts


def _name(names: "Series[str]") -> list[str]:
    """Count rows by name; of more than MOST_ONE_BY_ONE names the others are one."""
    counts = names.value_counts(sort=False)
    lines = [
        f"{name} ({write_count(n, 'row')})"
        for name, n in counts[:MOST_ONE_BY_ONE].items()
    ]
    more = counts[MOST_ONE_BY_ONE:]
    return lines + [f"{len(more)} more ({more.sum()} rows)"] * bool(len(more))


def write_fault_sentence(worse: set[str], exact: set[str]) -> str:
    """Say which engine is at fault in a scene.

    The rows of `worse` regressed; `exact`: engines held to round-off.
    """
    engines = worse - {FORMULAS}
    if len(exact) > 1 and engines >= exact:
        if FORMULAS in worse:
            return "all engines and the identity disagree: the formulas"
        return (
            "all engines disagree, and the identities hold: the formulas, or what all"
            " engines are given"
        )
    if not engines:
        return "only the identities: the formulas, or what is stated of them"
    return f"only {', '.join(sorted(engines))}" + (
        " and an identity" if FORMULAS in worse else ""
    )


def compare_runs(
    old: tuple[About, "DataFrame"],
    new: tuple[About, "DataFrame"],
    chosen: Mapping[str, Iterable[str]] = MappingProxyType({}),
) -> Differences:
    """Compare two runs, each by its record and the table of its rows.

    Rows are compared only if both answer the same question.

    `chosen`: names, of either run, by the column that rows are chosen by.
    """
    pairs, notes = pair_engines(old, new)
    before = move_engines(old[0], pairs)
    after = new[0]
    names = find_renamed(before.scenes, after.scenes)
    notes += [f"renamed: {first} -> {then}" for first, then in names.items()]
    changed = list_scene_changes(before.scenes, after.scenes)
    rows = old[1].replace({"engine": pairs, "scene": names}), new[1]
    for column, wanted in chosen.items():
        now = {pairs.get(name, names.get(name, name)) for name in wanted}
        rows = rows[0][rows[0][column].isin(now)], rows[1][rows[1][column].isin(now)]
    table = _join_runs(*map(_keep_worst, rows))
    table = _classify_rows(table, changed, before, after)
    weakened = list_weakened(before.rules, after.rules)
    surroundings = _list_surroundings(before, after)
    differences = Differences(table, surroundings, changed, weakened, notes)
    suites = [
        about.settings.get("suite", "not recorded")[:12] for about in (old[0], after)
    ]
    if suites[0] != suites[1] and not (before.scenes or after.scenes):
        notes += [
            f"{differences.compared} of {differences.rows} rows are compared: the"
            " others are of one run alone",
            f"the scenes' hash is another ({suites[0]} -> {suites[1]}), and neither run"
            " says what they ask: a scene that changed cannot be named, rows are"
            " compared by name alone",
        ]
    return differences


def _keep_worst(rows: "DataFrame") -> "DataFrame":
    """Keep the worse of two rows of one name."""
    by_verdict = rows.sort_values(
        "verdict", key=lambda verdict: verdict.map(VERDICTS.index), kind="stable"
    )
    return by_verdict.drop_duplicates(KEY, keep="last")


def _join_runs(old: "DataFrame", new: "DataFrame") -> "DataFrame":
    """Join the rows of both runs by KEY.

    Rows that each run has with a single setting of its own are one line, with the new
    setting as `setting_new`.
    """
    keys = old[KEY].merge(new[KEY], how="outer", indicator="runs")
    single = {
        run: keys.loc[(keys.runs == run) & (keys.setting != "-"), KEY].drop_duplicates(
            WITHOUT_SETTING, keep=False
        )
        for run in ("left_only", "right_only")
    }
    moved = single["left_only"].merge(
        single["right_only"], on=WITHOUT_SETTING, suffixes=("_old", "_new")
    )
    new = new.merge(moved.assign(setting=moved.setting_new), how="left", on=KEY)
    new["setting"] = new.pop("setting_old").fillna(new.setting)
    table = old.merge(new, how="outer", on=KEY, suffixes=("_old", "_new"))
    texts = [
        f"{column}_{run}" for column in ("verdict", "reason") for run in ("old", "new")
    ]
    texts.append("setting_new")
    table[texts] = table[texts].fillna("")
    return table.sort_values(KEY, ignore_index=True)


def _classify_rows(
    table: "DataFrame",
    changed: list[SceneChange],
    before: About,
    after: About,
) -> "DataFrame":
    """Add `why` two rows are not compared, their kind, the cause and the severity."""
    in_old = table.verdict_old != ""
    in_new = table.verdict_new != ""
    fails = table.verdict_new == FAILS
    failed = table.verdict_old == FAILS
    why = {
        "has other positions": {one.scene for one in changed if one.positions_alone},
        "changed": {one.scene for one in changed if not one.positions_alone},
    }
    table["why"] = np.select(
        [table.scene.isin(scenes) for scenes in why.values()]
        + [table.setting_new != ""],
        [("scene " + table.scene + " " + words) for words in why]
        + [
            table.scene
            + " / "
            + table.engine
            + ": "
            + table.setting
            + " -> "
            + table.setting_new
        ],
        "",
    )
    conditions = table[["condition_old", "condition_new"]]
    table["round_off"] = (
        FREE_ROUND_OFFS
        * EPS
        / conditions.where(conditions > 0.0).min(axis=1).fillna(1.0)
    ).where(in_old & in_new)
    missing = _classify_missing(table, before, after)
    pairs = table.set_index(["scene", "engine"]).index
    refused = (table.quantity == "all") & (table.verdict_new == REFUSES) & ~in_old
    refused = pairs.isin(pairs[refused]) & pairs.isin(pairs[in_old])
    rank_old, rank_new = (
        table[column].map({verdict: rank for rank, verdict in enumerate(VERDICTS)})
        for column in ("verdict_old", "verdict_new")
    )
    old, new = table.error_old, table.error_new
    alike = ~table.verdict_new.isin(COMPARED_VERDICTS) | (old == new)
    alike |= (old.isna() & new.isna()) | ((new - old).abs() <= table.round_off)
    larger = (new > _NOTICEABLE * old) | new.isna()
    within = table.verdict_new.isin(HOLDING_VERDICTS)
    within &= new <= _NOTICEABLE * table.allowed_old
    same = np.where(fails, Kind.STILL_FAILS, Kind.SAME)
    choices = [
        (refused & (in_old != in_new), Kind.REFUSED),
        (~in_new, missing),
        (~in_old & fails, Kind.NEW_FAILURE),
        (~in_old, Kind.NEW),
        ((table.why != "") & fails & ~failed, Kind.NEW_FAILURE),
        (table.why != "", Kind.NOT_COMPARED),
        (rank_new > rank_old, Kind.VERDICT_WORSE),
        (rank_new < rank_old, Kind.VERDICT_BETTER),
        (alike, same),
        (larger & within, Kind.GREW),
        (larger, Kind.WORSE),
        (old > _NOTICEABLE * new, Kind.BETTER),
    ]
    conditions_of, kinds = zip(*choices, strict=True)
    table["kind"] = np.select(conditions_of, kinds, same)
    other = in_old & (table.verdict_old != table.verdict_new)
    came = (table.verdict_old + " -> ").where(other, "")
    told = (Kind.VERDICT_WORSE, Kind.VERDICT_BETTER, Kind.NEW_FAILURE, Kind.STILL_FAILS)
    of_rule = table.reason_new.str.startswith(_HELD_TO)
    table["reason_new"] = table.reason_new.mask(of_rule, "held to " + table.reason_new)
    table["cause"] = (came + table.verdict_new + ": " + table.reason_new).where(
        table.kind.isin(told), ""
    )
    table["fails"] = fails
    table["since"] = ""
    floor = np.fmax(old, table.round_off)
    table["grown"] = (new / floor).where(in_old & in_new, 1.0)
    return table


def _classify_missing(
    table: "DataFrame",
    before: About,
    after: About,
) -> np.ndarray[Any, Any]:
    """Return the kind of each line if only the old run has it."""
    of_new = table[table.verdict_new != ""]
    scenes = set(after.scenes or of_new.scene)
    engines = {FORMULAS, *of_new.engine, *after.engines}
    mended = (table.verdict_old == FAILS) & table.quantity.isin(WHOLE_ENGINE)
    suite = after.settings.get("scenes of", "")
    same_suite = suite != "" and suite == before.settings.get("scenes of")
    left_out = ~table.engine.isin(before.guests_by_option)
    left_out &= after.settings.get("chosen") != ""
    return np.select(
        [~table.scene.isin(scenes), ~table.engine.isin(engines), mended],
        [
            Kind.SCENE_GONE if same_suite else Kind.NOT_RUN,
            np.where(left_out, Kind.NOT_RUN, Kind.ENGINE_GONE),
            Kind.GONE_FAILURE,
        ],
        Kind.GONE,
    )


_NOT_SURROUNDINGS = {"suite", "scenes of", "chosen", "guests"}
"""Settings that say what was asked for, and not with what."""


def _list_surroundings(
    old: About,
    new: About,
) -> list[tuple[str, str, str]]:
    """List what the runs were made with if it differs: what, old and new."""
    if old.commit and new.commit:
        pairs = [("commit", old.commit, new.commit)]
    else:
        pairs = []
    for before, after in (
        (old.versions, new.versions),
        ({"machine": old.machine}, {"machine": new.machine}),
        (old.settings, new.settings),
    ):
        pairs += [
            (what, before.get(what, "not recorded"), after.get(what, "not recorded"))
            for what in sorted((before.keys() | after.keys()) - _NOT_SURROUNDINGS)
        ]
    return [pair for pair in pairs if pair[1] != pair[2]]
