"""A scene file that states a drawing: `[pins]`, and places `{ drawn = [x, y] }`.

The motion may use the word "drawn".
"""

import cmath
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import ForceDrive, LinearDrive
from fourbar.errors import InputError
from fourbar.files.fields import Reader
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.mobility import count_equalities, meet_change_points
from fourbar.linkage import (
    BAR_NAMES,
    BAR_NUMBERS,
    ENDS,
    FIRST_PIN,
    MOVING_BARS,
    PINS,
    Bar,
    FourBar,
)
from fourbar.quantities.units import half_unit_of_text
from fourbar.scene import Command, Scene, find_signs
from fourbar.scene.drawing import DRAWN_WORD, DrawnPins, PlanePoint
from fourbar.scene.motion import (
    BAR_OF_ANGLE,
    STROKE_COMMAND,
    Motion,
)
from fourbar.scene.scene import require_cylinder
from fourbar.solving import solve

_STANDS_ALONE = "must be left out: `drawn` states the place"
PINS_APART = 0.05
"""Distance of the pins from the drawing above which no motion has that assembly. It is
a part of the longest bar.
"""


def from_pins(
    O2: tuple[Any, Any],
    A: tuple[Any, Any],
    B: tuple[Any, Any],
    O4: tuple[Any, Any],
) -> Scene:
    """Make the scene of a linkage from the places of its pins, at the drawn position.

    The bars have no mass; the branch is the assembly that is drawn.

    Parameters
    ----------
    O2, A, B, O4 : (x, y) of each pin, m, or texts with units.

    Raises
    ------
    InputError : two pins of a bar lie in one place, or all four in one line.

    >>> scene = from_pins((0.0, 0.0), (0.0, 0.1), (0.175, 0.05), (0.25, 0.05))
    >>> scene.linkage.input.length, scene.motion.theta_2
    (0.1, 1.5707963267948966)
    """
    drawing = DrawnPins(O2, A, B, O4)
    two, three, four = (Bar(drawing.length(bar)) for bar in MOVING_BARS)
    linkage = FourBar(drawing.length(1), two, three, four, drawing.angle(1))
    scene = Scene(linkage, Motion(drawing.angle(2)), drawing=drawing)
    return choose_assembly(scene, drawing)


def read_drawing(read: Reader, top: dict[str, Any]) -> DrawnPins | None:
    """Read the table of the pins; None where a scene states lengths."""
    if "pins" not in top:
        return None
    if "lengths" in top:
        allowed = "must be left out: the pins state the lengths and the ground's angle"
        raise read.refuse("lengths", top["lengths"], allowed)
    motion = top.get("motion", {})
    if isinstance(motion, dict) and "branch" in motion:
        allowed = "must be left out: the pins state the assembly"
        raise read.refuse("motion.branch", motion["branch"], allowed)
    pins = read.table("pins", top["pins"], PINS)
    places = (read_point(read, f"pins.{pin}", pins.get(pin)) for pin in PINS)
    return DrawnPins(*places)


def read_point(read: Reader, key: str, value: object) -> tuple[float, float]:
    """Read a place of the drawing, ["x", "y"], m."""
    if not isinstance(value, list) or len(value) != 2:
        raise read.refuse(key, value, 'must be two coordinates like ["10 mm", "25 mm"]')
    x, y = value
    return read.quantity(f"{key}[0]", x, "m"), read.quantity(f"{key}[1]", y, "m")


class DrawnGround(NamedTuple):
    """The ground of a scene of lengths, O2 at the origin; no other bar is drawn."""

    direction: float = 0.0
    """Direction from O2 to O4, rad."""
    length: float | None = None
    """m; None: the scene states it as that of any bar."""

    def angle(self, bar: int) -> float:
        """Return the direction of the ground, rad."""
        return self.direction

    def into_bar(self, bar: int, place: PlanePoint) -> complex:
        """Return a place in the frame of the ground, m."""
        return complex(*place) * cmath.rect(1.0, -self.direction)


def read_ground(read: Reader, lengths: Any) -> DrawnGround:
    """Read the direction of the ground of a scene of lengths.

    The file may have x and y of O4 from O2 in the place of length and angle.
    """
    if not isinstance(lengths, dict):
        return DrawnGround()
    key = "lengths.ground"
    angle = lengths.get("ground_angle")
    ground = lengths.get("ground")
    if not isinstance(ground, dict):
        by = FourBar.numbers["ground_angle"]
        return DrawnGround(read.declared(f"{key}_angle", angle, by))
    if angle is not None:
        allowed = "must be left out: x and y of the ground state its angle"
        raise read.refuse(f"{key}_angle", angle, allowed)
    entry = read.table(key, ground, ("x", "y"))
    x, y = (read.quantity(f"{key}.{axis}", entry.get(axis), "m") for axis in "xy")
    length = math.hypot(x, y)
    if not 0.0 < length < math.inf:
        allowed = "must be coordinates of O4 from O2, where it does not lie"
        raise read.refuse(key, ground, allowed)
    return DrawnGround(math.atan2(y, x), length)


def meet_lengths(drawing: DrawnPins, pins: dict[str, Any]) -> tuple[float, ...]:
    """Return the lengths of a drawing.

    Lengths of a parallelogram or a kite come without the rounding of its coordinates.

    `pins`: x and y of each pin as they are written.
    """
    halves = {pin: [half_unit_of_text(text, "m") for text in pins[pin]] for pin in PINS}
    lengths = []
    roundings = []
    decimals = []
    for bar, (first, second) in ENDS.items():
        lengths.append(drawing.length(bar))
        roundings.append(math.hypot(*halves[first]) + math.hypot(*halves[second]))
        decimals.append(max(*halves[first], *halves[second]))
    met = meet_change_points(tuple(lengths), tuple(roundings), tuple(decimals))  # type: ignore[arg-type]
    # one equality alone is met by chance: nobody draws it
    return met if count_equalities(met) > 1 else tuple(lengths)


def state_places(
    read: Reader,
    key: str,
    value: Any,
    drawing: DrawnPins | DrawnGround,
    bar: int | None = None,
) -> Any:
    """State each `{ drawn = [x, y] }` of an entry in the frame of its bar."""
    if isinstance(value, list):
        return [
            state_places(read, f"{key}[{index}]", entry, drawing, bar)
            for index, entry in enumerate(value)
        ]
    if not isinstance(value, dict):
        return value
    number = value.get("bar")
    if isinstance(number, int) and number in BAR_NAMES:
        bar = number
    if DRAWN_WORD in value:
        place = _state_place(read, key, value, drawing, bar)
        if len(value) == 1:
            return place
        if "from_pin" in value:
            raise read.refuse(f"{key}.from_pin", value["from_pin"], _STANDS_ALONE)
        value = {**value, "from_pin": place}
        del value[DRAWN_WORD]
    named = BAR_NUMBERS if key == "bars" else {}
    return {
        name: state_places(read, f"{key}.{name}", entry, drawing, named.get(name, bar))
        for name, entry in value.items()
    }


def _state_place(
    read: Reader,
    key: str,
    value: dict[str, Any],
    drawing: DrawnPins | DrawnGround,
    bar: int | None,
) -> dict[str, str]:
    """State a place of the drawing by its coordinates in the frame of its bar."""
    drawn = f"{key}.{DRAWN_WORD}"
    stated = value[DRAWN_WORD]
    if bar is None:
        allowed = (
            f'must name the bar it is of: {key} = {{ bar = 3, drawn = ["x", "y"] }}'
        )
        raise read.refuse(drawn, stated, allowed)
    if bar != 1 and isinstance(drawing, DrawnGround):
        allowed = (
            "is a place of a moving bar: it is drawn where [pins] states the linkage;"
            " here from_pin states it"
        )
        raise read.refuse(drawn, stated, allowed)
    if key.endswith((".from_centre", ".arm")):
        raise read.refuse(key, value, "a place of the drawing is written from_pin")
    z = drawing.into_bar(bar, read_point(read, drawn, stated))
    return {"x": f"{z.real!r} m", "y": f"{z.imag!r} m"}


def list_drawn(drawing: DrawnPins, drive: ForceDrive | None) -> dict[str, float]:
    """List the drawn angles and the stroke of a cylinder by their names, rad or m."""
    drawn = {name: drawing.angle(bar) for name, bar in BAR_OF_ANGLE.items()}
    if isinstance(drive, LinearDrive):
        start, end = _draw_ends(drawing, drive)
        drawn[STROKE_COMMAND[0]] = abs(end - start)
    return drawn


def _draw_ends(drawing: DrawnPins, line: LinearDrive) -> tuple[complex, complex]:
    """Return the drawn places of the ends of a cylinder, m."""
    start = drawing.from_bar(line.start.bar, line.start.vector())
    end = drawing.from_bar(line.end.bar, line.end.vector())
    return start, end


def find_side_of_cylinder(drawing: DrawnPins, drive: ForceDrive | None) -> str:
    """Find the side of a cylinder's end on its bar; InputError for another drive."""
    line = require_cylinder(drive)
    ends = line.start, line.end
    moving = ends[0].bar == 1  # the number of the end on the bar
    places = _draw_ends(drawing, line)
    pivot = complex(*drawing.place(FIRST_PIN[ends[moving].bar]))
    across = cross(places[not moving] - pivot, places[moving] - pivot)
    return "left" if across >= 0.0 else "right"


def choose_assembly(scene: Scene, drawing: DrawnPins) -> Scene:
    """Put a scene on the assembly that is drawn.

    The sine between the two bars that are not commanded has its sign in the drawing.
    """
    bar = scene.motion.bar
    first, second = (drawing.vector(other) for other in MOVING_BARS if other != bar)
    sign = 1 if cross(first, second) >= 0.0 else -1
    angle = np.array([drawing.angle(bar)])
    branch = find_signs(scene.linkage, angle, sign, bar)
    here = solve(scene, "position", at=Command(angle, branch, None, 0.0, bar))
    gap = 0.0
    for pin, found in (("A", here.A), ("B", here.B)):
        drawn = np.subtract(drawing.place(pin), drawing.O2)
        gap += math.hypot(*(found[0] - drawn))
    if gap > PINS_APART * max(scene.linkage.lengths):
        raise InputError(
            f"motion.theta_{bar}",
            DRAWN_WORD,
            f"in the assembly that is drawn the {BAR_NAMES[bar]} stands still: "
            "command another bar",
        )
    return replace(scene, motion=scene.motion.replace(branch=int(branch[0])))
