"""Injected faults against the harness, each in a process of its own; none may survive without a reason."""

import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from fourbar.errors import FAILED, HOLDS
from fourbar_lab import injection
from fourbar_lab.injection import read_faults
from fourbar_validation.engines.processes import run_to_end
from fourbar_validation.engines.workers import apply_each
from fourbar_validation.places import FORMULAS, PACKAGE

SECONDS = 300
"""A fault with which the harness takes longer than this ends the run as a failure would; it takes some ten."""
Failing = dict[str, list[str]]
"""By test scene: the rows that fail."""


def try_faults(numbers: Sequence[int]) -> list[Failing] | str:
    """Try the fault of each number in turn, or none: the rows that fail, or why there is no result."""
    packages = dict.fromkeys(str(folder) for folder in (FORMULAS.parent, PACKAGE.parent, Path(__file__).parents[1]))
    line = [sys.executable, "-P", injection.__file__, *numbers]
    done = run_to_end(line, seconds=SECONDS, variables={"PYTHONPATH": os.pathsep.join(packages)})
    return done.why or [json.loads(each) for each in done.out.splitlines()[-max(1, len(numbers)) :]]


def explain_survival(entry: dict[str, Any], found: Failing | str) -> str | None:
    """Say why an entry does not count as caught on each of its test scenes; None where it does."""
    if isinstance(found, str):
        return f"it raises, which is no physical fault: {found}"
    for scene, rows in found.items():
        named = [row.partition(":")[0].partition(" ")[2] for row in rows]
        if not rows:
            return f"nothing fails on {scene!r}"
        if not set(named) & set(entry["caught_by"]):
            return f"on {scene!r} {', '.join(sorted(set(named)))} fail, none of {', '.join(entry['caught_by'])}"
    return None


def try_every_fault(workers: int) -> Iterator[tuple[str, str | None]]:
    """Try every fault: the reason why it survives, or None; first the tree without a fault."""
    entries = read_faults()
    tried = apply_each(try_faults, [(), *((n,) for n in range(len(entries)))], workers, seconds=None)
    rows = next(tried)
    failing = rows if isinstance(rows, str) else [row for result in rows[0].values() for row in result]
    yield "no fault", f"the harness fails without one: {failing}" if failing else None
    for entry, rows in zip(entries, tried, strict=True):
        why = explain_survival(entry, rows if isinstance(rows, str) else rows[0])
        yield entry["fault"], None if why and "harmless" in entry else why


@click.command()
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1))
def command(workers: int) -> int:
    """Make each fault of faults.toml in formulas, effects, MJCF and engines, one at a time; each must be caught."""
    from rich.console import Console
    from rich.progress import track

    results = list(
        track(try_every_fault(workers), "injecting", total=len(read_faults()) + 1, console=Console(stderr=True))
    )
    survivors = [(fault, why) for fault, why in results if why is not None]
    for fault, why in survivors:
        click.echo(f"{fault}: {why}")
    click.echo(f"{len(results) - 1} faults, {len(survivors)} of them survive without a reason on record")
    return FAILED if survivors else HOLDS
