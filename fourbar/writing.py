"""Read files within a bound and write them atomically.

Representations of results are written here too.
"""

import json
import math
import os
import shutil
import stat
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar.errors import DependencyError, InputError, write_count

if TYPE_CHECKING:
    from pandas import DataFrame

_TEMPORARY = ".part"
"""Suffix of the name of an unfinished file."""
STANDARD_STREAM = Path("-")
"""Path that stands for standard input or standard output. The former if a file is read,
the latter if one is written.
"""


def read_bytes(
    path: str | Path,
    key: str,
    largest: int,
    *,
    shown: str | None = None,
    pipes: bool = False,
) -> bytes:
    """Read a file whose kind and size are looked at before it is opened.

    Parameters
    ----------
    key : what names the file, for the error.
    largest : bytes.
    shown : how the error names it; left out: by its path.
    pipes : read standard input for the path `-`, and pipes (those of a shell's `<(...)`
        too) until they end.

    Raises InputError for a file that is missing, too large or unreadable, for a
    directory, for devices, and for pipes where they are not read.
    """

    def refuse(allowed: str) -> InputError:
        return InputError(key, str(path) if shown is None else shown, allowed)

    if pipes and Path(path) == STANDARD_STREAM:
        if sys.stdin is None:
            raise refuse("standard input is closed")
        source = sys.stdin.fileno()
    else:
        source = path
    try:
        about = os.stat(source)
        is_pipe = stat.S_ISFIFO(about.st_mode) or stat.S_ISSOCK(about.st_mode)
        may_end = pipes and (is_pipe or source is not path)
        if stat.S_ISDIR(about.st_mode):
            raise refuse("is a directory; must be a file")
        if not stat.S_ISREG(about.st_mode) and not may_end:
            raise refuse("must be an ordinary file: a pipe or a device may never end")
        if about.st_size > largest:
            raise refuse(f"has {about.st_size} bytes; must not exceed {largest}")
        with open(source, "rb", closefd=source is path) as opened:
            data = opened.read(largest + 1)
    except FileNotFoundError:
        other = f"{path}.toml"
        meant = f'; did you mean "{other}"?' if os.path.isfile(other) else ""
        raise refuse(f"file not found{meant}") from None
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise refuse(
            f"cannot be read: {getattr(error, 'strerror', None) or error}"
        ) from None
    if len(data) > largest:  # it grew, or is of those in /proc that say 0
        raise refuse(f"must not exceed {largest} bytes")
    return data


def read_text(path: str | Path, key: str, largest: int, *, pipes: bool = False) -> str:
    """Read a file as text in UTF-8, with or without a byte order mark.

    Line ends stay as they are.

    Raises InputError as `read_bytes` does, and for what is no UTF-8.
    """
    try:
        return read_bytes(path, key, largest, pipes=pipes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        allowed = f"must be UTF-8 text; byte {error.start} is not"
        raise InputError(key, str(path), allowed) from None


@contextmanager
def name_file(path: Path) -> Iterator[None]:
    """Put the name of the file into an OSError while it is open, as of a full disk.

    No reader knows the temporary file.
    """
    try:
        yield
    except OSError as error:
        # a copy names the file that it reads first, whichever of the two is full
        names = (str(error.filename), str(error.filename2))
        is_temporary = any(name.endswith(_TEMPORARY) for name in names)
        if error.filename is None or is_temporary:
            error.filename = str(path)
            error.filename2 = None
        raise


def require_file(target: Path, *read: Path) -> None:
    """Raise InputError for a path that cannot be written to.

    Such a path is a folder, a file in a missing folder, or a file that is read. `-`
    names standard output.
    """
    if target == STANDARD_STREAM:
        return
    if target.is_dir() or "\0" in str(target):
        raise InputError("path", str(target), "must name a file, not a folder")
    if not target.parent.is_dir():
        allowed = f"there is no such folder: {target.parent}"
        raise InputError("path", str(target), allowed)
    for file in read:
        if target.exists() and file.exists() and target.samefile(file):
            raise InputError("path", str(target), "is read here, and would be lost")


def write_bytes(path: str | Path, data: bytes, *, private: bool = False) -> None:
    """Write a file whole; on any failure the old file, or none, stays.

    A symbolic link stays and the file that it names is written. An existing file keeps
    its mode; a new one is an ordinary file, and with `private` it is readable by its
    owner alone in either case. `-` is standard output.

    Raises InputError as `require_file` does, OSError for what fails otherwise (full
    disk, read-only folder).
    """
    if Path(path) == STANDARD_STREAM:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    require_file(Path(path))
    target = Path(os.path.realpath(path))
    require_file(target)
    if target.exists() and not target.is_file():
        # a device or pipe is written to; renaming onto it would replace /dev/null
        # itself
        with name_file(target), target.open("wb") as file:
            file.write(data)
        return
    temporary = target.with_name(
        f".{target.name[:100]}.{os.urandom(8).hex()}{_TEMPORARY}"
    )
    opener = partial(os.open, mode=0o600 if private else 0o666)
    with name_file(target):
        try:
            with open(temporary, "xb", opener=opener) as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if not private:
                with suppress(FileNotFoundError):
                    shutil.copymode(target, temporary)
            os.replace(temporary, target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file whole, line ends as given."""
    write_bytes(path, text.encode("utf-8"))


def make_data_frame(columns: Mapping[str, Any]) -> "DataFrame":
    """Make a table of pandas; DependencyError where it is not installed."""
    try:
        from pandas import DataFrame
    except ImportError:
        raise DependencyError("to_pandas needs pandas: pip install pandas") from None
    return DataFrame(columns)


def describe_extent(theta_2: Any) -> str:
    """Say how many positions there are, of how many linkages."""
    count = write_count(theta_2.shape[-1], "position")
    if theta_2.ndim == 1:
        return count
    return f"{write_count(len(theta_2), 'linkage')}, {count} each"


def write_between(values: Any) -> str:
    """Write the least and greatest of an array."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return "no value"
    least, greatest = finite.min(), finite.max()
    if least == greatest:
        return f"{least:.6g}"
    return f"{least:.6g} to {greatest:.6g}"


def list_names(what: str, names: Iterable[str]) -> str:
    """Write names on one line of a representation, as many as fit."""
    return shorten(f"{what}: {', '.join(names)}", 110, placeholder=" ...")


def make_html(title: str, head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Make what a notebook shows of a result."""
    from html import escape

    lines = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
        for row in rows
    )
    heads = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    return f"<div><b>{escape(title)}</b><table><tr>{heads}</tr>{lines}</table></div>"


def write_object(schema: str, **entries: Any) -> str:
    """Write one JSON object.

    Named tuples are objects, arrays lists, null what is not finite.
    """
    return json.dumps({"schema": schema, **null_nan(entries)}, allow_nan=False) + "\n"


def null_nan(value: Any) -> Any:
    """Make lists, tables and numbers of Python of a value.

    None stands for what is not finite.
    """
    if isinstance(value, np.ndarray):
        plain = value.tolist()
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            return null_nan(plain)
        return plain
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {name: null_nan(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [null_nan(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
