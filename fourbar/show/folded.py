"""Tables of rich that a narrow terminal shows whole."""

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

from rich.measure import Measurement
from rich.table import Column, Table

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

_ANY_WIDTH = 10_000
"""Characters of a line that no table fills."""


class FoldedTable(Table):
    """A table that is printed as several where it is wider than its console.

    Each of them begins with the first column, so that no number is broken or cut.
    """

    def __rich_console__(
        self,
        console: "Console",
        options: "ConsoleOptions",
    ) -> "RenderResult":
        """Yield the table, or below each other tables of some of its columns."""
        for number, part in enumerate(self._split(console, options)):
            if number:
                yield ""
            yield from Table.__rich_console__(part, console, options)

    def _split(
        self,
        console: "Console",
        options: "ConsoleOptions",
    ) -> "list[FoldedTable]":
        """Return tables that fit, the first with the title, the last with the caption.

        One of two columns is not split, and rich breaks the words in it.
        """
        wide = options.update_width(_ANY_WIDTH)

        def measure(*columns: Column) -> int:
            return Measurement.get(console, wide, self._keep([*columns])).maximum

        first, *others = self.columns or [Column()]
        width_of_first = measure(first)
        # what two tables have beyond one of both columns, whichever these are
        shared = 2 * width_of_first - measure(first, first)
        groups = [[first]]
        width = width_of_first
        for column in others:
            added = measure(column) - shared
            if len(groups[-1]) > 1 and width + added > options.max_width:
                groups.append([first])
                width = width_of_first
            groups[-1].append(column)
            width += added
        parts = [self._keep(columns) for columns in groups]
        parts[0].title = self.title
        parts[-1].caption = self.caption
        return parts

    def _keep(self, columns: list[Column]) -> "FoldedTable":
        kept = copy(self)
        kept.columns = [
            replace(column, _index=index) for index, column in enumerate(columns)
        ]
        kept.title = kept.caption = None
        return kept
