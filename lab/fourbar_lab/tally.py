"""Collect the largest errors over what is allowed, and whether error bars hold.

The error allowed is 8 eps (|y| + sum |x_i dy/dx_i|) with y the value (1 rad for angles)
and x_i the stored inputs: what a change of the inputs in their last digits does to y,
and nothing more.
"""

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from fourbar.quantities import VECTORS
from fourbar_validation.compare.tolerance import EPS, find_used

FACTOR_ON_EPS = 8.0
"""Factor on eps in the allowed error, as the contract states it."""
TOO_SMALL, BAR_FACTORS = 10.0, 100.0
"""Factors by which an error bar may miss the error. It may be smaller (never) and
larger (in one of USELESS samples).
"""
USELESS = 0.01
CHANCE = 1e-6
"""Least probability of so many samples or more by chance. The share is that of USELESS.
One of 60 samples is.
"""
HALF_A_DIGIT = 2.0**-53
"""Half a digit of a result: a smaller error is chance, for no double need be nearer to
the truth. A bar is called too large only against at least this error.
"""
_UNTOLD = 0.125
"""Part of |sin mu| that may be wrong. With it doubles do not tell whether the loop
closes.
"""


@dataclass(slots=True)
class Tally:
    """Results of a number of samples of one family."""

    samples: int = 0
    not_assembled: int = 0
    no_torque: int = 0
    """Samples in which the exact system of forces is singular: nothing to compare."""
    untold: int = 0
    """Samples without derivatives, where doubles do not tell that the loop closes."""
    worst: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Output: largest error/allowed, and the sample it belongs to."""
    too_small: dict[str, float] = field(default_factory=dict)
    """Error bar: largest error/bar."""
    too_large: Counter[str] = field(default_factory=Counter)
    """Error bar: samples in which it is more than BAR_FACTORS times the error."""
    warned: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Take in the samples of another tally."""
        self.samples += other.samples
        self.not_assembled += other.not_assembled
        self.no_torque += other.no_torque
        self.untold += other.untold
        self.warned += other.warned
        for name, entry in other.worst.items():
            self.note(name, *entry)
        for name, ratio in other.too_small.items():
            self.too_small[name] = max(self.too_small.get(name, 0.0), ratio)
        self.too_large.update(other.too_large)

    def note(
        self,
        output: str,
        ratio: float,
        sample: str,
    ) -> None:
        """Keep the largest error over what is allowed."""
        self.worst[output] = max(self.worst.get(output, (0.0, "")), (ratio, sample))

    def holds(self) -> bool:
        """Return whether error and error bars are as promised.

        Something must have been compared.
        """
        within = all(ratio <= 1.0 for ratio, _ in self.worst.values())
        bars = all(ratio <= TOO_SMALL for ratio in self.too_small.values())
        useful = all(is_by_chance(n, self.samples) for n in self.too_large.values())
        return bool(self.worst) and within and bars and useful and not self.warned


def is_by_chance(count: int, samples: int) -> bool:
    """Return whether a share of USELESS explains the samples (binomial).

    So many samples or more are counted.
    """
    from scipy.stats import binom

    return bool(binom.sf(count - 1, samples, USELESS) >= CHANCE)


def list_components(name: str) -> list[tuple[str, Any]]:
    """Return an output's components as (name in the reference, index in the array)."""
    if name in VECTORS:
        return [(f"{name}_x", 0), (f"{name}_y", 1)]
    return [(name, 0)]


def error_over_allowed(
    name: str,
    ours: float,
    value: Any,
    sensitivity: float,
) -> tuple[float, float]:
    """Return an error as a part of the allowed one, and the error itself.

    Both are 0 where the reference's ball contains the value.
    """
    is_angle = name.startswith("theta")
    error = math.inf
    if math.isfinite(ours):
        error = value - float(ours)
        if is_angle:
            error = math.remainder(float(error), 2.0 * math.pi)
    size = 1.0 if is_angle else abs(float(value.mid()))
    wrong = abs(float(error)) if value.rad() < abs(error) else 0.0
    allowed = _compute_allowed(size, sensitivity)
    return float(find_used(wrong, allowed)), wrong


def is_untold(sine: Any, sensitivity: float) -> bool:
    """Return whether sin mu has so few digits that derivatives may be missing."""
    size = abs(float(sine.mid()))
    return _compute_allowed(size, sensitivity) > _UNTOLD * size


def _compute_allowed(size: float, sensitivity: float) -> float:
    """Return 8 eps (|y| + sum |x_i dy/dx_i|)."""
    return FACTOR_ON_EPS * EPS * (size + sensitivity)
