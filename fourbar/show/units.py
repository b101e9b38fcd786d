"""The units in which results are shown: a list such as "mm N N.mm deg", those of a scene file, or SI with prefixes."""

import math
from pathlib import Path

from fourbar.errors import InputError
from fourbar.solution import DEGREES, SI, Conversion, find_unit_in

ALLOWED = 'must be "SI", "imperial" or a list like "mm N N.mm deg rpm"'
PRESETS = {"si": "", "imperial": "in lbf lbf.in lb deg rpm hp"}
STATED = ("m", "N", "N m", "kg", "rad", "rad/s", "rad/s^2", "m/s", "m/s^2", "W")
"""The SI units for which another one can be stated, each of a dimension of its own."""
DERIVED = {"m/s": ("m", "{}/s"), "m/s^2": ("m", "{}/s^2"), "J": ("N m", "{}")}
"""Not stated, these follow another one: energy the unit of torque, speeds that of length."""
IMPERIAL = ("in", "inch", "inches", "ft", "foot", "feet")
"""Units of lengths.ground with which a scene is shown in imperial units."""
COMMON: Conversion = {**DEGREES, "rad/s": ("rpm", 30.0 / math.pi)}
"""Units of a summary where nobody asks for others: what is left out has the SI unit with a prefix."""
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
    """Read the units of a list, or of "SI" or "imperial" (in, lbf, lbf in, lb, deg, rpm, hp).

    A product is joined by dots ("N.mm"). What the list leaves out stays SI, but for speeds and accelerations of
    points, which follow the length, and the energy, which follows the torque.

    Raises InputError for what is no unit of a result, and for two of one dimension.
    """
    if not isinstance(text, str):
        raise InputError("units", text, ALLOWED)
    from fourbar.quantities.units import to_si

    stated: dict[str, str] = {}
    for name in PRESETS.get(text.casefold(), text).replace(",", " ").split():
        why = {unit: _explain_refusal(name, unit) for unit in STATED}
        unit = next((unit for unit in STATED if not why[unit]), None)
        if unit is None or unit in stated:
            hint = next(
                (
                    f"; {word}"
                    for reason in why.values()
                    if (word := reason.partition("; ")[2])
                ),
                "",
            )
            reason = (
                f"is no unit of a result{hint}"
                if unit is None
                else f"is the second unit for {unit}"
            )
            raise InputError("units", name, f"{reason}; {ALLOWED}")
        stated[unit] = name.replace(".", " ")
    for unit, (base, form) in DERIVED.items():
        if base in stated and unit not in stated:
            stated[unit] = form.format(stated[base])
    return {
        unit: (name, to_si(f"1 {unit}", name)) for unit, name in stated.items()
    } or SI


def _explain_refusal(name: str, unit: str) -> str:
    """Explain why a name is no unit for another one; empty where it is."""
    from fourbar.quantities.units import UnitError, to_si

    try:
        to_si(f"1 {name}", unit)
    except UnitError as error:
        return str(error).replace('"1 ', '"')
    return ""


def suit_units(length: str) -> Conversion:
    """Return the units that suit a length as it was typed: imperial for inches and feet, otherwise `COMMON`."""
    from fourbar.quantities.units import find_unit

    return (
        units("imperial") if find_unit(length, "m").casefold() in IMPERIAL else COMMON
    )


def units_of_file(path: Path) -> Conversion:
    """Return the units that suit a scene file, by the unit of its lengths.ground."""
    import tomllib

    return suit_units(
        str(tomllib.loads(path.read_text(encoding="utf-8"))["lengths"]["ground"])
    )


def choose_unit(largest: float, unit: str, units: Conversion = SI) -> tuple[float, str]:
    """Choose the factor from SI and the unit given, or the prefix that suits the largest magnitude; a rate has none."""
    if unit in units or "/" in unit:
        name, factor = find_unit_in(unit, units)
        return factor, name.replace("^2", "²")
    if not math.isfinite(largest) or largest <= 0.0:
        return 1.0, unit
    size, prefix = next((row for row in PREFIXES if largest >= row[0]), PREFIXES[-1])
    return 1.0 / size, prefix + unit


def write_digits(value: float) -> str:
    """Write a number with four significant digits, up to a million without an exponent."""
    return f"{float(f'{value:.4g}'):.6g}"


def write_short(
    value: float, unit: str, units: Conversion, largest: float | None = None
) -> str:
    """Write a quantity with four significant digits and a unit that suits it, or the largest of its kind."""
    factor, name = choose_unit(abs(value) if largest is None else largest, unit, units)
    return f"{write_digits(factor * value)} {name}"
