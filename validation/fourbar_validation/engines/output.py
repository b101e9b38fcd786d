"""Capture what engines print, through Python or not: kept for their rows, never passed to the terminal."""

import ctypes
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import BinaryIO

from fourbar_validation.compare.rows import make_plain

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
