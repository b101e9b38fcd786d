"""The table at the end of a run."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.errors import clean_line, write_count
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.report.overview import OVERVIEW_GROUPS
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.report.templating import write_error

if TYPE_CHECKING:
    from rich.table import Table

MOST_CAUSES_PRINTED = 18
"""Causes of failures that are printed, one line each; the report has all."""
_MOST_NOTES = 10
"""Lines beneath the table."""


def print_table(
    summary: Summary,
    out: Path,
    *,
    verbose: bool = False,
) -> None:
    """Print the verdict, a row of every engine, what is wrong, and the report's path.

    `verbose`: the worst row of every scene and engine too, each row that fails, and
    each reason for which something was not compared.
    """
    from rich.console import Console
    from rich.markup import escape

    console = Console()
    colour = "green" if summary.good else "red"
    console.print(f"[bold {colour}]{escape(clean_line(summary.headline))}[/]")
    console.print(_make_overview(summary))
    for cause in summary.causes[:MOST_CAUSES_PRINTED]:
        console.print(f"[bold red]wrong:[/] {escape(clean_line(str(cause)))}")
    more = len(summary.causes) - MOST_CAUSES_PRINTED
    if more > 0:
        console.print(f"and {more} more causes; the report has them")
    for note in summary.notes[:_MOST_NOTES]:
        console.print(escape(clean_line(note)))
    for engine, reason in summary.missing:
        console.print(f"[bold red]Not run:[/] {escape(engine)}: {escape(reason)}")
    if verbose:
        _print_rows(summary, console)
    console.print(
        f"Report: {escape(clean_line(str(out / 'report.html')))}",
        soft_wrap=True,
    )


def _print_rows(summary: Summary, console: Any) -> None:
    """Print the worst rows, those that fail, and why others were not compared."""
    from rich.markup import escape

    console.print(_make_worst_table(summary))
    for row in summary.failures:
        console.print(
            f"[bold red]fails[/] {escape(clean_line(row.scene))} {escape(row.engine)} "
            f"{escape(row.quantity)}: error {write_error(row.error)}, allowed "
            f"{write_error(row.allowed)}: {escape(clean_line(row.reason))}"
        )
    more = summary.counts[FAILS] - len(summary.failures)
    if more > 0:
        console.print(f"{more} more rows fail; results.csv has them.")
    for engine, reason, count in summary.refusals:
        scenes = write_count(count, "scene")
        why = escape(clean_line(reason))
        console.print(f"not compared: {escape(engine)} in {scenes}: {why}")


def _make_overview(summary: Summary) -> "Table":
    """Make the table of engines: largest error and allowance in each group."""
    rows = []
    for line in summary.independent:
        cells = [" ".join(line.cell(group)) for group in OVERVIEW_GROUPS]
        rows.append((line.name, *cells, str(line.counts.compared)))
    headings = ("error of allowed", *OVERVIEW_GROUPS, "compared")
    return make_words_table(headings, rows, collapse_padding=True)


def _make_worst_table(summary: Summary) -> "Table":
    many = f"{len(summary.worst)} of {summary.judged}"
    title = f"worst rows of {many} scenes and engines"
    rows = []
    for row in summary.worst:
        place = f"{math.degrees(row.theta_2):.1f}".replace("nan", "-")
        sizes = map(write_error, (row.error, row.allowed))
        words = (f"{row.engine}, {row.scene}", row.quantity)
        rows.append((*words, *sizes, f"{row.used:.2g}", place))
    headings = ("engine and scene", "worst", "error", "allowed", "used", "at deg")
    return make_words_table(headings, rows, 2, title=title, collapse_padding=True)
