"""Whether an engine's times, each over the formulas' on the same scene in the same process, grew."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fourbar_validation.compare.rows import FORMULAS

SCATTERS = 3.0
"""A change of the mean ratio is one beyond this many of its standard errors over the scenes."""
NOTICEABLE = 1.25
"""And by this factor: clocks of two nights differ by less than it, and by no reason of the engine's."""
ENOUGH = 3
"""Scenes: of two the scatter says nothing."""

Time = tuple[str, float]
"""An engine, and its time over that of the formulas on a scene."""


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

    @property
    def slower(self) -> bool:
        """Whether that is to the worse."""
        return self.beyond and self.ratio > 1.0

    def __str__(self) -> str:
        word = "slower" if self.ratio > 1.0 else "faster"
        times = max(self.ratio, 1.0 / self.ratio)
        return f"{self.engine} is {times:.2f} times {word} (factor of scatter {self.scatter:.2f}, {self.scenes} scenes)"


def list_time_changes(scenes: Iterable[tuple[str, Sequence[Time], Sequence[Time]]]) -> list[TimeChange]:
    """Every engine with times of at least ENOUGH scenes in both runs, over the formulas' own.

    Where all of several engines became slower, or all faster, it is the formulas whose time changed the other way.
    """
    sums: dict[str, list[float]] = {}
    for _, old, new in scenes:
        before = dict(old)
        for engine, time in new:
            if engine != FORMULAS and time > 0.0 and before.get(engine, 0.0) > 0.0:
                log = math.log(time / before[engine])
                kept = sums.setdefault(engine, [0.0, 0.0, 0.0])
                kept[:] = kept[0] + 1.0, kept[1] + log, kept[2] + log * log
    result = []
    for engine, (n, total, squares) in sorted(sums.items()):
        if n >= ENOUGH:
            spread = math.sqrt(max(squares - total * total / n, 0.0) / (n - 1.0))
            result.append(TimeChange(engine, math.exp(total / n), math.exp(spread / math.sqrt(n)), int(n)))
    if len(result) > 1 and all(each.beyond for each in result) and len({each.ratio > 1.0 for each in result}) == 1:
        ratio = math.exp(-sum(math.log(each.ratio) for each in result) / len(result))
        return [TimeChange(FORMULAS, ratio, max(each.scatter for each in result), result[0].scenes)]
    return result
