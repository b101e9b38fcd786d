"""Wall clock of an effect: runs with it and without it in turn, their ratio and its spread.

For the reader alone: on a machine that does other things the ratio scatters by several per cent.
"""

import gc
import time
from typing import NamedTuple

import numpy as np

from validation.studies.effects.work import ENGINES

ROUNDS = 31
"""Pairs of runs, first one ahead and then the other."""
AMOUNTS = {"formulas": 40, "mujoco-simulated": 1000, "mujoco-inverse": 100, "pinocchio-inverse": 100}
"""Of one run: 10 to 20 ms, long against the clock's resolution and short against what disturbs it."""


class Ratio(NamedTuple):
    """Time with the effect by time of the bare scene, of pairs of neighbouring runs."""

    median: float
    low: float
    high: float
    """The middle half of the pairs lies between them."""


def ratio(engine: str, effect: str, rounds: int = ROUNDS) -> Ratio:
    """The ratio of neighbouring runs: both meet the same disturbances."""
    works = [ENGINES[engine](name) for name in ("none", effect)]
    amount = AMOUNTS[engine]
    for work in works:
        work(amount)
    times = np.empty((rounds, 2))
    gc.collect()
    gc.disable()
    try:
        for number in range(rounds):
            for which in (0, 1) if number % 2 == 0 else (1, 0):
                start = time.perf_counter()
                works[which](amount)
                times[number, which] = time.perf_counter() - start
    finally:
        gc.enable()
    low, median, high = np.percentile(times[:, 1] / times[:, 0], [25, 50, 75])
    return Ratio(float(median), float(low), float(high))
