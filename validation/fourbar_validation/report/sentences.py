"""Sentences and small tables that commands print."""

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from fourbar.errors import clean_line
from fourbar.show.lines import find_terminal_width, wrap_line
from fourbar_validation.compare.rows import escape_controls

if TYPE_CHECKING:
    from rich.table import Table


_BLANK = "\ue000"
"""Stand-in for a blank at which no line is broken."""


def print_sentence(text: str, whole: re.Pattern[str] | None = None) -> None:
    """Print a sentence, broken where it is wider than a block.

    `whole`: what is never broken, like the value of an attribute.
    """
    import click

    text = escape_controls(text)
    if whole is not None:
        text = whole.sub(lambda part: part[0].replace(" ", _BLANK), text)
    for line in wrap_line(text, find_terminal_width()):
        click.echo(line.replace(_BLANK, " "))


def make_words_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    words: int = 1,
    **options: Any,
) -> "Table":
    """Make a table whose first columns are words and whose others are numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape

    from fourbar.show.folded import FoldedTable

    settings: dict[str, Any] = {"box": SIMPLE_HEAD, "pad_edge": False}
    shown = FoldedTable(**(settings | options))
    for index, heading in enumerate(headings):
        shown.add_column(
            heading,
            justify="left" if index < words else "right",
            overflow="fold",
        )
    for row in rows:
        shown.add_row(*(escape(clean_line(cell)) for cell in row))
    return shown
