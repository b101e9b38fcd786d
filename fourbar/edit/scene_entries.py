"""A scene file that is changed entry by entry.

Comments, order and units of the rest stay as they were.
"""

import tomllib
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Item, Table

from fourbar.effects import Load, PointDrive, list_kinds
from fourbar.errors import InputError
from fourbar.files.scene_text import write_toml_value
from fourbar.linkage import (
    BAR_NAMES,
    MOVING_BARS,
    PINS,
    REQUIRED_NUMBER,
    Bar,
    Entries,
    OneOf,
    list_declared,
)
from fourbar.scene.motion import (
    BRANCH_OF_NAME,
    COMMAND_NAMES,
    SIDES,
    SPLINES,
    STROKE_COMMAND,
    Motion,
)
from fourbar.scene.numbers import Point

KeyPath = Sequence[str | int]
WORDS_OF_MOTION = {
    "branch": [*BRANCH_OF_NAME],
    "side": [*SIDES],
    "ends": [*SPLINES],
}
"""Entries of a motion that are one of a few words."""
EXAMPLES = {
    "m": "50 mm",
    "kg": "0.2 kg",
    "kg m^2": "2 kg cm^2",
    "kg/m^3": "7850 kg/m^3",
    "kg/m": "1 kg/m",
}
"""Examples of the numbers of a bar by their SI unit."""
_MOVING = {
    "rad": "60 deg",
    "rad/s": "10 rad/s",
    "rad/s^2": "0 rad/s^2",
    "m": "500 mm",
    "m/s": "100 mm/s",
    "m/s^2": "0 mm/s^2",
}
"""Examples of what is commanded, likewise."""


@cache
def list_offers() -> dict[str, Any]:
    """List what the declarations of a scene's numbers and effects let a page offer.

    `fields`: empty fields with an example; `commands`: what can be commanded, with its
    fields; `parts`: what a button adds; `words`: what an entry is one of; `bars`: their
    names; `pairs`: the names of what pairs consist of.
    """
    file = files("fourbar.edit").joinpath("offers.toml")
    offers = tomllib.loads(file.read_text(encoding="utf-8"))
    parts = offers["parts"]
    pairs = dict[str, list[str]]()
    for kind in (Bar, Point, Load):
        for name, number in kind.numbers.items():
            if number.pair == "rad":
                pairs[name] = ["distance" if number.unit == "m" else "size", "angle"]
            elif number.pair:
                pairs[name] = ["height", "thickness"]
    _offer_bars(offers)
    words = WORDS_OF_MOTION | _collect_words(Load) | _collect_words(PointDrive)
    for key, effect in list_kinds().items():
        words |= _collect_words(effect)
        value = tomllib.loads(effect.example)[key]
        parts.append({"at": ["effects", key], "value": value})
        if isinstance(value, dict) and set(value) <= set(PINS):
            of_a_pin, *_ = value.values()
            for pin in PINS:
                parts.append({"at": ["effects", key, pin], "value": of_a_pin})
        elif isinstance(value, list) and isinstance(value[0], str):
            pairs[key] = [*effect.numbers]
        elif isinstance(value, list):
            path = ["effects", key, -1]
            parts.append({"at": path, "label": "another", "value": value[0]})
    bars = {number: f"{number} {name}" for number, name in BAR_NAMES.items()}
    return offers | {
        "commands": _offer_commands(),
        "words": words,
        "pairs": pairs,
        "bars": bars,
    }


def _collect_words(kind: Any) -> dict[str, list[str]]:
    """Collect the entries of a description, and of its lists, that are one of words."""
    words = dict[str, list[str]]()
    for field in list_declared(kind):
        if isinstance(field.by, OneOf):
            words[field.key] = [*field.by.words]
        elif isinstance(field.by, Entries):
            words |= _collect_words(field.by.kind)
    return words


def _offer_bars(offers: dict[str, Any]) -> None:
    """Add the numbers of the moving bars to what the workbench offers, in place.

    Pairs are parts, optional numbers are fields.
    """
    fields: dict[str, Any] = offers["fields"].setdefault("bars", {})
    for bar in map(BAR_NAMES.__getitem__, MOVING_BARS):
        for name, declared in Bar.numbers.items():
            example = EXAMPLES[declared.unit]
            if declared.pair:
                pair = [example, "0 deg"]
                if declared.pair == "m":  # height and thickness of a cross-section
                    pair = ["20 mm", "5 mm"]
                offers["parts"].append({"at": ["bars", bar, name], "value": pair})
            elif declared.left_out is not REQUIRED_NUMBER:
                fields.setdefault(bar, {})[name] = example


def _offer_commands() -> dict[str, Any]:
    """List the names that can be commanded: label, and the fields that apply to it."""
    offered = {}
    for bar, names in (*COMMAND_NAMES.items(), (0, STROKE_COMMAND)):
        label = "stroke of the cylinder"
        fields = {name: _MOVING[Motion.numbers[name].unit] for name in names}
        if bar:
            label = f"angle \u03b8{chr(0x2080 + bar)} of the {BAR_NAMES[bar]}"
        else:
            fields["side"] = "left"
        fields["branch"] = "open"
        offered[names[0]] = {"label": label, "fields": fields}
    return offered


class SceneDocument:
    """The text of a scene file, entry by entry."""

    def __init__(self, text: str) -> None:
        try:
            self.tree = tomlkit.parse(text)
        except (TOMLKitError, RecursionError) as error:
            raise InputError("TOML", text[:60], f"cannot be read: {error}") from None

    def become(self, text: str) -> None:
        """Replace the tables by those of another text."""
        self.tree = SceneDocument(text).tree

    def text(self) -> str:
        """Return the text of the file."""
        return tomlkit.dumps(self.tree)

    def at(self, path: KeyPath) -> Any:
        """Return the entry at a path of keys and indices; None where there is none."""
        return _find_entry(self.tree, path)

    def set(self, path: KeyPath, text: str) -> None:
        """State one entry as it is typed; an empty text removes it.

        The value is a text, or a number where the file has one.
        """
        old = self.at(path)
        is_empty = not text.strip()
        if is_empty and old is None:
            return
        if is_empty and not isinstance(path[-1], int):
            self.remove(path)
            return
        example = old
        if old is None:
            example = _find_entry(list_offers()["fields"], path)
        is_text = isinstance(example, str) or example is None
        self.put(path, text if is_text else _read_plain_number(text))

    def put(self, path: KeyPath, value: Any) -> None:
        """State an entry and the tables that contain it; an index of -1 appends."""
        *into, last = path
        holder = self._find_holder(into)
        if last == -1:
            new = _write_inline(value)
            if isinstance(holder, AoT):
                new = _make_toml_table(value)
                new.add(tomlkit.nl())
            holder.append(new)
            return
        old = self.at(path)
        # a table of its own is written anew, with its heading
        if isinstance(old, Table):
            del holder[last]
            old = None
        if old is not None:
            new = tomlkit.item(_write_inline(value))
            if isinstance(old, Item):  # its comment and blanks stay
                for part in ("comment_ws", "comment", "trail"):
                    setattr(new.trivia, part, getattr(old.trivia, part))
        elif len(path) == 1 and isinstance(value, dict):
            new = _make_toml_table(value)
        else:
            new = _write_inline(value)
        holder[last] = new

    def remove(self, path: KeyPath) -> None:
        """Take an entry away, and a table that it leaves empty."""
        *into, last = path
        holder = self.at(into)
        del holder[last]
        if into and not len(holder) and into[0] not in ("lengths", "motion"):
            self.remove(into)

    def _find_holder(self, path: KeyPath) -> Any:
        holder = self.at(path)
        if holder is not None:
            return holder
        if path == ["loads"]:
            made: Item = tomlkit.aot()
        elif len(path) == 1 or path[0] == "bars":
            made = tomlkit.table()
        else:
            made = tomlkit.inline_table()
        if len(path) > 1:
            self._find_holder(path[:-1])
        parent = self.at(path[:-1])
        parent[path[-1]] = made
        return self.at(path)


def _find_entry(entry: Any, path: KeyPath) -> Any:
    """Return what stands at a path of keys and indices; None where there is none."""
    for step in path:
        try:
            entry = entry[step]
        except (KeyError, IndexError, TypeError, TOMLKitError):
            return None
    return entry


def _read_plain_number(text: str) -> int | float | str:
    """Return a number without a unit.

    A text that is no number stays a text, which the reader of the file refuses.
    """
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _make_toml_table(entries: dict[str, Any]) -> Table:
    made = tomlkit.table()
    for key, value in entries.items():
        made[key] = _write_inline(value)
    return made


def _write_inline(value: Any) -> Any:
    """Write a value, tables and lists in one line."""
    return tomlkit.value(write_toml_value("workbench", value))
