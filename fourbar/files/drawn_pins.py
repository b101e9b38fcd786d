"""A scene file that states a drawing: `[pins]`, and places `{ drawn = [x, y] }`.

The motion may use the word "drawn".
"""

import cmath
import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import ForceDrive, LinearDrive
from fourbar.errors import ELSEWHERE, InputError
from fourbar.files.fields import Entry
from fourbar.formulas.arithmetic import cross
from fourbar.formulas.mobility import count_equalities, meet_change_points
from fourbar.linkage import (
    BAR_NAMES,
    ENDS,
    FIRST_PIN,
    MOVING_BARS,
    PINS,
    Bar,
    Declared,
    FourBar,
)
from fourbar.quantities.units import half_unit_of_text
from fourbar.scene import Command, Scene, find_signs, require_cylinder
from fourbar.scene.drawing import DRAWN_WORD, DrawnPins, PlanePoint
from fourbar.scene.motion import (
    BAR_OF_ANGLE,
    STROKE_COMMAND,
    Motion,
)
from fourbar.solving import solve

PINS_APART = 0.05
"""Distance of the pins from the drawing, over the longest bar, above which no motion
has that assembly.
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


def read_drawing(top: Entry) -> DrawnPins | None:
    """Read the table of the pins; None where a scene states lengths."""
    pins = top["pins"]
    if pins.value is None:
        return None
    if top["lengths"].value is not None:
        allowed = "must be left out: the pins state the lengths and the ground's angle"
        raise top["lengths"].refuse(allowed)
    if isinstance(pins.value, dict) and len(pins.value) > 5:  # a fifth may be a point
        raise pins.refuse(ELSEWHERE)
    motion = top["motion"]
    if isinstance(motion.value, dict) and "branch" in motion.value:
        raise motion["branch"].refuse("must be left out: the pins state the assembly")
    return pins.described(DrawnPins)  # type: ignore[no-any-return]


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


def read_ground(lengths: Entry) -> DrawnGround:
    """Read the direction of the ground of a scene of lengths.

    The file may have x and y of O4 from O2 in the place of length and angle.
    """
    if not isinstance(lengths.value, dict):
        return DrawnGround()
    angle = lengths["ground_angle"]
    ground = lengths["ground"]
    if not isinstance(ground.value, dict):
        return DrawnGround(angle.declared(FourBar.numbers["ground_angle"]))
    if angle.value is not None:
        raise angle.refuse("must be left out: x and y of the ground state its angle")
    ground.table("xy")
    x, y = (ground[axis].check(Declared("m")) for axis in "xy")
    length = math.hypot(x, y)
    if not 0.0 < length < math.inf:
        raise ground.refuse("must be coordinates of O4 from O2, where it does not lie")
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
