"""Effects with values per pin: rows (pin, number, ...)."""

from typing import Any, Self

from fourbar.effects.effect import Effect
from fourbar.effects.numbers import OF_EFFECT, ROWS
from fourbar.errors import InputError, expect
from fourbar.linkage import PINS, require


class PinRows(Effect):
    """An effect that holds rows (pin, number, ...), in the field that `ROWS` names, in the order of the pins."""

    __slots__ = ()

    @classmethod
    def at(cls, **values: Any) -> Self:
        """Make it from the numbers of each pin: ``Viscous.at(O2=0.01)``, ``PinFriction.at(A=(mu, radius))``."""
        rows = ((pin, *(value if isinstance(value, (tuple, list)) else (value,))) for pin, value in values.items())
        return cls(tuple(rows))  # type: ignore[call-arg]

    def __post_init__(self) -> None:
        key, numbers, rows = f"effects.{self.key}", OF_EFFECT[self.key], getattr(self, ROWS[self.key])
        expect(key, rows, tuple, list)
        found: dict[str, tuple[Any, ...]] = {}
        for row in rows:
            if not isinstance(row, (tuple, list)) or len(row) != 1 + len(numbers) or not isinstance(row[0], str):
                raise InputError(key, row, f"must be (pin, {', '.join(name or 'value' for name in numbers)})")
            pin, *values = row
            if pin not in PINS or pin in found:
                raise InputError(f"{key}.{pin}", row[1:], f"the pins are {', '.join(PINS)}, each once")
            given = zip(numbers.items(), values, strict=True)
            checked = (require(f"{key}.{pin}.{name}".rstrip("."), value, *of) for (name, of), value in given)
            found[pin] = (pin, *checked)
        object.__setattr__(self, ROWS[self.key], tuple(found[pin] for pin in PINS if pin in found))
