"""How much may differ, and why: four classes of tolerance, each a named object.

`condition` lies in (0, 1], 1 is best; an exact comparison is allowed K eps / condition. The motion
condition is s = |sin(theta_4 - theta_3)|, the drive condition the sine between the two bars that
are not driven, the lever the shorter of bars 3 and 4 over the longest bar.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import InputError
from fourbar.linkage import MOVING_BARS, FourBar
from fourbar.quantities import UNITS
from fourbar.solution import Solution

Array = NDArray[np.float64]

EPS = 2.0**-52
K = 50.0
"""One factor for every exact comparison. Two evaluations of about fifty roundings each differ by
sqrt(2 * 50) = 10 of them as a random walk; 50 covers the tails of some 10^5 comparisons."""
ROUNDINGS = 8.0
"""A chain of some fifty roundings moves a result by sqrt(50) = 7 last digits, as a random walk."""
NOTHING_TO_TELL = 1e-3
"""Where eps/condition exceeds this, two correct programs may differ in the third digit: no verdict is drawn."""
WELL_CONDITIONED = 0.1
"""Positions whose condition is at least this set the scale of a quantity."""
DEGRADED = 10.0
"""An engine whose error is predicted may exceed the prediction by this factor, not more."""


@dataclass(frozen=True, slots=True)
class ErrorBound:
    """What a comparison is allowed, with the reason that the report prints."""

    name: str
    reason: str
    factor: float
    """Error allowed at condition 1, relative to the scale."""
    conditioned: bool
    """Whether it is divided by the condition."""
    in_time: bool = False
    """Whether it is of an engine that runs through the motion in time, and has no convention at rest."""

    def allowed(self, condition: Array) -> Array:
        """Compute the relative error allowed at each position, (n,)."""
        if not self.conditioned:
            return np.full_like(condition, self.factor)
        with np.errstate(divide="ignore"):
            return self.factor / condition


IDENTITY = ErrorBound(
    "identity",
    "K eps of the sum of the absolute terms: an equation that holds in every position, whatever the condition",
    K * EPS,
    conditioned=False,
)
EQUIVALENCE = ErrorBound(
    "equivalence",
    "K eps/condition: two exact derivations of one number differ by round-off alone; beyond that ten times the error "
    "computed for the position, from moving every stored number and the closure by one rounding in 320-bit arithmetic",
    K * EPS,
    conditioned=True,
)
SIMULATED = ErrorBound(
    "modelling + integration",
    "1e-5 of the scale: the soft loop and the time step of the generated MJCF at about 628 RK4 steps per revolution, "
    "two to ten times what was measured (1e-6 to 4e-6)",
    1e-5,
    conditioned=False,
    in_time=True,
)
FULL_ACCURACY = ErrorBound(
    "full accuracy",
    "K eps whatever the condition; beyond that ten times the error computed for the position, quantity by quantity, "
    "from moving every stored number and the closure by one rounding in 320-bit arithmetic",
    K * EPS,
    conditioned=False,
)

POWER = {**dict.fromkeys(("rad", "m", "1"), 1), **dict.fromkeys(("rad/s", "m/s", "rad/s^2", "m/s^2", "N", "N m"), 2)}
"""By unit: angles and positions lose digits as 1/s, everything that follows from them as 1/s^2."""
OF_THE_INPUT = frozenset(("theta_2", "omega_2", "alpha_2", "A", "G2", "v_A", "v_G2", "a_A", "a_G2"))
"""Quantities that the input alone decides: they lose none."""


def simulated_within(error: float, why: str) -> ErrorBound:
    """Hold what runs through time to a wanted error."""
    if not 0.0 < error < 1.0:
        raise InputError("--error", error, "must be a relative error, above 0 and below 1")
    return replace(SIMULATED, factor=error, reason=f"{error:g} of the scale, as wanted: {why}")


def lever(linkage: FourBar, bar: int = 2) -> float:
    """Compute min(b, c)/longest bar: a loop closes to eps of its longest bar, which turns a shorter bar 3 or 4 by more.

    Of another commanded bar it is the shorter of the two moving bars besides it.

    Without it 28 of 10 008 comparisons on 300 random linkages exceed K = 50 (at most 83); with it none exceeds 17.
    """
    return min(linkage.bar(each).length for each in MOVING_BARS if each != bar) / max(linkage.lengths)


def condition_of(quantity: str, linkage: FourBar, formulas: Solution) -> Array:
    """Compute a quantity's condition at each position: s for positions, s^2 for what follows, times lever and drive."""
    s, unit, bar = formulas.condition, UNITS[quantity], int(formulas.commanded[-1])
    if quantity in (OF_THE_INPUT if bar == 2 else (f"theta_{bar}", f"omega_{bar}", f"alpha_{bar}")):
        return np.ones_like(s)
    condition = lever(linkage, bar) * s ** POWER[unit]
    if unit in ("N", "N m"):
        assert formulas.drive_condition is not None
        condition = condition * formulas.drive_condition
    return np.asarray(condition, dtype=float)
