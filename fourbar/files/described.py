"""Descriptions in scene files: loads, points, drives, springs and effects.

Each is read and written by the declarations of its fields. A place is stated by
`from_pin`, `from_centre` or `point`, in polar form or by x and y.
"""

from collections.abc import Mapping
from typing import Any

from fourbar.effects.effect import PinRows
from fourbar.effects.load import PLACES_OF_LOADS
from fourbar.effects.place import (
    AT_FIRST_PIN,
    STATED_PLACES,
    At,
    Place,
    states_place,
)
from fourbar.errors import InputError
from fourbar.files.fields import (
    Reader,
    write_declared,
    write_numbers,
    write_quantity,
)
from fourbar.linkage import (
    PINS,
    REQUIRED_NUMBER,
    Declared,
    DeclaredField,
    Entries,
    Listed,
    OfBar,
    OneOf,
    Part,
    Whole,
    list_declared,
)

PLACES_OF_ENDS = (*STATED_PLACES, "point")
"""Keys of which one states an end of a spring or cylinder, or the point of a force."""
_PAIR = ["0", "1"]
"""Keys of two numbers that are written as a pair [magnitude, angle]."""


def list_keys(kind: Any) -> tuple[str, ...]:
    """List the keys in which a scene file states a description of a class."""
    keys = list[str]()
    for field in list_declared(kind):
        keys += _KEYS_OF_PLACE if field.key == "" else [field.key]
    return (*keys, *getattr(kind, "forms", ()))


_KEYS_OF_PLACE = ("bar", *PLACES_OF_ENDS)


def read_described(
    read: Reader,
    key: str,
    value: object,
    kind: Any,
    bars: Mapping[str, int],
    **stated: Any,
) -> Any:
    """Read a description of a class by the declarations of its fields.

    Parameters
    ----------
    bars : the bar of each named point.
    stated : fields that stand elsewhere.
    """
    if issubclass(kind, PinRows):
        return kind(_read_rows(read, key, value, kind))
    declared = list_declared(kind)
    if [field.key for field in declared] == _PAIR:
        first, *_ = kind.numbers.values()
        return kind(*read.polar(key, value, first.unit))
    if [field.key for field in declared if isinstance(field.by, Entries)] == [""]:
        return kind(_read_entries(read, key, value, declared[0], bars))
    entry = read.table(key, value, list_keys(kind))
    make = kind
    left = [field for field in declared if field.name not in stated]
    for form, numbers in getattr(kind, "forms", {}).items():
        if form in entry:
            make = getattr(kind, form)
            left = [field for field in left if not isinstance(field.by, Declared)]
            read.table(key, entry, (*(field.key for field in left), form))
            table = read.table(f"{key}.{form}", entry[form], numbers)
            stated |= read.numbers(f"{key}.{form}", table, numbers)
    if states_place(kind):
        by = next(field.by for field in left if field.name == "bar")
        place = read_stated_place(read, key, entry, bars, by.bars)
        forms = place._asdict()
        stated |= {f.name: forms[f.name] for f in left if f.name in forms}
        left = [field for field in left if field.name not in forms]
    for field in left:
        stated[field.name] = _read_field(read, key, entry, field, bars)
    try:
        return make(**stated)
    except InputError as error:  # which knows of one description alone
        section = kind.stated_at
        if error.file or "{" in section:
            raise
        inner = error.key.removeprefix(section).removeprefix(".")
        raise error.moved_to(f"{key}.{inner}".strip("."), read.file) from None


def _read_field(
    read: Reader,
    key: str,
    entry: Mapping[str, Any],
    field: DeclaredField,
    bars: Mapping[str, int],
) -> Any:
    """Read one field of a description from the entries of its table."""
    path = f"{key}.{field.key}".rstrip(".")
    value = entry.get(field.key)
    by = field.by
    if isinstance(by, At):
        if by.is_value:
            return read_stated_place(read, key, entry, bars, by.bars)
        table = read.table(path, value, _KEYS_OF_PLACE)
        end = read_stated_place(read, path, table, bars, by.bars)
        return Place(end.bar, AT_FIRST_PIN) if end == Place(end.bar) else end
    if value is None and field.left_out is not REQUIRED_NUMBER:
        return field.left_out
    if isinstance(by, Entries):
        return _read_entries(read, path, value, field, bars)
    if isinstance(by, Part):
        return read_described(read, path, value, by.kind, bars)
    if isinstance(by, Listed):
        return read.quantities(path, value, by.unit)
    if isinstance(by, Whole):
        return read.whole(path, value, by.least, by.most)
    if isinstance(by, OneOf):
        return read.choice(path, value, by.words)
    if isinstance(by, OfBar):
        return read.bar(path, value, by.bars)
    return read.declared(path, value, by)


def _read_entries(
    read: Reader,
    key: str,
    value: object,
    field: DeclaredField,
    bars: Mapping[str, int],
) -> tuple[Any, ...]:
    """Read a list of descriptions."""
    most = field.by.most
    if not isinstance(value, list) or not 1 <= len(value) <= most:
        raise read.refuse(key, value, f"must be a list of 1 to {most} {field.name}")
    return tuple(
        read_described(read, f"{key}[{index}]", entry, field.by.kind, bars)
        for index, entry in enumerate(value)
    )


def _read_rows(read: Reader, key: str, value: object, kind: Any) -> tuple[Any, ...]:
    """Read what each pin has: one number, or a table of several."""
    rows = []
    for pin, entry in read.table(key, value, PINS).items():
        path = f"{key}.{pin}"
        if "" in kind.numbers:
            stated = {"": entry}
        else:
            stated = read.table(path, entry, kind.numbers)
        rows.append((pin, *read.numbers(path, stated, kind.numbers).values()))
    return tuple(rows)


def write_described(description: Any) -> Any:
    """Write a description by the declarations of its fields.

    A table is returned, or the list that is the value of an effect.
    """
    kind = type(description)
    if isinstance(description, PinRows):
        return _write_rows(description)
    table = dict[str, Any]()
    for field in list_declared(kind):
        value = getattr(description, field.name)
        by = field.by
        if value is None:
            continue
        if isinstance(by, Declared):
            table[field.key] = write_declared(value, by)
        elif isinstance(by, At) and by.is_value:
            table |= _write_place(value)
        elif isinstance(by, At):
            table[field.key] = _write_place(value)
        elif isinstance(by, Entries):
            if value or by.is_value:
                table[field.key] = [write_described(entry) for entry in value]
        elif isinstance(by, Part):
            table[field.key] = write_described(value)
        elif isinstance(by, Listed):
            table[field.key] = [write_quantity(number, by.unit) for number in value]
        else:
            table[field.key] = value
    if [*table] == _PAIR:
        return [*table.values()]
    return table[""] if [*table] == [""] else table


def _write_place(place: Place) -> dict[str, Any]:
    by_name = {} if place.point is None else {"point": place.point}
    return {"bar": place.bar, **write_numbers(place), **by_name}


def _write_rows(rows: PinRows) -> dict[str, Any]:
    """Write what each pin has: one number, or a table of several."""
    table = dict[str, Any]()
    for pin, *numbers in rows.rows:
        written = {
            name: write_declared(number, by)
            for (name, by), number in zip(rows.numbers.items(), numbers, strict=True)
        }
        table[pin] = written.get("", written)
    return table


def read_stated_place(
    read: Reader,
    key: str,
    entry: Mapping[str, Any],
    bars: Mapping[str, int],
    allowed_bars: tuple[int, ...],
) -> Place:
    """Read the bar of an entry and its place on it, which one key states.

    An entry without such a key is at the bar's first pin.

    Parameters
    ----------
    bars : the bar of each named point, which the entry need not state again.
    allowed_bars : numbers of the bars that it may be on.
    """
    stated = [name for name in PLACES_OF_LOADS if name in entry]
    if len(stated) > 1:
        allowed = f"{stated[0]} states the place already; state one of them"
        raise read.refuse(f"{key}.{stated[1]}", entry[stated[1]], allowed)
    name: Any = entry.get("point")
    if name is not None:
        if name not in [*bars] and (not bars or name in [*PINS]):
            allowed = (
                "must be a point of [points]; the first pin of a bar is "
                'from_pin = ["0 m", "0 deg"], the second has its length in place of 0'
            )
            raise read.refuse(f"{key}.point", name, allowed)
        read.choice(f"{key}.point", name, bars)
    bar = read.bar(f"{key}.bar", entry.get("bar", bars.get(name)), allowed_bars)
    if name is None:
        pairs: dict[str, Any] = {
            form: read.polar(f"{key}.{form}", entry[form], "m")
            for form in STATED_PLACES
            if form in stated
        }
        return Place(bar, **pairs)
    if bar != bars[name]:
        allowed = f"the point {name} is on bar {bars[name]}"
        raise read.refuse(f"{key}.bar", bar, allowed)
    return Place(bar, point=name)
