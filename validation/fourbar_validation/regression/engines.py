"""Pair the engines of two runs: versions of one name, and a guest of another name."""

from typing import TYPE_CHECKING

from fourbar_validation.compare.rows import FORMULAS
from fourbar_validation.regression.record import About
from fourbar_validation.regression.rules import ANSWERS_CHECK

if TYPE_CHECKING:
    from pandas import DataFrame


def pair_engines(
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
