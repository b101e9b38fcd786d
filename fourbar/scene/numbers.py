"""Points that a scene wants, and its numbers by their keys, with tolerances.

Units are declared where the numbers belong.
"""

import math
import re
from typing import Annotated, Any

from fourbar import effects
from fourbar.effects.place import (
    STATED_PLACES,
    At,
    Place,
    Placed,
    StatedPair,
    require_place,
)
from fourbar.errors import InputError, expect
from fourbar.linkage import (
    BAR_NAMES,
    MOVING_BARS,
    POSITIVE,
    Bar,
    Declared,
    Entries,
    FourBar,
    OfBar,
    list_declared,
    record,
    require,
)
from fourbar.quantities import DERIVED_NAMES, UNITS, find_derived
from fourbar.scene.drawing import DRAWN_PLACE, DRAWN_WORD, DrawnPins
from fourbar.scene.motion import Motion

_POINT_NAME = re.compile("(?!v_|a_)[A-Za-z_][A-Za-z_0-9]*")
"""Word that names a point: its velocity and acceleration begin with v_ and a_."""
_THREE_SIGMA = 3.0
"""Half width of a normal distribution in a worst case, in standard deviations."""
LONGEST_POINT_NAME = 40
"""Characters of the name of a point, which heads columns of tables."""


@record
class Point(Placed):
    """A point of a bar.

    Parameters
    ----------
    name : letters, digits and underlines; no name of a quantity, as v_ and a_ with it.
    bar : 1, 2, 3 or 4.
    from_pin : (distance, angle), from the bar's first pin (O2, O2, A, O4), the angle
        from its line, m and rad.
    from_centre : likewise from the bar's mass centre, in place of `from_pin`.
    """

    name: str
    bar: Annotated[int, OfBar((1, *MOVING_BARS))]
    from_pin: StatedPair = None
    from_centre: StatedPair = None
    stated_at = "points.{0.name}"

    def __post_init__(self) -> None:
        is_word = isinstance(self.name, str) and _POINT_NAME.fullmatch(self.name)
        if not is_word or len(self.name) > LONGEST_POINT_NAME:
            allowed = (
                "must be a word of letters, digits and _, not beginning with a digit,"
                " v_ or a_"
            )
            raise InputError("points", self.name, allowed)
        if {self.name, f"{self.name}_x", f"{self.name}_y"} & TAKEN_NAMES or (
            find_derived(self.name)
        ):
            raise InputError(
                self.key,
                self.name,
                "is the name of a quantity; a point needs another",
            )
        Placed.__post_init__(self)
        require_place(self.key, self.place)

    @property
    def place(self) -> Place:
        """Place of the point on its bar."""
        return Place(self.bar, self.from_pin, self.from_centre)

    @property
    def key(self) -> str:
        """Key of the point in a scene file."""
        return f"points.{self.name}"


TAKEN_NAMES = frozenset(
    (
        *UNITS,
        *DERIVED_NAMES,
        "status",
        "branch",
        "drive_bar",
        "member",
        "title",
        "schema",
        "angle_unit",
        "assembled",
        "O2",
        "O4",
    )
)
"""Names that a table or a JSON object has already, and the pins."""


LENGTH_NUMBERS = {
    **FourBar.numbers,
    **{BAR_NAMES[bar]: Bar.numbers["length"] for bar in MOVING_BARS},
}


def find_unit_of_key(key: str) -> str | None:
    """Return the unit of the number that a key of a scene file names.

    None: no scene has such a number.
    """
    table, *names = key.split(".")
    if names[-2:-1] == [DRAWN_WORD]:
        return DRAWN_PLACE.unit
    tables = {"lengths": LENGTH_NUMBERS, "motion": Motion.numbers}
    kinds: dict[str, Any] = {
        "pins": DrawnPins,
        "bars": Bar,
        "points": Point,
        "loads": effects.Load,
        "drive": effects.PointDrive,
    }
    if table == "effects" and names:
        kinds[table] = effects.list_kinds().get(names[0])
    numbers = tables.get(table) or _collect_numbers(kinds.get(table))
    *_, before, last = ("", "", *names)
    if last == "1" and last not in numbers and before in numbers:
        return numbers[before].pair or None
    for name in (last, before if last == "0" else last, ""):
        if name in numbers:
            return numbers[name].unit
    return None


def _collect_numbers(kind: Any) -> dict[str, Declared]:
    """Collect the numbers of a description, its places and its entries, by their keys.

    Numbers whose names differ may be of one unit; a key needs no more.
    """
    if kind is None:
        return {}
    numbers = {by.key or name: by for name, by in kind.numbers.items()}
    for field in list_declared(kind):
        if isinstance(field.by, At):
            numbers |= STATED_PLACES
        elif isinstance(field.by, Entries):
            numbers |= _collect_numbers(field.by.kind)
    return numbers


@record
class Tolerance:
    """Tolerance of one number of a scene.

    Parameters
    ----------
    key : of the number, as in the scene file, pairs and lists by index.
    width : in its SI unit or a text like "0.1 mm", > 0: plus or minus, evenly
        distributed, or the standard deviation of a normal distribution.
    sigma : whether it is that.
    """

    key: str
    width: float
    sigma: bool = False

    def __post_init__(self) -> None:
        expect("tolerances", self.key, str)
        unit = find_unit_of_key(self.key)
        if unit is None and isinstance(self.width, str):
            raise InputError(f"tolerances.{self.key}", self.width, "unknown key")
        object.__setattr__(
            self,
            "width",
            require(f"tolerances.{self.key}", self.width, unit or "1", POSITIVE),
        )
        expect(f"tolerances.{self.key}", self.sigma, bool)

    @property
    def deviation(self) -> float:
        """Standard deviation."""
        if self.sigma:
            return self.width
        return self.width / math.sqrt(3.0)

    @property
    def reach(self) -> float:
        """The largest change that a worst case counts with."""
        if self.sigma:
            return _THREE_SIGMA * self.width
        return self.width
