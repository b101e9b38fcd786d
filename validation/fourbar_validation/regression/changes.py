"""Compare two runs scene by scene.

Both tables are sorted and read in step, so that neither is ever whole in memory.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import merge, nlargest
from itertools import groupby
from typing import TypeVar

from fourbar.errors import FAILED, HOLDS, InputError
from fourbar_validation.compare.rows import FORMULAS, VERDICTS, Counts, Row
from fourbar_validation.regression.change import (
    OTHER_QUESTION,
    REGRESSIONS,
    Change,
    Key,
    KindOfChange,
    compare_row,
)
from fourbar_validation.regression.fault import Fault
from fourbar_validation.regression.record import About
from fourbar_validation.regression.rules import (
    Weakening,
    find_weakened_row,
    has_grown,
    list_weakened,
)
from fourbar_validation.regression.scenes import (
    SceneChange,
    find_renamed,
    list_scene_changes,
)

ROWS_LISTED = 10_000
"""Rows of one kind that are listed, the worst of them; all are counted."""
MOST_ENGINES_LISTED = 50
"""Scenes and engines listed by name that were not run or not compared. The others are
counted.
"""
KINDS_OF_ONE_RUN = (
    *(KindOfChange.NOT_RUN, KindOfChange.GONE, KindOfChange.GONE_FAILURE),
    *(KindOfChange.NEW, KindOfChange.NEW_FAILURE),
)
"""Kinds of rows that only one run has."""
PerScene = TypeVar("PerScene")
_ByScene = Iterable[tuple[str, Sequence[PerScene]]]
"""Items of one scene after the other, in ascending order of the scenes' names."""


class Named:
    """Rows by a name; of more than MOST_ENGINES_LISTED names the others are one."""

    def __init__(self) -> None:
        self._rows: Counter[str] = Counter()
        self._others = 0
        """Names beyond, each in turn: those of one scene come together."""
        self._rows_of_others = 0
        self._last = ""

    def add(self, name: str) -> None:
        """Add one more row of a name."""
        if name in self._rows or len(self._rows) < MOST_ENGINES_LISTED:
            self._rows[name] += 1
        else:
            self._others += name != self._last
            self._rows_of_others += 1
        self._last = name

    def __iter__(self) -> Iterator[str]:
        yield from (
            f"{name} ({count} row{'s' if count > 1 else ''})"
            for name, count in self._rows.items()
        )
        if self._others:
            yield f"{self._others} more ({self._rows_of_others} rows)"


@dataclass(slots=True)
class Differences:
    """Everything that differs between two runs."""

    surroundings: list[tuple[str, str, str]]
    """(what, old, new) of versions, machine and settings."""
    scenes: list[SceneChange] = field(default_factory=list)
    """Scenes that ask something else."""
    weakened: list[Weakening] = field(default_factory=list)
    """Rules that are weaker than they were; reported first, and a regression."""
    baseline: str = ""
    """The old run in words: where it lies, of which date and commit."""
    notes: list[str] = field(default_factory=list)
    """Scenes of another name, and what an older record cannot say."""
    kept: int = ROWS_LISTED
    kinds: Counter[KindOfChange] = field(default_factory=Counter)
    """Rows by what happened to them."""
    counts: Counts = field(default_factory=Counts)
    """The rows of the new run by verdict."""
    fault: Fault = field(default_factory=Fault)
    _changes: dict[KindOfChange, list[Change]] = field(default_factory=dict)
    _compared: Counts = field(default_factory=Counts)
    """The rows of the new run that have their counterpart in the old one."""
    _scenes_not_run: Named = field(default_factory=Named)
    _engines_not_run: Named = field(default_factory=Named)
    _not_compared: Named = field(default_factory=Named)
    _grown: Named = field(default_factory=Named)

    def add(self, changes: Sequence[Change]) -> None:
        """Add the rows of one more scene."""
        self.kinds.update(change.kind for change in changes)
        self.counts.add(change.new for change in changes if change.new is not None)
        alike = (change for change in changes if change.kind not in OTHER_QUESTION)
        self._compared.add(
            change.new
            for change in alike
            if change.new is not None and change.old is not None
        )
        self.fault.add(changes)
        scene_was_run = any(change.new is not None for change in changes)
        for change in changes:
            if change.kind is KindOfChange.NOT_RUN and scene_was_run:
                self._engines_not_run.add(change.key[1])
            elif change.kind is KindOfChange.NOT_RUN:
                self._scenes_not_run.add(f"scene {change.key[0]}")
            elif (
                change.kind in OTHER_QUESTION
                and change.old is not None
                and change.new is not None
            ):
                self._not_compared.add(
                    _say_why_not_compared(change, change.old, change.new)
                )
            elif change.old is not None and change.new is not None:
                self._hold_rules(change.old, change.new)
            same_kind = self._changes.setdefault(change.kind, [])
            same_kind.append(change)
            if len(same_kind) > 2 * self.kept:
                self._changes[change.kind] = nlargest(
                    self.kept,
                    same_kind,
                    key=lambda one: one.severity,
                )

    def _hold_rules(self, old: Row, new: Row) -> None:
        """Note a row whose rule is another one, or that is allowed far more."""
        weakening = find_weakened_row(old, new)
        if weakening is not None:
            known = {(one.name, one.what) for one in self.weakened}
            if (weakening.name, weakening.what) not in known:
                self.weakened.append(weakening)
        elif has_grown(old, new):
            growth = f"{old.allowed:.1e} -> {new.allowed:.1e}"
            self._grown.add(f"{new.scene} / {new.engine} / {new.quantity}: {growth}")

    def of(self, kind: KindOfChange) -> list[Change]:
        """List the changes of one kind, the worst first; at most `kept` of them."""
        return nlargest(
            self.kept,
            self._changes.get(kind, ()),
            key=lambda one: one.severity,
        )

    @property
    def changes(self) -> list[Change]:
        """Return the changes that are kept, by scene, engine, setting and quantity."""
        return sorted(
            (change for kind in KindOfChange for change in self.of(kind)),
            key=lambda change: change.key,
        )

    @property
    def rows(self) -> int:
        """Return how many rows there are."""
        return self.kinds.total()

    @property
    def regressed(self) -> int:
        """Return how many rows and rules a run fails for."""
        rows = sum(self.kinds[kind] for kind in REGRESSIONS)
        return rows + len(self.weakened)

    @property
    def grown(self) -> list[str]:
        """Rows whose allowed error grew by a factor above NOTABLE: no regression."""
        return [*self._grown]

    @property
    def not_run(self) -> list[str]:
        """Scenes and engines of the old run that the new one was not run for.

        A line names one and its number of rows.
        """
        return [*self._scenes_not_run, *self._engines_not_run]

    @property
    def not_compared(self) -> list[str]:
        """Scene, engine and setting of rows that answer different questions."""
        return [*self._not_compared]

    @property
    def compared(self) -> int:
        """Return how many rows of the new run have a counterpart in the old one."""
        return self._compared.total

    @property
    def nothing(self) -> bool:
        """Return whether no comparison of the new run has a counterpart.

        The counterpart would be in the old run.
        """
        return self._compared.nothing

    @property
    def shared(self) -> int:
        """Return how many rows stand in both runs, whatever question they answer."""
        return self.rows - sum(self.kinds[kind] for kind in KINDS_OF_ONE_RUN)

    @property
    def strange(self) -> bool:
        """Return whether the runs share fewer than half of their rows.

        The old one is then of another suite, or holds far more than the new one.
        """
        return 2 * self.shared < self.rows

    @property
    def status(self) -> int:
        """Exit status: 1 on a regression, and where nothing was compared."""
        return FAILED if self.regressed or self.nothing else HOLDS


def _say_why_not_compared(
    change: Change,
    old: Row,
    new: Row,
) -> str:
    if change.kind is KindOfChange.OTHER_SETTING:
        return f"{change.key[0]} / {change.key[1]}: {old.setting} -> {new.setting}"
    other_scene = change.kind is KindOfChange.OTHER_SCENE
    return (
        f"scene {change.key[0]} {'changed' if other_scene else 'has other positions'}"
    )


def compare_runs(
    old: tuple[About, _ByScene[Row]],
    new: tuple[About, _ByScene[Row]],
    engines: set[str],
    kept: int = ROWS_LISTED,
) -> Differences:
    """Compare two runs by their scenes, in ascending order.

    Rows are compared only if both answer the same question.

    `engines`: those that have rows in the new run.
    """
    scenes = {
        change.scene: change
        for change in list_scene_changes(old[0].scenes, new[0].scenes)
    }
    names = find_renamed(old[0].scenes, new[0].scenes)
    surroundings, older = _list_surroundings(old[0], new[0])
    notes = [f"renamed: {before} -> {after}" for before, after in names.items()]
    weakened = list_weakened(old[0].rules, new[0].rules)
    differences = Differences(
        surroundings,
        list(scenes.values()),
        weakened,
        notes=notes,
        kept=kept,
    )
    answering = {FORMULAS} | engines | (new[0].engines or set())
    for scene, before, after in _merge_scenes(_rename_scenes(old[1], names), new[1]):
        if new[0].scenes:
            run_for = scene in new[0].scenes
        else:
            run_for = bool(after) or not engines
        rows = _index_rows(scene, before), _index_rows(scene, after)
        differences.add(
            _compare_scene(
                *rows,
                answering if run_for else set(),
                scenes.get(scene),
            )
        )
    if older:
        compared = (
            f"{differences.compared} of {differences.rows} rows are compared: the"
            " others are of one run alone"
        )
        differences.notes += [compared, *older]
    return differences


def _rename_scenes(
    scenes: _ByScene[PerScene],
    names: Mapping[str, str],
) -> _ByScene[PerScene]:
    """Return the old run's scenes under the new run's names.

    Nothing is held in memory if none differs.
    """
    if not names:
        return scenes
    return sorted(
        ((names.get(name, name), rows) for name, rows in scenes),
        key=lambda scene: scene[0],
    )


def _merge_scenes(
    old: _ByScene[PerScene],
    new: _ByScene[PerScene],
) -> Iterator[tuple[str, Sequence[PerScene], Sequence[PerScene]]]:
    """Yield each scene that either run has, with what both have of it.

    Raises InputError if the scenes are not in order.
    """
    both = merge(
        _require_order("OLD", old),
        _require_order("NEW", new),
        key=lambda entry: entry[0],
    )
    for scene, entries in groupby(both, key=lambda entry: entry[0]):
        by_run = {run: rows for _, run, rows in entries}
        yield scene, by_run.get("OLD", ()), by_run.get("NEW", ())


def _require_order(
    run: str,
    scenes: _ByScene[PerScene],
) -> Iterator[tuple[str, str, Sequence[PerScene]]]:
    last = None
    for scene, rows in scenes:
        if last is not None and scene <= last:
            raise InputError(
                run,
                scene,
                f"must stand before scene {last}: a table of `run` is sorted by scene",
            )
        last = scene
        yield scene, run, rows


def _index_rows(scene: str, rows: Iterable[Row]) -> dict[Key, Row]:
    worst_last = sorted(
        rows,
        key=lambda row: VERDICTS.index(row.verdict),
    )  # the worse of two rows of one name counts
    return {(scene, row.engine, row.setting, row.quantity): row for row in worst_last}


def _compare_scene(
    before: Mapping[Key, Row],
    after: Mapping[Key, Row],
    engines: set[str],
    change: SceneChange | None,
) -> list[Change]:
    """Tell what happened to each row of a scene, and what changed in it.

    `engines`: those that were to answer.
    """
    renamed = _pair_settings(before, after)
    changes = []
    of_either = before.keys() | after.keys()
    for key in sorted(of_either - set(renamed.values())):
        differs = KindOfChange.OTHER_SETTING if key in renamed else None
        if change is not None:
            if change.positions_alone:
                differs = KindOfChange.OTHER_POSITIONS
            else:
                differs = KindOfChange.OTHER_SCENE
        new = after.get(renamed.get(key, key))
        changes.append(
            compare_row(
                key,
                before.get(key),
                new,
                asked=key[1] in engines,
                differs=differs,
            )
        )
    return changes


def _pair_settings(
    before: Mapping[Key, Row],
    after: Mapping[Key, Row],
) -> dict[Key, Key]:
    """Pair the rows that each run has with a single setting of its own.

    The pairs lead from old key to new key.
    """

    def index_single(keys: Iterable[Key]) -> dict[tuple[str, str, str], Key]:
        groups: dict[tuple[str, str, str], list[Key]] = {}
        for key in keys:
            scene, engine, _, quantity = key
            groups.setdefault((scene, engine, quantity), []).append(key)
        single = {}
        for name, group in groups.items():
            if len(group) == 1:
                single[name] = group[0]
        return single

    old = index_single(before.keys() - after.keys())
    new = index_single(after.keys() - before.keys())
    pairs = {}
    for name in old.keys() & new.keys():
        _, _, old_setting, _ = old[name]
        _, _, new_setting, _ = new[name]
        if "-" not in (old_setting, new_setting):
            pairs[old[name]] = new[name]
    return pairs


def _list_surroundings(
    old: About,
    new: About,
) -> tuple[list[tuple[str, str, str]], list[str]]:
    """List what the runs were made with if it differs.

    What a record cannot say is listed too.
    """
    if old.commit and new.commit:
        pairs = [("commit", old.commit, new.commit)]
    else:
        pairs = []
    pairs += _take_both(old.versions, new.versions)
    pairs.append(("machine", old.machine, new.machine))
    pairs += [
        pair for pair in _take_both(old.settings, new.settings) if pair[0] != "suite"
    ]
    suites = [about.settings.get("suite", "not recorded")[:12] for about in (old, new)]
    notes = []
    if suites[0] != suites[1] and not (old.scenes and new.scenes):
        if not (old.scenes or new.scenes):
            silent = "neither run says"
        else:
            silent = "the older record does not say"
        notes.append(
            f"the scenes' hash is another ({suites[0]} -> {suites[1]}), and {silent}"
            " what they ask: a scene that changed cannot be named, rows are compared by"
            " name alone"
        )
    return [
        (what, before, after) for what, before, after in pairs if before != after
    ], notes


def _take_both(
    old: Mapping[str, str],
    new: Mapping[str, str],
) -> list[tuple[str, str, str]]:
    unstated = "not recorded"
    return [
        (what, old.get(what, unstated), new.get(what, unstated))
        for what in sorted(old.keys() | new.keys())
    ]
