"""Viscous pin damping: a couple proportional to the relative angular velocity at a pin."""

from dataclasses import dataclass
from typing import ClassVar

from fourbar.effects.effect import Actions, PinRows
from fourbar.formulas.motion import State
from fourbar.linkage import AT_LEAST_ZERO, Declared


@dataclass(frozen=True, slots=True)
class Viscous(PinRows):
    """Damping coefficients per pin, N m s/rad, as pairs (pin, value)."""

    coefficients: tuple[tuple[str, float], ...]
    key: ClassVar[str] = "viscous"
    example: ClassVar[str] = 'viscous = { O2 = "0.01 N m s/rad" }'
    numbers: ClassVar[dict[str, Declared]] = {"": Declared("N m s/rad", AT_LEAST_ZERO)}

    def act(self, actions: Actions, state: State) -> None:
        """Add M on bar j = -k (omega_j - omega_i), its opposite on bar i."""
        for pin, k in self.coefficients:
            actions.couple(pin, -k * (state.slip(pin) * state.speed))
