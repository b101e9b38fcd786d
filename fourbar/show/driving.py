"""What drives a linkage, and whether its motion closes."""

from typing import Any, NamedTuple

import numpy as np

from fourbar.formulas.path import count_turns
from fourbar.quantities import COUPLE, LINE, UNITS, Array, DriveNames
from fourbar.show.shown_units import drop_rounding
from fourbar.solution import Solution

_BESIDE = 1e-6
"""Part of a law's time from an instant at rest to where it is told how it moves."""
_SAME_RATE = 1e-9
"""Difference of two rates of a spline that is round-off, over its largest value. The
rounding is that of its coefficients.
"""
_BEGINNING = 1e-100
"""Speed of what begins to move, rad/s or m/s. Its square is nothing; dry friction has
its sign.
"""


class Driving(NamedTuple):
    """Torque or force of the drive, as it is shown."""

    name: str
    symbol: str
    unit: str
    values: Array
    """(n,); NaN where only positions are known, and along a released motion, in which
    no drive acts.
    """
    error: Array
    """Error bars, (n,); NaN where none were computed."""
    keys: DriveNames
    """Names of its torque or force among the quantities."""
    speed_key: str
    """Name of the speed of the driven bar, or of the stroke."""

    @property
    def sizes(self) -> Array:
        """Sizes of torque or force, (n,)."""
        return np.abs(self.values)


def read_drive_demand(solution: Solution) -> Driving:
    """Return torque or force of the drive, with its error bar."""
    names = COUPLE
    symbol = f"T{solution.drive_bar}"
    speed = f"omega_{solution.drive_bar}"
    if solution.drive is not None:
        names = LINE
        symbol = "F"
        speed = "stroke_speed"
    values, error = (getattr(solution, name) for name in names[:2])
    none = np.full(solution.theta_2.shape, np.nan)
    is_released = solution.stated.motion.free and solution.time is not None
    if values is None or is_released:
        values = error = none
    if error is None:
        error = none
    name = names.value.replace("_", " ")
    return Driving(name, symbol, UNITS[names.value], values, error, names, speed)


def lacks_friction(solution: Solution) -> Any:
    """Return where dry friction at rest is left out, (n,).

    Torque or force of the drive and the pin forces are without it there.
    """
    low, high = (getattr(solution, end) for end in read_drive_demand(solution).keys[2:])
    if low is None:
        return np.zeros(len(solution), dtype=bool)
    return np.isfinite(high - low) & (low < high)


def find_senses(solution: Solution) -> Array:
    """Return the senses in which positions at rest start and come to rest, (2, n).

    A position with dry friction starts in the sense of its acceleration, 1 or -1. One
    that follows on a motion the other way comes to rest by it, and starts only if the
    next position moves its way; it then turns back, and else both senses are one. They
    are 0 elsewhere, and where the acceleration is the rounding with which a law ends.
    """
    speed: Any = solution.at.speed
    acceleration = solution.at.acceleration
    at_rest = lacks_friction(solution) & (speed == 0.0)
    if not at_rest.any():
        return np.zeros((2, len(solution)))
    largest = float(np.nanmax(np.abs(acceleration), initial=0.0))
    growth = drop_rounding(acceleration, largest)
    starts = np.where(at_rest, np.sign(growth), 0.0)
    moves = np.sign(speed) * np.ones(len(starts))
    before, after = np.append(0.0, moves[:-1]), np.append(moves[1:], 0.0)
    law = solution.stated.motion.law
    if law is not None and solution.time is not None:
        # it moves beside a single instant too
        first, last = law.time[0], law.time[-1]
        away = _BESIDE * (last - first)
        before, after = (
            np.sign(law.at(np.clip(solution.at.places + aside, first, last))[1])
            for aside in (-away, away)
        )
    stops = np.where(before == -starts, before, starts)
    return np.stack([np.where(after == starts, starts, stops), stops])


def begin_to_move(speed: Any, senses: Any) -> Any:
    """Return speeds of which those that are 0 begin in a sense, 1 or -1; 0: none."""
    return np.where(speed == 0.0, _BEGINNING * senses, speed)


def leaves_range(solution: Solution) -> Any:
    """Return where dry friction holds a pin and leaves the drive a range, (n,).

    Nothing is held where an acceleration starts or stops a motion.
    """
    return lacks_friction(solution) & (find_senses(solution)[0] == 0.0)


def name_places(solution: Solution) -> tuple[str, str]:
    """Return the symbol and the SI unit of what the positions of a motion follow."""
    if solution.time is not None:
        return "t", "s"
    return solution.commanded, solution.at.unit


def is_once_round(solution: Solution) -> bool:
    """Return True if the last position repeats the first.

    The motion then covers whole turns, of an assembly with a single change point an
    even number of them. Speed and acceleration must repeat too: a motion law may end at
    another speed than it begins with.
    """
    angle = solution.at.angle
    period = float(count_turns(solution.stated.linkage.lengths, solution.at.bar))
    turns = abs(angle[-1] - angle[0]) / (2.0 * np.pi * period)
    if turns <= 0.5 or not np.isclose(turns, np.round(turns), rtol=1e-12, atol=0.0):
        return False
    rates = (solution.at.speed, solution.at.acceleration)
    return all(
        abs(rate[-1] - rate[0]) <= _SAME_RATE * np.abs(rate).max()
        for rate in rates
        if isinstance(rate, np.ndarray) and rate.ndim
    )
