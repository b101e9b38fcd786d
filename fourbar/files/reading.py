"""Somebody's file is read whole, and within a bound: what may never end is not opened."""

import os
import stat
from pathlib import Path

from fourbar.errors import InputError


def read_bytes(path: str | Path, key: str, largest: int, *, shown: str | None = None) -> bytes:
    """Read an ordinary file; its kind and its size are looked at before it is opened.

    Parameters
    ----------
    key : what names the file, for the error.
    largest : bytes.
    shown : how the error names it; left out: by its path.

    Raises InputError for a file that is missing, too large or unreadable, for a directory, and for pipes (those of a
    shell's `<(...)` too) and devices.
    """

    def refuse(allowed: str) -> InputError:
        return InputError(key, str(path) if shown is None else shown, allowed)

    try:
        about = os.stat(path)
        if stat.S_ISDIR(about.st_mode):
            raise refuse("is a directory; must be a file")
        if not stat.S_ISREG(about.st_mode):
            raise refuse("must be an ordinary file: a pipe or a device may never end")
        if about.st_size > largest:
            raise refuse(f"has {about.st_size} bytes; must not exceed {largest}")
        with open(path, "rb") as opened:
            data = opened.read(largest + 1)
    except FileNotFoundError:
        raise refuse("file not found") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise refuse(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(data) > largest:  # it grew, or is of those in /proc that say 0
        raise refuse(f"must not exceed {largest} bytes")
    return data


def read_text(path: str | Path, key: str, largest: int) -> str:
    """Read a file as text in UTF-8, with or without a byte order mark, line ends as they are.

    Raises InputError as `read_bytes` does, and for what is no UTF-8.
    """
    try:
        return read_bytes(path, key, largest).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(key, str(path), f"must be UTF-8 text; byte {error.start} is not") from None
