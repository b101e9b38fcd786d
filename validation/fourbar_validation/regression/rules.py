"""Rules that a run holds its engines to.

A later run may hold them to weaker ones, which is told. A row says by how much it is
wrong and how much was allowed. Whoever widens what is allowed makes every later error
pass, so the rules themselves are kept with a run.
"""

from collections.abc import Iterable, Mapping

from fourbar.linkage import record
from fourbar_validation.compare.tolerance import IDENTITY, ErrorBound, K
from fourbar_validation.engines.limits import BOUNDARIES
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression.scenes import list_changed

Rules = dict[str, dict[str, str]]
"""What stands under each name, as entries of text."""
FACTOR_CHANGED = "factor"
ANSWERS_CHECK = "answers"
_REASON = "reason"
_SAID = ("no", "yes")
_LOOSER = 1.0 + 1e-9
"""Factor by which a number of a rule has grown if it is another one."""
NOTABLE = 10.0
"""Growth of a row's allowance that is printed. The worst position moves with the
kernels of a processor, and K eps/condition with it: 139 of 2093 allowances grew so.
"""


def list_rules(engines: Iterable[Engine]) -> Rules:
    """List the rules of a run: of identities, engines and limits."""
    rules = {
        "identities": _describe_bound(IDENTITY),
        "K": {FACTOR_CHANGED: repr(K)},
    }
    for engine in engines:
        predicted = engine.predictor is not None or engine.residuals
        rules[engine.name] = _describe_bound(engine.tolerance)
        rules[engine.name] |= {
            "prediction": _SAID[predicted],
            ANSWERS_CHECK: ", ".join(sorted(engine.answers)),
        }
    for limit in BOUNDARIES:
        rules[f"limit of {limit.engine}: {limit.name}"] = {
            "boundary": repr(limit.boundary),
            _REASON: limit.reason,
        }
    return rules


def _describe_bound(bound: ErrorBound) -> dict[str, str]:
    return {
        "class": bound.name,
        FACTOR_CHANGED: repr(bound.factor),
        "over the condition": _SAID[bound.conditioned],
        "through time": _SAID[bound.in_time],
        _REASON: bound.reason,
    }


@record
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
    weakened = [
        Weakening(name, what, before, after)
        for name in old.keys() & new.keys()
        for what, before, after in list_changed(old[name], new[name], "")
        if before and after and _is_weaker(what, old[name], new[name])
    ]
    return sorted(
        weakened,
        key=lambda one: (one.name, one.what != FACTOR_CHANGED, one.what),
    )


def _is_weaker(what: str, old: Mapping[str, str], new: Mapping[str, str]) -> bool:
    """Return whether an entry that differs makes its rule weaker."""
    before, after = (float(rule.get(FACTOR_CHANGED, "inf")) for rule in (old, new))
    match what:
        case "factor":
            return after > _LOOSER * before
        case "class" | "reason":  # without a factor both are infinite
            return not after * _LOOSER < before
        case "over the condition" | "prediction" | "through time":
            return new[what] == "yes"
        case "answers":
            return not {*old[what].split(", ")} <= {*new[what].split(", ")}
    return True
