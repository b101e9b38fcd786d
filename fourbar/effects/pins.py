"""Values per pin, and the relative rotation of the two bars that meet there."""

from collections.abc import Mapping

from fourbar.errors import InputError
from fourbar.linkage import PINS, require


def pin_values(key: str, values: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """The non-negative value of each pin named, in the order of the pins."""
    for pin, value in values.items():
        known(f"{key}.{pin}", pin, value)
    return tuple((pin, require(f"{key}.{pin}", values[pin], at_least_zero=True)) for pin in PINS if pin in values)


def known(key: str, pin: str, value: object) -> None:
    """An InputError where there is no such pin."""
    if pin not in PINS:
        raise InputError(key, value, "the pins are " + ", ".join(PINS))
