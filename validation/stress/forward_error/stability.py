"""The command: samples of the families in parallel, and a table of what they showed."""

import math
from collections.abc import Iterator

import click
import numpy as np

from fourbar.errors import FAILED, HOLDS
from validation.report.terminal import lined_up
from validation.stress.forward_error.families import FAMILIES
from validation.stress.forward_error.judge import TOO_LARGE, Tally, judge

FULL = 10_000
"""Samples per family of the full set."""
CHUNK = 250
"""Samples per task: about a second."""


def run(family: str, samples: range, seed: int = 0) -> Tally:
    """Judge some samples of a family; each depends on the family, the seed and its number alone."""
    tally = Tally()
    for number in samples:
        rng = np.random.default_rng([seed, list(FAMILIES).index(family), number])
        judge(FAMILIES[family](rng), tally, f"{family} {number}")
    return tally


def chunks(samples: int) -> Iterator[range]:
    """The sample numbers in portions of one task."""
    for start in range(0, samples, CHUNK):
        yield range(start, min(start + CHUNK, samples))


@click.command()
@click.option("--samples", default=FULL, show_default=True, type=click.IntRange(1), help="Samples per family.")
@click.option("--family", "families", multiple=True, type=click.Choice(list(FAMILIES)), help="Only these (repeatable).")
@click.option("--seed", default=0, show_default=True)
@click.option("--jobs", default=2, show_default=True, help="Processes.")
def stability(samples: int, families: tuple[str, ...], seed: int, jobs: int) -> int:
    """Error of every output against 50-digit arithmetic, and whether the error bars hold."""
    from joblib import Parallel, delayed
    from rich.box import HEAVY_HEAD
    from rich.console import Console
    from rich.progress import track

    chosen = families or tuple(FAMILIES)
    tasks = [(family, part) for family in chosen for part in chunks(samples)]
    results = Parallel(n_jobs=jobs, return_as="generator")(delayed(run)(family, part, seed) for family, part in tasks)
    tallies = {family: Tally() for family in chosen}
    for (family, _), tally in track(zip(tasks, results, strict=True), "samples", total=len(tasks)):
        tallies[family].add(tally)
    rows = []
    for name in dict.fromkeys(name for tally in tallies.values() for name in tally.worst):
        cells = [tallies[family].worst.get(name, (math.nan, ""))[0] for family in chosen]
        rows.append((name, *("-" if math.isnan(cell) else f"{cell:.3f}" + " fails" * (cell > 1.0) for cell in cells)))
    for bar in ("torque_error", "force_error"):
        rows.append((f"error / {bar}", *(f"{tallies[family].too_small.get(bar, math.nan):.2f}" for family in chosen)))
        shares = (100.0 * tallies[family].too_large.get(bar, 0) / tallies[family].samples for family in chosen)
        rows.append((f"% {bar} > {TOO_LARGE:.0f} x error", *(f"{share:.2f}" for share in shares)))
    rows.append(("not assembled", *(str(tallies[family].not_assembled) for family in chosen)))
    rows.append(("no torque", *(str(tallies[family].no_torque) for family in chosen)))
    console = Console()
    title = f"largest error / (8 eps (|y| + sum |x dy/dx|)), {samples} samples each, seed {seed}"
    console.print(lined_up(("output", *chosen), rows, title=title, box=HEAVY_HEAD))
    for family, tally in tallies.items():
        for name, (ratio, sample) in tally.worst.items():
            if ratio > 1.0:
                console.print(f"{name}: {ratio:.3g} at sample {sample}")
        for line in tally.warned[:5]:
            console.print(f"{family} warned: {line}")
    for family, tally in tallies.items():
        if not tally.worst:
            console.print(f"{family}: nothing was compared")
    return HOLDS if all(tally.held() for tally in tallies.values()) else FAILED
