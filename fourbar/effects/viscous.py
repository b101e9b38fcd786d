"""Viscous pin damping: a couple proportional to the relative angular velocity at a pin."""

from dataclasses import dataclass
from typing import ClassVar

from fourbar.effects.actions import Actions
from fourbar.effects.effect import Effect
from fourbar.effects.pins import check_rows
from fourbar.formulas.motion import State


@dataclass(frozen=True, slots=True)
class Viscous(Effect):
    """Damping coefficients per pin, N m s/rad, as pairs (pin, value)."""

    coefficients: tuple[tuple[str, float], ...]
    key: ClassVar[str] = "viscous"

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", check_rows("viscous", self.coefficients))

    @classmethod
    def at(cls, **coefficients: float) -> "Viscous":
        """``Viscous.at(O2=0.01)``."""
        return cls(tuple(coefficients.items()))

    def act(self, actions: Actions, state: State) -> None:
        """M on bar j = -k (omega_j - omega_i), its opposite on bar i."""
        for pin, k in self.coefficients:
            actions.couple(pin, -k * (state.slip(pin) * state.speed))
