"""Locate a regression: rows by engine and cause, scenes by engines.

The engines are those that disagree.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from fourbar_validation.compare.rows import FORMULAS, Row
from fourbar_validation.regression.change import Change, KindOfChange
from fourbar_validation.report.words import NUMBER_IN_A_REASON

EXACT_SETTING = "exact"
"""Setting of an engine that is held to round-off, and sees what is wrong by more."""
MOST_CAUSES_APART = 200
"""Causes with a line of their own; the others are one."""


@dataclass(slots=True)
class Group:
    """Rows of one engine to which the same happened, for one cause."""

    engine: str
    kind: KindOfChange
    cause: str
    """What came of it, and the reason without its numbers."""
    rows: int = 0
    scenes: int = 0
    of_scenes: int = 0
    """Number of scenes in which the engine has rows."""
    quantities: Counter[str] = field(default_factory=Counter)
    worst: Change | None = None

    def add(self, changes: Sequence[Change]) -> None:
        """Add the rows of one more scene."""
        self.scenes += 1
        self.rows += len(changes)
        self.quantities.update(change.key[3] for change in changes)
        self.worst = max(
            (*changes, *([self.worst] if self.worst else [])),
            key=lambda change: change.severity,
        )

    def __str__(self) -> str:
        names = ", ".join(
            name if n == 1 else f"{name} {n}"
            for name, n in self.quantities.most_common(6)
        )
        more = ", ..." if len(self.quantities) > 6 else ""
        if self.cause:
            cause = f", {self._write_cause()}"
        else:
            cause = ""
        return (
            f"{self.engine}, {self.scenes} of {self.of_scenes} scenes, {self.rows} rows"
            f" ({names}{more}){cause}"
        )

    def _write_cause(self) -> str:
        """Write the cause with the numbers of the worst row."""
        if self.worst is None or self.cause != _find_cause(self.worst):
            return self.cause
        return _write_cause(self.worst)


class Fault:
    """Scene by scene; what is kept does not grow with their number."""

    def __init__(self) -> None:
        self._groups: dict[tuple[str, KindOfChange, str], Group] = {}
        self._scenes: Counter[str] = Counter()
        self._who: Counter[tuple[str, frozenset[str]]] = Counter()

    def add(self, changes: Iterable[Change]) -> None:
        """Add the rows of one scene."""
        changes = list(changes)
        self._scenes.update(
            {
                change.key[1]
                for change in changes
                if change.kind is not KindOfChange.NOT_RUN
            }
        )
        groups: dict[tuple[str, KindOfChange, str], list[Change]] = {}
        for change in changes:
            groups.setdefault(
                (change.key[1], change.kind, _find_cause(change)), []
            ).append(change)
        for key, some in groups.items():
            if key not in self._groups and len(self._groups) >= MOST_CAUSES_APART:
                key = (*key[:2], "other causes")  # noqa: PLW2901
            self._groups.setdefault(key, Group(*key)).add(some)
        worse = {change.key[1] for change in changes if change.regression}
        if worse:
            exact = {
                change.key[1]
                for change in changes
                if _is_compared_exactly(change.old) or _is_compared_exactly(change.new)
            }
            self._who[write_fault_sentence(worse, exact), frozenset(worse)] += 1

    def groups(self, kinds: Iterable[KindOfChange]) -> list[Group]:
        """Return the groups of some kinds, the worst first.

        In each the number of its engine's scenes is set.
        """
        wanted = set(kinds)
        groups = [group for group in self._groups.values() if group.kind in wanted]
        for group in groups:
            group.of_scenes = self._scenes[group.engine]
        order = list(KindOfChange)
        return sorted(
            groups,
            key=lambda g: (
                order.index(g.kind),
                *(-x for x in _rank_severity(g)),
                -g.rows,
                g.engine,
            ),
        )

    @property
    def sentences(self) -> list[str]:
        """List who disagrees, and in how many of their scenes.

        The most frequent come first.
        """
        counts: Counter[str] = Counter()
        of_scenes: Counter[str] = Counter()
        for (text, engines), n in self._who.items():
            counts[text] += n
            of_scenes[text] = max(
                of_scenes[text], min(self._scenes[engine] for engine in engines)
            )
        return [
            f"{text}, {n} of {of_scenes[text]} scenes"
            for text, n in counts.most_common()
        ]


def _rank_severity(group: Group) -> tuple[bool, float]:
    if group.worst is not None:
        return group.worst.severity
    return (False, 0.0)


def _is_compared_exactly(row: Row | None) -> bool:
    return (
        row is not None
        and row.setting == EXACT_SETTING
        and row.compared
        and row.engine != FORMULAS
    )


def _find_cause(change: Change) -> str:
    """Take the reason without its numbers: one cause has one text in all scenes."""
    return NUMBER_IN_A_REASON.sub("#", _write_cause(change))


def _write_cause(change: Change) -> str:
    """Say how the verdict changed, and why."""
    if (
        change.kind
        in (
            KindOfChange.VERDICT_WORSE,
            KindOfChange.VERDICT_BETTER,
            KindOfChange.NEW_FAILURE,
        )
        and change.new is not None
    ):
        if change.old is not None:
            came = f"{change.old.verdict} -> {change.new.verdict}"
        else:
            came = change.new.verdict
        return f"{came}: {change.new.reason}"
    return ""


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
