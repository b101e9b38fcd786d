"""Other processes: the same suite under another Python (what does upgrading an engine change for my linkages?)."""

import os
import subprocess
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from fourbar.errors import FAILED, HOLDS, DependencyError, InputError
from fourbar_validation.compare.rows import write_one_line
from fourbar_validation.places import import_path

NEEDS = "numpy, pint, click, rich, jinja2, pebble, filelock, pyarrow and the engines"


class ElsewhereError(DependencyError):
    """The other environment could not run the suite."""


class Ended(NamedTuple):
    """How a process ended."""

    out: str
    errors: str
    failed: bool
    last: str
    """Line of the errors, or the exit status."""

    @property
    def why(self) -> str:
        """It failed, in one line; nothing where it did not."""
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


def run_elsewhere(python: Path, arguments: Sequence[str], out: Path) -> Path:
    """Run `run` of this code under another interpreter; the folder of its results.

    Raises InputError where there is no such interpreter, ElsewhereError where it does not get
    through the suite (comparisons that fail are results, not an error).
    """
    if not python.is_file():
        raise InputError("--python", str(python), "must be a Python interpreter, such as .venv-old/bin/python")
    results = out / "results.csv"
    results.unlink(missing_ok=True)  # of an earlier run; what is there afterwards is of this one
    command = [python.absolute(), "-m", "fourbar_validation", "run", *arguments, "--out", out.absolute()]
    try:
        done = start_harness(command, fine=(HOLDS, FAILED))
    except OSError as error:
        raise InputError("--python", str(python), f"cannot be run: {error.strerror}") from None
    if done.failed or not results.is_file():
        reason = done.last.removeprefix("error: ")
        raise ElsewhereError(f"{python}: the suite did not run there: {reason} (it needs {NEEDS})")
    return out
