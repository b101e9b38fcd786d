"""Compute errors and allowed errors, with the reason for each.

Tolerances are of four classes, each a named object.

`condition` lies in (0, 1], 1 is best; an exact comparison is allowed K eps / condition.
The motion condition is s = |sin(theta_4 - theta_3)|, the drive condition the sine
between the two bars that are not driven, the lever the shorter of bars 3 and 4 over the
longest bar.
"""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.formulas.mobility import TURN
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import UNITS, Array
from fourbar.solution import Solution

Mask = NDArray[np.bool_]

Angle = TypeVar("Angle", float, Array)

EPS = 2.0**-52
_LEAST_DOUBLE = 2.0**-1074
K = 50.0
"""One factor for every exact comparison. Two evaluations of about fifty roundings each
differ by sqrt(2 * 50) = 10 of them as a random walk; 50 covers the tails of some 10^5
comparisons.
"""
RANDOM_WALK = 8.0
"""Last digits by which a chain of some fifty roundings moves a result, as a random
walk: sqrt(50) = 7.
"""
MOST_ALLOWED = 0.05
"""Greatest allowed error with a verdict, unless an engine declares more. Where the
condition and terms that cancel raise it further, two correct programs may differ in the
second digit.
"""
NOTHING_TO_TELL = MOST_ALLOWED / K
"""Greatest eps/condition with a verdict of a row that has no terms to cancel."""
WELL_CONDITIONED = 0.1
"""Positions whose condition is at least this set the scale of a quantity."""
IN_PARTS_OF_EPS = 1e-12
"""Allowed errors below this are stated in parts of eps."""
TIMES_PREDICTED = 10.0
"""Factor by which an engine may exceed the error that is predicted."""


@dataclass(frozen=True, slots=True)
class ErrorBound:
    """Allowed error of a comparison, with the reason that the report prints."""

    name: str
    reason: str
    factor: float
    """Error allowed at condition 1, relative to the scale."""
    conditioned: bool
    """True if the allowed error is divided by the condition."""
    in_time: bool = False
    """True for an engine that runs through the motion in time, which has no convention
    at rest.
    """
    cause: str = ""
    """Cause of the error, in a few words."""

    def explain(self, condition: float) -> str:
        """Say in a sentence what is allowed at a condition, and the error's cause."""
        if self.conditioned:
            size = f"{self.factor / EPS:.3g} eps over the condition {condition:.2g}"
        elif self.factor < IN_PARTS_OF_EPS:
            size = f"{self.factor / EPS:.3g} eps, whatever the condition"
        else:
            size = f"{self.factor:g} of the scale"
        return f"{self.cause or self.name}: {size}"

    def allowed(self, condition: Array) -> Array:
        """Compute the relative error allowed at each position, (n,)."""
        if not self.conditioned:
            return np.full_like(condition, self.factor)
        with np.errstate(divide="ignore"):
            return self.factor / condition


IDENTITY = ErrorBound(
    "identity",
    "K eps of the sum of the absolute terms: an equation that holds in every position,"
    " whatever the condition",
    K * EPS,
    conditioned=False,
    cause="round-off of the terms",
)
EQUIVALENCE = ErrorBound(
    "equivalence",
    "K eps/condition: two exact derivations of one number differ by round-off alone;"
    " beyond that ten times the error computed for the position, from moving every"
    " stored number and the closure by one rounding in 320-bit arithmetic",
    K * EPS,
    conditioned=True,
    cause="round-off of both sides",
)
SIMULATED = ErrorBound(
    "modelling + integration",
    "1e-5 of the scale: the soft loop and the time step of the generated MJCF at about"
    " 628 RK4 steps per revolution, two to ten times what was measured (1e-6 to 4e-6)",
    1e-5,
    conditioned=False,
    in_time=True,
    cause="softness and time step",
)
FULL_ACCURACY = ErrorBound(
    "full accuracy",
    "K eps whatever the condition; beyond that ten times the error computed for the"
    " position, quantity by quantity, from moving every stored number and the closure"
    " by one rounding in 320-bit arithmetic",
    K * EPS,
    conditioned=False,
    cause="round-off of both sides",
)

POWER = {
    **dict.fromkeys(("rad", "m", "1"), 1),
    **dict.fromkeys(("rad/s", "m/s", "rad/s^2", "m/s^2", "N", "N m", "W"), 2),
}
"""Power of 1/s by unit. Angles and positions lose digits as 1/s, everything that
follows from them as 1/s^2.
"""
OF_THE_COMMAND = {
    bar: frozenset(
        (
            *(f"{quantity}_{bar}" for quantity in ("theta", "omega", "alpha")),
            *(f"{rate}{point}" for rate in ("", "v_", "a_") for point in points),
        )
    )
    for bar, points in ((2, ("A", "G2")), (3, ()), (4, ("B", "G4")))
}
"""Quantities that the command of a bar decides by itself, also where the loop is open:
they lose no digits.
"""
OF_THE_INPUT = OF_THE_COMMAND[2]
TOUCHING_MARGIN = 32.0 * EPS
"""A loop that closes, or misses, by less than this part of the sum of its lengths does
so by the rounding of the data, and the engines may differ on whether it closes.
"""


def hold_simulated(error: float, why: str) -> ErrorBound:
    """Return the tolerance of an engine that runs through time, for a wanted error."""
    if not 0.0 < error < 1.0:
        raise InputError(
            "--error", error, "must be a relative error, above 0 and below 1"
        )
    return replace(
        SIMULATED,
        factor=error,
        reason=f"{error:g} of the scale, as wanted: {why}",
    )


_OF_DIRECTION = frozenset(("drive_line", "stroke_speed", "drive_condition"))
"""Quantities that, like every force, follow from the direction of the force that
drives: the places of its ends are rounded as the lengths are, and the direction by that
over the stroke.
"""


def find_lever(linkage: FourBar, bar: int = 2) -> float:
    """Compute min(b, c)/longest bar.

    A loop closes to eps of its longest bar, which turns a shorter bar 3 or 4 by more.
    Of another commanded bar it is the shorter of the two moving bars besides it.

    Without it 28 of 10 008 comparisons on 300 random linkages exceed K = 50 (at most
    83); with it none exceeds 17.
    """
    lengths = linkage.lengths
    others = [lengths[number - 1] for number in MOVING_BARS if number != bar]
    return min(others) / max(lengths)


def find_condition(quantity: str, linkage: FourBar, formulas: Solution) -> Array:
    """Return the condition of a quantity at each position, (n,).

    Angles, places and pure numbers have s times the lever, all that follows from them
    s^2 times the lever; forces, torques and power have the drive condition as a further
    factor, and those of a cylinder its stroke over the longest bar. What is commanded,
    or follows from a commanded input alone, has the condition of the command.
    """
    bar = formulas.at.bar
    unit = UNITS[quantity]
    if quantity in OF_THE_COMMAND[bar]:
        # a stroke commands the bar as far as its cylinder has a lever
        return np.full(len(formulas), np.asarray(formulas.at.condition) ** POWER[unit])
    condition = find_lever(linkage, bar) * formulas.condition ** POWER[unit]
    of_force = unit in ("N", "N m", "W")
    if formulas.stroke is not None and (of_force or quantity in _OF_DIRECTION):
        condition *= np.minimum(formulas.stroke / max(linkage.lengths), 1.0)
    if of_force:
        condition *= formulas.drive_condition
    return condition


def wrap_difference(angle: Angle) -> Angle:
    """Wrap into [-pi, pi)."""
    return (angle + math.pi) % TURN - math.pi


def count_half_turns(ground_angle: float, theta_2: Array | float) -> float:
    """Give the largest angle in half turns, at least 1.

    Many turns away it has fewer digits of its direction.
    """
    return max(
        1.0, abs(ground_angle) / np.pi, float(np.abs(theta_2).max(initial=0.0)) / np.pi
    )


def sum_lengths(linkage: FourBar) -> float:
    """Sum of the four lengths, m: the terms of the loop closure."""
    return math.fsum(linkage.lengths)


def compute_closing_margin(linkage: FourBar, theta: Array, bar: int = 2) -> Array:
    """Return by what the loop closes (> 0) or misses (< 0) at a bar's angle, (n,).

    The margin is relative to the sum of the lengths.
    """
    lengths = linkage.lengths
    held = lengths[bar - 1] * (-1.0 if bar == 4 else 1.0)
    b, c = (lengths[number - 1] for number in MOVING_BARS if number != bar)
    e = np.abs(
        linkage.ground * np.exp(1j * linkage.ground_angle) - held * np.exp(1j * theta)
    )
    return np.asarray(np.minimum(b + c - e, e - abs(b - c)) / sum_lengths(linkage))


def find_gap(linkage: FourBar, theta_2: Array, theta_3: Array, theta_4: Array) -> Array:
    """Return by what three angles miss the closure of the loop, (n,).

    The gap is relative to the sum of the lengths.
    """
    d, a, b, c = linkage.lengths
    ground = d * np.exp(1j * linkage.ground_angle)
    gap = (
        a * np.exp(1j * theta_2)
        + b * np.exp(1j * theta_3)
        - ground
        - c * np.exp(1j * theta_4)
    )
    return divide(np.abs(gap), sum_lengths(linkage))


def mark_touching(linkage: FourBar, theta: Array, bar: int = 2) -> Mask:
    """Mark positions at which rounding decides whether the loop closes."""
    return np.asarray(
        np.abs(compute_closing_margin(linkage, theta, bar)) < TOUCHING_MARGIN
    )


def magnitude(values: Array) -> Array:
    """Return the absolute value of a scalar, the Euclidean norm of a vector, (n,)."""
    if values.ndim == 2:
        return np.asarray(np.hypot(values[:, 0], values[:, 1]))
    return np.abs(values)


def compute_difference(quantity: str, ours: Array, theirs: Array) -> Array:
    """Compute the differences of a quantity, (n,).

    Angles differ modulo 2 pi, vectors by Euclidean norm; NaN where the shapes differ.
    """
    if ours.shape != theirs.shape:
        return np.full(len(ours), np.nan)
    difference = ours - theirs
    if quantity.startswith("theta"):
        difference = wrap_difference(difference)
    return magnitude(difference)


def divide(apart: Array | float, size: Array | float) -> Array:
    """Divide a difference by a size.

    A size of 0 demands exactly 0: over the least double any other difference is huge.
    """
    with np.errstate(over="ignore"):
        return np.asarray(apart / np.where(size == 0.0, _LEAST_DOUBLE, size))


def find_error(quantity: str, ours: Array, theirs: Array, size: Array) -> Array:
    """Compute the error of an answer in parts of the size of the quantity, (n,)."""
    return divide(compute_difference(quantity, ours, theirs), size)


def replace_zero_size(size: Array) -> Array:
    """Replace a size by 1 of its unit where there is nothing to be relative to."""
    return np.where(size == 0.0, 1.0, size)


def find_used(error: Array | float, allowed: Array | float) -> Array:
    """Return error/allowed, the used part of the allowed error.

    The ratio is infinite if the error is not finite, and 0 if the error is 0.
    """
    error = np.asarray(error, dtype=float)
    allowed = np.asarray(allowed, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        share = np.where(error == 0.0, 0.0, error / allowed)
    return np.where(np.isfinite(share), share, np.inf)


def find_worst(errors: Array) -> int:
    """Return the index of the largest error; NaN counts as the largest."""
    return int(np.where(np.isnan(errors), np.inf, errors).argmax())
