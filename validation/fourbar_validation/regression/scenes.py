"""Flatten a scene's file into entries in SI units.

Two runs are compared where these are the same.
"""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from fourbar.errors import FourBarError
from fourbar.files import dump
from fourbar.linkage import record
from fourbar.scene import Scene
from fourbar_validation.scenes.suites import Suite

SceneEntries = dict[str, str]

_MOST_DESCRIBED = 2000
"""Scenes that a record describes, one or two kB each. Random linkages follow from their
seed.
"""
POSITION_KEYS = ("motion.theta_2", "motion.free.steps", "motion.law.steps")
"""Entries that say at which positions the same question is put."""


def describe_scenes(suite: Suite) -> dict[str, dict[str, str]]:
    """Describe each scene of a suite by its name.

    None of a suite of more than _MOST_DESCRIBED is described.
    """
    if len(suite) > _MOST_DESCRIBED:
        return {}
    return {
        suite.name(index): describe_changes(suite.scene(index))
        for index in range(len(suite))
    }


def describe_changes(scene: Scene) -> dict[str, str]:
    """List the entries of the scene's file that change a number.

    As "bars.output.inertia": "0.05 kg m^2".
    """
    try:
        entries = tomllib.loads(dump(scene))
    except FourBarError:  # a scene that no file can state
        return {"scene": repr(scene)}
    for name in ("title", "source", "pictures"):  # they change no number
        entries.pop(name, None)
    return dict(_flatten_entries("", entries))


def _flatten_entries(key: str, value: Any) -> Iterable[tuple[str, str]]:
    parts: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, dict):
        parts = value.items()
    elif isinstance(value, list):
        if any(isinstance(entry, dict) for entry in value):
            parts = enumerate(value, 1)
        else:
            value = ", ".join(map(str, value))
    for name, entry in parts:
        yield from _flatten_entries(f"{key}.{name}".lstrip("."), entry)
    if not parts:
        yield key, str(value)


@record
class SceneChange:
    """Entries that a scene states now and stated before."""

    scene: str
    entries: tuple[tuple[str, ...], ...]
    """(key, old, new)."""

    @property
    def moved(self) -> bool:
        """Return whether the question is the same, at other positions."""
        return all(key.startswith(POSITION_KEYS) for key, *_ in self.entries)

    def __str__(self) -> str:
        parts = (f"{key} {_write_unit_once(*two)}" for key, *two in self.entries)
        return f"scene {self.scene}: {'; '.join(parts)}"


def _write_unit_once(old: str, new: str) -> str:
    """Write a unit that both have once: "0.048 -> 0.05 kg m^2"."""
    number, _, unit = old.partition(" ")
    if unit and "," not in old and new.endswith(f" {unit}"):
        old = number
    return f"{old} -> {new}"


def find_renamed(
    old: Mapping[str, SceneEntries],
    new: Mapping[str, SceneEntries],
) -> dict[str, str]:
    """Find the scenes that state the same under another name.

    The other run does not have the name; old name to new name.
    """
    added = sorted(new.keys() - old.keys())
    renamed = {}
    for name in sorted(old.keys() - new.keys()):
        same = next((other for other in added if new[other] == old[name]), None)
        if same is not None:
            added.remove(same)
            renamed[name] = same
    return renamed


def list_scene_changes(
    old: Mapping[str, SceneEntries],
    new: Mapping[str, SceneEntries],
) -> list[SceneChange]:
    """List the scenes of both runs that ask something else now."""
    changes = []
    for name in sorted(old.keys() & new.keys()):
        entries = tuple(list_changed(old[name], new[name], "not stated"))
        if entries:
            changes.append(SceneChange(name, entries))
    return changes


def list_changed(
    old: Mapping[str, str], new: Mapping[str, str], missing: str
) -> Iterator[tuple[str, str, str]]:
    """List the entries that differ: key, old and new; `missing` stands for none."""
    for key in dict.fromkeys((*old, *new)):
        before, after = (entries.get(key) or missing for entries in (old, new))
        if before != after:
            yield key, before, after
