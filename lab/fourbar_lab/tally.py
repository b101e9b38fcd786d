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
SAMPLES = "samples"
TOO_LARGE = f" > {BAR_FACTORS:.0f} x error"
"""Name of what is counted of all samples, and end of the name of it of a bar."""
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

    counts: Counter[str] = field(default_factory=Counter)
    """SAMPLES, and of these the ones in which something was not compared, or an error
    bar is more than BAR_FACTORS times the error.
    """
    worst: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Output: largest error/allowed, and the sample it belongs to; of an error bar the
    largest error/bar.
    """
    warned: list[str] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Take in the samples of another tally."""
        self.counts.update(other.counts)
        self.warned += other.warned
        for name, entry in other.worst.items():
            self.note(name, *entry)

    def note(
        self,
        output: str,
        ratio: float,
        sample: str,
    ) -> None:
        """Keep the largest error over what is allowed."""
        self.worst[output] = max(self.worst.get(output, (0.0, "")), (ratio, sample))

    def list_beyond(self) -> list[str]:
        """List the outputs and error bars that are beyond what is allowed."""
        return [
            name
            for name, (ratio, _) in self.worst.items()
            if not ratio <= find_most(name)
        ]

    def holds(self) -> bool:
        """Return whether error and error bars are as promised.

        Something must have been compared.
        """
        samples = self.counts[SAMPLES]
        useful = all(
            is_by_chance(count, samples)
            for name, count in self.counts.items()
            if name.endswith(TOO_LARGE)
        )
        return bool(self.worst) and useful and not (self.list_beyond() or self.warned)


def find_most(name: str) -> float:
    """Return how many times what is allowed an output's error, or a bar's, may be."""
    return TOO_SMALL if name.endswith("_error") else 1.0


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
