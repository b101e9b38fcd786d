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
from fourbar_validation.regression.record import About
from fourbar_validation.regression.rules import (
    ANSWERS_CHECK,
    NOTABLE,
    Weakening,
    list_weakened,
)
from fourbar_validation.regression.scenes import (
    SceneChange,
    find_renamed,
    list_changed,
    list_scene_changes,
)
from fourbar_validation.report.words import NUMBERS_IN_A_REASON

if TYPE_CHECKING:
    from pandas import DataFrame

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
_BOTH_VERDICTS = ["verdict_old", "verdict_new"]
MOST_ONE_BY_ONE = 50
"""Scenes and engines listed by name that were not run or not compared. The others are
counted.
"""


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
        lines = lines[lines.fails]
        return lines.sort_values(
            "kind", key=lambda kinds: kinds.map([*Kind].index), kind="stable"
        )

    @property
    def regressed(self) -> int:
        """Return how many rows and rules a run fails for."""
        return len(self.of(*REGRESSIONS)) + len(self.weakened)

    @property
    def counts(self) -> Counts:
        """Return the rows of the new run by verdict."""
        return _count_new_rows(self.table)

    @property
    def counterparts(self) -> Counts:
        """Return those that have a counterpart in the old one."""
        table = self.table
        return _count_new_rows(table[(table.verdict_old != "") & (table.why == "")])

    @property
    def shared(self) -> int:
        """Return how many rows stand in both runs, whatever question they answer."""
        return int((self.table[_BOTH_VERDICTS] != "").all(axis=1).sum())

    @property
    def nothing(self) -> bool:
        """Return whether no comparison of the new run has a counterpart."""
        return self.counterparts.nothing

    @property
    def strange(self) -> bool:
        """Return whether the old run has fewer than half of the new one's rows.

        Not counted are engines and scenes that the new one does not have. The old one
        is then of another suite.
        """
        missing = self.of(Kind.NOT_RUN, *WHOLE)
        return 2 * self.shared < len(self.table) - len(missing)

    @property
    def status(self) -> int:
        """Exit status: 1 on a regression, and where nothing was compared."""
        return FAILED if self.regressed or self.nothing else HOLDS

    def name_whole(self, *kinds: Kind) -> list[str]:
        """Name what is missing, not run or not compared as a whole, by its kinds."""
        counts = self.of(*kinds).why.value_counts(sort=False)
        few = counts[:MOST_ONE_BY_ONE].items()
        lines = [f"{name} ({write_count(n, 'row')})" for name, n in few]
        more = counts[MOST_ONE_BY_ONE:]
        return lines + [f"{len(more)} more ({more.sum()} rows)"] * bool(len(more))

    @property
    def gone(self) -> list[str]:
        """Name what is missing as a whole: engines, scenes, and scenes now refused."""
        return self.name_whole(*WHOLE)

    @property
    def grown(self) -> list[str]:
        """Name the rows whose allowed error grew so far that it is printed."""
        table = self.table
        both = table[_BOTH_VERDICTS].isin(COMPARED_VERDICTS).all(axis=1)
        more = table.allowed_new > NOTABLE * table.allowed_old
        rows = table[both & (table.why == "") & (table.allowed_old > 0.0) & more]
        return [
            f"{row.scene} / {row.engine} / {row.quantity}:"
            f" {row.allowed_old:.1e} -> {row.allowed_new:.1e}"
            for row in rows.itertuples()
        ]

    def list_groups(self, kind: Kind) -> list[str]:
        """Write the rows of a kind by engine and cause, the worst groups first."""
        lines = self.of(kind)
        asked = self.table[self.table.kind != Kind.NOT_RUN]
        scenes = asked.groupby("engine").scene.nunique()
        same = lines.cause.str.replace(NUMBERS_IN_A_REASON, "#", regex=True)
        texts = []
        for (engine, _), some in lines.groupby(["engine", same], sort=False):
            counts = Counter(some.quantity.sort_values())
            names = [
                f"{name} {n}".removesuffix(" 1") for name, n in counts.most_common(6)
            ]
            names += ["..."] * (len(counts) > 6)
            cause = some.cause.iloc[0]
            texts.append(
                f"{engine}, {some.scene.nunique()} of {scenes[engine]} scenes,"
                f" {write_count(len(some), 'row')} ({', '.join(names)})"
                + f", {cause}"
                * bool(cause)
            )
        return texts

    @property
    def sentences(self) -> list[str]:
        """Say who disagrees, and in how many scenes; the most frequent first."""
        lines = self.table
        # an engine that is held to round-off sees what is wrong by more
        exact = (lines.setting == "exact") & (lines.engine != FORMULAS)
        exact &= lines[_BOTH_VERDICTS].isin(COMPARED_VERDICTS).any(axis=1)
        of_scene = lines[exact].groupby("scene").engine.agg(set)
        worse = lines[lines.kind.isin(_DISAGREEING)].groupby("scene").engine.agg(set)
        counts = Counter(
            write_fault_sentence(engines, of_scene.get(scene, set()))
            for scene, engines in worse.items()
        )
        total = lines[lines.verdict_new != ""].scene.nunique()
        return [f"{text}, {n} of {total} scenes" for text, n in counts.most_common()]


def _count_new_rows(lines: "DataFrame") -> Counts:
    """Count the rows of the new run among lines."""
    counts = Counts()
    lines = lines[lines.verdict_new != ""]
    counts.add_counted(lines.groupby(["engine", "verdict_new"]).size().to_dict())
    return counts


def write_fault_sentence(worse: set[str], exact: set[str]) -> str:
    """Say which engine is at fault in a scene.

    The rows of `worse` regressed; `exact`: engines held to round-off.
    """
    engines = worse - {FORMULAS}
    identity = FORMULAS in worse
    if not engines:
        return "only the identities: the formulas, or what is stated of them"
    if len(exact) < 2 or not engines >= exact:
        return f"only {', '.join(sorted(engines))}" + " and an identity" * identity
    if identity:
        return "all engines and the identity disagree: the formulas"
    return (
        "all engines disagree, and the identities hold: the formulas, or what all"
        " engines are given"
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
    pairs, notes = _pair_engines(old, new)
    before, after = old[0], new[0]
    names = find_renamed(before.scenes, after.scenes)
    notes += [f"renamed: {first} -> {then}" for first, then in names.items()]
    changed = list_scene_changes(before.scenes, after.scenes)
    runs = [old[1].replace({"engine": pairs, "scene": names}), new[1]]
    for column, wanted in chosen.items():
        now = {pairs.get(name, names.get(name, name)) for name in wanted}
        runs = [rows[rows[column].isin(now)] for rows in runs]
    table = _join_runs(*map(_keep_worst, runs))
    _classify_rows(table, changed, before, after)
    rules = {pairs.get(name, name): rule for name, rule in before.rules.items()}
    weakened = list_weakened(rules, after.rules)
    surroundings = _list_surroundings(before, after)
    differences = Differences(table, surroundings, changed, weakened, notes)
    suites = [
        about.settings.get("suite", "not recorded")[:12] for about in (before, after)
    ]
    if suites[0] != suites[1] and not (before.scenes or after.scenes):
        notes += [
            f"{differences.counterparts.total} of {len(table)} rows are compared:"
            " the others are of one run alone",
            f"the scenes' hash is another ({suites[0]} -> {suites[1]}), and neither run"
            " says what they ask: a scene that changed cannot be named, rows are"
            " compared by name alone",
        ]
    return differences


def _pair_engines(
    old: tuple[About, "DataFrame"],
    new: tuple[About, "DataFrame"],
) -> tuple[dict[str, str], list[str]]:
    """Pair the engines that have other names in the two runs, and say so.

    A version pairs with the same version, else with one of the same name, several in
    their order. The only guest that is gone pairs with the only one that is new if both
    answer the same quantities.
    """
    names = [_list_recorded(run) for run in (old, new)]
    gone = [name for name in names[0] if name not in names[1]]
    added = [name for name in names[1] if name not in names[0]]
    pairs: dict[str, str] = {}
    for parts in (2, 1):  # name and version, then the name alone
        for name in [name for name in gone if name not in pairs]:
            described = _name_version(old[0], name)[:parts]
            for other in added:
                if _name_version(new[0], other)[:parts] == described:
                    pairs[name] = other
                    added.remove(other)
                    break
    notes = [f"versions compared as one: {a} -> {b}" for a, b in pairs.items()]
    lost = [name for name in old[0].guests if name in gone and name not in pairs]
    found = [name for name in new[0].guests if name in added]
    if len(lost) == len(found) == 1:
        answers = old[0].rules.get(lost[0], {}).get(ANSWERS_CHECK)
        theirs = new[0].rules.get(found[0], {}).get(ANSWERS_CHECK)
        if answers is not None and answers == theirs:
            pairs[lost[0]] = found[0]
            notes.append(
                f"guests compared as one: {lost[0]} is gone, {found[0]} is new, and"
                " both answer the same quantities"
            )
    return pairs, notes


def _list_recorded(run: tuple[About, "DataFrame"]) -> list[str]:
    """List the engines of a run in the order of its record."""
    about, rows = run
    names = dict.fromkeys([*about.engines, *rows.engine.unique()])
    return [name for name in names if name != FORMULAS]


def _name_version(about: About, engine: str) -> tuple[str, str]:
    """Return name and version of an engine of a run."""
    version = about.versions.get(engine, "")
    return engine.removesuffix(f" {version}"), version


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
    first, then = (
        keys.loc[(keys.runs == run) & (keys.setting != "-"), KEY].drop_duplicates(
            WITHOUT_SETTING, keep=False
        )
        for run in ("left_only", "right_only")
    )
    moved = first.merge(then, on=WITHOUT_SETTING, suffixes=("_old", "_new"))
    new = new.merge(moved.assign(setting=moved.setting_new), how="left", on=KEY)
    new["setting"] = new.pop("setting_old").fillna(new.setting)
    table = old.merge(new, how="outer", on=KEY, suffixes=("_old", "_new"))
    texts = ["verdict_old", "verdict_new", "reason_old", "reason_new", "setting_new"]
    table[texts] = table[texts].fillna("")
    return table.sort_values(KEY, ignore_index=True)


def _classify_rows(
    table: "DataFrame",
    changed: list[SceneChange],
    before: About,
    after: About,
) -> None:
    """Add the kind of change of each line, its cause and its severity.

    Added too is `why` two rows are not compared, or what is missing with them.
    """
    in_old = table.verdict_old != ""
    in_new = table.verdict_new != ""
    fails = table.verdict_new == FAILS
    old, new = table.error_old, table.error_new
    moved = table.scene + " / " + table.engine + ": " + table.setting
    moved = (moved + " -> " + table.setting_new).where(table.setting_new != "", "")
    ways = ("changed", "has other positions")
    whys = {one.scene: f"scene {one.scene} {ways[one.moved]}" for one in changed}
    both = zip(table.scene, moved, strict=True)
    table["why"] = [whys.get(scene, move) for scene, move in both]
    conditions = table[["condition_old", "condition_new"]]
    condition = conditions.where(conditions > 0.0).min(axis=1).fillna(1.0)
    table["round_off"] = (FREE_ROUND_OFFS * EPS / condition).where(in_old & in_new)
    pairs = table.set_index(["scene", "engine"]).index
    refused = (table.quantity == "all") & (table.verdict_new == REFUSES) & ~in_old
    refused = pairs.isin(pairs[refused]) & pairs.isin(pairs[in_old])
    rank = ["", *VERDICTS].index
    old_rank, new_rank = (table[name].map(rank).astype(int) for name in _BOTH_VERDICTS)
    worse = new_rank - old_rank
    alike = ~table.verdict_new.isin(COMPARED_VERDICTS) | (old == new)
    alike |= (old.isna() & new.isna()) | ((new - old).abs() <= table.round_off)
    larger = (new > _NOTICEABLE * old) | new.isna()
    within = table.verdict_new.isin(HOLDING_VERDICTS)
    within &= new <= _NOTICEABLE * table.allowed_old
    same = np.where(fails, Kind.STILL_FAILS, Kind.SAME)
    choices = [
        (refused & (in_old != in_new), Kind.REFUSED),
        (~in_new, _classify_missing(table, before, after)),
        (~in_old & fails, Kind.NEW_FAILURE),
        (~in_old, Kind.NEW),
        ((table.why != "") & fails & (worse > 0), Kind.NEW_FAILURE),
        (table.why != "", Kind.NOT_COMPARED),
        (worse > 0, Kind.VERDICT_WORSE),
        (worse < 0, Kind.VERDICT_BETTER),
        (alike, same),
        (larger & within, Kind.GREW),
        (larger, Kind.WORSE),
        (old > _NOTICEABLE * new, Kind.BETTER),
    ]
    conditions_of, kinds = zip(*choices, strict=True)
    table["kind"] = np.select(conditions_of, kinds, same)
    # reasons that say what is allowed, and not what went wrong
    causes = tuple(bound.cause for bound in (EQUIVALENCE, IDENTITY, SIMULATED))
    of_rule = table.reason_new.str.startswith(causes)
    table["reason_new"] = table.reason_new.mask(of_rule, "held to " + table.reason_new)
    came = (table.verdict_old + " -> ").where(in_old & (worse != 0), "")
    caused = [Kind.VERDICT_WORSE, Kind.VERDICT_BETTER]
    caused += [Kind.NEW_FAILURE, Kind.STILL_FAILS]
    cause = came + table.verdict_new + ": " + table.reason_new
    table["cause"] = cause.where(table.kind.isin(caused), "")
    table["fails"] = fails
    table["since"] = ""
    scenes = "scene " + table.scene
    told = {
        Kind.ENGINE_GONE: "engine " + table.engine + " is gone",
        Kind.SCENE_GONE: scenes + " is gone",
        Kind.REFUSED: scenes + " is newly refused by " + table.engine,
        Kind.NOT_RUN: table.engine.where(table.scene.isin(table.scene[in_new]), scenes),
    }
    of_kinds = [table.kind == kind for kind in told]
    table["why"] = np.select(of_kinds, [*told.values()], table.why)
    growth = new / np.fmax(old, table.round_off)
    table["grown"] = growth.where(in_old & in_new, 1.0)


def _classify_missing(table: "DataFrame", before: About, after: About) -> Any:
    """Return the kind of each line if only the old run has it."""
    of_new = table[table.verdict_new != ""]
    scenes = set(after.scenes or of_new.scene)
    engines = {FORMULAS, *of_new.engine, *after.engines}
    mended = (table.verdict_old == FAILS) & table.quantity.isin(WHOLE_ENGINE)
    suite = after.settings.get("scenes of")
    same_suite = suite and suite == before.settings.get("scenes of")
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


def _list_surroundings(old: About, new: About) -> list[tuple[str, str, str]]:
    """List what the runs were made with if it differs: what, old and new."""
    before, after = (
        {"commit": about.commit, **about.versions, "machine": about.machine}
        | about.settings
        for about in (old, new)
    )
    # what was asked for is no surrounding
    left_out = ("suite", "scenes of", "chosen", "guests")
    changed = list_changed(before, after, "not recorded")
    return [entry for entry in changed if entry[0] not in left_out]
