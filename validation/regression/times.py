"""Are an engine's times, each over the formulas' on the same scene in the same process, longer than before?"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import fmean, stdev

from validation.compare.identities import FORMULAS

SCATTERS = 3.0
"""A change of the mean ratio is one beyond this many of its standard errors over the scenes."""
NOTICEABLE = 1.25
"""And by this factor: clocks of two nights differ by less than it, and by no reason of the engine's."""
ENOUGH = 3
"""Scenes: of two the scatter says nothing."""

Times = Mapping[tuple[str, str], float]


@dataclass(frozen=True, slots=True)
class TimeChange:
    """The ratio new/old of one engine's times."""

    engine: str
    ratio: float
    """Geometric mean over the scenes."""
    scatter: float
    """Factor of one standard error of that mean, 1 or more."""
    scenes: int

    @property
    def beyond(self) -> bool:
        """Whether it is more than its scatter explains."""
        change = abs(math.log(self.ratio))
        return change > max(math.log(NOTICEABLE), SCATTERS * math.log(self.scatter))

    def __str__(self) -> str:
        word = "slower" if self.ratio > 1.0 else "faster"
        times = max(self.ratio, 1.0 / self.ratio)
        return f"{self.engine} is {times:.2f} times {word} (factor of scatter {self.scatter:.2f}, {self.scenes} scenes)"


def time_changes(old: Times, new: Times) -> list[TimeChange]:
    """Every engine with times of at least ENOUGH scenes in both runs, over the formulas' own."""
    by_engine: dict[str, list[float]] = {}
    for key in sorted(old.keys() & new.keys()):
        if old[key] > 0.0 and new[key] > 0.0 and key[1] != FORMULAS:
            by_engine.setdefault(key[1], []).append(math.log(new[key] / old[key]))
    return [
        TimeChange(engine, math.exp(fmean(logs)), math.exp(stdev(logs) / math.sqrt(len(logs))), len(logs))
        for engine, logs in by_engine.items()
        if len(logs) >= ENOUGH
    ]
