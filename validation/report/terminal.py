"""The table at the end of a run."""

import math
from pathlib import Path

from validation.report.markdown import number
from validation.report.summary import Summary

WIDE = 100
"""Columns of a terminal from which the position and its condition are shown too."""


def table(summary: Summary, out: Path) -> None:
    """Print the worst row of every scene and engine, the verdict last."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    wide = console.width >= WIDE
    shown = Table(title="worst row of each scene and engine", box=SIMPLE_HEAD, pad_edge=False)
    shown.add_column("scene", overflow="fold")
    for heading in ("engine", "worst"):
        shown.add_column(heading, no_wrap=True)
    for heading in ("error", "allowed", "used", *(("theta_2", "condition") if wide else ())):
        shown.add_column(heading, justify="right", no_wrap=True)
    for w in summary.worst:
        style = "" if w.failed == 0 else "bold red"
        shown.add_row(
            escape(w.row.scene),
            escape(w.row.engine),
            escape(w.row.quantity),
            number(w.row.error),
            number(w.row.allowed),
            f"{w.used:.2f}",
            *((f"{math.degrees(w.row.theta_2):.2f} deg", number(w.row.condition)) if wide else ()),
            style=style,
        )
    console.print(shown)
    for row in summary.failures[:20]:
        console.print(
            f"[bold red]fails[/] {escape(row.scene)} {escape(row.engine)} {escape(row.quantity)}: "
            f"error {number(row.error)}, allowed {number(row.allowed)}: {escape(row.reason)}"
        )
    for engine, reason, count in summary.refusals:
        console.print(f"left out in {count} scene(s): {escape(engine)}: {escape(reason)}")
    console.print(f"[bold]{escape(summary.verdict)}[/]; written to {escape(str(out))}")
