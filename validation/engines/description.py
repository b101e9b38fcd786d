"""What a scene's numbers mean, stated a second time: no engine takes it from the formulas' side.

Pins and the bars i, j that meet there; a bar's inertia and mass centre where they are left out; a field of gravity;
a point of a bar.
"""

import math

from fourbar.effects import Gravity
from fourbar.linkage import Bar

PINS = {"O2": (1, 2), "A": (2, 3), "B": (3, 4), "O4": (1, 4)}
FIRST_PIN = {2: "O2", 3: "A", 4: "O4"}
FORCE_AT = {"O2": "F12", "A": "F32", "B": "F43", "O4": "F14"}
TELLS = 2.0**-53
"""A component of a direction below this is what the angle's own rounding leaves of zero."""


def inertia(bar: Bar) -> float:
    """About the mass centre, kg m^2: as stated, or that of a uniform slender bar, m L^2/12."""
    return bar.inertia if bar.inertia is not None else bar.mass * bar.length**2 / 12.0


def centre(bar: Bar) -> tuple[float, float]:
    """Distance (m) and angle (rad) of the mass centre from the first pin and the bar's line: as stated, or mid-bar."""
    return bar.centre if bar.centre is not None else (bar.length / 2.0, 0.0)


def along_and_across(distance: float, angle: float) -> tuple[float, float]:
    """A point at a distance (m) and an angle from a line (rad), along and across it."""
    return distance * math.cos(angle), distance * math.sin(angle)


def field(gravity: Gravity) -> tuple[float, float]:
    """(g_x, g_y), m/s^2; the angle counts from +x, counter-clockwise."""
    x, y = math.cos(gravity.angle), math.sin(gravity.angle)
    return gravity.magnitude * (x if abs(x) > TELLS else 0.0), gravity.magnitude * (y if abs(y) > TELLS else 0.0)
