"""A point of a bar whose position, velocity and acceleration a scene wants."""

from dataclasses import dataclass
from typing import ClassVar

from fourbar.errors import InputError
from fourbar.linkage import BAR_NAMES, Declared, check_numbers, require_whole
from fourbar.quantities import UNITS

LONGEST_NAME = 40
POINT_STAGES = {"": "position", "v_": "velocity", "a_": "acceleration"}
"""Quantities evaluated for a point: the prefix of the name and the stage."""


@dataclass(frozen=True, slots=True)
class Point:
    """A point of a bar.

    Parameters
    ----------
    name : letters, digits and underlines; no name of a quantity, as v_ and a_ with it.
    bar : 1, 2, 3 or 4.
    from_pin : (distance, angle), from the bar's first pin (O2, O2, A, O4), the angle from its line, m and rad.
    """

    name: str
    bar: int
    from_pin: tuple[float, float]
    numbers: ClassVar[dict[str, Declared]] = {"from_pin": Declared("m", pair=True)}

    def __post_init__(self) -> None:
        plain = isinstance(self.name, str) and self.name.isascii() and self.name.isidentifier()
        if not plain or self.name.startswith(("v_", "a_")) or len(self.name) > LONGEST_NAME:
            allowed = "must be a word of letters, digits and _, not beginning with a digit, v_ or a_"
            raise InputError("points", self.name, allowed)
        if {self.name, f"{self.name}_x", f"{self.name}_y"} & COLUMNS:
            raise InputError(self.key, self.name, "is the name of a quantity; a point needs another")
        bar = require_whole(f"{self.key}.bar", self.bar, BAR_NAMES, "must be 1, 2, 3 or 4")
        object.__setattr__(self, "bar", bar)
        check_numbers(self, self.key)

    @property
    def key(self) -> str:
        """Key of the point in a scene file."""
        return f"points.{self.name}"


COLUMNS = frozenset(
    (*UNITS, "status", "branch", "drive_bar", "member", "title", "schema", "angle_unit", "assembled", "O2", "O4")
)
"""Names that a table or a JSON object has already, and the pins."""
