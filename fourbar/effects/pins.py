"""Values per pin, as an effect holds them: rows (pin, number, ...)."""

from collections.abc import Mapping
from typing import Any

from fourbar.effects.numbers import AT_LEAST_ZERO, OF_EFFECT, POSITIVE
from fourbar.errors import InputError, expect
from fourbar.linkage import PINS, require


def require_number(key: str, value: object, number: tuple[str, str]) -> float:
    """Return a number of an effect as a float, or raise an InputError.

    `number`: its unit and bound, as of `OF_EFFECT`.
    """
    unit, bound = number
    return require(key, value, unit, positive=bound == POSITIVE, at_least_zero=bound == AT_LEAST_ZERO)


def make_rows(values: Mapping[str, Any]) -> tuple[Any, ...]:
    """Rows from the numbers by pin, to be checked."""
    return tuple((pin, *(value if isinstance(value, (tuple, list)) else (value,))) for pin, value in values.items())


def check_rows(effect: str, rows: object) -> tuple[Any, ...]:
    """Return the rows of an effect in the order of the pins, each number within its bound, or raise InputError."""
    key, numbers = f"effects.{effect}", OF_EFFECT[effect]
    expect(key, rows, tuple, list)
    found: dict[str, tuple[Any, ...]] = {}
    for row in rows:  # type: ignore[attr-defined]
        if not isinstance(row, (tuple, list)) or len(row) != 1 + len(numbers) or not isinstance(row[0], str):
            raise InputError(key, row, f"must be (pin, {', '.join(name or 'value' for name in numbers)})")
        pin, *values = row
        if pin not in PINS or pin in found:
            raise InputError(f"{key}.{pin}", row[1:], f"the pins are {', '.join(PINS)}, each once")
        given = zip(numbers.items(), values, strict=True)
        found[pin] = (
            pin,
            *(require_number(f"{key}.{pin}.{name}".rstrip("."), value, of) for (name, of), value in given),
        )
    return tuple(found[pin] for pin in PINS if pin in found)
