"""A private page next to the scene file that leads a browser to the workbench.

A second `fourbar edit` finds the first one by this page too. The address of the
workbench holds its token. A browser gets the name of this page instead, for the
arguments of a program are seen by every user of the machine. The page is locked while
its server runs: two servers on one file would share its state file and lose work.
"""

import os
import re
import sys
import time
import webbrowser
from pathlib import Path

from fourbar.errors import InputError

REDIRECT_ENDING = ".edit.html"
_ADDRESS = re.compile(r"url=(http://127\.0\.0\.1:\d+/[A-Za-z0-9_-]+/)\"")
REDIRECT_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={address}">
<title>The workbench</title></head>
<body><a href="{address}">The workbench</a></body></html>
"""
_OWN_PAGE = re.compile(
    re.escape(REDIRECT_PAGE.encode()).replace(re.escape(b"{address}"), rb"\S+")
)
PATIENCE = 10.0
"""Time that a server may take from locking its page to writing it, s."""
_LOCKED_BYTE = 1 << 30
"""Byte of the page that Windows locks: far behind its text, which others read."""


class Redirect:
    """The page of one scene file; whoever holds its lock serves the file."""

    def __init__(self, scene: Path) -> None:
        self.scene = scene
        self.path = scene.with_name(scene.name + REDIRECT_ENDING)
        self.handle: int | None = None

    def claim(self) -> bool:
        """Lock the page, and make it if needed; return False if another holds it."""
        while self.handle is None:
            try:
                handle = os.open(
                    self.path,
                    os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0),
                    0o600,
                )
            except OSError as error:
                reason = f"{self.path} cannot be written beside it: {error.strerror}"
                raise InputError("scene file", str(self.scene), reason) from None
            if not _lock(handle):
                os.close(handle)
                return False
            if not self.path.exists() or not os.path.samestat(
                os.fstat(handle),
                os.stat(self.path),
            ):
                os.close(handle)  # its server has just ended and taken it away
                continue
            self.handle = handle
        content = os.read(self.handle, 2 * len(REDIRECT_PAGE))
        if content and _OWN_PAGE.fullmatch(content) is None:
            os.close(self.handle)
            self.handle = None
            reason = (
                f"needs the name {self.path.name} beside it, and that is another file:"
                " move it away"
            )
            raise InputError("scene file", str(self.scene), reason)
        os.chmod(self.handle if os.chmod in os.supports_fd else self.path, 0o600)
        os.ftruncate(self.handle, 0)
        os.lseek(self.handle, 0, os.SEEK_SET)
        return True

    def write(self, address: str) -> None:
        """Make the page lead to an address."""
        assert self.handle is not None
        os.write(self.handle, REDIRECT_PAGE.format(address=address).encode())

    def read(self) -> str:
        """Return the address that another server has written.

        Raises InputError if it writes none.
        """
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            if self.path.exists() and (
                address := _ADDRESS.search(
                    self.path.read_text(encoding="utf-8", errors="replace")
                )
            ):
                return address[1]
            time.sleep(0.05)
        raise InputError(
            "scene file",
            str(self.scene),
            f"is open in another workbench, and {self.path} has no address",
        )

    def open(self) -> None:
        """Open the page in the browser."""
        webbrowser.open(self.path.absolute().as_uri())

    def remove(self) -> None:
        """Take the page away and give up its lock."""
        if self.handle is not None:
            if sys.platform == "win32":  # where an open file cannot be taken away
                os.close(self.handle)
            self.path.unlink(missing_ok=True)
            if sys.platform != "win32":
                os.close(self.handle)
            self.handle = None


def _lock(handle: int) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
            os.lseek(handle, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
