"""Every planted fault against the harness, each in a process of its own; none may survive without a reason."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from validation.stress.mutation import planting
from validation.stress.mutation.planting import ROOT, faults

SECONDS = 300
"""A fault with which the harness takes longer than this ends the run as a failure would; it takes some ten."""


def outcome(number: int | None) -> dict[str, list[str]] | str:
    """The failing rows by specimen with the fault of a number, or why there are none; None: without a fault."""
    line = [sys.executable, "-P", planting.__file__, *([] if number is None else [str(number)])]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    try:
        done = subprocess.run(
            line, cwd=ROOT, check=False, capture_output=True, text=True, timeout=SECONDS, env=environment
        )
    except subprocess.TimeoutExpired:
        return f"it took more than {SECONDS} s"
    if done.returncode:
        return (done.stderr.strip().splitlines() or ["no word"])[-1]
    found: dict[str, list[str]] = json.loads(done.stdout.splitlines()[-1])
    return found


def survives(entry: dict[str, Any], found: dict[str, list[str]] | str) -> str | None:
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
        found = pool.map(outcome, [None, *range(len(entries))])
        without = next(found)
        failing = without if isinstance(without, str) else [row for rows in without.values() for row in rows]
        yield "no fault", f"the harness fails without one: {failing}" if failing else None
        for entry, rows in zip(entries, found, strict=True):
            why = survives(entry, rows)
            yield entry["fault"], None if why and "harmless" in entry else why
