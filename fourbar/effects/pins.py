"""Effects with values per pin: rows (pin, number, ...)."""

from dataclasses import fields
from typing import Any, Self

from fourbar.effects.effect import Effect
from fourbar.errors import InputError, expect
from fourbar.linkage import PINS, require


class PinRows(Effect):
    """An effect whose first field holds rows (pin, number, ...), in the order of the pins.

    The one number that a pin has is called "".
    """

    __slots__ = ()

    @classmethod
    def at(cls, **values: Any) -> Self:
        """Make it from the numbers of each pin: ``Viscous.at(O2=0.01)``, ``PinFriction.at(A=(mu, radius))``."""
        rows = ((pin, *(value if isinstance(value, (tuple, list)) else (value,))) for pin, value in values.items())
        return cls(tuple(rows))  # type: ignore[call-arg]

    @property
    def field(self) -> str:
        """Name of the field that holds the rows."""
        return fields(self)[0].name  # type: ignore[arg-type]

    @property
    def rows(self) -> tuple[tuple[Any, ...], ...]:
        """Rows (pin, number, ...)."""
        return getattr(self, self.field)  # type: ignore[no-any-return]

    def __post_init__(self) -> None:
        key, numbers, rows = f"effects.{self.key}", self.numbers, self.rows
        expect(key, rows, tuple, list)
        found: dict[str, tuple[Any, ...]] = {}
        for row in rows:
            if not isinstance(row, (tuple, list)) or len(row) != 1 + len(numbers) or not isinstance(row[0], str):
                raise InputError(key, row, f"must be (pin, {', '.join(name or 'value' for name in numbers)})")
            pin, *values = row
            if pin not in PINS or pin in found:
                raise InputError(f"{key}.{pin}", row[1:], f"the pins are {', '.join(PINS)}, each once")
            given = zip(numbers.items(), values, strict=True)
            checked = (require(f"{key}.{pin}.{name}".rstrip("."), value, *of[:2]) for (name, of), value in given)
            found[pin] = (pin, *checked)
        object.__setattr__(self, self.field, tuple(found[pin] for pin in PINS if pin in found))
