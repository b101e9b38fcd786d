"""Timings of one process, taken in turns."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import median
from typing import Any, TypeVar

from fourbar.mjcf import Settings
from fourbar_validation.engines.mujoco.trial import Edit, TrialSetup

Clocked = TypeVar("Clocked")


def summarise_timings(times: Sequence[float]) -> tuple[float, float]:
    """Return the least of timings, and the middle one above it.

    The latter is a part of the least.
    """
    least = min(times)
    return least, median(times) / least - 1.0


def time_call(action: Callable[[], object], calls: int = 1) -> float:
    """Time one call in this process, in CPU seconds."""
    start = time.process_time()
    for _ in range(calls):
        action()
    return (time.process_time() - start) / calls


def time_in_turns(
    clocks: Mapping[Any, Callable[[], Clocked]],
    rounds: int,
) -> dict[Any, list[Clocked]]:
    """Read the clocks in turns, there and back.

    A slow spell hits all, and none always finds a warmer machine.
    """
    times: dict[Any, list[Clocked]] = {name: [] for name in clocks}
    for number in range(rounds):
        for name in list(clocks)[:: -1 if number % 2 else 1]:
            times[name].append(clocks[name]())
    return times


def time_kinds(
    setup: TrialSetup,
    kinds: Sequence[tuple[Settings, Edit | None]],
    steps: Sequence[int],
    readings: int,
    rounds: int,
) -> list[tuple[list[float], list[float]]]:
    """Time a step and a reading of each kind of settings, in turns, CPU seconds.

    So many steps of each kind, and so many readings, are timed at once.
    """
    clocks: dict[tuple[int, bool], Callable[[], float]] = {}
    for kind, (settings, edit) in enumerate(kinds):
        time_steps, time_readings = setup.make_clocks(settings, edit)
        clocks[kind, True] = partial(_time_each, time_steps, steps[kind])
        clocks[kind, False] = partial(_time_each, time_readings, readings)
    times = time_in_turns(clocks, rounds)
    return [(times[kind, True], times[kind, False]) for kind in range(len(kinds))]


def _time_each(clock: Callable[[int], float], count: int) -> float:
    return clock(count) / count
