"""The table at the end of a run."""

import math
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.errors import clean_line
from fourbar_validation.report.summary import Summary
from fourbar_validation.report.templating import write_number

if TYPE_CHECKING:
    from rich.table import Table

NARROWEST = 80
"""Columns of the table at least: a narrower terminal breaks its lines, where rich would cut its numbers."""


def print_table(summary: Summary, out: Path) -> None:
    """Print the worst row of every scene and engine, the verdict last."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    title = "worst row of each scene and engine"
    if len(summary.worst) < summary.judged:
        title = f"worst rows of {len(summary.worst)} of {summary.judged} scenes and engines"
    shown = Table(title=title, box=SIMPLE_HEAD, pad_edge=False, collapse_padding=True)
    for heading in ("scene and engine", "worst"):
        shown.add_column(heading, no_wrap=True)
    for heading in ("error", "allowed", "used", "at deg"):
        shown.add_column(heading, justify="right", no_wrap=True)
    for scene, group in groupby(summary.worst, key=lambda w: w.row.scene):
        shown.add_row(f"[bold]{escape(clean_line(scene))}[/]")
        for w in group:
            numbers = (
                write_short(w.row.error),
                write_short(w.row.allowed),
                f"{w.used:.2g}",
                "-" if math.isnan(w.row.theta_2) else f"{math.degrees(w.row.theta_2):.1f}",
            )
            words = (f"  {escape(w.row.engine)}", escape(w.row.quantity))
            shown.add_row(*words, *numbers, style="" if w.failed == 0 else "bold red")
    Console(width=max(console.width, NARROWEST)).print(shown)
    for row in summary.failures[:20]:
        console.print(
            f"[bold red]fails[/] {escape(clean_line(row.scene))} {escape(row.engine)} {escape(row.quantity)}: "
            f"error {write_number(row.error)}, allowed {write_number(row.allowed)}: {escape(clean_line(row.reason))}"
        )
    for engine, reason, count in summary.refusals:
        console.print(f"left out in {count} scene(s): {escape(engine)}: {escape(clean_line(reason))}")
    for engine, reason in summary.missing:
        console.print(f"[bold red]not run[/] {escape(engine)}: {escape(reason)}")
    console.print(f"[bold]{escape(summary.verdict)}[/]; written to {escape(clean_line(str(out)))}")


def make_table(headings: Sequence[str], rows: Iterable[Sequence[str]], words: int = 1, **options: Any) -> "Table":
    """Make a table whose first columns are words and whose others are numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    given: dict[str, Any] = {"box": SIMPLE_HEAD, "pad_edge": False}
    shown = Table(**(given | options))
    for index, heading in enumerate(headings):
        shown.add_column(heading, justify="left" if index < words else "right", overflow="fold")
    for row in rows:
        shown.add_row(*(escape(clean_line(cell)) for cell in row))
    return shown


def write_short(value: float) -> str:
    """Two digits: the table fits 80 columns, results.csv has them all."""
    return "-" if math.isnan(value) else f"{value:.1e}"
