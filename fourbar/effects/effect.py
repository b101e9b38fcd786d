"""Base classes of all effects, without units or files."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fourbar.effects.actions import Actions
from fourbar.errors import InputError, expect
from fourbar.formulas.arithmetic import Number
from fourbar.formulas.motion import State
from fourbar.formulas.pin_forces import PinForces
from fourbar.linkage import PINS, Declared, require
from fourbar.quantities import Array


class SolvedFriction(NamedTuple):
    """Pin forces with the friction that they make."""

    pins: PinForces
    from_jamming: Any = None
    """Distance of the friction from jamming, in (0, 1]."""
    residual: Any = None
    """Largest |mu r |F| - couple| that remains, N m."""
    status: Any = None


class Effect:
    """One effect in one file: what it does to the bars, and where it has no value.

    A subclass is a frozen dataclass. What it leaves at the default it does not have. Files, MJCF, engines and
    scales translate it, each in a table by its key.
    """

    __slots__ = ()
    key: ClassVar[str]
    """Name of the effect under ``[effects]`` and in every table."""
    example: ClassVar[str] = ""
    """One line of a scene file."""
    numbers: ClassVar[Mapping[str, Declared]] = {}
    """Declarations of the effect's numbers by name."""
    dry: ClassVar[bool] = False
    """True if the couples jump where the relative rotation at a pin reverses."""

    counts_turns: ClassVar[bool] = False
    """True if the effect depends on where the motion began (`counted_from`)."""

    @property
    def loaded_pins(self) -> tuple[str, ...]:
        """Pins whose forces it depends on itself."""
        return ()

    @property
    def carried(self) -> Mapping[int, Number]:
        """Inertia that turns with bar 2, 3 or 4, kg m^2, by its number."""
        return {}

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """Pins at which its couples jump."""
        return ()

    def act(self, actions: Actions, state: State) -> None:
        """Add its forces and couples on the bars."""

    def solve_friction(self, actions: Actions, pins: PinForces, eliminate: Callable[..., PinForces]) -> SolvedFriction:
        """Solve for what depends on the pin forces, where there are `loaded_pins`, and add it to the actions.

        `pins`: pin forces under the actions, without it. `eliminate`: computes the pin forces under some actions, and
        under inertia if `with_inertia`.
        """
        raise NotImplementedError

    def act_known(self, actions: Actions, forces: Mapping[str, Array]) -> None:
        """Add what `act` leaves to the solution of the pin forces, once these are computed (name: (n, 2), N)."""

    def counted_from(self, start: State, branch: Number) -> Self:
        """Return the same effect in a motion that begins at this position, on this branch."""
        return self

    def status(self, state: State, branch: NDArray[np.int8] | None) -> NDArray[np.uint8] | None:
        """Status codes, (n,): other than `OK` where it has no value; None: it has one everywhere."""
        return None


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
        by_pin: dict[str, tuple[Any, ...]] = {}
        for row in rows:
            if not isinstance(row, (tuple, list)) or len(row) != 1 + len(numbers) or not isinstance(row[0], str):
                raise InputError(key, row, f"must be (pin, {', '.join(name or 'value' for name in numbers)})")
            pin, *values = row
            if pin not in PINS or pin in by_pin:
                raise InputError(f"{key}.{pin}", row[1:], f"the pins are {', '.join(PINS)}, each once")
            pairs = zip(numbers.items(), values, strict=True)
            checked = (
                require(f"{key}.{pin}.{name}".rstrip("."), value, *declared[:2]) for (name, declared), value in pairs
            )
            by_pin[pin] = (pin, *checked)
        object.__setattr__(self, self.field, tuple(by_pin[pin] for pin in PINS if pin in by_pin))
