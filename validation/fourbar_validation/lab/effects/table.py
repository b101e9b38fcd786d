"""The table of what effects and flags cost: instructions, and with them wall clock, of runs with and without in turn.

The wall clock is for the reader alone: on a machine that does other things the ratio scatters by several per cent.
"""

import gc
import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from fourbar_validation.lab.effects.work import EFFECTS, ENGINES
from fourbar_validation.places import PROGRAM
from fourbar_validation.report.machine import machine, versions
from fourbar_validation.report.terminal import lined_up

ROUNDS = 31
"""Pairs of runs, first one ahead and then the other."""
AMOUNTS = {"formulas": 40, "mujoco-simulated": 1000, "mujoco-inverse": 100, "pinocchio-inverse": 100}
"""Of one run: 10 to 20 ms, long against the clock's resolution and short against what disturbs it."""
COMMAND = f"{PROGRAM} cost --effects"
ABOUT = (
    "Instructions per position, per step of the simulation (RK4), counted by valgrind within the work alone, and "
    "relative to the scene without effects; counts of the same work repeat to 0.1 %. In brackets the wall "
    "clock of runs with and without in turn: the median of the ratios and their middle half. It scatters with whatever "
    "else the machine does."
)


class Ratio(NamedTuple):
    """Time with the effect by time of the bare scene, of pairs of neighbouring runs."""

    median: float
    low: float
    high: float
    """The middle half of the pairs lies between them."""


class Entry(NamedTuple):
    """One effect, or one flag, in one engine."""

    engine: str
    effect: str
    instructions: float
    clock: Ratio


def rows(entries: Iterable[Entry]) -> tuple[list[str], list[list[str]]]:
    """Engines, and for each effect its name and a cell for each engine."""
    found = {(one.engine, one.effect): one for one in entries}
    engines = list(dict.fromkeys(engine for engine, _ in found))
    table = []
    for effect in dict.fromkeys(effect for _, effect in found):
        cells = [effect]
        for engine in engines:
            if (engine, effect) not in found:
                cells.append("no counterpart" if effect in EFFECTS else "")
                continue
            one, bare = found[engine, effect], found[engine, "none"]
            cell = f"{one.instructions:,.0f}"
            if one is not bare:
                clock = ", ".join(f"{100.0 * (each - 1.0):+.0f}" for each in (one.clock.low, one.clock.high))
                median = f"{100.0 * (one.clock.median - 1.0):+.0f}"
                cell += f" {100.0 * (one.instructions / bare.instructions - 1.0):+.1f} % [{median}: {clock} %]"
            cells.append(cell)
        table.append(cells)
    return engines, table


def show(entries: Iterable[Entry]) -> None:
    """Print it."""
    from rich.console import Console

    engines, table = rows(entries)
    Console().print(lined_up(["effect", *engines], table, caption=ABOUT))


def markdown(entries: Iterable[Entry]) -> str:
    """The same as Markdown, with the command, the versions and the machine."""
    engines, table = rows(entries)
    lines = ["# What effects cost", "", f"`{COMMAND}`. {ABOUT}", ""]
    lines += ["| " + " | ".join(["", *engines]) + " |", "|---|" + "---:|" * len(engines)]
    lines += ["| " + " | ".join(cells) + " |" for cells in table]
    lines += ["", ", ".join(f"{name} {version}" for name, version in versions().items()) + f"; {machine()}.", ""]
    return "\n".join(lines)


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
