"""Entries of a scene file, read and written: numbers, places and whole descriptions.

Every error names the file, the key, the value and what is allowed. Loads, points,
drives, springs and effects follow the declarations of their fields.
"""

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

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
    ELSEWHERE,
    InputError,
    name_unit,
    names_other_mechanism,
    write_count,
)
from fourbar.linkage import (
    ANY_NUMBER,
    BAR_NAMES,
    MOVING_BARS,
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
    is_within,
    list_declared,
)
from fourbar.quantities.units import (
    UNIT_MISSING,
    UnitError,
    converts,
    find_unit,
    to_si,
)
from fourbar.scene.motion import is_length

BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,40}")
LONGEST_FIELD = 60
DIRECTION_WORDS = {
    "up": "90 deg",
    "down": "-90 deg",
    "left": "180 deg",
    "right": "0 deg",
}
"""Words for directions, as the suggestions of an error know them."""
_FURTHER_PIN = re.compile(r"[C-F]|O_?[5-9]")
"""Pins of more than four bars, as they are usually named."""
_MEANT = {
    "weight": "mass",
    "torque": "moment",
    "couple": "moment",
    "rate": "stiffness",
    "k": "stiffness",
    "material": "density",
    "crank": "input",
    "rocker": "output",
    "follower": "output",
    "frame": "ground",
    "x": "from_pin",
    "y": "from_pin",
    "at": "from_pin",
    "pin": "from_pin",
    **dict.fromkeys(("theta", "angle"), "theta_2"),
    **dict.fromkeys(("omega", "speed", "rpm"), "omega_2"),
    "alpha": "alpha_2",
    **dict.fromkeys(("cg", "cog", "com", "G"), "centre"),
    "I": "inertia",
    "link": "bar",
    "start": "from",
    "stop": "to",
    "end": "to",
}
"""Words that are no keys, and the keys that may be meant by them."""
_FORMULAS = dict.fromkeys(
    ("radius_of_gyration", "gyration", "k_G"),
    "write inertia = m k^2, or m (k^2 - r^2) if k is about a pin at r from the centre",
)
"""Words for what a key states by a formula."""
_TABLE_OF = {
    "ground_angle": "lengths",
    **dict.fromkeys(("branch", "side", "stroke", "law", "free"), "motion"),
    **dict.fromkeys(("theta_2", "omega_2", "alpha_2"), "motion"),
    **dict.fromkeys(("gravity", "viscous", "friction", "pin_friction"), "effects"),
    **dict.fromkeys(("torsion", "springs", "flywheel"), "effects"),
}
"""Tables of keys that are easily written elsewhere."""
_LIKELY = {"rad": "deg", "m": "mm", "rad/s": "rpm"}
"""Units that a number without one may have been meant in, other than the SI unit. They
are suggested where no number beside it has a unit of the kind.
"""
PLACES_OF_ENDS = (*STATED_PLACES, "point")
"""Keys of which one states an end of a spring or cylinder, or the point of a force."""
_KEYS_OF_PLACE = ("bar", *PLACES_OF_ENDS)
_PAIR = ["0", "1"]
"""Keys of two numbers that are written as a pair [magnitude, angle]."""


def split_key(key: str) -> list[str | int]:
    """List the names and indices of a key like `loads[0].force[1]` or `loads.0`."""
    steps = re.findall(r"[^.\[\]]+", key)
    return [int(step) if step.isdigit() else step for step in steps]


class Reader:
    """Reads entries of one file; effects are read through it too."""

    QUANTITY = 'with a unit, like "1 {}"'
    """The form of a number of a unit, as errors say it. Likewise of several, and of a
    polar pair.
    """
    QUANTITIES = '["1 {0}", "2 {0}"]'
    POLAR = '["1 {0}", "0 deg"]'
    COORDINATES = 'or {{ x = "1 {0}", y = "0 {0}" }}'
    """A place or a force by its components; empty where it has to be polar."""

    def __init__(self, file: str, document: Mapping[str, Any] | None = None) -> None:
        self.file = file
        self.document: Mapping[str, Any] = document or {}
        """Tables of the file, for suggestions."""
        self.coordinates: dict[str, tuple[float, float]] = {}
        """x and y of the places (m) and forces that are stated by them, by their keys.
        """
        self.drawn: dict[str, float] = {}
        """Numbers that the word "drawn" stands for in a motion, by their names."""
        self.bars: dict[str, int] = {}
        """Bar of each named point, which a place at it need not state again."""

    def refuse(self, key: str, value: object, allowed: str) -> InputError:
        """Make the error for an entry, or a missing one (None), with the file."""
        missing = "is missing; " if value is None else ""
        return InputError(key, _shorten_for_error(value), missing + allowed, self.file)

    def table(self, key: str, value: object, allowed: Iterable[str]) -> dict[str, Any]:
        """Read a table that holds no keys but those allowed.

        `key`: "" for the top of the file.
        """
        names = list(allowed)
        if not isinstance(value, dict):
            allowed = f"must be a table with the keys {', '.join(names)}"
            raise self.refuse(key, value, allowed)
        for name, entry in value.items():
            if name not in names:
                known = f"{_suggest_word(name, names)}allowed: {', '.join(names)}"
                if _TABLE_OF.get(name, key) != key:
                    known = f"write it under [{_TABLE_OF[name]}]"
                if "inertia" in names and name in _FORMULAS:
                    known = _FORMULAS[name]
                if _is_elsewhere(key, value, names):
                    known = ELSEWHERE
                raise self.refuse(_join_key(key, name), entry, f"unknown key; {known}")
        return value

    def text(self, key: str, value: object) -> str:
        """Read a string."""
        if not isinstance(value, str):
            raise self.refuse(key, value, "must be a text in quotes")
        return value

    def choice(self, key: str, value: object, allowed: Iterable[str]) -> Any:
        """Read one of a few words."""
        words = list(allowed)
        if value not in words:
            quoted = " or ".join(f'"{word}"' for word in words)
            meant = _suggest_word(value, words)
            raise self.refuse(key, value, f"{meant}must be {quoted}")
        return value

    def whole(self, key: str, value: Any, least: int, most: int) -> int:
        """Read an integer of a range, both ends included."""
        if type(value) is not int or not least <= value <= most:
            allowed = f"must be a whole number from {least} to {most}"
            raise self.refuse(key, value, allowed)
        return value

    def bar(self, key: str, value: object, bars: tuple[int, ...] = MOVING_BARS) -> int:
        """Read the number of a bar, one of `bars`."""
        if type(value) is not int or value not in bars:
            *others, last = (f"{bar} ({BAR_NAMES[bar]})" for bar in bars)
            allowed = f"must be {', '.join(others)} or {last}"
            if isinstance(value, int) and value > len(BAR_NAMES):
                allowed = f"{allowed}: {ELSEWHERE}"
            raise self.refuse(key, value, allowed)
        return value

    def number(self, key: str, value: Any) -> float:
        """Read a number without a dimension."""
        if type(value) not in (int, float) or not math.isfinite(value):
            allowed = "must be a finite number without a unit, and without quotes"
            raise self.refuse(key, value, allowed)
        return float(value)

    def quantity(
        self,
        key: str,
        value: object,
        unit: str,
        bound: str = ANY_NUMBER,
    ) -> float:
        """Read a number in `unit`; with unit "1" it has none."""
        if unit == "1":
            return self.number(key, value)
        wanted = f"must be {bound} {self.QUANTITY.format(name_unit(unit))}"
        number = self.in_si(key, value, unit, wanted)
        if not is_within(number, bound):
            raise self.refuse(key, value, wanted)
        return number

    def in_si(self, key: str, value: Any, unit: str, wanted: str) -> float:
        """Convert a text with a unit to a number in `unit`."""
        if type(value) in (int, float):
            like = f"{value:.6g} {self._find_likely_unit(key, unit)}"
            missing = f'the unit is missing; did you mean "{like}"? {wanted}'
            raise self.refuse(key, value, missing)
        if value == "drawn":
            _, _, name = key.partition("motion.")
            name = name.partition(".")[0]
            if name in self.drawn:
                return self.drawn[name]
            allowed = "stands for what a drawing has, and the scene has no [pins]; "
            raise self.refuse(key, value, allowed + wanted)
        if not isinstance(value, str):
            raise self.refuse(key, value, wanted)
        try:
            return to_si(value, unit)
        except UnitError as error:
            hint = ""
            if unit == "rad" and value.casefold() in DIRECTION_WORDS:
                hint = f'did you mean "{DIRECTION_WORDS[value.casefold()]}"? '
            elif str(error) == UNIT_MISSING:
                likely = self._find_likely_unit(key, unit)
                hint = f'did you mean "{value.strip()} {likely}"? '
            elif unit == "kg" and converts(find_unit(value, "m"), "kg/m"):
                hint = f'did you mean mass_per_length = "{value.strip()}"? '
            raise self.refuse(key, value, f"{error}; {hint}{wanted}") from None

    def _find_likely_unit(self, key: str, unit: str) -> str:
        """Return the unit in which a number without one was probably meant.

        The nearest number of its kind decides, first in the entry's own table, then in
        those around it.
        """
        holder: Any = self.document
        around = [holder]
        with suppress(LookupError, TypeError):
            for step in split_key(key):
                holder = holder[step]
                around.append(holder)
        for holder in reversed(around):
            for text in _list_texts(holder):
                stated = find_unit(text, "")
                if stated and converts(stated, unit):
                    return stated
        return name_unit(unit, _LIKELY.get(unit))

    def declared(self, key: str, value: object, by: Declared) -> Any:
        """Read a number, or a pair of numbers, as it is declared."""
        if value is None and by.left_out is not REQUIRED_NUMBER:
            return by.left_out
        if by.pair:
            return self.pair(key, value, by)
        return self.quantity(key, value, by.unit, by.bound)

    def numbers(
        self,
        key: str,
        given: Mapping[str, object],
        numbers: Mapping[str, Declared],
    ) -> dict[str, Any]:
        """Read each of some numbers, by name."""
        return {
            name: self.declared(f"{key}.{name}".strip("."), given.get(name), by)
            for name, by in numbers.items()
        }

    def pair(self, key: str, value: object, by: Declared) -> tuple[float, float]:
        """Read a declared pair: two numbers, or { x, y } of a magnitude and angle."""
        is_polar = by.pair == "rad"
        if is_polar and isinstance(value, dict) and self.COORDINATES:
            entry = self.table(key, value, ("x", "y"))
            x, y = (
                self.quantity(f"{key}.{name}", entry.get(name), by.unit)
                for name in "xy"
            )
            if not math.isfinite(math.hypot(x, y)):
                raise self.refuse(key, value, "must have a finite size")
            self.coordinates[key] = x, y
            return convert_to_polar(x, y)
        if not isinstance(value, list) or len(value) != 2:
            form = f'["1 {by.unit}", "1 {by.pair}"]'
            if is_polar:
                form = f"{self.POLAR} {self.COORDINATES}".strip()
                form = form.format(name_unit(by.unit))
            raise self.refuse(key, value, f"must be a pair like {form}")
        first, second = (
            self.quantity(f"{key}[{index}]", value[index], unit, by.bounds[index])
            for index, unit in enumerate(by.units)
        )
        return first, second

    def quantities(self, key: str, value: object, unit: str) -> tuple[float, ...]:
        """Read a list of numbers with units, in `unit`."""
        if not isinstance(value, list):
            form = f"like {self.QUANTITIES.format(name_unit(unit))}"
            if unit == "1":
                form = "of numbers without a unit"
            raise self.refuse(key, value, f"must be a list {form}")
        return tuple(
            self.quantity(f"{key}[{index}]", entry, unit)
            for index, entry in enumerate(value)
        )

    def described(self, key: str, value: Any, kind: Any, **stated: Any) -> Any:
        """Read a description of a class by the declarations of its fields.

        A place is stated by `from_pin`, `from_centre` or `point`, in polar form or by x
        and y.

        `stated`: fields that stand elsewhere.
        """
        if issubclass(kind, PinRows):
            return kind(self._read_rows(key, value, kind))
        fields: Any = list_declared(kind)
        if [field.key for field in fields] == _PAIR:
            by = Declared(fields[0].by.unit, pair="rad")
            return kind(*self.pair(key, value, by))
        if [field.key for field in fields if isinstance(field.by, Entries)] == [""]:
            return kind(self._read_field(key, {"": value}, fields[0]))
        entry = self.table(key, value, list_keys(kind))
        make = kind
        for form, numbers in getattr(kind, "forms", {}).items():
            if form in entry:
                make = getattr(kind, form)
                fields = [one for one in fields if not isinstance(one.by, Declared)]
                self.table(key, entry, (*(field.key for field in fields), form))
                table = self.table(f"{key}.{form}", entry[form], numbers)
                stated |= self.numbers(f"{key}.{form}", table, numbers)
        if states_place(kind):
            by = next(field.by for field in fields if field.name == "bar")
            place = self._read_place(key, entry, by.bars)._asdict()
            for field in fields:
                if field.name in place:
                    stated[field.name] = place[field.name]
        for field in fields:
            if field.name not in stated:
                stated[field.name] = self._read_field(key, entry, field)
        with self._knowing(key, kind.stated_at):
            return make(**stated)

    @contextmanager
    def _knowing(self, key: str, section: str) -> Iterator[None]:
        """Name the file and the key in errors of one description of a section."""
        try:
            yield
        except InputError as error:
            if error.file or "{" in section:
                raise
            inner = error.key.removeprefix(section).removeprefix(".")
            raise error.moved_to(f"{key}.{inner}".strip("."), self.file) from None

    def _read_field(
        self, key: str, entry: Mapping[str, Any], field: DeclaredField
    ) -> Any:
        """Read one field of a description from the entries of its table."""
        path = f"{key}.{field.key}".rstrip(".")
        value = entry.get(field.key)
        by = field.by
        if isinstance(by, At):
            if by.is_value:
                return self._read_place(key, entry, by.bars)
            table = self.table(path, value, _KEYS_OF_PLACE)
            end = self._read_place(path, table, by.bars)
            return end._replace(from_pin=AT_FIRST_PIN) if end == Place(end.bar) else end
        if value is None and field.left_out is not REQUIRED_NUMBER:
            return field.left_out
        if isinstance(by, Entries):
            if not isinstance(value, list) or not 1 <= len(value) <= by.most:
                allowed = f"must be a list of 1 to {by.most} {field.name}"
                raise self.refuse(path, value, allowed)
            return tuple(
                self.described(f"{path}[{index}]", one, by.kind)
                for index, one in enumerate(value)
            )
        if isinstance(by, Part):
            return self.described(path, value, by.kind)
        if isinstance(by, Listed):
            return self.quantities(path, value, by.unit)
        if isinstance(by, Whole):
            return self.whole(path, value, by.least, by.most)
        if isinstance(by, OneOf):
            return self.choice(path, value, by.words)
        if isinstance(by, OfBar):
            return self.bar(path, value, by.bars)
        return self.declared(path, value, by)

    def _read_rows(self, key: str, value: object, kind: Any) -> tuple[Any, ...]:
        """Read what each pin has: one number, or a table of several."""
        rows = []
        for pin, entry in self.table(key, value, PINS).items():
            path = f"{key}.{pin}"
            stated = {"": entry}
            if "" not in kind.numbers:
                stated = self.table(path, entry, kind.numbers)
            rows.append((pin, *self.numbers(path, stated, kind.numbers).values()))
        return tuple(rows)

    def _read_place(
        self, key: str, entry: Mapping[str, Any], allowed_bars: tuple[int, ...]
    ) -> Place:
        """Read the bar of an entry, one of some, and its place, which one key states.

        An entry without such a key is at the bar's first pin.
        """
        stated = [name for name in PLACES_OF_LOADS if name in entry]
        if len(stated) > 1:
            allowed = f"{stated[0]} states the place already; state one of them"
            raise self.refuse(f"{key}.{stated[1]}", entry[stated[1]], allowed)
        bars = self.bars
        name: Any = entry.get("point")
        if name is not None:
            if name not in [*bars] and (not bars or name in [*PINS]):
                allowed = (
                    "must be a point of [points]; the first pin of a bar is "
                    'from_pin = ["0 m", "0 deg"], the second has its length in place of'
                    " 0"
                )
                raise self.refuse(f"{key}.point", name, allowed)
            self.choice(f"{key}.point", name, bars)
        bar = self.bar(f"{key}.bar", entry.get("bar", bars.get(name)), allowed_bars)
        if name is not None and bar != bars[name]:
            allowed = f"the point {name} is on bar {bars[name]}"
            raise self.refuse(f"{key}.bar", bar, allowed)
        pairs = self.numbers(key, entry, STATED_PLACES)
        return Place(bar, **pairs, point=name)


def list_keys(kind: Any) -> tuple[str, ...]:
    """List the keys in which a scene file states a description of a class."""
    keys = list[str]()
    for field in list_declared(kind):
        keys += [field.key] if field.key else _KEYS_OF_PLACE
    return (*keys, *getattr(kind, "forms", ()))


def _list_texts(holder: Any) -> Iterator[str]:
    """List the texts of an entry, those of tables and lists within it too."""
    if isinstance(holder, dict):
        holder = [*holder.values()]
    if isinstance(holder, str):
        yield holder
    elif isinstance(holder, list):
        for entry in holder:
            yield from _list_texts(entry)


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
            value = [write_described(entry) for entry in value]
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


def _is_elsewhere(key: str, table: dict[str, Any], names: list[str]) -> bool:
    """Return True if a table has a key of another mechanism, or too many bars or pins.

    A key that may mean one of those allowed is none.
    """
    if key == "pins" and len(table) > len(names):
        return True
    has_lengths = key == "lengths" and table.keys() >= set(BAR_NAMES.values())
    for name in table.keys() - {*names}:
        if has_lengths and is_length(table[name]) and not _suggest_word(name, names):
            return True
        if names == [*PINS] and _FURTHER_PIN.fullmatch(name):
            return True
        if names_other_mechanism(name) and _MEANT.get(name) not in names:
            return True
    return False


def _suggest_word(word: object, names: list[str]) -> str:
    """Suggest the valid word that is nearest to one that is not, or means the same."""
    if not isinstance(word, str):
        return ""
    close = difflib.get_close_matches(word[:LONGEST_FIELD], names, 1)
    if _MEANT.get(word) in names:
        close = [_MEANT[word]]
    return f'did you mean "{close[0]}"? ' if close else ""


def _join_key(key: str, name: str) -> str:
    """Join the dotted key.

    A name that is not a plain word is quoted, so that it stays on one line.
    """
    if not BARE_KEY.fullmatch(name):
        end = "..." if len(name) > LONGEST_FIELD else ""
        name = repr(name[:LONGEST_FIELD] + end)
    return f"{key}.{name}" if key else name


def _shorten_for_error(value: object) -> object:
    """Shorten a value to what an error line shows: never long or deep."""
    if isinstance(value, str):
        return value[: 2 * LONGEST_FIELD]
    if isinstance(value, dict):
        return _Words(f"a table of {write_count(len(value), 'entry')}")
    if isinstance(value, list):
        if len(value) <= 3 and all(
            isinstance(entry, (str, float, bool)) for entry in value
        ):
            return [_shorten_for_error(entry) for entry in value]
        return _Words(f"a list of {write_count(len(value), 'entry')}")
    if isinstance(value, int) and value.bit_length() > 64:
        return _Words("a huge whole number")
    return value


class _Words(str):
    """A description that is shown without quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)
