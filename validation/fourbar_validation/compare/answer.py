"""Define an engine's answer: its numbers at the motion it really made.

A refusal in their place has a reason.
"""

from dataclasses import dataclass, field
from typing import Protocol

from fourbar.errors import FourBarError
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import Array, Mask
from fourbar.scene import Command, Scene

Arrays = dict[str, Array]
"""Numbers of quantities by their names: (n,), or (n, 2) of a vector."""
RELEASED_QUANTITIES = ("theta_2", "omega_2", "energy", "terms")
"""Quantities of a released motion at stated times, (n,). The energy is kinetic and
potential energy less the work that was done, J; `terms` are their magnitudes, summed.
"""


@dataclass(slots=True, eq=False)
class Answer:
    """Quantities of one engine on one scene, in SI units and radians.

    The names are those of `fourbar.Solution`.
    """

    engine: str
    """Name of the engine, such as "pinocchio-inverse" or "mujoco-simulated"."""
    setting: str
    """Setting of the engine: "exact", or for example "RK4 628/rev"."""
    at: Command | None = None
    """Motion of this answer: the command itself, or that of a simulation."""
    assembled: Mask | None = None
    """Positions where the engine found by its own means that the loop closes, (n,)."""
    quantities: dict[str, Array] = field(default_factory=dict)
    """(n,) or (n, 2) arrays; NaN where not assembled. A name that is missing was not
    answered. A released motion has those of `RELEASED_QUANTITIES`.
    """
    refusal: str | None = None
    """Declared limit of the engine that this scene meets, with its reason. Nothing else
    is set then.
    """
    predicted: dict[str, Array] = field(default_factory=dict)
    """Errors that the engine must expect by its own residuals, (n,), in the quantity's
    unit.
    """
    alarms: list[str] = field(default_factory=list)
    """Faults that the engine's monitoring of itself found, in words. Each fails the
    run.
    """
    evidence: dict[str, float] = field(default_factory=dict)
    """Figures that the engine reports of itself: closure gap (m), speed error, resets
    and residuals.
    """
    shared: str = ""
    """Inputs that the engine takes from the formulas' side."""
    own: str = ""
    """Results that the engine found alone."""
    seconds: float = 0.0

    @property
    def theta(self) -> dict[int, Array] | None:
        """Angles of bars 2, 3 and 4, commanded or answered; None if one is missing."""
        numbers = dict(self.quantities)
        if self.at is not None and self.at.commanded == "theta_2":
            numbers["theta_2"] = self.at.angle
        theta = {bar: numbers.get(f"theta_{bar}") for bar in MOVING_BARS}
        known = {bar: angle for bar, angle in theta.items() if angle is not None}
        return known if self.at is not None and len(known) == len(theta) else None


class EngineError(FourBarError):
    """Failure of an engine from outside, in words."""


class Adapter(Protocol):
    """One engine, in one of its forms."""

    @property
    def name(self) -> str:
        """Return the engine's name as it stands in the results."""

    def answer(self, scene: Scene, command: Command) -> Answer:
        """Answer a scene, given the description and the command alone.

        No result of the formulas reaches an engine.
        """


def explain_refusal(engine: Adapter, command: Command) -> str:
    """Return why an engine does not take what is commanded, "" if it does.

    Engines declare what they take.
    """
    takes = getattr(engine, "commands", ("theta_2",))
    if command.commanded in takes:
        return ""
    return (
        f"it takes a command of {', '.join(takes)}, and here {command.commanded} is"
        " commanded"
    )
