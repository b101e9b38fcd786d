"""The units in which results are shown.

Units are a list like "mm N N.mm deg", those of a scene file, or SI with prefixes.
"""

import math
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from fourbar.errors import InputError
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array
from fourbar.solution import DEGREES, SI, Conversion, find_unit_in

ALLOWED_UNITS = 'must be "SI", "imperial" or a list like "mm N N.mm deg rpm"'
_PRESETS = {"si": "", "imperial": "in lbf lbf.in lb deg rpm hp psi"}
_FEET = "ft lbf lbf.ft lb deg rpm hp psi"
"""Imperial units of a scene whose lengths are in feet."""
STATABLE_UNITS = (
    "m",
    "N",
    "N m",
    "kg",
    "rad",
    "rad/s",
    "rad/s^2",
    "m/s",
    "m/s^2",
    "W",
    "Pa",
)
"""The SI units for which another one can be stated, each of a dimension of its own."""
FOLLOWING_UNITS = {"m/s": ("m", "{}/s"), "m/s^2": ("m", "{}/s^2"), "J": ("N m", "{}")}
"""Units that follow another one if not stated. Energy follows the unit of torque,
speeds that of length.
"""
COMMON: Conversion = {**DEGREES, "rad/s": ("rpm", 30.0 / math.pi)}
"""Units of a summary if no others are asked for. A unit that is left out is the SI unit
with a prefix.
"""
_RATES = {"rpm": COMMON["rad/s"][1], "rad/s": 1.0, "deg/s": DEGREES["rad"][1]}
"""Units in which rates of bars are shown, with their numbers in a rad/s."""
PREFIXES = (
    (1e9, "G"),
    (1e6, "M"),
    (1e3, "k"),
    (1.0, ""),
    (1e-3, "m"),
    (1e-6, "µ"),
    (1e-9, "n"),
)


def units(text: str) -> Conversion:
    """Read the units of a list, or of "SI" or "imperial".

    Imperial units are in, lbf, lbf in, lb, deg, rpm and hp. A product is joined by dots
    ("N.mm"). What the list leaves out stays SI, but for speeds and accelerations of
    points, which follow the length, and the energy, which follows the torque.

    Raises InputError for what is no unit of a result, and for two of one dimension.
    """
    if not isinstance(text, str):
        raise InputError("units", text, ALLOWED_UNITS)
    from fourbar.quantities.units import converts, to_si

    stated: dict[str, str] = {}
    for name in _PRESETS.get(text.casefold(), text).replace(",", " ").split():
        unit = next((unit for unit in STATABLE_UNITS if converts(name, unit)), None)
        if unit is None or unit in stated:
            what = (
                "no unit of a result" if unit is None else f"the second unit for {unit}"
            )
            raise InputError("units", name, f"is {what}; {ALLOWED_UNITS}")
        stated[unit] = name.replace(".", " ")
    mass = stated.get("kg", "")
    # names of the pound, a mass; a list that names no force may mean pounds-force
    if mass.casefold() in ("lb", "lbs", "pound", "pounds", "lbm") and "N" not in stated:
        reason = (
            "is a mass, and the list names no unit of force: write lbf for"
            " pounds-force, or both"
        )
        raise InputError("units", mass, reason)
    for unit, (base, form) in FOLLOWING_UNITS.items():
        if base in stated and unit not in stated:
            stated[unit] = form.format(stated[base])
    return {unit: (name, to_si(f"1 {unit}", name)) for unit, name in stated.items()}


def units_of_scene(document: Mapping[str, Any]) -> Conversion:
    """Return the units that suit the tables of a scene file.

    Lengths in inches, feet or yards give imperial units; otherwise lengths have the
    unit of lengths.ground, and speeds and accelerations of bars those that the motion
    is stated in, or rad/s if it is a released one. Tables that are no scene give
    `COMMON`: the reader says what is wrong with them.
    """
    try:
        length = str(find_length(document))
        motion = document.get("motion", {})
        rates = [
            _first_text(motion.get(f"{rate}_{bar}", ""))
            for bar in MOVING_BARS
            for rate in ("omega", "alpha")
        ]
        if "free" in motion:
            # what it reaches is read beside its acceleration, unless it states more
            rates.insert(0, "0 rad/s")
    except (LookupError, TypeError, AttributeError):
        return COMMON
    return units_of_length(length, *rates)


def _first_text(stated: Any) -> str:
    """Return a text, or the first of a list."""
    return str(stated[0]) if isinstance(stated, list) and stated else str(stated)


def states_radians(document: Mapping[str, Any]) -> bool:
    """Return True if the tables of a scene command an angle in rad."""
    motion = document.get("motion", {})
    stated = [
        table.get(f"theta_{bar}")
        for table in (motion, motion.get("law", {}))
        for bar in MOVING_BARS
    ]
    return re.search(r"\d\s*rad'", repr(stated)) is not None


@cache
def units_of_length(length: str, *rates: str) -> Conversion:
    """Return the units that suit a length, speeds and accelerations as written.

    Inches, feet and yards give imperial units; other lengths keep their unit.
    """
    from fourbar.quantities.units import IMPERIAL, converts, find_unit

    name = find_unit(length, "m")
    if name.casefold() in IMPERIAL:
        inches = name.casefold().startswith("in")
        shown = dict(units("imperial" if inches else _FEET))
    else:
        named = units(name.replace(" ", ".")) if converts(name, "m") else {}
        shown = {**COMMON, **named}
    for text in rates:
        name = find_unit(text, "")
        rate = name.removesuffix("^2").removesuffix("²")
        factor = _RATES.get(rate, 0.0)
        if factor and rate == name:
            shown["rad/s"] = rate, factor
        if factor and rate != "rpm":
            shown["rad/s^2"] = f"{rate}^2", factor
    return shown


def find_length(document: Mapping[str, Any]) -> object:
    """Return lengths.ground, or a coordinate of its end or a pin, as it is written."""
    if "pins" in document:
        return document["pins"]["A"][0]
    ground = document["lengths"]["ground"]
    return ground["x"] if isinstance(ground, Mapping) else ground


def choose_unit(largest: float, unit: str, units: Conversion = SI) -> tuple[float, str]:
    """Choose the factor from SI and the unit, or a suitable prefix.

    The prefix suits the largest magnitude; a rate has none, and no pure number "1".
    """
    if unit in units or unit == "1" or "/" in unit:
        name, factor = find_unit_in(unit, units)
        return factor, name.replace("^2", "²")
    if not math.isfinite(largest) or largest <= 0.0:
        return 1.0, unit
    fitting = (row for row in PREFIXES if largest >= row[0])
    size, prefix = next(fitting, PREFIXES[-1])
    return 1.0 / size, prefix + unit


SHOWN_AS_ZERO = 1e-13
"""Part of the largest number of its kind below which a number is shown as zero."""
PLACE_ROUNDING = 1e-6
"""Part of the motion within which the place of a flat maximum is located. A place
nearer to zero than that is zero.
"""
SHOWN_DIGITS, POSITION_DIGITS = 4, 6
"""Significant digits of a number of a summary, and of one about a single position."""


def drop_rounding(values: float | Array, largest: float | Array) -> Array:
    """Return numbers with zero for what is rounding of the largest of their kind."""
    return np.where(np.abs(values) <= SHOWN_AS_ZERO * largest, 0.0, values)


def drop_place_rounding(place: float, extent: float) -> float:
    """Return a place of a motion of this extent, and zero for one that is rounding."""
    return 0.0 if abs(place) <= PLACE_ROUNDING * abs(extent) else place


def write_cell(number: float, form: str) -> str:
    """Write a number for a table; a dash for no value, and 0 without a sign."""
    if not math.isfinite(number):
        return "-"
    text = format(number, form)
    if float(text) == 0.0:
        return text.removeprefix("-")
    return text


def write_digits(value: float, digits: int = SHOWN_DIGITS) -> str:
    """Write a number with some significant digits, up to a million without exponent.

    Zero has no sign.
    """
    return f"{float(f'{value:.{digits}g}') + 0.0:.6g}"


def write_ends(values: float | Array, write: Callable[[float], str]) -> str:
    """Write a number, or the least and the largest of several as "1 to 2"."""
    least, largest = (write(float(end)) for end in (np.min(values), np.max(values)))
    return least if least == largest else f"{least} to {largest}"


def write_short(
    value: float,
    unit: str,
    units: Conversion,
    largest: float | None = None,
    digits: int = SHOWN_DIGITS,
) -> str:
    """Write a quantity with some significant digits and a unit that suits.

    The unit suits it, or the largest of its kind.
    """
    factor, name = choose_unit(abs(value) if largest is None else largest, unit, units)
    return f"{write_digits(factor * value, digits)} {name}"
