"""The table at the end of a run."""

import math
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.errors import clean_line
from fourbar_validation.compare.rows import FAILS
from fourbar_validation.report.summary import OWN, Summary
from fourbar_validation.report.templating import write_number

if TYPE_CHECKING:
    from rich.table import Table

NARROWEST = 80
"""Columns of the table at least: a narrower terminal breaks its lines, where rich would cut its numbers."""


def print_table(summary: Summary, out: Path, *, verbose: bool = False) -> None:
    """Print a row of every engine, what fails, what was left out, the verdict last.

    `verbose`: the worst row of every scene and engine too, and each reason for which something was left out.
    """
    from rich.console import Console
    from rich.markup import escape

    console = Console()
    wide = Console(width=max(console.width, NARROWEST))
    if verbose:
        wide.print(_make_worst_table(summary))
    wide.print(_make_engine_table(summary))
    for row in summary.failures:
        console.print(
            f"[bold red]fails[/] {escape(clean_line(row.scene))} {escape(row.engine)} {escape(row.quantity)}: "
            f"error {write_number(row.error)}, allowed {write_number(row.allowed)}: {escape(clean_line(row.reason))}"
        )
    if summary.counts[FAILS] > len(summary.failures):
        console.print(
            f"{summary.counts[FAILS] - len(summary.failures)} more rows fail; results.csv has them."
        )
    if verbose:
        for engine, reason, count in summary.refusals:
            scenes = f"{count} scene{'s' if count > 1 else ''}"
            console.print(
                f"{escape(engine)} left out in {scenes}: {escape(clean_line(reason))}"
            )
    elif summary.refusals:
        count = sum(count for *_, count in summary.refusals)
        console.print(
            f"{count} comparisons were left out, for {len(summary.refusals)} reasons; --verbose lists them."
        )
    for engine, reason in summary.missing:
        console.print(f"[bold red]Not run:[/] {escape(engine)}: {escape(reason)}")
    console.print(f"[bold]{escape(summary.verdict)}.[/]")
    console.print(
        f"Report: {escape(clean_line(str(out / 'report.html')))}", soft_wrap=True
    )


def _make_engine_table(summary: Summary) -> "Table":
    from rich.markup import escape

    shown = _make_bare_table(("engine",), ("error", "allowed"))
    shown.add_column("worst at", overflow="fold")
    for line in summary.engines:
        row, name = line.worst, f"{line.name} {line.version}".rstrip()
        if row is None:
            shown.add_row(escape(name), "-", "-", "nothing compared")
            continue
        quantity = f"{row.engine} {row.quantity}" if line.name == OWN else row.quantity
        place = (
            "" if math.isnan(row.theta_2) else f", {math.degrees(row.theta_2):.1f} deg"
        )
        cells = (
            name,
            write_short(row.error),
            write_short(row.allowed),
            f"{quantity} of {clean_line(row.scene)}{place}",
        )
        shown.add_row(
            *map(escape, cells), style="bold red" if line.counts[FAILS] else ""
        )
    return shown


def _make_worst_table(summary: Summary) -> "Table":
    from rich.markup import escape

    title = "worst row of each scene and engine"
    if len(summary.worst) < summary.judged:
        title = (
            f"worst rows of {len(summary.worst)} of {summary.judged} scenes and engines"
        )
    shown = _make_bare_table(
        ("scene and engine", "worst"),
        ("error", "allowed", "used", "at deg"),
        title=title,
    )
    for scene, group in groupby(summary.worst, key=lambda w: w.row.scene):
        shown.add_row(f"[bold]{escape(clean_line(scene))}[/]")
        for w in group:
            numbers = (
                write_short(w.row.error),
                write_short(w.row.allowed),
                f"{w.used:.2g}",
                "-"
                if math.isnan(w.row.theta_2)
                else f"{math.degrees(w.row.theta_2):.1f}",
            )
            words = (f"  {escape(w.row.engine)}", escape(w.row.quantity))
            shown.add_row(*words, *numbers, style="" if w.failed == 0 else "bold red")
    return shown


def _make_bare_table(
    words: Sequence[str], numbers: Sequence[str], title: str | None = None
) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    shown = Table(title=title, box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for heading in (*words, *numbers):
        shown.add_column(
            heading, justify="left" if heading in words else "right", no_wrap=True
        )
    return shown


def make_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str]],
    words: int = 1,
    **options: Any,
) -> "Table":
    """Make a table whose first columns are words and whose others are numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    settings: dict[str, Any] = {"box": SIMPLE_HEAD, "pad_edge": False}
    shown = Table(**(settings | options))
    for index, heading in enumerate(headings):
        shown.add_column(
            heading, justify="left" if index < words else "right", overflow="fold"
        )
    for row in rows:
        shown.add_row(*(escape(clean_line(cell)) for cell in row))
    return shown


def write_short(value: float) -> str:
    """Write two digits: the table fits 80 columns, and results.csv has them all."""
    return "-" if math.isnan(value) else f"{value:.1e}"
