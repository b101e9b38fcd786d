"""The numbers of a scene by their keys: the unit of each, declared where it belongs, and tolerances."""

import math
from dataclasses import dataclass

from fourbar import effects
from fourbar.errors import InputError, expect
from fourbar.linkage import BAR_NAMES, MOVING_BARS, POSITIVE, Bar, FourBar, require
from fourbar.scene.motion import Motion
from fourbar.scene.point import Point

THREE_SIGMA = 3.0
"""Half width of a normal distribution in a worst case, in standard deviations."""
LENGTHS = {**FourBar.numbers, **{BAR_NAMES[bar]: Bar.numbers["length"] for bar in MOVING_BARS}}


def find_unit(key: str) -> str | None:
    """Return the unit of the number that a key of a scene file names; None where no scene has such a number."""
    table, *names = key.split(".")
    tables = {"lengths": LENGTHS, "bars": Bar.numbers, "motion": Motion.numbers, "points": Point.numbers}
    numbers = tables.get(table, {})
    if table == "loads":
        numbers = effects.Load.numbers
    elif table == "drive":
        numbers = {"at": effects.Springs.numbers["at"]}
    elif table == "effects" and names and (kind := effects.list_kinds().get(names[0])):
        numbers = {**kind.numbers, "gravity": effects.Gravity.numbers["magnitude"]}
    part = names.pop() if names and names[-1] in ("0", "1") else ""
    stated = numbers.get(names[-1] if names else "", numbers.get(""))
    return None if stated is None else "rad" if part == "1" else stated.unit


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Tolerance of one number of a scene.

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
