"""Files appear whole or not at all: written under a temporary name next to the target, then renamed."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fourbar.errors import InputError

TEMPORARY = ".part"
"""What the name of an unfinished file ends with."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name the file in what goes wrong while it is open (a full disk), not the temporary one, which no reader knows."""
    try:
        yield
    except OSError as error:
        both = (error.filename, error.filename2)  # a copy names what it reads first, whichever of the two is full
        if error.filename is None or any(str(name).endswith(TEMPORARY) for name in both):
            error.filename, error.filename2 = str(path), None
        raise


def require_file(target: Path, *read: Path) -> None:
    """InputError for what can name no output: a folder, a file in a folder that does not exist, one that is read."""
    if target.is_dir() or "\0" in str(target):
        raise InputError("path", str(target), "must name a file, not a folder")
    if not target.parent.is_dir():
        raise InputError("path", str(target), f"there is no such folder: {target.parent}")
    if any(target.exists() and file.exists() and target.samefile(file) for file in read):
        raise InputError("path", str(target), "is read here, and would be lost")


def write_bytes(path: str | Path, data: bytes, *, private: bool = False) -> None:
    """Write a file whole, `private`: readable by its owner alone; on any failure the old file, or none, stays.

    Raises InputError as `require_file` does, OSError for what fails otherwise (full disk, read-only folder).
    """
    target = Path(path)
    require_file(target)
    if target.exists() and not target.is_file():
        # a device or pipe is written to; renaming onto it would replace /dev/null itself
        with naming(target), target.open("wb") as file:
            file.write(data)
        return
    with naming(target):
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name[:100]}.", suffix=TEMPORARY, dir=target.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            umask = os.umask(0)
            os.umask(umask)
            if not private:
                os.chmod(temporary, 0o666 & ~umask)  # mkstemp makes it private; a result is an ordinary file
            os.replace(temporary, target)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file whole, line ends as given."""
    write_bytes(path, text.encode("utf-8"))
