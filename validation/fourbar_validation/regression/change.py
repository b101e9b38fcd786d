"""Classify what happened to one row from an old run to a new one."""

import math
from dataclasses import dataclass
from enum import Enum

from fourbar_validation.compare.rows import FAILS, VERDICTS, Row
from fourbar_validation.compare.tolerance import EPS, K

FREE_ROUND_OFFS = K
"""Errors of an exact comparison move freely by this many eps/condition: another
compiler, another order of summation. A move beyond it is a change of the numbers
themselves.
"""
_NOTICEABLE = 1.25
"""An error that is not round-off has changed where it grew or shrank by this factor."""


class KindOfChange(Enum):
    """Change of a row; the value is the heading in the report."""

    VERDICT_WORSE = "verdict got worse"
    WORSE = "worse"
    GONE = "gone"
    VERDICT_BETTER = "verdict got better"
    BETTER = "better"
    GONE_FAILURE = "gone, and had failed"
    GREW = "grew within its allowance"
    NEW = "new"
    NEW_FAILURE = "new, and fails"
    OTHER_SCENE = "of a changed scene"
    OTHER_POSITIONS = "at other positions"
    OTHER_SETTING = "with another setting"
    NOT_RUN = "not run"
    ROUND_OFF = "moved within round-off"
    SAME = "same"


WHOLE_ENGINE = ("all", "watch")
"""Rows of what went wrong with an engine as a whole. Once it is mended they are gone.
"""
REGRESSIONS = frozenset(
    (
        KindOfChange.VERDICT_WORSE,
        KindOfChange.WORSE,
        KindOfChange.GONE,
        KindOfChange.NEW_FAILURE,
    )
)
OTHER_QUESTION = (
    KindOfChange.OTHER_SCENE,
    KindOfChange.OTHER_POSITIONS,
    KindOfChange.OTHER_SETTING,
)
"""Rows that are not compared: each run answers a question of its own."""
Key = tuple[str, str, str, str]


@dataclass(frozen=True, slots=True)
class Change:
    """One row in the old and the new run."""

    kind: KindOfChange
    key: Key
    old: Row | None
    new: Row | None
    round_off: float
    """Change of the error that has no meaning, K eps/condition."""

    @property
    def regression(self) -> bool:
        """Return whether the run should fail for it."""
        return self.kind in REGRESSIONS

    @property
    def severity(self) -> tuple[bool, float]:
        """Return whether it fails now, and by what factor its error has grown.

        The error is at least round-off.
        """
        new = self.new
        if new is None or self.old is None:
            return new is not None and new.failed, 1.0
        grown = new.error / max(self.old.error, self.round_off)
        return new.failed, math.inf if math.isnan(grown) else grown


def compare_row(
    key: Key,
    old: Row | None,
    new: Row | None,
    *,
    asked: bool = True,
    differs: KindOfChange | None = None,
) -> Change:
    """Compare a row of both runs, or take that of one of them.

    `asked`: whether the new run was to answer it. `differs`: in what the two rows
    answer different questions, if so.
    """
    round_off = math.nan
    if old is None:
        if new is not None and new.verdict == FAILS:
            kind = KindOfChange.NEW_FAILURE
        else:
            kind = KindOfChange.NEW
    elif new is None and not asked:
        kind = KindOfChange.NOT_RUN
    elif new is None:
        if old.verdict == FAILS and old.quantity in WHOLE_ENGINE:
            kind = KindOfChange.GONE_FAILURE
        else:
            kind = KindOfChange.GONE
    else:
        round_off = (
            FREE_ROUND_OFFS
            * EPS
            / min((c for c in (old.condition, new.condition) if c > 0.0), default=1.0)
        )
        kind = _choose_kind(old, new, round_off)
        if differs is not None:
            if new.verdict == FAILS and old.verdict != FAILS:
                kind = KindOfChange.NEW_FAILURE
            else:
                kind = differs
    return Change(kind, key, old, new, round_off)


def _choose_kind(
    old: Row,
    new: Row,
    round_off: float,
) -> KindOfChange:
    if old.verdict != new.verdict:
        worse = VERDICTS.index(new.verdict) > VERDICTS.index(old.verdict)
        if worse:
            return KindOfChange.VERDICT_WORSE
        return KindOfChange.VERDICT_BETTER
    if (
        not new.compared
        or old.error == new.error
        or (math.isnan(old.error) and math.isnan(new.error))
    ):
        return KindOfChange.SAME
    if abs(new.error - old.error) <= round_off:
        return KindOfChange.ROUND_OFF
    if new.error > _NOTICEABLE * old.error or math.isnan(new.error):
        within = (
            new.passed and new.error <= _NOTICEABLE * old.allowed
        )  # an allowance that was widened holds nothing
        return KindOfChange.GREW if within else KindOfChange.WORSE
    if old.error > _NOTICEABLE * new.error:
        return KindOfChange.BETTER
    return KindOfChange.SAME
