"""The table at the end of a run."""

import math
from pathlib import Path

from validation.report.markdown import number
from validation.report.summary import Summary


def table(summary: Summary, out: Path) -> None:
    """Print the worst row of every scene and engine, the verdict last."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    shown = Table(title="worst row of each scene and engine")
    for heading in ("scene", "engine", "quantity"):
        shown.add_column(heading, overflow="fold")
    for heading in ("error", "allowed", "used", "theta_2", "condition"):
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
            f"{math.degrees(w.row.theta_2):.2f} deg",
            number(w.row.condition),
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
