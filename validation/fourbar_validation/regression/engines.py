"""Pair the engines of two runs: versions of one name, and a guest of another name."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from fourbar_validation.compare.rows import FORMULAS
from fourbar_validation.regression.record import About
from fourbar_validation.regression.rules import ANSWERS_CHECK

if TYPE_CHECKING:
    from pandas import DataFrame


def pair_engines(
    old: tuple[About, "DataFrame | None"],
    new: tuple[About, "DataFrame | None"],
) -> tuple[dict[str, str], list[str]]:
    """Pair the engines that have other names in the two runs, and say so.

    A version pairs with the same version, else with one of the same name, several in
    their order. The only guest that is gone pairs with the only one that is new if both
    answer the same quantities.
    """
    gone, added = (
        [name for name in run if name not in other]
        for run, other in (
            (_list_recorded(old), _list_recorded(new)),
            (_list_recorded(new), _list_recorded(old)),
        )
    )
    pairs: dict[str, str] = {}
    for describe in (_name_version, lambda about, name: _name_version(about, name)[0]):
        for name in gone:
            alike = [
                one
                for one in added
                if one not in pairs.values()
                and describe(new[0], one) == describe(old[0], name)
            ]
            if alike and name not in pairs:
                pairs[name] = alike[0]
    notes = [f"versions compared as one: {a} -> {b}" for a, b in pairs.items()]
    guests = [
        [name for name in names if name in about.guests]
        for about, names in (
            (old[0], [name for name in gone if name not in pairs]),
            (new[0], [name for name in added if name not in pairs.values()]),
        )
    ]
    if [len(names) for names in guests] == [1, 1]:
        ((before,), (after,)) = guests
        answers = [
            about.rules.get(name, {}).get(ANSWERS_CHECK)
            for about, name in ((old[0], before), (new[0], after))
        ]
        if answers[0] is not None and answers[0] == answers[1]:
            pairs[before] = after
            notes.append(
                f"guests compared as one: {before} is gone, {after} is new, and both"
                " answer the same quantities"
            )
    return pairs, notes


def list_gone(before: About, after: About) -> list[str]:
    """Name the engines that a run was asked for, as far as the records say, and lacks.

    Engines that --engines chose before need not be asked for again.
    """
    pairs, _ = pair_engines((before, None), (after, None))
    lacking = [name for name in before.engines if name not in after.engines]
    if after.settings.get("chosen") != "":
        lacking = [name for name in lacking if name in before.guests_by_option]
    return [f"engine {name}" for name in lacking if name not in pairs]


def _list_recorded(run: tuple[About, "DataFrame | None"]) -> list[str]:
    """List the engines of a run in the order of its record."""
    about, rows = run
    of_rows = () if rows is None else rows.engine.unique()
    return [
        name for name in dict.fromkeys((*about.engines, *of_rows)) if name != FORMULAS
    ]


def _name_version(about: About, engine: str) -> tuple[str, str]:
    """Return name and version of an engine of a run."""
    version = about.versions.get(engine, "")
    return engine.removesuffix(f" {version}"), version


def move_engines(about: About, pairs: Mapping[str, str]) -> About:
    """Return a record whose engines bear the names that they are paired with."""
    return replace(
        about,
        versions={pairs.get(name, name): text for name, text in about.versions.items()},
        rules={pairs.get(name, name): rule for name, rule in about.rules.items()},
        settings=about.settings
        | {"engines": ", ".join(pairs.get(name, name) for name in about.engines)},
    )
