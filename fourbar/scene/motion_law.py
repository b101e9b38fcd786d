"""The drive's motion as a table of theta_2 over time, smoothly interpolated: each position has its own speed."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fourbar.errors import DependencyError, InputError, expect, installing
from fourbar.linkage import MOST_STEPS, require_numbers, require_whole
from fourbar.solution import Array

ENDS = {"free": "not-a-knot", "rest": "clamped", "periodic": "periodic"}
"""How the motion begins and ends: no condition, at rest, or as one period of a motion that goes on."""
LEAST = {"free": 4, "rest": 2, "periodic": 3}
"""Points that determine the cubic pieces."""
MOST_POINTS = 100_000
STEPS = (range(1, MOST_STEPS + 1), f"must be a whole number from 1 to {MOST_STEPS}")
"""Intervals of any motion."""


@dataclass(frozen=True, slots=True)
class Law:
    """theta_2(t) through the points of a table: piecewise cubic, its acceleration continuous.

    Parameters
    ----------
    time : rising, s.
    theta_2 : one angle for each time, rad.
    steps : the law is evaluated at the ends of so many equal intervals of time.
    ends : "free", "rest" (speed 0 at both ends) or "periodic" (the speed and acceleration at the end
        are those at the start; theta_2 may have gained whole turns).
    """

    time: tuple[float, ...]
    theta_2: tuple[float, ...]
    steps: int = 360
    ends: str = "free"

    def __post_init__(self) -> None:
        key = "motion.law"
        expect(f"{key}.ends", self.ends, str)
        if self.ends not in ENDS:
            raise InputError(f"{key}.ends", self.ends, "must be one of " + ", ".join(ENDS))
        time, theta_2 = (
            tuple(require_numbers(f"{key}.{name}", getattr(self, name), unit=unit).ravel().tolist())
            for name, unit in (("time", "s"), ("theta_2", "rad"))
        )
        if len(time) != len(theta_2) or not LEAST[self.ends] <= len(time) <= MOST_POINTS:
            allowed = f"needs {LEAST[self.ends]} to {MOST_POINTS} times and as many angles"
            raise InputError(key, (len(time), len(theta_2)), allowed)
        if any(b <= a for a, b in pairwise(time)):
            raise InputError(f"{key}.time", time, "must rise")
        object.__setattr__(self, "steps", require_whole(f"{key}.steps", self.steps, *STEPS))
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "theta_2", theta_2)

    def times(self) -> Array:
        """Where it is evaluated, (steps + 1,), s."""
        return np.linspace(self.time[0], self.time[-1], self.steps + 1)

    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """theta_2, omega_2 and alpha_2 at times within the table, each (n,).

        Raises DependencyError where SciPy is not installed.
        """
        try:
            from scipy.interpolate import CubicSpline
        except ModuleNotFoundError:
            raise DependencyError(f"SciPy is needed for a motion law: {installing('dynamics')}") from None
        time = require_numbers("time", time)
        t, angle = np.array(self.time), np.array(self.theta_2)
        mean = 0.0
        if self.ends == "periodic":
            # what is periodic is the departure from the mean speed
            mean = (angle[-1] - angle[0]) / (t[-1] - t[0])
            angle = angle - mean * (t - t[0])
            angle[-1] = angle[0]
        curve = CubicSpline(t, angle, bc_type=ENDS[self.ends])
        theta_2, omega_2, alpha_2 = (np.asarray(curve(time, order)) for order in (0, 1, 2))
        return theta_2 + mean * (time - t[0]), omega_2 + mean, alpha_2
