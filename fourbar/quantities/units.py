"""Quantities as text, "48 cm" or "0.01 N m s/rad", to SI numbers.

Conversions are exact and rounded once. The units are a short list rather than all that
the units library knows, because the angle is a dimension here: rad/s is not 1/s, so
neither Hz nor a forgotten "deg" slips through.
"""

import math
import re
import tomllib
from fractions import Fraction
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from fourbar.errors import InputError

_TABLES = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
DEFINITIONS: str = _TABLES["definitions"]
"""Unit definitions in the form of the units library."""
PARSED_UNITS: dict[str, str] = _TABLES["common"]
"""What the library makes of the commonest texts. Loading it takes longer than NumPy."""
_JOINED = re.compile(r"(?<=[A-Za-z])[.-](?=[A-Za-z])")
"""N.mm, lbf-in: a product."""
_SWAPS = (
    {"lb": "lbf", "oz": "ozf", "kg": "kgf"},
    {"lbf": "lb", "ozf": "oz", "kgf": "kg"},
)
"""Names that stand for each other in ordinary speech. Here a pound is a mass.
"""
_SIGNS: dict[int, Any] = {
    **str.maketrans("⋅×•º˚", "···°°"),
    **dict.fromkeys(map(ord, '″”"'), " in"),
    **dict.fromkeys(map(ord, "′’'"), " ft"),
}
"""Other signs of a product and of a degree, and those of inches and feet."""
_PREFIXED_ANGLE = re.compile(
    r"(?<![A-Za-z])(?!m|µ|u|grad)[A-Za-zµ]{1,2}rad(?![A-Za-z])"
)
"""Grad, krad: a prefix before an angle. Nobody means one but milli- and micro-."""
_TURNING_SENSE = re.compile(r"\b(c?cw|clockwise)$", re.IGNORECASE)
"""A sense of turning after a unit: the sign states it."""
_GLUED = re.compile(r"(kg|g|N)(m|mm|cm)(?=$|[\^²*])")
"""kgm^2: a product without a sign between its factors."""
RAISED_TEXT = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+|(?<=[A-Za-z])[23](?![0-9])")
"""A power: a raised one, or the 2 of kg m2. No unit's name ends in 2 or 3."""
SUPERSCRIPT_DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_FRACTION = re.compile(
    r"([+-]?)(?:([0-9]{1,6})[ -])?([0-9]{1,6})/([1-9][0-9]{0,5})(?=[ A-Za-z'\"′″]|$)"
)
"""1/2 or -12 1/2, as inches are written; the sign is that of the sum."""
_FEET = re.compile(r"([+-]?)([0-9]{1,6}) ?['′’][ -]?(?=[0-9.][^'′’]*[\"″”]$)")
"""The feet of 1'6", 1' 6 1/2" or -1'-6.5"; the sign is that of the sum."""
NUMBER_TEXT = re.compile(
    r"[+-]?(?:[0-9]{1,100}(?:\.[0-9]{0,100})?|\.[0-9]{1,100})"
    r"(?:[eE][+-]?[0-9]{1,3})?(?![0-9.])"
)
UNIT_TEXT = re.compile(
    r"(?:[A-Za-zµμ°_]++(?:0(?![0-9]))?"
    r"(?:(?:\^|\*\*)-?[1-9](?![0-9])|[²³])?|[·*/()]|\s)++"
)
"""Names, each with at most one small exponent, and operators: nothing else reaches the
parser, no tower of powers. Names are taken whole (`++`), so that a text which does not
fit is refused in one pass.
"""
IMPERIAL = ("in", "inch", "inches", "ft", "foot", "feet", "yd", "yard", "yards")
"""Units of a length with which a scene is shown in imperial units, yards in feet."""
UNIT_MISSING = "the unit is missing"
"""Reason of the error for a number alone."""
_LONGEST_UNIT = 60
"""Characters of a unit that are read: the library takes long over longer texts."""


class UnitError(ValueError):
    """A text that is not a quantity, or is one of another dimension.

    The message says why in one phrase.
    """


# a drag reads the whole scene again at each step, and one of its texts has changed
@lru_cache(maxsize=1024)
def to_si(text: str, unit: str) -> float:
    """Convert the number in `text` to `unit`, as the nearest double.

    Raises UnitError where the text has no number, no unit, an unknown unit, or a unit
    of another dimension than `unit`, and where the number does not fit into a double.
    """
    text = _strip(text)
    feet = _FEET.match(text)
    text = text[feet.end() :] if feet else text
    number_text = _FRACTION.match(text) or NUMBER_TEXT.match(text)
    if number_text is None:
        raise UnitError("there is no finite number")
    name = _spell_unit(text[number_text.end() :])
    if name.startswith(","):
        raise UnitError("a comma is no part of a number")
    if not name:
        raise UnitError(UNIT_MISSING)
    if _TURNING_SENSE.search(name):
        raise UnitError("the sign says how it turns, counter-clockwise is positive")
    name = _GLUED.sub(r"\1 \2", name)
    wanted, wanted_dimension = _find_factor(unit)
    factor, dimension = _find_factor(name)
    if dimension != wanted_dimension:
        suggestion = _suggest_unit(number_text[0], name, unit)
        raise UnitError(f'"{name}" does not convert to {unit}{suggestion}')
    try:
        number = _read_fraction(number_text)
        if feet:
            inches = 12 * int(feet[2]) + number
            number = -inches if feet[1] == "-" else inches
        value = float(number * factor / wanted)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise UnitError("the number is too large")
    # Fraction has no -0.0
    return -0.0 if value == 0.0 and number_text[0].startswith("-") else value


def read_bare(text: str) -> float | None:
    """Return the number of a text, a fraction too; None if it has a unit."""
    text = _strip(text)
    if fraction := _FRACTION.fullmatch(text):
        return float(_read_fraction(fraction))
    try:
        return float(text)
    except ValueError:
        return None


def write_pint_quantity(quantity: Any) -> Any:
    """Write a quantity of the units library as text like "48 cm".

    An array of numbers becomes a list of such texts. The text is read as any other is:
    an angle is a dimension here, which it is not in the library, so that 10 Hz stay no
    speed.
    """
    unit = f"{quantity.units:~C}"
    numbers = np.asarray(quantity.magnitude, dtype=float).tolist()
    if isinstance(numbers, list):
        return [f"{number!r} {unit}" for number in numbers]
    return f"{numbers!r} {unit}"


def _strip(text: object) -> str:
    """Return a text without space around it, and the minus sign as a hyphen."""
    return str(text).strip().replace("−", "-")


def _read_fraction(text: re.Match[str]) -> Fraction:
    """Return the number that `NUMBER_TEXT` or `_FRACTION` matched."""
    if text.re is NUMBER_TEXT:
        return Fraction(text[0])
    sign, whole, above, below = text.groups()
    size = int(whole or 0) + Fraction(f"{above}/{below}")
    return -size if sign == "-" else size


def find_unit(text: object, otherwise: str) -> str:
    """Return the unit that a text has; another one where it has none."""
    last = _FEET.sub("", _strip(text))  # the inches of 1'6"
    number_text = _FRACTION.match(last) or NUMBER_TEXT.match(last)
    unit = last[number_text.end() :].strip() if number_text else ""
    unit = re.sub('[″”"]', "in", re.sub("[′’']", "ft", unit))
    return unit or otherwise


def half_unit_of_text(text: object, unit: str) -> float:
    """Return half a unit of the last decimal of the number in a text, in `unit`.

    A number without decimals gives 0.
    """
    last = _FEET.sub("", _strip(text))
    number_text = None if _FRACTION.match(last) else NUMBER_TEXT.match(last)
    if number_text is None:
        return 0.0
    digits, _, power = number_text[0].lower().partition("e")
    decimals = len(digits.partition(".")[2])
    if not decimals:
        return 0.0
    half = 0.5 * 10.0 ** (int(power or 0) - decimals)
    return half * find_factor(unit, find_unit(text, unit))


def find_factor(unit: str, given: str) -> float:
    """Return what a number in the unit `given` is multiplied by to be in `unit`.

    Raises InputError for a unit that is unknown or of another dimension.
    """
    try:
        return to_si(f"1 {given}", unit)
    except UnitError as error:
        raise InputError("unit", given, f"{error}; must convert to {unit}") from None


def _spell_unit(name: str) -> str:
    """Return the name of a unit with the signs and powers that the library knows."""
    return RAISED_TEXT.sub(
        lambda power: f"^{power[0].translate(SUPERSCRIPT_DIGITS)}",
        name.translate(_SIGNS),
    ).strip()


def converts(name: str, unit: str) -> bool:
    """Return True if a name is a unit of the dimension of another unit."""
    name = _GLUED.sub(r"\1 \2", _spell_unit(name))
    try:
        return _find_factor(name)[1] == _find_factor(unit)[1]
    except UnitError:
        return False


def _suggest_unit(number: str, name: str, unit: str) -> str:
    """Suggest a mass for a force, or the reverse, where that converts to `unit`."""
    for swap in _SWAPS:
        words = re.split("([A-Za-z]+)", name)
        meant = "".join(swap.get(word, word) for word in words)
        if meant != name and converts(meant, unit):
            return f'; did you mean "{number} {meant}"?'
    return ""


@cache
def _load_registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(None, non_int_type=Fraction)
    registry.load_definitions(DEFINITIONS.splitlines())
    return registry


@cache
def _find_factor(name: str) -> tuple[Fraction, dict[str, Fraction]]:
    """Return what one of the unit is in base units, and its dimension."""
    if name in PARSED_UNITS:
        number, *powers = PARSED_UNITS[name].split()
        bases = (power.partition("^") for power in powers)
        return Fraction(number), {
            f"[{base}]": Fraction(power or 1) for base, _, power in bases
        }
    return ask_library(name)


def ask_library(name: str) -> tuple[Fraction, dict[str, Fraction]]:
    """Return what the library makes of a unit: its number in base units, its dimension.

    Raises UnitError for what is no unit.
    """
    name = _JOINED.sub(" ", name.rstrip("."))
    if len(name) > _LONGEST_UNIT or not UNIT_TEXT.fullmatch(name):
        raise UnitError("the unit cannot be read")
    registry = _load_registry()
    if angle := _PREFIXED_ANGLE.search(name):
        raise UnitError(f'the unit "{angle[0]}" is not known')
    try:
        one = registry.Quantity(Fraction(1), registry.parse_units(name)).to_root_units()
    # the parser of the library raises whatever its tokenizer and evaluator do
    except Exception:
        raise UnitError(f'the unit "{name}" is not known') from None
    return Fraction(one.magnitude), dict(one.dimensionality)
