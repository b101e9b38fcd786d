"""Every planted fault against the harness, each in a process of its own; none may survive without a reason."""

import json
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from fourbar_validation.lab.stress.mutation import planting
from fourbar_validation.lab.stress.mutation.planting import ROOT, faults
from fourbar_validation.run.elsewhere import ended

SECONDS = 300
"""A fault with which the harness takes longer than this ends the run as a failure would; it takes some ten."""


Failing = dict[str, list[str]]
"""By specimen: the rows that fail."""


def outcomes(*numbers: int) -> list[Failing] | str:
    """What fails with the fault of each number, one after another, or why nothing was found; once without any fault."""
    line = [sys.executable, "-P", planting.__file__, *numbers]
    done = ended(
        line,
        folder=ROOT,
        seconds=SECONDS,
        variables={"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "validation")))},
    )
    return done.why or [json.loads(each) for each in done.out.splitlines()[-max(1, len(numbers)) :]]


def survives(entry: dict[str, Any], found: Failing | str) -> str | None:
    """Why an entry does not count as caught on each of its specimens, or None."""
    if isinstance(found, str):
        return f"it raises, which is no physical fault: {found}"
    for specimen, rows in found.items():
        named = [row.partition(":")[0].partition(" ")[2] for row in rows]
        if not rows:
            return f"nothing fails on {specimen!r}"
        if not set(named) & set(entry["caught_by"]):
            return f"on {specimen!r} {', '.join(sorted(set(named)))} fail, none of {', '.join(entry['caught_by'])}"
    return None


def planted(workers: int) -> Iterator[tuple[str, str | None]]:
    """Every fault with the reason why it survives, or None; first the tree without a fault."""
    entries = faults()
    with ThreadPoolExecutor(workers) as pool:
        without, *found = (pool.submit(outcomes, *number) for number in [(), *((n,) for n in range(len(entries)))])
        rows = without.result()
        failing = rows if isinstance(rows, str) else [row for found in rows[0].values() for row in found]
        yield "no fault", f"the harness fails without one: {failing}" if failing else None
        for entry, one in zip(entries, found, strict=True):
            rows = one.result()
            why = survives(entry, rows if isinstance(rows, str) else rows[0])
            yield entry["fault"], None if why and "harmless" in entry else why
