"""Rules that a run holds its engines to.

A later run may hold them to weaker ones, which is told. A row says by how much it is
wrong and how much was allowed. Whoever widens what is allowed makes every later error
pass, so the rules themselves are kept with a run.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fourbar_validation.compare.rows import COMPARED_VERDICTS
from fourbar_validation.compare.tolerance import (
    IDENTITY,
    ErrorBound,
    K,
)
from fourbar_validation.engines.limits import BOUNDARIES
from fourbar_validation.engines.registry import Engine

if TYPE_CHECKING:
    from pandas import DataFrame

Rules = dict[str, dict[str, str]]
"""What stands under each name, as entries of text."""
FACTOR_CHANGED = "factor"
CLASS_CHANGED = "class"
_REASON = "reason"
_CONDITIONED = "over the condition"
_PREDICTED = "prediction"
ANSWERS_CHECK = "answers"
_BOUNDARY = "boundary"
_IN_TIME = "through time"
_YES = "yes"
NO = "no"
_LOOSER = 1.0 + 1e-9
"""Factor by which a number of a rule has grown if it is another one."""
NOTABLE = 10.0
"""Growth of a row's allowance that is printed. The worst position moves with the
kernels of a processor, and K eps/condition with it: 139 of 2093 allowances grew so.
"""


def list_rules(engines: Iterable[Engine]) -> Rules:
    """List the rules of a run: of identities, engines and limits."""
    rules: Rules = {
        "identities": _describe_bound(IDENTITY),
        "K": {FACTOR_CHANGED: repr(K)},
    }
    for engine in engines:
        predicted = engine.predictor is not None or engine.residuals
        rules[engine.name] = _describe_bound(engine.tolerance) | {
            _PREDICTED: _YES if predicted else NO,
            ANSWERS_CHECK: ", ".join(sorted(engine.answers)),
        }
    for limit in BOUNDARIES:
        rules[f"limit of {limit.engine}: {limit.name}"] = {
            _BOUNDARY: repr(limit.boundary),
            _REASON: limit.reason,
        }
    return rules


def _describe_bound(bound: ErrorBound) -> dict[str, str]:
    return {
        CLASS_CHANGED: bound.name,
        FACTOR_CHANGED: repr(bound.factor),
        _CONDITIONED: _YES if bound.conditioned else NO,
        _IN_TIME: _YES if bound.in_time else NO,
        _REASON: bound.reason,
    }


@dataclass(frozen=True, slots=True)
class Weakening:
    """A rule that is weaker than it was."""

    name: str
    """Engine, limit or identity that it holds for."""
    what: str
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.name}: {self.what} {self.old} -> {self.new}"


def list_weakened(old: Mapping[str, Mapping[str, str]], new: Rules) -> list[Weakening]:
    """List the rules of both runs that the new one has weakened.

    A smaller factor is stricter, whatever its class and its reason; otherwise a class,
    a reason or a boundary that is another one is weaker until somebody has accepted it.
    """
    weakened = []
    for name in old.keys() & new.keys():
        before = old[name]
        after = new[name]
        for what in before.keys() & after.keys():
            if before[what] != after[what] and _is_weaker(what, before, after):
                weakened.append(Weakening(name, what, before[what], after[what]))
    return sorted(
        weakened,
        key=lambda one: (one.name, one.what != FACTOR_CHANGED, one.what),
    )


def _is_weaker(
    what: str,
    old: Mapping[str, str],
    new: Mapping[str, str],
) -> bool:
    """Return whether an entry that differs makes its rule weaker."""
    if what == FACTOR_CHANGED:
        return _read_float(new[what]) > _LOOSER * _read_float(old[what])
    if (
        what in (CLASS_CHANGED, _REASON)
        and FACTOR_CHANGED in old
        and FACTOR_CHANGED in new
    ):
        before = _read_float(old[FACTOR_CHANGED])
        return not _read_float(new[FACTOR_CHANGED]) * _LOOSER < before
    if what in (_CONDITIONED, _PREDICTED, _IN_TIME):
        return new[what] == _YES
    if what == ANSWERS_CHECK:
        asked = set(old[what].split(", "))
        return bool(asked - set(new[what].split(", ")))
    return True


def _read_float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("inf")


def list_grown_rows(table: "DataFrame") -> list[str]:
    """Name the rows whose allowed error has grown so far that it is printed."""
    rows = table[
        table.verdict_old.isin(COMPARED_VERDICTS)
        & table.verdict_new.isin(COMPARED_VERDICTS)
        & (table.why == "")
        & (table.allowed_old > 0.0)
        & (table.allowed_new > NOTABLE * table.allowed_old)
    ]
    return [
        f"{row.scene} / {row.engine} / {row.quantity}:"
        f" {row.allowed_old:.1e} -> {row.allowed_new:.1e}"
        for row in rows.itertuples()
    ]
