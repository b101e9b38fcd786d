"""Dry pin friction of constant torque, against the relative rotation at a pin."""

from typing import Any, ClassVar

from fourbar.effects.effect import Actions, PinRows
from fourbar.formulas.arithmetic import is_any
from fourbar.formulas.motion import State
from fourbar.linkage import AT_LEAST_ZERO, Declared, FourBar, record


@record
class Friction(PinRows):
    """Friction torques per pin, N m, as pairs (pin, value).

    At a pin that does not turn the couple may have any value up to the torque; 0, the
    middle, is taken, and `torque_low`, `torque_high` of the solution are what the ends
    give.
    """

    torques: tuple[tuple[str, float], ...]
    key = "friction"
    in_balls = True
    joint_elements: ClassVar[dict[str, str]] = {"gazebo": "friction"}
    example = 'friction = { A = "0.05 N m" }'
    numbers: ClassVar[dict[str, Declared]] = {"": Declared("N m", AT_LEAST_ZERO)}
    dry = True

    @property
    def dry_pins(self) -> tuple[str, ...]:
        """Pins with friction."""
        return tuple(pin for pin, f in self.torques if is_any(f != 0.0))

    def act(self, actions: Actions, state: State) -> None:
        """Add M on bar j = -f sign(omega_j - omega_i), its opposite on bar i."""
        for pin, f in self.torques:
            actions.pin_couple(pin, -f * actions.sense(pin))

    def add_to_mjcf(self, model: Any) -> None:
        """Set ``frictionloss`` of the hinge, or of a tendon at the cut pin B."""
        for pin, f in self.torques:
            model.add_dry_friction(pin, f)

    def couple_on_drive(self, linkage: FourBar, speed: float) -> float:
        """Sum the couples of all pins."""
        return sum((f for _, f in self.torques), 0.0)
