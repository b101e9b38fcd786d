"""Lines as wide as a block, or as a terminal that is narrower."""

import shutil
import sys
from textwrap import wrap

BLOCK_WIDTH = 80
"""Columns of a printed block."""


def find_terminal_width() -> int | None:
    """Return the columns of the terminal that is printed to; None: it is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def find_block_width(width: int | None) -> int:
    """Return the columns of a block on a terminal of a width; None: a file."""
    return BLOCK_WIDTH if width is None else min(width, BLOCK_WIDTH)


def wrap_line(line: str, width: int | None = None) -> list[str]:
    """Break a line that is wider than a block between words; what follows is indented.

    `width`: that of a terminal.
    """
    most = find_block_width(width)
    if len(line) <= most:
        return [line]
    return wrap(
        line,
        most,
        subsequent_indent="    ",
        break_on_hyphens=False,
        break_long_words=False,
    )
