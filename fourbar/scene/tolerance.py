"""A tolerance of one number of a scene."""

import math
from dataclasses import dataclass

from fourbar.errors import InputError, expect
from fourbar.linkage import POSITIVE, require
from fourbar.scene.numbers import find_unit

THREE_SIGMA = 3.0
"""What counts as the width of a normal distribution in a worst case."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far one number of a scene may be off.

    Parameters
    ----------
    key : of the number, as in the scene file, pairs and lists by index.
    width : in its SI unit or a text like "0.1 mm", > 0: plus or minus, evenly distributed, or the standard deviation
        of a normal distribution.
    sigma : whether it is that.
    """

    key: str
    width: float
    sigma: bool = False

    def __post_init__(self) -> None:
        expect("tolerances", self.key, str)
        unit = find_unit(self.key)
        if unit is None and isinstance(self.width, str):
            raise InputError(f"tolerances.{self.key}", self.width, "unknown key")
        object.__setattr__(self, "width", require(f"tolerances.{self.key}", self.width, unit or "1", POSITIVE))
        expect(f"tolerances.{self.key}", self.sigma, bool)

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        return self.width if self.sigma else self.width / math.sqrt(3.0)

    @property
    def reach(self) -> float:
        """The largest change that a worst case counts with."""
        return THREE_SIGMA * self.width if self.sigma else self.width
