"""A linkage as it is drawn: the places of its four pins in the plane of the drawing."""

import math
from typing import Annotated, Any

from fourbar.errors import InputError
from fourbar.formulas.arithmetic import cross, vector
from fourbar.linkage import (
    BAR_NAMES,
    ENDS,
    FIRST_PIN,
    PINS,
    Declared,
    Described,
    record,
)

DRAWN_WORD = "drawn"
"""Word that stands for the drawn angle, stroke or side; key of a drawn place."""
PINS_IN_LINE = 1e-12
"""Part of the drawing's size within which four pins lie in one line: a change point."""
PlanePoint = tuple[float, float]
DRAWN_PLACE = Declared("m", pair="m")
"""x and y of a place in the drawing."""


@record
class DrawnPins(Described):
    """Places of the pins, each (x, y), m or texts with units.

    Raises InputError where two pins of a bar lie in one place, and where all four lie
    in one line: on a change point a drawing does not tell one assembly from the other.
    """

    O2: Annotated[PlanePoint, DRAWN_PLACE]
    A: Annotated[PlanePoint, DRAWN_PLACE]
    B: Annotated[PlanePoint, DRAWN_PLACE]
    O4: Annotated[PlanePoint, DRAWN_PLACE]
    stated_at = "pins"

    def __post_init__(self) -> None:
        Described.__post_init__(self)
        for bar, (first, second) in ENDS.items():
            if self.vector(bar) == 0.0:
                name = f"both ends of the {BAR_NAMES[bar]}"
                raise InputError(
                    f"pins.{second}",
                    self.place(second),
                    f"lies where {first} does: {name}",
                    unit="m",
                )
        size = max(abs(self.vector(bar)) for bar in BAR_NAMES)
        areas = []
        for one, other in ((1, 2), (1, 4), (2, 3)):
            areas.append(abs(cross(self.vector(one), self.vector(other))))
        if max(areas) <= PINS_IN_LINE * size * size:
            raise InputError(
                "pins",
                tuple(PINS),
                "lie in one line: at a change point a drawing tells no assembly; "
                "draw the linkage in another position",
            )

    def place(self, pin: str) -> PlanePoint:
        """Return the place of a pin, m."""
        x, y = getattr(self, pin)
        return x, y

    def vector(self, bar: int) -> Any:
        """Return the vector of a bar, from its first pin to its second, complex, m.

        The coordinates may be arrays.
        """
        first, second = ENDS[bar]
        x, y = self.place(first)
        to_x, to_y = self.place(second)
        return vector(to_x - x, to_y - y)

    def length(self, bar: int) -> float:
        """Return the length of a bar, m."""
        v = self.vector(bar)
        return math.hypot(v.real, v.imag)

    def angle(self, bar: int) -> float:
        """Return the direction of a bar, rad.

        theta_2 less that of the ground lies in (-pi, pi].
        """
        v = self.vector(bar)
        angle = math.atan2(v.imag, v.real)
        if bar != 2:
            return angle
        ground = self.angle(1)
        turned = math.remainder(angle - ground, math.tau)
        return angle + math.tau * round((ground + turned - angle) / math.tau)

    def into_bar(self, bar: int, place: PlanePoint) -> complex:
        """Return a place of the drawing in a bar's frame: along + i across, m.

        The frame's origin is the bar's first pin.
        """
        x, y = place
        pin_x, pin_y = self.place(FIRST_PIN[bar])
        from_pin = complex(x - pin_x, y - pin_y)
        along: complex = self.vector(bar)
        return from_pin * along.conjugate() / abs(along)

    def from_bar(self, bar: int, z: complex) -> complex:
        """Return the place in the drawing of a point of a bar, x + i y, m."""
        x, y = self.place(FIRST_PIN[bar])
        v: complex = self.vector(bar)
        return complex(x, y) + z * v / abs(v)
