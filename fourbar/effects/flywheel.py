"""A flywheel on a bar that ground carries: more inertia, and no weight."""

from collections.abc import Mapping
from typing import Annotated, Any

from fourbar.effects.effect import Effect
from fourbar.linkage import AT_LEAST_ZERO, Declared, OfBar, record


@record
class Flywheel(Effect):
    """A wheel that turns with the driven bar about its fixed pin.

    Parameters
    ----------
    inertia : kg m^2, >= 0.
    bar : 2 (on pin O2) or 4 (on pin O4).
    """

    inertia: Annotated[float, Declared("kg m^2", AT_LEAST_ZERO)]
    bar: Annotated[int, OfBar((2, 4), "a bar on a fixed pin")] = 2
    key = "flywheel"
    in_balls = True
    example = 'flywheel = { bar = 2, inertia = "0.02 kg m^2" }'

    @property
    def added_inertia(self) -> Mapping[int, float]:
        """The wheel's inertia on its bar: a rotation has no other."""
        return {self.bar: self.inertia}

    def add_to_mjcf(self, model: Any) -> None:
        """Add the flywheel as inertia of the body.

        MuJoCo's armature of pin O2 is the drive.
        """
        model.inertia[self.bar] += self.inertia
