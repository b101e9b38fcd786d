"""Entries of a scene file, read and written.

Every error names the file, the key, the value and what is allowed.
"""

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

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
    is_within,
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
_STEP_OF_KEY = re.compile(r"[^.\[\]]+")
"""One name or index of a key like `loads[0].force[1]`."""


class Reader:
    """Reads entries of one file; effects are read through it too."""

    QUANTITY = 'with a unit, like "1 {}"'
    """The form of a number of a unit, as errors say it. Likewise of several, and of a
    polar pair.
    """
    QUANTITIES = '["1 {0}", "2 {0}"]'
    POLAR = '["1 {}", "0 deg"]'
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

    def refuse(self, key: str, value: object, allowed: str) -> InputError:
        """Make the error for an entry, or a missing one (None), with the file."""
        return InputError(
            key,
            _shorten_for_error(value),
            f"{'is missing; ' if value is None else ''}{allowed}",
            self.file,
        )

    def table(self, key: str, value: object, allowed: Iterable[str]) -> dict[str, Any]:
        """Read a table that holds no keys but those allowed.

        `key`: "" for the top of the file.
        """
        names = list(allowed)
        if not isinstance(value, dict):
            raise self.refuse(
                key,
                value,
                "must be a table with the keys " + ", ".join(names),
            )
        for name, entry in value.items():
            if name not in names:
                known = f"{_suggest_word(name, names)}allowed: {', '.join(names)}"
                if _TABLE_OF.get(name, key) != key:
                    known = f"write it under [{_TABLE_OF[name]}]"
                if "inertia" in names and name in _FORMULAS:
                    known = _FORMULAS[name]
                hint = ELSEWHERE if _is_elsewhere(key, value, names) else known
                raise self.refuse(_join_key(key, name), entry, f"unknown key; {hint}")
        return value

    def text(self, key: str, value: object) -> str:
        """Read a string."""
        if not isinstance(value, str):
            raise self.refuse(key, value, "must be a text in quotes")
        return value

    def choice(self, key: str, value: object, allowed: Iterable[str]) -> str:
        """Read one of a few words."""
        words = list(allowed)
        if not isinstance(value, str) or value not in words:
            raise self.refuse(
                key,
                value,
                f"{_suggest_word(value, words)}must be "
                + " or ".join(f'"{word}"' for word in words),
            )
        return value

    def whole(self, key: str, value: object, least: int, most: int) -> int:
        """Read an integer of a range, both ends included."""
        if (
            isinstance(value, bool)
            or not isinstance(value, int)
            or not least <= value <= most
        ):
            raise self.refuse(
                key,
                value,
                f"must be a whole number from {least} to {most}",
            )
        return value

    def bar(self, key: str, value: object, bars: tuple[int, ...] = MOVING_BARS) -> int:
        """Read the number of a bar, one of `bars`."""
        if isinstance(value, bool) or not isinstance(value, int) or value not in bars:
            numbers = [f"{bar} ({BAR_NAMES[bar]})" for bar in bars]
            allowed = f"must be {', '.join(numbers[:-1])} or {numbers[-1]}"
            if isinstance(value, int) and value > len(BAR_NAMES):
                allowed = f"{allowed}: {ELSEWHERE}"
            raise self.refuse(key, value, allowed)
        return value

    def number(self, key: str, value: object) -> float:
        """Read a number without a dimension."""
        if (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not math.isfinite(value)
        ):
            raise self.refuse(
                key,
                value,
                "must be a finite number without a unit, and without quotes",
            )
        return float(value)

    def quantity(
        self,
        key: str,
        value: object,
        unit: str,
        bound: str = ANY_NUMBER,
        default: float | None = None,
    ) -> float:
        """Read a number in `unit`; with unit "1" it has none.

        `default`: what a value of None stands for.
        """
        if value is None and default is not None:
            return default
        if unit == "1":
            return self.number(key, value)
        wanted = f"must be {bound} {self.QUANTITY.format(name_unit(unit))}"
        number = self.in_si(key, value, unit, wanted)
        if not is_within(number, bound):
            raise self.refuse(key, value, wanted)
        return number

    def in_si(self, key: str, value: object, unit: str, wanted: str) -> float:
        """Convert a text with a unit to a number in `unit`."""
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            like = f"{value:.6g} {self._find_likely_unit(key, unit)}"
            missing = f'the unit is missing; did you mean "{like}"? {wanted}'
            raise self.refuse(key, value, missing)
        if value == "drawn":
            _, _, name = key.partition("motion.")
            drawn = self.drawn.get(name.partition(".")[0])
            if drawn is not None:
                return drawn
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
        around: list[Any] = [self.document]
        for step in _STEP_OF_KEY.findall(key):
            holder = around[-1]
            if isinstance(holder, dict):
                around.append(holder.get(step))
            elif isinstance(holder, list) and step.isdigit():
                around += holder[int(step) : int(step) + 1]
            else:
                break
        for holder in reversed(around):
            for text in _list_texts(holder):
                stated = find_unit(text, "")
                if stated and converts(stated, unit):
                    return stated
        return name_unit(unit, _LIKELY.get(unit))

    def declared(self, key: str, value: object, by: Declared) -> Any:
        """Read a number, or a magnitude with its angle, as it is declared."""
        if value is None and by.left_out is not REQUIRED_NUMBER:
            return by.left_out
        if by.pair:
            return self.pair(key, value, by)
        return self.quantity(key, value, *by[:2])

    def numbers(
        self,
        key: str,
        given: Mapping[str, object],
        numbers: Mapping[str, Declared],
    ) -> dict[str, Any]:
        """Read each of some numbers, by name."""
        return {
            name: self.declared(f"{key}.{name}".rstrip("."), given.get(name), by)
            for name, by in numbers.items()
        }

    def pair(self, key: str, value: object, by: Declared) -> tuple[float, float]:
        """Read a declared pair: magnitude and angle, or two numbers of a kind."""
        if by.pair == "rad":
            return self.polar(key, value, by.unit)
        if not isinstance(value, list) or len(value) != 2:
            form = f'["1 {by.unit}", "1 {by.pair}"]'
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

    def polar(self, key: str, value: object, unit: str) -> tuple[float, float]:
        """Read a pair [magnitude, angle], in `unit` and rad, or { x, y }."""
        if isinstance(value, dict) and self.COORDINATES:
            entry = self.table(key, value, ("x", "y"))
            x, y = (
                self.quantity(f"{key}.{name}", entry.get(name), unit) for name in "xy"
            )
            if not math.isfinite(math.hypot(x, y)):
                raise self.refuse(key, value, "must have a finite size")
            self.coordinates[key] = x, y
            return convert_to_polar(x, y)
        if not isinstance(value, list) or len(value) != 2:
            named = name_unit(unit)
            polar = self.POLAR.format(named)
            form = self.COORDINATES.format(named)
            raise self.refuse(key, value, f"must be a pair like {polar} {form}".strip())
        return (
            self.quantity(f"{key}[0]", value[0], unit),
            self.quantity(f"{key}[1]", value[1], "rad"),
        )


def _list_texts(holder: Any) -> Iterator[str]:
    """List the texts of an entry, those of tables and lists within it too."""
    if isinstance(holder, str):
        yield holder
    elif isinstance(holder, Mapping):
        for entry in holder.values():
            yield from _list_texts(entry)
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
    """Write a number, or a magnitude with its angle, as it is declared."""
    if by.pair:
        return write_pair(value[0], value[1], by.unit, by.pair)
    return write_quantity(value, by.unit)


def write_numbers(description: Any) -> dict[str, Any]:
    """Write the numbers that a description states; what it leaves out stays out."""
    values = {name: getattr(description, name) for name in description.numbers}
    return {
        name: write_declared(value, description.numbers[name])
        for name, value in values.items()
        if value is not None
    }


def write_pair(
    first: float,
    second: float,
    unit: str,
    of_second: str = "rad",
) -> list[str]:
    """Write a pair, mostly [magnitude, angle], likewise."""
    return [write_quantity(first, unit), write_quantity(second, of_second)]


def _is_elsewhere(key: str, table: dict[str, Any], names: list[str]) -> bool:
    """Return True if a table has a key of another mechanism, or too many bars or pins.

    A key that may mean one of those allowed is none.
    """
    unknown = [name for name in table if name not in names]
    if key == "pins" and len(table) > len(names):
        return True
    if key == "lengths" and table.keys() >= set(BAR_NAMES.values()):
        for name in unknown:
            if is_length(table[name]) and not _suggest_word(name, names):
                return True
    of_pins = names == [*PINS] and any(_FURTHER_PIN.fullmatch(name) for name in unknown)
    return of_pins or any(
        names_other_mechanism(name) and _MEANT.get(name) not in names
        for name in unknown
    )


def _suggest_word(word: object, names: list[str]) -> str:
    """Suggest the valid word that is nearest to one that is not, or means the same."""
    if isinstance(word, str) and _MEANT.get(word) in names:
        return f'did you mean "{_MEANT[word]}"? '
    if isinstance(word, str):
        close = difflib.get_close_matches(word[:LONGEST_FIELD], names, 1)
    else:
        close = []
    if close:
        return f'did you mean "{close[0]}"? '
    return ""


def _join_key(key: str, name: str) -> str:
    """Join the dotted key.

    A name that is not a plain word is quoted, so that it stays on one line.
    """
    if not BARE_KEY.fullmatch(name):
        name = repr(
            name if len(name) <= LONGEST_FIELD else name[:LONGEST_FIELD] + "..."
        )
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
