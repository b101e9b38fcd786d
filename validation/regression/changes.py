"""Two runs held against each other, row by row."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum

from fourbar.errors import FAILED, HOLDS
from validation.compare.counts import Counts
from validation.compare.identities import FORMULAS
from validation.compare.rows import FAILS, VERDICTS, Row
from validation.compare.tolerance import EPS, K
from validation.regression.record import About
from validation.regression.scenes import SceneChange, scene_changes
from validation.regression.times import TimeChange, Times, time_changes

ROUND_OFF = K
"""Errors of an exact comparison move freely by this many eps/condition: another compiler, another
order of summation. A move beyond it is a change of the numbers themselves."""
NOTICEABLE = 1.25
"""An error that is not round-off has changed where it grew or shrank by this factor."""


class Kind(Enum):
    """What happened to a row; the value is the heading of the report."""

    VERDICT_WORSE = "verdict got worse"
    WORSE = "worse"
    GONE = "gone"
    VERDICT_BETTER = "verdict got better"
    BETTER = "better"
    GONE_FAILURE = "gone, and had failed"
    NEW = "new"
    NEW_FAILURE = "new, and fails"
    OTHER_SCENE = "of a changed scene"
    OTHER_POSITIONS = "at other positions"
    OTHER_SETTING = "with another setting"
    NOT_RUN = "not run"
    ROUND_OFF = "moved within round-off"
    SAME = "same"


WHOLE = ("all", "watch")
"""Rows that stand for what went wrong with an engine as a whole: once it is mended they are gone."""
REGRESSIONS = frozenset((Kind.VERDICT_WORSE, Kind.WORSE, Kind.GONE, Kind.NEW_FAILURE))
OTHER_QUESTION = (Kind.OTHER_SCENE, Kind.OTHER_POSITIONS, Kind.OTHER_SETTING)
"""Rows that are not compared: each run answers a question of its own."""
Key = tuple[str, str, str, str]


@dataclass(frozen=True, slots=True)
class Change:
    """One row in the old and the new run."""

    kind: Kind
    key: Key
    old: Row | None
    new: Row | None
    round_off: float
    """By how much the error may move without meaning, K eps/condition."""

    @property
    def regression(self) -> bool:
        """Whether the run should fail for it."""
        return self.kind in REGRESSIONS


@dataclass(frozen=True, slots=True)
class Differences:
    """Everything that differs between two runs."""

    surroundings: list[tuple[str, str, str]]
    """(what, old, new) of versions, machine and settings."""
    changes: list[Change]
    scenes: list[SceneChange] = field(default_factory=list)
    """Scenes that ask something else; reported first."""
    notes: list[str] = field(default_factory=list)
    """What an older record cannot say."""
    times: list[TimeChange] = field(default_factory=list)

    def of(self, kind: Kind) -> list[Change]:
        """The changes of one kind."""
        return [change for change in self.changes if change.kind is kind]

    @property
    def regressions(self) -> list[Change]:
        """The changes for which a run fails."""
        return [change for change in self.changes if change.regression]

    @property
    def slower(self) -> list[TimeChange]:
        """Engines whose times changed by more than their scatter."""
        return [change for change in self.times if change.beyond]

    @property
    def not_run(self) -> list[str]:
        """Scenes and engines of the old run that the new one was not run for, each with its number of rows."""
        found = self.of(Kind.NOT_RUN)
        there = {change.key[0] for change in self.changes if change.new is not None}
        lines = []
        for name in dict.fromkeys(change.key[0] for change in found if change.key[0] not in there):
            lines.append(f"scene {name} ({sum(change.key[0] == name for change in found)} rows)")
        engines = [change.key[1] for change in found if change.key[0] in there]
        return lines + [f"{name} ({engines.count(name)} rows)" for name in dict.fromkeys(engines)]

    @property
    def not_compared(self) -> list[str]:
        """Rows that both runs have, each as the answer to another question: by scene, engine and setting."""
        found: Counter[str] = Counter()
        for change in self.changes:
            if change.kind in OTHER_QUESTION and change.old is not None and change.new is not None:
                what = "changed" if change.kind is Kind.OTHER_SCENE else "has other positions"
                name = f"scene {change.key[0]} {what}"
                if change.kind is Kind.OTHER_SETTING:
                    name = f"{change.key[0]} / {change.key[1]}: {change.old.setting} -> {change.new.setting}"
                found[name] += 1
        return [f"{name} ({count} rows)" for name, count in found.items()]

    @property
    def counts(self) -> Counts:
        """The rows of the new run by verdict."""
        return Counts(change.new for change in self.changes if change.new is not None)

    @property
    def nothing(self) -> bool:
        """Whether no comparison of the new run has its counterpart in the old one."""
        alike = (change for change in self.changes if change.kind not in OTHER_QUESTION)
        both = (change.new for change in alike if change.new and change.old)
        return Counts(both).nothing

    @property
    def status(self) -> int:
        """Exit status: 1 on a regression, and where nothing was compared."""
        return FAILED if self.regressions or self.nothing else HOLDS


def differences(
    old: tuple[About, Iterable[Row]], new: tuple[About, Iterable[Row]], times: tuple[Times, Times] = ({}, {})
) -> Differences:
    """Compare two runs: only where both answer the same question."""
    before, after = _by_key(old[1]), _by_key(new[1])
    scenes = {change.scene: change for change in scene_changes(old[0].scenes, new[0].scenes)}
    settings = _other_settings(before, after)
    changes = []
    for key in sorted(before.keys() | after.keys()):
        if key in settings.values():
            continue  # it stands with its counterpart
        one, other = before.get(key), after.get(settings.get(key, key))
        change = _change(key, one, other)
        if other is None and not _was_run(key, new[0], after):
            change = Change(Kind.NOT_RUN, key, one, None, math.nan)
        elif one is not None and other is not None and (kind := _other_question(key, scenes, settings)):
            fails = other.verdict == FAILS and one.verdict != FAILS
            change = Change(Kind.NEW_FAILURE if fails else kind, key, one, other, change.round_off)
        changes.append(change)
    changed, notes = _surroundings(old[0], new[0])
    return Differences(changed, changes, list(scenes.values()), notes, time_changes(*times))


def _by_key(rows: Iterable[Row]) -> dict[Key, Row]:
    worst_last = sorted(rows, key=lambda row: VERDICTS.index(row.verdict))  # of two of one name the worse one counts
    return {(row.scene, row.engine, row.setting, row.quantity): row for row in worst_last}


def _other_settings(before: Mapping[Key, Row], after: Mapping[Key, Row]) -> dict[Key, Key]:
    """Rows that both runs have with one setting each, but not the same: old key to new key."""

    def alone(keys: Iterable[Key]) -> dict[tuple[str, str, str], Key]:
        found: dict[tuple[str, str, str], list[Key]] = {}
        for key in keys:
            found.setdefault((key[0], key[1], key[3]), []).append(key)
        return {name: group[0] for name, group in found.items() if len(group) == 1}

    old, new = alone(before.keys() - after.keys()), alone(after.keys() - before.keys())
    return {old[name]: new[name] for name in old.keys() & new.keys() if "-" not in (old[name][2], new[name][2])}


def _was_run(key: Key, new: About, rows: Mapping[Key, Row]) -> bool:
    """Whether the new run was made for the scene and the engine of a row; without a record its rows say so."""
    scenes = new.scenes.keys() or {each[0] for each in rows} or {key[0]}
    engines = new.engines or {each[1] for each in rows}
    known = {each[1] for each in rows} | engines
    return key[0] in scenes and (key[1] in known or key[1] == FORMULAS)


def _other_question(key: Key, scenes: Mapping[str, SceneChange], settings: Mapping[Key, Key]) -> Kind | None:
    if key[0] in scenes:
        return Kind.OTHER_POSITIONS if scenes[key[0]].positions_alone else Kind.OTHER_SCENE
    return Kind.OTHER_SETTING if key in settings else None


def _change(key: Key, old: Row | None, new: Row | None) -> Change:
    if old is None or new is None:
        fails = new is not None and new.verdict == FAILS
        kind = Kind.NEW_FAILURE if fails else Kind.NEW
        if old is not None:
            kind = Kind.GONE_FAILURE if old.verdict == FAILS and old.quantity in WHOLE else Kind.GONE
        return Change(kind, key, old, new, math.nan)
    condition = min((c for c in (old.condition, new.condition) if c > 0.0), default=1.0)
    round_off = ROUND_OFF * EPS / condition
    return Change(_kind(old, new, round_off), key, old, new, round_off)


def _kind(old: Row, new: Row, round_off: float) -> Kind:
    if old.verdict != new.verdict:
        worse = VERDICTS.index(new.verdict) > VERDICTS.index(old.verdict)
        return Kind.VERDICT_WORSE if worse else Kind.VERDICT_BETTER
    if not new.compared or old.error == new.error or (math.isnan(old.error) and math.isnan(new.error)):
        return Kind.SAME
    if abs(new.error - old.error) <= round_off:
        return Kind.ROUND_OFF
    if new.error > NOTICEABLE * old.error or math.isnan(new.error):
        return Kind.WORSE
    if old.error > NOTICEABLE * new.error:
        return Kind.BETTER
    return Kind.SAME


def _surroundings(old: About, new: About) -> tuple[list[tuple[str, str, str]], list[str]]:
    """What the runs were made with where it differs, and what a record cannot say."""
    found = [("commit", old.commit, new.commit)] if old.commit and new.commit else []
    for what in sorted(old.versions.keys() | new.versions.keys()):
        found.append((what, old.versions.get(what, "not recorded"), new.versions.get(what, "not recorded")))
    found.append(("machine", old.machine, new.machine))
    for what in sorted(old.settings.keys() | new.settings.keys() - {"suite"}):
        if what != "suite":
            found.append((what, old.settings.get(what, "not recorded"), new.settings.get(what, "not recorded")))
    suites = [each.settings.get("suite", "not recorded")[:12] for each in (old, new)]
    notes = []
    if suites[0] != suites[1] and not (old.scenes and new.scenes):
        silent = "neither run says" if not (old.scenes or new.scenes) else "the older record does not say"
        notes.append(f"the scenes' hash is another ({suites[0]} -> {suites[1]}), and {silent} what they ask: "
                     "a scene that changed cannot be named, rows are compared by name alone")  # fmt: skip
    return [(what, before, after) for what, before, after in found if before != after], notes
