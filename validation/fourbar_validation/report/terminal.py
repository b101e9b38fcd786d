"""The table at the end of a run."""

import math
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.errors import clean_line, write_count
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.report.overview import OVERVIEW_GROUPS
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.report.sentences import write_two_digits
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
    causes = summary.causes
    for cause in causes[:MOST_CAUSES_PRINTED]:
        console.print(f"[bold red]wrong:[/] {escape(clean_line(str(cause)))}")
    if len(causes) > MOST_CAUSES_PRINTED:
        console.print(
            f"and {len(causes) - MOST_CAUSES_PRINTED} more causes; the report has them"
        )
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
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape

    from fourbar.show.folded import FoldedTable

    shown = FoldedTable(
        box=SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
        padding=(0, 1),
    )
    shown.add_column("error of allowed", overflow="fold", ratio=1)
    for heading in (*OVERVIEW_GROUPS, "compared"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for line in summary.independent:
        name = escape(clean_line(line.name))
        cells = []
        for group in OVERVIEW_GROUPS:
            worst = line.worst.get(group)
            cell = " ".join(line.cell(group))
            cells.append(f"[bold red]{cell}[/]" if worst and worst.failed else cell)
        if line.counts[FAILS]:
            name = f"[bold red]{name}[/]"
        shown.add_row(name, *cells, str(line.counts.compared))
    return shown


def _make_worst_table(summary: Summary) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape

    from fourbar.show.folded import FoldedTable

    title = "worst row of each scene and engine"
    if len(summary.worst) < summary.judged:
        title = (
            f"worst rows of {len(summary.worst)} of {summary.judged} scenes and engines"
        )
    shown = FoldedTable(
        title=title, box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True
    )
    for heading in ("scene and engine", "worst"):
        shown.add_column(heading, overflow="fold")
    for heading in ("error", "allowed", "used", "at deg"):
        shown.add_column(heading, justify="right", overflow="fold", no_wrap=True)
    for scene, group in groupby(summary.worst, key=lambda row: row.scene):
        shown.add_row(f"[bold]{escape(clean_line(scene))}[/]")
        for row in group:
            numbers = (
                write_two_digits(row.error),
                write_two_digits(row.allowed),
                f"{row.used:.2g}",
                (
                    "-"
                    if math.isnan(row.theta_2)
                    else f"{math.degrees(row.theta_2):.1f}"
                ),
            )
            words = (f"  {escape(row.engine)}", escape(row.quantity))
            shown.add_row(
                *words,
                *numbers,
                style="bold red" if row.failed else "",
            )
    return shown
