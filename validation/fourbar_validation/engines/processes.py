"""Run other programs to their end, bound the memory of this process, and keep what engines print in it."""

import ctypes
import os
import subprocess
import sys
import tempfile
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from fourbar_validation.compare.rows import make_plain, write_one_line

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


KEPT = 20_000
"""Bytes that are kept of one answer's output: half from its beginning, half from its end."""
_file: list[BinaryIO] = []
"""The one file of this process, once it keeps what is printed."""


def keep_output() -> None:
    """Send what this process prints into a file that goes with it, from now on."""
    if not _file:
        _file.append(tempfile.TemporaryFile(buffering=0))  # noqa: SIM115 - as long as the process
        sys.stdout = sys.stderr = None
    take_printed()


@contextmanager
def keep_printed(outputs: dict[str, str], engine: str) -> Iterator[None]:
    """Add what is printed meanwhile to the outputs, under the name of the engine."""
    take_printed()
    try:
        yield
    finally:
        if text := take_printed():
            outputs[engine] = outputs.get(engine, "") + text


def print_kept(data: bytes) -> None:
    """Add what a program outside printed to what this process keeps; nothing where it keeps none."""
    if _file and data:
        _file[0].write(data)


def take_printed() -> str:
    """Take what was printed since the last call, as plain text; nothing where this process does not keep it."""
    if not _file:
        return ""
    file = _file[0]
    for stream in (sys.stdout, sys.stderr):
        with suppress(Exception):  # there is none, it was closed, or is somebody else's
            stream.flush()
    with suppress(AttributeError, OSError, TypeError):  # another system than those of the Unix family
        ctypes.CDLL(None).fflush(None)
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    text = file.read(min(size, KEPT // 2))
    remaining = max(size - KEPT, 0)
    file.seek(remaining, os.SEEK_CUR)
    text += f"\n... {remaining} bytes left out ...\n".encode() * bool(remaining) + file.read()
    file.truncate(0)
    file.seek(0)
    for name, descriptor in (("stdout", 1), ("stderr", 2)):  # an engine may have closed them, or sent them elsewhere
        os.dup2(file.fileno(), descriptor)
        if getattr(getattr(sys, name), "closed", True):
            # line by line, in the order of what libraries print
            stream = open(descriptor, "w", 1, "utf-8", "backslashreplace", closefd=False)  # noqa: SIM115
            setattr(sys, name, stream)
    return make_plain(text.decode(errors="backslashreplace"))
