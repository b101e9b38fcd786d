"""The table of what effects and flags cost in time: runs with and without in turn."""

import gc
import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from fourbar_validation.lab.effects.work import EFFECTS, ENGINES, POSITIONS
from fourbar_validation.places import PROGRAM
from fourbar_validation.report.machine import list_versions, name_machine
from fourbar_validation.report.terminal import make_table

ROUNDS = 31
"""Pairs of runs, first one ahead and then the other."""
AMOUNTS = {"formulas": 40, "mujoco-simulated": 1000, "mujoco-inverse": 100, "pinocchio-inverse": 100}
"""Of one run: 10 to 20 ms, long against the clock's resolution and short against what disturbs it."""
COMMAND = f"{PROGRAM} cost --effects"
ABOUT = (
    "Processor time of a position, of a step of the simulation (RK4), in us without effects; with an effect relative "
    "to that: the median of the ratios of neighbouring runs and their middle half."
)


class EffectCost(NamedTuple):
    """Time of one effect, or one flag, in one engine by that of the bare scene, of pairs of neighbouring runs."""

    engine: str
    effect: str
    seconds: float
    """Of the bare scene, per position or step."""
    low: float
    median: float
    high: float
    """The middle half of the pairs lies between low and high."""


def list_rows(costs: Iterable[EffectCost]) -> tuple[list[str], list[list[str]]]:
    """List the engines, and for each effect its name and a cell for each engine."""
    by_name = {(one.engine, one.effect): one for one in costs}
    engines = list(dict.fromkeys(engine for engine, _ in by_name))
    table = []
    for effect in dict.fromkeys(effect for _, effect in by_name):
        cells = [effect]
        for engine in engines:
            one = by_name.get((engine, effect))
            if one is None:
                cells.append("no counterpart" if effect in EFFECTS else "")
            elif effect == "none":
                cells.append(f"{1e6 * one.seconds:.3g} us")
            else:
                low, median, high = (f"{100.0 * (each - 1.0):+.0f}" for each in one[3:])
                cells.append(f"{median} % [{low}, {high}]")
        table.append(cells)
    return engines, table


def show(costs: Iterable[EffectCost]) -> None:
    """Print the table."""
    from rich.console import Console

    engines, table = list_rows(costs)
    Console().print(make_table(["effect", *engines], table, caption=ABOUT))


def write_markdown(costs: Iterable[EffectCost]) -> str:
    """Write the table as Markdown, with the command, the versions and the machine."""
    engines, table = list_rows(costs)
    lines = ["# What effects cost", "", f"`{COMMAND}`. {ABOUT}", ""]
    lines += ["| " + " | ".join(["", *engines]) + " |", "|---|" + "---:|" * len(engines)]
    lines += ["| " + " | ".join(cells) + " |" for cells in table]
    lines += [
        "",
        ", ".join(f"{name} {version}" for name, version in list_versions().items()) + f"; {name_machine()}.",
        "",
    ]
    return "\n".join(lines)


def measure(engine: str, effect: str, rounds: int = ROUNDS) -> EffectCost:
    """Time neighbouring runs with and without an effect: both meet the same disturbances."""
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
                start = time.process_time()
                works[which](amount)
                times[number, which] = time.process_time() - start
    finally:
        gc.enable()
    units = amount * (POSITIONS if engine == "formulas" else 1)
    low, median, high = np.percentile(times[:, 1] / times[:, 0], [25, 50, 75]).tolist()
    return EffectCost(engine, effect, float(np.median(times[:, 0])) / units, low, median, high)
