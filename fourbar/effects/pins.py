"""Values per pin, as an effect holds them: rows (pin, number, ...)."""

from collections.abc import Mapping
from typing import Any

from fourbar.errors import InputError, expect
from fourbar.linkage import PINS, require

AT_LEAST_ZERO: dict[str, bool] = {"at_least_zero": True}
POSITIVE: dict[str, bool] = {"positive": True}
ANY: dict[str, bool] = {}


def rows_of(values: Mapping[str, Any]) -> tuple[Any, ...]:
    """Rows from the numbers by pin, to be checked."""
    return tuple((pin, *(value if isinstance(value, (tuple, list)) else (value,))) for pin, value in values.items())


def checked(key: str, rows: object, **limits: dict[str, bool]) -> tuple[Any, ...]:
    """Return the rows in the order of the pins, each number a float within its limits, or raise InputError."""
    expect(key, rows, tuple, list)
    found: dict[str, tuple[Any, ...]] = {}
    for row in rows:  # type: ignore[attr-defined]
        if not isinstance(row, (tuple, list)) or len(row) != 1 + len(limits) or not isinstance(row[0], str):
            raise InputError(key, row, f"must be (pin, {', '.join(limits)})")
        pin, *numbers = row
        if pin not in PINS or pin in found:
            raise InputError(f"{key}.{pin}", row[1:], f"the pins are {', '.join(PINS)}, each once")
        names = [f"{key}.{pin}.{name}" if len(limits) > 1 else f"{key}.{pin}" for name in limits]
        checks = zip(names, numbers, limits.values(), strict=True)
        found[pin] = (pin, *(require(name, number, **limit) for name, number, limit in checks))
    return tuple(found[pin] for pin in PINS if pin in found)
