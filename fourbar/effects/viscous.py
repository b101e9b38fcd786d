"""Viscous pin damping: a couple proportional to the relative angular velocity."""

from typing import Any, ClassVar

from fourbar.effects.effect import Actions, PinRows
from fourbar.formulas.motion import State
from fourbar.linkage import AT_LEAST_ZERO, Declared, FourBar, record


@record
class Viscous(PinRows):
    """Damping coefficients per pin, N m s/rad, as pairs (pin, value)."""

    coefficients: tuple[tuple[str, float], ...]
    key = "viscous"
    in_balls = True
    joint_elements: ClassVar[dict[str, str]] = {"gazebo": "damping", "drake": "damping"}
    example = 'viscous = { O2 = "0.01 N m s/rad" }'
    numbers: ClassVar[dict[str, Declared]] = {"": Declared("N m s/rad", AT_LEAST_ZERO)}

    def act(self, actions: Actions, state: State) -> None:
        """Add M on bar j = -k (omega_j - omega_i), its opposite on bar i."""
        for pin, k in self.coefficients:
            actions.pin_couple(pin, -k * (state.slip(pin) * state.speed))

    def add_to_mjcf(self, model: Any) -> None:
        """Set the attribute ``damping`` of the hinge (of a tendon at the cut pin B)."""
        for pin, k in self.coefficients:
            model.pin[pin]["damping"] = k

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Sum the couples of all pins at the speed."""
        return sum((k for _, k in self.coefficients), 0.0) * speed
