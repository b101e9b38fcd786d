"""Progress of a run on a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from fourbar_validation.run.plan import DRAWING, Progress


class _Shown(Progress):
    """Progress of a run on standard error: notes, and on a terminal a bar per stage."""

    def __init__(self, bars: Any, scenes: int) -> None:
        self.bars = bars
        self.scenes = scenes
        self.tasks: dict[str, Any] = {}

    def note(self, line: str) -> None:
        """Print the line above the bars."""
        self.bars.console.print(line, markup=False, highlight=False)

    def advance(self, stage: str, scenes: int) -> None:
        """Move the bar of the stage; how many scenes are drawn is not told before."""
        if stage not in self.tasks:
            total = None if stage == DRAWING else self.scenes
            self.tasks[stage] = self.bars.add_task(stage, total=total)
        self.bars.advance(self.tasks[stage], scenes)


@contextmanager
def show_progress(scenes: int) -> Iterator[Progress]:
    """Show the progress of a run of so many scenes, and leave the bars as they are."""
    from rich import progress
    from rich.console import Console

    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with progress.Progress(*columns, console=console, disable=hidden) as bars:
        yield _Shown(bars, scenes)
