"""State a second time what a scene's numbers mean.

No engine takes it from the formulas' side. Pins and the bars i, j that meet there; a
bar's inertia and mass centre where they are left out; a field of gravity; a point of a
bar; the bars as a tree that is open at pin B.
"""

import cmath
import math
from collections.abc import Callable, Iterable
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fourbar.effects import Effect, ForceDrive, Gravity, Table
from fourbar.linkage import MOVING_BARS, Bar, FourBar
from fourbar.quantities import COUPLE, LINE, UNKNOWNS, Array
from fourbar.scene import Command, Scene
from fourbar_validation.compare.pins import (
    find_centre,
    find_inertia,
    find_mass,
    resolve,
)

FORCE_AT = {"O2": "F12", "A": "F32", "B": "F43", "O4": "F14"}
FORCE_BETWEEN = {
    "F12": (1, 2),
    "F32": (3, 2),
    "F43": (4, 3),
    "F14": (1, 4),
}
"""Bar that exerts each pin force, and bar on which it acts."""
PIN_OF_MOVING_BAR = {2: "O2", 3: "A", 4: "O4"}
PART_POINTS = {
    "A": "first_pin3",
    "O4": "first_pin4",
    "A2": "end2",
    "B": "end3",
    "B4": "end4",
    **{g: g for g in ("G2", "G3", "G4")},
}
"""Names of points in `MovingPart`, by the name under which a point is answered. A2 and
B4 are the ends of bars 2 and 4.
"""
ON_BARS = {"A": "end2", "B": "end4", "G2": "G2", "G3": "G3", "G4": "G4"}
"""Points whose accelerations are answered, each as a point of a bar."""
_TELLS = 2.0**-53
"""Least component of a direction that is not what the angle's rounding leaves of zero.
"""
SHARED_BY_EXACT_ENGINES = "the description, what is commanded and the branch"
"""Words of a report for what an exact engine takes from the formulas' side."""

Sizes = dict[str, float]
"""Sizes of inputs or outputs, by their names."""
Value = float | str | tuple[float, ...]
"""Value of an entry of a model file, in SI and rad."""


class ModelEntry(NamedTuple):
    """One entry of a model file, with its value as compiled.

    `element` and `attribute` of the file state it.
    """

    value: Value
    element: str = ""
    """Tag and name, for example `joint "A"`. Empty if no single element states it."""
    attribute: str = ""


def inertia_about_first_pin(bar: Bar) -> float:
    """Compute the moment of inertia about the first pin, kg m^2."""
    return find_inertia(bar) + find_mass(bar) * find_centre(bar)[0] ** 2


def reduce_angle(angle: float) -> float:
    """Reduce an angle to its direction, rad.

    Sums with others then lose none of its digits.
    """
    if abs(angle) <= math.pi:
        return angle
    return math.atan2(math.sin(angle), math.cos(angle))


def find_field(gravity: Gravity) -> tuple[float, float]:
    """Return (g_x, g_y), m/s^2; the angle counts from +x, counter-clockwise."""
    x = math.cos(gravity.angle)
    y = math.sin(gravity.angle)
    return gravity.magnitude * (x if abs(x) > _TELLS else 0.0), gravity.magnitude * (
        y if abs(y) > _TELLS else 0.0
    )


def find_from_middle(table: Table, theta_2: float | Array) -> Any:
    """Return angles (rad) from the middle of a table, within half a turn."""
    middle = 0.5 * (table.theta_2[0] + table.theta_2[-1])
    return np.remainder(theta_2 - middle + np.pi, 2.0 * np.pi) - np.pi


def look_up(table: Table, theta_2: float | Array) -> Any:
    """Interpolate a table between its points, at one angle or several.

    Beyond the ends the nearer one counts. The formulas' `at` is not used.
    """
    middle = 0.5 * (table.theta_2[0] + table.theta_2[-1])
    angle = middle + find_from_middle(table, theta_2)
    return np.interp(angle, table.theta_2, table.factor)


class MovingPart(NamedTuple):
    """A moving bar in its own axes: from its first pin along its line, and across."""

    bar: int
    bearer: int
    """The bar that carries its first pin; 1: the ground."""
    first_pin: tuple[float, float]
    """Place of that pin in the bearer's axes, for the ground in world axes, m."""
    mass: float
    inertia: float
    """About the mass centre, kg m^2."""
    length: float
    points: dict[str, tuple[float, float]]
    """Positions of first_pin, G and end, each with the bar's number, m: first pin, mass
    centre and second pin.
    """

    @property
    def centre(self) -> tuple[float, float]:
        """Return the mass centre, m."""
        return self.points[f"G{self.bar}"]


def list_moving_parts(linkage: FourBar) -> list[MovingPart]:
    """Describe bars 2, 3 on 2, and 4."""
    theta_1 = linkage.ground_angle
    d = linkage.ground
    first_pins = {
        2: (1, (0.0, 0.0)),
        3: (2, (linkage.input.length, 0.0)),
        4: (1, resolve(d, theta_1)),
    }
    parts_of_bars = []
    for number in MOVING_BARS:
        bar = linkage.bar(number)
        ends = {
            "first_pin": (0.0, 0.0),
            "G": resolve(*find_centre(bar)),
            "end": (bar.length, 0.0),
        }
        points = {f"{name}{number}": place_of for name, place_of in ends.items()}
        parts_of_bars.append(
            MovingPart(
                number,
                *first_pins[number],
                find_mass(bar),
                find_inertia(bar),
                bar.length,
                points,
            )
        )
    return parts_of_bars


def place(point: Any, ground_angle: float) -> complex:
    """Return the vector to a spring's end from the first pin of its bar, m.

    On a moving bar it is along and across the bar, on the ground in world axes.
    """
    turned = ground_angle if point.bar == 1 else 0.0
    return cmath.rect(point.distance, point.angle) * cmath.rect(1.0, turned)


def list_speeds(command: Command) -> tuple[Array, Array]:
    """List speed and acceleration of the commanded bar at each position, (n,).

    A speed that is not stated is 0.
    """
    rates = np.zeros((2, len(command.angle)))
    if command.speed is not None:
        rates[0] = command.speed
    rates[1] = command.acceleration
    omega, alpha = rates
    return omega, alpha


def name_driving(scene: Scene) -> str:
    """Name what is solved for of a scene's drive: its torque or its force."""
    return (COUPLE if scene.drive is None else LINE).value


def name_drive(drive: ForceDrive) -> str:
    """Name the kind of a drive that exerts a force, as an engine's hello lists it."""
    return "cylinder" if drive.has_stroke else "push"


def list_unknowns(scene: Scene, names: Iterable[str] = UNKNOWNS) -> list[str]:
    """List quantities with the scene's own drive in place of a torque."""
    return [name_driving(scene) if name == COUPLE.value else name for name in names]


def declares(effect: Effect, method: str) -> bool:
    """Return True if an effect defines a method that the base class leaves open."""
    return getattr(type(effect), method) is not getattr(Effect, method)


_UNITS_OF_LENGTH = (Fraction(1), Fraction("0.0254"), Fraction("0.3048"))
"""Metre, inch and foot, m; the other units of a length differ by powers of ten."""


@lru_cache(maxsize=256)
def find_stated_lengths(lengths: tuple[float, ...]) -> list[Fraction]:
    """Return d, a, b, c as they were stated, m.

    Decimals of 12 digits at most of which two pairs have one sum make a change point,
    which their doubles miss by a rounding: 80, 100, 120 and 60 mm do. The double of a
    stated length is at most one unit in the last place off, as the product of a number
    and a unit is. Other lengths are their doubles.
    """
    for unit in _UNITS_OF_LENGTH:
        d, a, b, c = stated = [
            Fraction(f"{length / float(unit):.12g}") * unit for length in lengths
        ]
        were_stated = all(
            abs(float(decimal) - length) <= math.ulp(length)
            for decimal, length in zip(stated, lengths, strict=True)
        )
        if were_stated and 0 in (d + a - b - c, d + b - a - c, d + c - a - b):
            return stated
    return [Fraction(length) for length in lengths]


def find_unknown(
    scene: Scene,
    knows: Callable[[Any], bool],
    *,
    forces: bool = False,
) -> str:
    """Return the reason to refuse a scene with an unknown effect.

    The reason is empty if the engine knows all effects.

    `forces`: True if the engine knows drives that exert a force.
    """
    if scene.drive is not None and scene.motion.free is None and not forces:
        return "a drive that exerts a force has no model here"
    return next(
        (
            f"the effect {effect.key!r} has no model here"
            for effect in scene.effects
            if not knows(effect)
        ),
        "",
    )
