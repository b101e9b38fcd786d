"""The table of what effects and flags cost: instructions, and wall clock with them."""

from collections.abc import Iterable
from typing import NamedTuple

from validation.report.machine import machine, versions
from validation.report.terminal import lined_up
from validation.studies.effects.clock import Ratio
from validation.studies.effects.work import EFFECTS

COMMAND = "python -m validation cost --effects"
ABOUT = (
    "Instructions per position, per step of the simulation (RK4), counted by valgrind within the work alone, and "
    "relative to the scene without effects; counts of the same work repeat to 0.1 %. In brackets the wall "
    "clock of runs with and without in turn: the median of the ratios and their middle half. It scatters with whatever "
    "else the machine does."
)


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
