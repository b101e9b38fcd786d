"""The units in which results are shown: a list such as "mm N N.mm deg", or "imperial"."""

from fourbar.errors import InputError
from fourbar.quantities.units import UnitError, to_si
from fourbar.solution import SI, Conversion

ALLOWED = 'must be "SI", "imperial" or a list like "mm N N.mm deg rpm"'
PRESETS = {"si": "", "imperial": "in lbf lbf.in lb deg rpm hp"}
STATED = ("m", "N", "N m", "kg", "rad", "rad/s", "rad/s^2", "m/s", "m/s^2", "W")
"""The SI units for which another one can be stated, each of a dimension of its own."""
DERIVED = {"m/s": ("m", "{}/s"), "m/s^2": ("m", "{}/s^2"), "J": ("N m", "{}")}
"""Not stated, these follow another one: energy the unit of torque, speeds that of length."""


def units(text: str) -> Conversion:
    """Read the units of a list, or of "SI" or "imperial" (in, lbf, lbf in, lb, deg, rpm, hp).

    A product is joined by dots ("N.mm"). What the list leaves out stays SI, but for speeds and accelerations of
    points, which follow the length, and the energy, which follows the torque.

    Raises InputError for what is no unit of a result, and for two of one dimension.
    """
    if not isinstance(text, str):
        raise InputError("units", text, ALLOWED)
    stated: dict[str, str] = {}
    for name in PRESETS.get(text.casefold(), text).replace(",", " ").split():
        why = {unit: _explain_refusal(name, unit) for unit in STATED}
        unit = next((unit for unit in STATED if not why[unit]), None)
        if unit is None or unit in stated:
            hint = next((f"; {word}" for reason in why.values() if (word := reason.partition("; ")[2])), "")
            reason = f"is no unit of a result{hint}" if unit is None else f"is the second unit for {unit}"
            raise InputError("units", name, f"{reason}; {ALLOWED}")
        stated[unit] = name.replace(".", " ")
    for unit, (base, form) in DERIVED.items():
        if base in stated and unit not in stated:
            stated[unit] = form.format(stated[base])
    return {unit: (name, to_si(f"1 {unit}", name)) for unit, name in stated.items()} or SI


def _explain_refusal(name: str, unit: str) -> str:
    """Why a name is no unit for another one; empty where it is."""
    try:
        to_si(f"1 {name}", unit)
    except UnitError as error:
        return str(error).replace('"1 ', '"')
    return ""
