"""Effects in a scene file: how the entry of each under ``[effects]`` is read and written, from its own declarations."""

from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any

from fourbar import effects as kinds
from fourbar.effects.effect import PinRows
from fourbar.effects.spring import END_POSITION, GAS
from fourbar.errors import InputError
from fourbar.files.fields import Reader, write_declared, write_numbers, write_polar
from fourbar.linkage import PINS

if TYPE_CHECKING:
    from fourbar.effects import Effect, SpringEnd, Springs

MOST_SPRINGS = 1000


def read_effect(key: str, value: object, read: Reader) -> "Effect":
    """Read an effect from the value under its key."""
    kind: Any = kinds.list_kinds()[key]
    path = f"effects.{key}"
    if kind is kinds.Gravity:
        return kinds.Gravity(*read.polar(path, value, kind.numbers["magnitude"].unit))
    if kind is kinds.Springs:
        return _read_springs(path, value, read)
    if issubclass(kind, PinRows):
        rows = []
        for pin, entry in read.table(path, value, PINS).items():
            stated = {"": entry} if "" in kind.numbers else read.table(f"{path}.{pin}", entry, kind.numbers)
            rows.append((pin, *read.numbers(f"{path}.{pin}", stated, kind.numbers).values()))
        return kind(tuple(rows))  # type: ignore[no-any-return]
    bars = {field.name: field.default for field in fields(kind) if field.name == "bar"}
    stated = read.table(path, value, (*bars, *kind.numbers))
    bar = {
        name: read.whole(f"{path}.{name}", stated.get(name, None if default is MISSING else default), 2, 4)
        for name, default in bars.items()
    }
    return kind(**bar, **read.numbers(path, stated, kind.numbers))  # type: ignore[no-any-return]


def write_effect(effect: "Effect") -> Any:
    """Write the value of an effect under its key; InputError where a scene file has no form of it."""
    if kinds.list_kinds().get(effect.key) is not type(effect):
        raise InputError(f"effects.{effect.key}", type(effect).__name__, "a scene file cannot state this effect")
    if isinstance(effect, kinds.Gravity):
        return write_polar(effect.magnitude, effect.angle, effect.numbers["magnitude"].unit)
    if isinstance(effect, kinds.Springs):
        return [{**write_ends(spring), **write_numbers(spring)} for spring in effect.springs]
    if isinstance(effect, PinRows):
        rows = {}
        for pin, *values in effect.rows:
            texts = {
                name: write_declared(x, declared)
                for (name, declared), x in zip(effect.numbers.items(), values, strict=True)
            }
            rows[pin] = texts.get("", texts)
        return rows
    bar = {"bar": effect.bar} if hasattr(effect, "bar") else {}
    return {**bar, **write_numbers(effect)}


def _read_springs(key: str, value: object, read: Reader) -> "Springs":
    """Read springs and gas springs."""
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_SPRINGS:
        raise read.refuse(key, value, f"must be a list of 1 to {MOST_SPRINGS} springs")
    springs = []
    for index, entry in enumerate(value):
        path = f"{key}[{index}]"
        row = read.table(path, entry, ("from", "to", *kinds.Spring.numbers, "gas"))
        start, end = read_ends(read, path, row)
        if gas := "gas" in row:
            read.table(path, entry, ("from", "to", "gas"))
            words = read.table(f"{path}.gas", row["gas"], GAS)
            stated = read.numbers(f"{path}.gas", {"compressed_force": words.get("extended_force"), **words}, GAS)
        else:
            stated = read.numbers(path, row, kinds.Spring.numbers)
        try:
            springs.append(kinds.Spring.gas(start, end, **stated) if gas else kinds.Spring(start, end, **stated))
        except InputError as error:  # which knows of one spring alone
            raise read.refuse(error.key.replace(key, path), error.value, error.allowed) from None
    return kinds.Springs(tuple(springs))


def read_ends(read: Reader, key: str, row: dict[str, Any]) -> "tuple[SpringEnd, SpringEnd]":
    """Read the entries `from` and `to` of a line between two bars; an end without `at` is at the bar's first pin."""
    ends = []
    for name in ("from", "to"):
        path = f"{key}.{name}"
        entry = read.table(path, row.get(name), ("bar", "at"))
        bar = read.whole(f"{path}.bar", entry.get("bar"), 1, 4)
        ends.append(kinds.SpringEnd(bar, *read.declared(f"{path}.at", entry.get("at"), END_POSITION)))
    return ends[0], ends[1]


def write_ends(line: Any) -> dict[str, Any]:
    """Write them back."""
    ends = {"from": line.start, "to": line.end}
    return {name: {"bar": end.bar, "at": write_declared(end[1:], END_POSITION)} for name, end in ends.items()}
