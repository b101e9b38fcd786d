"""Two runs held against each other, row by row."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from fourbar.errors import FAILED, HOLDS
from validation.compare.counts import Counts
from validation.compare.rows import FAILS, VERDICTS, Row
from validation.compare.tolerance import EPS, K
from validation.regression.record import About

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
    ROUND_OFF = "moved within round-off"
    SAME = "same"


WHOLE = ("all", "watch")
"""Rows that stand for what went wrong with an engine as a whole: once it is mended they are gone."""
REGRESSIONS = frozenset((Kind.VERDICT_WORSE, Kind.WORSE, Kind.GONE, Kind.NEW_FAILURE))
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
    """(what, old, new) of versions, machine and settings; said first."""
    changes: list[Change]

    def of(self, kind: Kind) -> list[Change]:
        """The changes of one kind."""
        return [change for change in self.changes if change.kind is kind]

    @property
    def regressions(self) -> list[Change]:
        """The changes for which a run fails."""
        return [change for change in self.changes if change.regression]

    @property
    def counts(self) -> Counts:
        """The rows of the new run by verdict."""
        return Counts(change.new for change in self.changes if change.new is not None)

    @property
    def nothing(self) -> bool:
        """Whether no comparison of the new run has its counterpart in the old one."""
        return Counts(change.new for change in self.changes if change.new and change.old).nothing

    @property
    def status(self) -> int:
        """Exit status: 1 on a regression, and where nothing was compared."""
        return FAILED if self.regressions or self.nothing else HOLDS


def differences(old: tuple[About, Iterable[Row]], new: tuple[About, Iterable[Row]]) -> Differences:
    """Compare two runs."""
    before, after = _by_key(old[1]), _by_key(new[1])
    changes = [_change(key, before.get(key), after.get(key)) for key in sorted(before.keys() | after.keys())]
    return Differences(_surroundings(old[0], new[0]), changes)


def _by_key(rows: Iterable[Row]) -> dict[Key, Row]:
    worst_last = sorted(rows, key=lambda row: VERDICTS.index(row.verdict))  # of two of one name the worse one counts
    return {(row.scene, row.engine, row.setting, row.quantity): row for row in worst_last}


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


def _surroundings(old: About, new: About) -> list[tuple[str, str, str]]:
    found = []
    for what in sorted(old.versions.keys() | new.versions.keys()):
        found.append((what, old.versions.get(what, "not recorded"), new.versions.get(what, "not recorded")))
    found.append(("machine", old.machine, new.machine))
    for what in sorted(old.settings.keys() | new.settings.keys()):
        found.append((what, old.settings.get(what, "not recorded"), new.settings.get(what, "not recorded")))
    return [(what, before, after) for what, before, after in found if before != after]
