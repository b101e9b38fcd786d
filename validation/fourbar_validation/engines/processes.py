"""Run other programs to their end, and bound the memory of this process: past the bound it gets a MemoryError."""

import os
import subprocess
from collections.abc import Container, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from fourbar_validation.compare.rows import write_one_line
from fourbar_validation.places import import_path

WORKER_MEMORY = 8 * 2**30
"""Bytes of address space of one process; a scene takes a hundredth, most of it libraries."""


def bound_memory() -> None:
    """Bound this process's address space; where the system cannot, nothing happens."""
    try:
        import resource
    except ImportError:  # only systems of the Unix family have it
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    with suppress(ValueError, OSError):  # macOS knows the limit and sets none
        resource.setrlimit(resource.RLIMIT_AS, (WORKER_MEMORY if hard < 0 else min(WORKER_MEMORY, hard), hard))


class Ended(NamedTuple):
    """Output and exit of a process that ended."""

    out: str
    errors: str
    failed: bool
    last: str
    """Line of the errors, or the exit status."""

    @property
    def why(self) -> str:
        """Return in one line why the process failed; an empty string if it did not."""
        return self.last if self.failed else ""


def run_to_end(
    command: Sequence[object],
    *,
    fine: Container[int] = (0,),
    folder: Path | None = None,
    seconds: float | None = None,
    variables: Mapping[str, str] | None = None,
) -> Ended:
    """Run a command to its end, with these variables added to the environment."""
    line, environment = [str(part) for part in command], {**os.environ, "PYTHONUTF8": "1", **(variables or {})}
    try:
        done = subprocess.run(
            line,
            cwd=folder,
            env=environment,
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Ended("", "", True, f"no answer within {seconds:g} s")
    last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    return Ended(done.stdout, done.stderr, done.returncode not in fine, write_one_line(last))


def start_harness(line: Sequence[object], **how: Any) -> Ended:
    """Run an interpreter that is to find this code, wherever it lies; for `how` see `run_to_end`."""
    with import_path() as path:
        return run_to_end(line, variables={"PYTHONPATH": path}, **how)
