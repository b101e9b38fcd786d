"""Entries of a scene file, read and written: numbers, places and whole descriptions.

Every error names the file, the key, the value and what is allowed. Loads, points,
drives, springs and effects follow the declarations of their fields.
"""

import math
import re
from collections.abc import Iterable, Mapping
from itertools import cycle
from typing import Any, Self

from fourbar.effects.effect import PinRows
from fourbar.effects.load import PLACES_OF_LOADS
from fourbar.effects.place import (
    AT_FIRST_PIN,
    STATED_PAIR,
    STATED_PLACES,
    At,
    Place,
    states_place,
)
from fourbar.errors import (
    InputError,
    name_unit,
    names_other_mechanism,
    suggest_keys,
)
from fourbar.linkage import (
    PINS,
    REQUIRED_NUMBER,
    Declared,
    DeclaredField,
    Entries,
    Listed,
    OfBar,
    Part,
    list_declared,
)
from fourbar.quantities.units import (
    UNIT_MISSING,
)
from fourbar.scene.drawing import DRAWN_PLACE, DRAWN_WORD, DrawnPins

_WAYS = {
    **dict.fromkeys(
        ("radius_of_gyration", "gyration", "k_G"),
        "write inertia = m k^2, or m (k^2 - r^2) if k is about a pin at r from the"
        " centre",
    ),
    **dict.fromkeys(
        ("stroke", "stroke_speed", "stroke_acceleration"),
        "write it under [motion], as a number or a list; a law is of an angle, and the"
        " table of a load is over theta_2",
    ),
    **dict.fromkeys(
        ("damper", "dampers", "damping", "damping_coefficient"),
        "viscous is damping in the pins; a damper between two points is in MuJoCo, as"
        " the damping of a spatial tendon",
    ),
}
"""Ways to state what has no key, by words for it."""
PLACES_OF_ENDS = (*STATED_PLACES, "point", DRAWN_WORD)
"""Keys of which one states an end of a spring or cylinder, or the point of a force."""
_KEYS_OF_PLACE = ("bar", *PLACES_OF_ENDS)
_PAIR = ["0", "1"]
"""Keys of two numbers that are written as a pair [magnitude, angle]."""


def split_key(key: str) -> list[str | int]:
    """List the names and indices of a key like `loads[0].force[1]` or `loads.0`."""
    steps = re.findall(r"[^.\[\]]+", key)
    return [int(step) if step.isdigit() else step for step in steps]


class SceneFile:
    """A file that is read, and what one entry of it tells the reader of another."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.drawing: Any = None
        """Drawing that states the pins, or the ground of a scene of lengths."""
        self.drawn: dict[str, Any] = {}
        """What the word "drawn" stands for in a motion, by the names of its entries."""
        self.bars: dict[str, int] = {}
        """Bar of each named point, which a place at it need not state again."""


class Entry:
    """Value under a key of a file, with the ways to read it.

    Parameters
    ----------
    key : dotted, "" for the top of the file.
    value : as TOML has it; None: the file has no such entry.
    """

    UNSTATED: tuple[type, ...] = (int, float)
    """Types of what states no number of a unit."""
    FORM = f'{UNIT_MISSING}; it is written like "1 {{}}"'
    """Form of a number of a unit, as errors say it."""

    def __init__(self, file: SceneFile, key: str, value: Any) -> None:
        self.file = file
        self.key = key
        self.value = value

    def holding(self, value: Any) -> Self:
        """Return an entry of the same key with another value."""
        return type(self)(self.file, self.key, value)

    def __getitem__(self, name: str) -> Self:
        """Return the entry of a name in this table."""
        key = f"{self.key}.{name}".strip(".")
        return type(self)(self.file, key, self.value.get(name))

    def entries(self) -> list[Self]:
        """List the entries of a list."""
        return [
            type(self)(self.file, f"{self.key}[{index}]", value)
            for index, value in enumerate(self.value)
        ]

    def refuse(self, allowed: str) -> InputError:
        """Make the error for the entry, or a missing one."""
        missing = "is missing; " if self.value is None else ""
        return InputError(self.key, self.value, missing + allowed, self.file.name)

    def table(self, allowed: Iterable[str]) -> dict[str, Any]:
        """Read a table that holds no keys but those allowed."""
        names = list(allowed)
        if not isinstance(self.value, dict):
            raise self.refuse(f"must be a table with the keys {', '.join(names)}")
        unknown = [name for name in self.value if name not in names]
        unknown.sort(key=names_other_mechanism, reverse=True)
        for name in unknown:
            known = _WAYS.get(name) or suggest_keys(name, names)
            raise self[name].refuse(f"unknown key; {known}")
        return self.value

    def check(self, by: Any) -> Any:
        """Read a value as its declaration has it, each number with its unit.

        A magnitude and an angle may be stated by x and y.
        """
        value = self.value
        if isinstance(value, dict) and getattr(by, "pair", "") == "rad":
            self.table("xy")
            x, y = (self[axis].check(Declared(by.unit)) for axis in "xy")
            value = convert_to_polar(x, y)
        numbers = value if isinstance(value, list) else [value]
        entries = self.entries() if isinstance(value, list) else [self]
        for entry, unit in zip(entries, cycle(getattr(by, "units", ["1"]))):
            if unit != "1" and type(entry.value) in self.UNSTATED:
                raise entry.refuse(self.FORM.format(name_unit(unit)))
        if DRAWN_WORD in numbers:
            name = self.key.removeprefix("motion.").partition(".")[0]
            drawn = self.file.drawn.get(name, DRAWN_WORD)
            numbers = [drawn if one == DRAWN_WORD else one for one in numbers]
            value = numbers if isinstance(value, list) else drawn
        try:
            return by.check(self.key, value)
        except InputError as error:
            alike = (entry for entry in entries if entry.value == error.value)
            wrong = next(alike, self.holding(error.value))
            allowed = error.allowed
            if wrong.value == DRAWN_WORD:
                of = "an angle, a stroke or a side directly under [motion] alone"
                allowed += f'; "{DRAWN_WORD}" needs [pins], and stands for {of}'
            raise wrong.refuse(allowed) from None

    def declared(self, by: Declared) -> Any:
        """Read a number, or a pair of numbers, which may be left out."""
        if self.value is None and by.left_out is not REQUIRED_NUMBER:
            return by.left_out
        return self.check(by)

    def numbers(self, numbers: Mapping[str, Declared]) -> dict[str, Any]:
        """Read some numbers of this table, by name."""
        return {name: self[name].declared(by) for name, by in numbers.items()}

    def described(self, kind: Any, **stated: Any) -> Any:
        """Read a description of a class by the declarations of its fields.

        A place is stated by `from_pin`, `from_centre` or `point`, in polar form or by x
        and y.

        `stated`: fields that stand elsewhere.
        """
        if issubclass(kind, PinRows):
            return kind(self._read_rows(kind.numbers))
        fields: Any = list_declared(kind)
        if [field.key for field in fields] == _PAIR:
            return kind(*self.check(Declared(fields[0].by.unit, pair="rad")))
        if [field.key for field in fields if isinstance(field.by, Entries)] == [""]:
            return kind(self.holding({"": self.value})._read_field(fields[0]))
        self.table(list_keys(kind))
        make = kind
        for form, numbers in getattr(kind, "forms", {}).items():
            if form in self.value:
                make = getattr(kind, form)
                fields = [one for one in fields if not isinstance(one.by, Declared)]
                self.table((*(field.key for field in fields), form))
                self[form].table(numbers)
                stated |= self[form].numbers(numbers)
        if states_place(kind):
            by = next(field.by for field in fields if field.name == "bar")
            place = self._read_place(by.bars)._asdict()
            for field in fields:
                if field.name in place:
                    stated[field.name] = place[field.name]
        for field in fields:
            if field.name not in stated:
                stated[field.name] = self._read_field(field)
        return self._make(make, stated, kind.stated_at)

    def _make(self, make: Any, stated: dict[str, Any], section: str) -> Any:
        """Make a description; errors name the file, and the key in it."""
        try:
            return make(**stated)
        except InputError as error:
            if error.file or "{" in section:
                raise
            inner = error.key.removeprefix(section).removeprefix(".")
            key = f"{self.key}.{inner}".strip(".")
            raise error.moved_to(key, self.file.name) from None

    def _read_field(self, field: DeclaredField) -> Any:
        """Read one field of a description from this table."""
        entry = self[field.key]
        by = field.by
        if isinstance(by, At):
            if by.is_value:
                return self._read_place(by.bars)
            entry.table(_KEYS_OF_PLACE)
            end = entry._read_place(by.bars)
            return end._replace(from_pin=AT_FIRST_PIN) if end == Place(end.bar) else end
        if entry.value is None and field.left_out is not REQUIRED_NUMBER:
            return field.left_out
        if isinstance(by, Entries):
            if (
                not isinstance(entry.value, list)
                or not 1 <= len(entry.value) <= by.most
            ):
                raise entry.refuse(f"must be a list of 1 to {by.most} {field.name}")
            return tuple(one.described(by.kind) for one in entry.entries())
        if isinstance(by, Part):
            return entry.described(by.kind)
        return entry.check(by)

    def _read_rows(self, numbers: Mapping[str, Declared]) -> tuple[Any, ...]:
        """Read what each pin has: one number, or a table of several."""
        rows = []
        for pin in self.table(PINS):
            stated = self[pin]
            if "" in numbers:
                stated = stated.holding({"": stated.value})
            stated.table(numbers)
            rows.append((pin, *stated.numbers(numbers).values()))
        return tuple(rows)

    def _read_place(self, allowed_bars: tuple[int, ...]) -> Place:
        """Read the bar of this table, one of some, and its place, which one key states.

        A table without such a key is at the bar's first pin.
        """
        names = (*PLACES_OF_LOADS, DRAWN_WORD)
        stated = [name for name in names if name in self.value]
        if len(stated) > 1:
            allowed = f"{stated[0]} states the place already; state one of them"
            raise self[stated[1]].refuse(allowed)
        bars = self.file.bars
        name = self.value.get("point")
        of_bar = self["bar"]
        if name is not None:
            if name not in [*bars]:
                known = ", ".join(bars) or "none"
                allowed = (
                    f"must be a point of [points], which has {known}; the first pin of"
                    ' a bar is from_pin = ["0 m", "0 deg"], the second has its length'
                    " in place of 0"
                )
                raise self["point"].refuse(allowed)
            if of_bar.value is None:
                of_bar.value = bars[name]
        bar = of_bar.check(OfBar(allowed_bars))
        if name is not None and bar != bars[name]:
            raise of_bar.refuse(f"the point {name} is on bar {bars[name]}")
        for holder in (self, self["from_pin"]):
            if holder.is_drawn():
                return Place(bar, holder.locate(bar))
        return Place(bar, **self.numbers(STATED_PLACES), point=name)

    def is_drawn(self) -> bool:
        """Return True for a table that states a place of the drawing."""
        return isinstance(self.value, dict) and DRAWN_WORD in self.value

    def locate(self, bar: int) -> tuple[float, float]:
        """Read `drawn = [x, y]` of this table in the frame of a bar, m and rad."""
        drawn = self[DRAWN_WORD]
        if bar != 1 and not isinstance(self.file.drawing, DrawnPins):
            raise drawn.refuse(
                "is a place of a moving bar: it is drawn where [pins] states the"
                " linkage; here from_pin states it"
            )
        z = self.file.drawing.into_bar(bar, drawn.check(DRAWN_PLACE))
        return convert_to_polar(z.real, z.imag)


def list_keys(kind: Any) -> tuple[str, ...]:
    """List the keys in which a scene file states a description of a class."""
    keys = list[str]()
    for field in list_declared(kind):
        keys += [field.key] if field.key else _KEYS_OF_PLACE
    if states_place(kind):
        keys.append(DRAWN_WORD)
    return (*keys, *getattr(kind, "forms", ()))


def convert_to_polar(x: float, y: float) -> tuple[float, float]:
    """Return the distance and the angle of a place given by coordinates, rad."""
    return math.hypot(x, y), math.atan2(y, x)


class Written(str):
    """A number in SI with its unit, every digit kept."""

    value: float


def write_quantity(value: float, unit: str) -> Any:
    """Write a number in SI with its unit; of unit "1" it stays a number."""
    if unit == "1":
        return value
    text = Written(f"{float(value)!r} {unit}")
    text.value = float(value)
    return text


def write_declared(value: Any, by: Declared) -> Any:
    """Write a number, or a pair of numbers, as it is declared."""
    if not by.pair:
        return write_quantity(value, by.unit)
    return [write_quantity(*one) for one in zip(value, by.units, strict=True)]


def write_described(description: Any) -> Any:
    """Write a description by the declarations of its fields.

    What it leaves out stays out. A table is returned, or the list that is the value of
    an effect.
    """
    if isinstance(description, PinRows):
        return _write_rows(description)
    table = dict[str, Any]()
    for field in list_declared(type(description)):
        value = getattr(description, field.name)
        by = field.by
        if value is None:
            continue
        if isinstance(by, Declared):
            value = write_declared(value, by)
        elif isinstance(by, At):
            value = _write_place(value)
            if by.is_value:
                table |= value
                continue
        elif isinstance(by, Entries):
            if not value and not by.is_value:
                continue
            value = [*map(write_described, value)]
        elif isinstance(by, Part):
            value = write_described(value)
        elif isinstance(by, Listed):
            value = [write_quantity(number, by.unit) for number in value]
        table[field.key] = value
    if [*table] == _PAIR:
        return [*table.values()]
    return table.get("", table)


def _write_rows(rows: PinRows) -> dict[str, Any]:
    """Write what each pin has: one number, or a table of several."""
    table = dict[str, Any]()
    for pin, *numbers in rows.rows:
        pairs = zip(rows.numbers.items(), numbers, strict=True)
        row = {name: write_declared(number, by) for (name, by), number in pairs}
        table[pin] = row.get("", row)
    return table


def _write_place(place: Place) -> dict[str, Any]:
    stated = dict[str, Any]()
    for name, value in place._asdict().items():
        if isinstance(value, tuple):
            stated[name] = write_declared(value, STATED_PAIR)
        elif value is not None:
            stated[name] = value
    return stated
