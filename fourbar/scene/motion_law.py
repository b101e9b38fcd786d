"""The motion as a table of an angle over time, smoothly interpolated: each position has its own speed."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fourbar.errors import DependencyError, InputError, expect, say_install
from fourbar.linkage import MOST_STEPS, MOVING_BARS, require_numbers, require_whole
from fourbar.quantities import Array

ENDS = {"free": "not-a-knot", "rest": "clamped", "periodic": "periodic"}
"""End conditions of the spline: none, at rest, or one period of a motion that goes on."""
LEAST = {"free": 4, "rest": 2, "periodic": 3}
"""Points that determine the cubic pieces."""
MOST_POINTS = 100_000
STEPS = (range(1, MOST_STEPS + 1), f"must be a whole number from 1 to {MOST_STEPS}")
"""Intervals of any motion."""
COMMANDS = {bar: (f"theta_{bar}", f"omega_{bar}", f"alpha_{bar}") for bar in MOVING_BARS}
"""Names of the commanded angle, speed and acceleration by bar."""
ANGLES = {bar: names[:1] for bar, names in COMMANDS.items()}


def find_bar(key: str, stated: object, commands: Mapping[int, tuple[str, ...]]) -> int | None:
    """Return the bar of which numbers are stated, None where none is; InputError where there are two."""
    found = [
        bar
        for bar, names in commands.items()
        for name in names
        if (value := getattr(stated, name)) is not None and not (name[0] == "a" and type(value) is float and not value)
    ]
    found = list(dict.fromkeys(found))
    if len(found) > 1:
        named = " and ".join(f"of bar {bar}" for bar in found)
        raise InputError(key, named, "is the command of one bar: theta, omega and alpha of bar 2, 3 or 4")
    return found[0] if found else None


@dataclass(frozen=True, slots=True)
class Law:
    """theta_2(t) through the points of a table: piecewise cubic, its acceleration continuous.

    Parameters
    ----------
    time : rising, s.
    theta_2, theta_3, theta_4 : one angle of the commanded bar for each time, rad; the others are left out.
    steps : the law is evaluated at the ends of so many equal intervals of time.
    ends : "free", "rest" (speed 0 at both ends) or "periodic" (the speed and acceleration at the end
        are those at the start; the angle may have gained whole turns).
    """

    time: tuple[float, ...]
    theta_2: tuple[float, ...] | None = None
    steps: int = 360
    ends: str = "free"
    theta_3: tuple[float, ...] | None = None
    theta_4: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        key = "motion.law"
        expect(f"{key}.ends", self.ends, str)
        if self.ends not in ENDS:
            raise InputError(f"{key}.ends", self.ends, "must be one of " + ", ".join(ENDS))
        angle = f"theta_{self.bar}"
        time, angles = (
            tuple(require_numbers(f"{key}.{name}", getattr(self, name), unit=unit).ravel().tolist())
            for name, unit in (("time", "s"), (angle, "rad"))
        )
        if len(time) != len(angles) or not LEAST[self.ends] <= len(time) <= MOST_POINTS:
            allowed = f"needs {LEAST[self.ends]} to {MOST_POINTS} times and as many angles"
            raise InputError(key, (len(time), len(angles)), allowed)
        if any(b <= a for a, b in pairwise(time)):
            raise InputError(f"{key}.time", time, "must rise")
        object.__setattr__(self, "steps", require_whole(f"{key}.steps", self.steps, *STEPS))
        object.__setattr__(self, "time", time)
        object.__setattr__(self, angle, angles)

    @property
    def bar(self) -> int:
        """Number of the bar whose angle the law gives: 2, 3 or 4."""
        return find_bar("motion.law", self, ANGLES) or 2

    @property
    def angle(self) -> tuple[float, ...]:
        """Angles of the law's bar at its times, rad."""
        found: tuple[float, ...] = getattr(self, f"theta_{self.bar}")
        return found

    def times(self) -> Array:
        """Return the times at which the law is evaluated, (steps + 1,), s."""
        return np.linspace(self.time[0], self.time[-1], self.steps + 1)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """Angle, speed and acceleration of its bar at times within the table, each (n,).

        Raises DependencyError where SciPy is not installed.
        """
        try:
            from scipy.interpolate import CubicSpline
        except ModuleNotFoundError:
            raise DependencyError(f"SciPy is needed for a motion law: {say_install('studies')}") from None
        time = require_numbers("time", time)
        t, angle = np.array(self.time), np.array(self.angle)
        mean = 0.0
        if self.ends == "periodic":
            # what is periodic is the departure from the mean speed
            mean = (angle[-1] - angle[0]) / (t[-1] - t[0])
            angle = angle - mean * (t - t[0])
            angle[-1] = angle[0]
        curve = CubicSpline(t, angle, bc_type=ENDS[self.ends])
        theta, omega, alpha = (np.asarray(curve(time, order)) for order in (0, 1, 2))
        return theta + mean * (time - t[0]), omega + mean, alpha
