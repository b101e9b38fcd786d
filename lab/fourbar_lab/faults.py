"""Try the faults of faults.toml, which `injection.py` plants, in processes apart.

None may survive without a reason.
"""

import json
import os
import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import click

from fourbar.errors import FAILED, HOLDS
from fourbar_lab import injection
from fourbar_lab.each import apply_each
from fourbar_lab.injection import read_faults
from fourbar_validation.engines.programs import Ended, run_to_end
from fourbar_validation.places import CHECKOUT, FORMULAS_FOLDER, PACKAGE

_TESTS_FAIL = 1
"""Exit status of pytest where a test fails."""
TEST_SECONDS = 10.0
"""Processor time within which the tests that an entry names must fail, s."""
FAULTS_OF_A_PROCESS = 8
"""Faults of one process, which loads the engines once."""
FAULT_SECONDS = 300
"""Time after which a run with a fault is ended and counts as failed, s; a run takes
some three seconds.
"""
_Failing = dict[str, list[str]]
"""Rows that fail, by test scene."""


def try_faults(numbers: Sequence[int]) -> list[_Failing] | str:
    """Try the fault of each number in turn, or none.

    Return the rows that fail, or why there is no result.
    """
    done = _inject(*map(str, numbers))
    return done.why or [
        json.loads(each) for each in done.out.splitlines()[-max(1, len(numbers)) :]
    ]


def _inject(*arguments: str) -> Ended:
    """Run the module that injects, in a process of its own."""
    folders = FORMULAS_FOLDER.parent, PACKAGE.parent, Path(__file__).parents[1]
    packages = dict.fromkeys(map(str, folders))
    line = [sys.executable, "-P", injection.__file__, *arguments]
    variables = {"PYTHONPATH": os.pathsep.join(packages)}
    return run_to_end(line, seconds=FAULT_SECONDS, folder=CHECKOUT, variables=variables)


def try_tests(number: int) -> str | None:
    """Try a fault on the tests that its entry names.

    Return why it survives them, or None.
    """
    done = _inject(str(number))
    if done.why:
        return f"it raises: {done.why}"
    outcome = json.loads(done.out.splitlines()[-1])
    if outcome["status"] != _TESTS_FAIL:
        return f"the tests end with status {outcome['status']}"
    if outcome["seconds"] > TEST_SECONDS:
        return f"the tests take {outcome['seconds']:.1f} s until one fails"
    return None


def explain_survival(entry: dict[str, Any], failing: _Failing | str) -> str | None:
    """Say why an entry does not count as caught on each of its test scenes.

    The answer is None if the entry is caught on all of them.
    """
    if isinstance(failing, str):
        return f"it raises, which is no physical fault: {failing}"
    for scene, rows in failing.items():
        quantities = [row.partition(":")[0].partition(" ")[2] for row in rows]
        if not rows:
            return f"nothing fails on {scene!r}"
        if not set(quantities) & set(entry["caught_by"]):
            return (
                f"on {scene!r} {', '.join(sorted(set(quantities)))} fail, none of"
                f" {', '.join(entry['caught_by'])}"
            )
    return None


def try_in_turn(numbers: Sequence[int]) -> list[_Failing | str]:
    """Try faults in one process, which loads the engines once.

    A process that ends early is replaced by one for each fault.
    """
    together = try_faults(numbers)
    if not isinstance(together, str):
        return [*together]
    apart = [try_faults([number]) for number in numbers]
    return [rows if isinstance(rows, str) else rows[0] for rows in apart]


def _try_every_fault(workers: int) -> Iterator[tuple[str, str | None]]:
    """Try every fault, first the tree without one.

    Yield its name, and the reason why it survives or None.
    """
    entries = read_faults()
    rows = try_faults(())
    failing = rows
    if not isinstance(rows, str):
        failing = [row for outcome in rows[0].values() for row in outcome]  # type: ignore[misc]
    yield "no fault", f"the harness fails without one: {failing}" if failing else None
    judged = [i for i, entry in enumerate(entries) if "scenes" in entry]
    batches = [
        judged[start : start + FAULTS_OF_A_PROCESS]
        for start in range(0, len(judged), FAULTS_OF_A_PROCESS)
    ]
    outcomes = chain.from_iterable(apply_each(try_in_turn, batches, workers))
    for number, outcome in zip(judged, outcomes, strict=True):
        entry = entries[number]
        why = explain_survival(entry, outcome)
        yield entry["fault"], None if "harmless" in entry else why
    tested = [i for i, entry in enumerate(entries) if "tests" in entry and CHECKOUT]
    reasons = apply_each(try_tests, tested, workers)
    for number, reason in zip(tested, reasons, strict=True):
        yield entries[number]["fault"], reason


@click.command()
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1))
def faults_command(workers: int) -> int:
    """Make each fault of faults.toml, one at a time; each must be caught.

    An entry says by which scenes of a run, or by which quick tests.
    """
    from rich.console import Console
    from rich.progress import track

    results = list(
        track(
            _try_every_fault(workers),
            "injecting",
            total=len(read_faults()) + 1,
            console=Console(stderr=True),
        )
    )
    survivors = [(fault, why) for fault, why in results if why is not None]
    for fault, why in survivors:
        click.echo(f"{fault}: {why}")
    click.echo(
        f"{len(results) - 1} faults, {len(survivors)} of them survive without a reason"
        " on record"
    )
    return FAILED if survivors else HOLDS
