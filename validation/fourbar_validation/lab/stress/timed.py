"""What is timed of the formulas, by names that older revisions have too: also run alone, with one tree on the path."""

import json
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

import fourbar
from fourbar import Bar, FourBar, Gravity, Motion, Scene, solve
from fourbar.scene import Command

Array = NDArray[np.float64]
T = TypeVar("T")

LINKAGE = FourBar(0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4))
"""Crank-rocker a = 0.1, b = 0.25, c = 0.22, d = 0.3 m, uniform bars."""
PER_CALL = {"one position to forces": 5_000, "one position with error bars": 20_000, "solve by default": 100_000}
"""Positions in the time of one call, roughly: what is quick is called as often as lets the clock see it."""


def make_example(linkage: FourBar = LINKAGE, theta_2: float | None = 0.0) -> Scene:
    """Build the scene that is timed: crank at 10 rad/s, gravity, drive on the input; theta_2 None: its full range."""
    return Scene(linkage, Motion(theta_2, 10.0), 2, (), (Gravity(),))


def make_command(n: int, start: float = 0.0, stop: float = 2.0 * np.pi) -> Command:
    """Command n positions, over a revolution unless specified otherwise."""
    return Command(np.linspace(start, stop, n), np.broadcast_to(np.int8(1), (n,)), 10.0, 0.0)


def allocate(names: Iterable[str], at: Command) -> dict[str, Array]:
    """Allocate arrays as `solve` lays them out, touched so that no page is faulted in while the clock runs."""
    first = solve(make_example(), at=at)
    return {name: getattr(first, name) for name in names}


def time_call(action: Callable[[], object], calls: int = 1) -> float:
    """Time one call in this process, in CPU seconds."""
    start = time.process_time()
    for _ in range(calls):
        action()
    return (time.process_time() - start) / calls


def time_in_turns(clocks: Mapping[Any, Callable[[], T]], rounds: int) -> dict[Any, list[T]]:
    """Read the clocks in turns, there and back: a slow spell hits all, and none always finds a warmer machine."""
    times: dict[Any, list[T]] = {name: [] for name in clocks}
    for number in range(rounds):
        for name in list(clocks)[:: -1 if number % 2 else 1]:
            times[name].append(clocks[name]())
    return times


def main(positions: int, unknowns: list[str], angles: list[str]) -> dict[str, float]:
    """Time each action, in CPU seconds, by name."""
    scene, whole, at, one = (
        make_example(),
        make_example(theta_2=None),
        make_command(positions),
        make_command(1, 1.0, 1.0),
    )
    everything, alone = allocate(unknowns, at), allocate(angles, at)
    actions: dict[str, Callable[[], object]] = {
        "formulas, all unknowns": lambda: solve(scene, at=at, out=everything),
        "angles alone": lambda: solve(scene, at=at, out=alone),
        "one position to forces": lambda: solve(scene, "force", at=one),
        "one position with error bars": lambda: solve(scene, "error", at=one),
        "solve by default": lambda: solve(whole),
    }
    times = {}
    for name, action in actions.items():
        action()  # imports and first pages are not what is timed
        times[name] = time_call(action, max(2, positions // PER_CALL.get(name, positions)))
    return times


if __name__ == "__main__":
    print(json.dumps({"from": fourbar.__file__, "times": main(int(sys.argv[1]), *map(str.split, sys.argv[2:]))}))
