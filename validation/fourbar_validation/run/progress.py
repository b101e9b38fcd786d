"""Progress of a run on a terminal."""

from types import TracebackType
from typing import Any

from fourbar_validation.run.plan import DRAWING, Progress


class ShownProgress(Progress):
    """Progress of a run on standard error: notes, and on a terminal a bar per stage."""

    def __init__(self, scenes: int) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            TextColumn,
            TimeRemainingColumn,
        )
        from rich.progress import Progress as Bars

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        console = Console(stderr=True)
        self.bars = Bars(*columns, console=console, disable=not console.is_terminal)
        self.scenes = scenes
        self.tasks: dict[str, Any] = {}

    def __enter__(self) -> "ShownProgress":
        """Begin to show."""
        self.bars.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the bars as they are."""
        self.bars.stop()

    def note(self, line: str) -> None:
        """Print the line above the bars."""
        self.bars.console.print(line, markup=False, highlight=False)

    def advance(self, stage: str, scenes: int) -> None:
        """Move the bar of the stage; how many scenes are drawn is not told before."""
        if stage not in self.tasks:
            self.tasks[stage] = self.bars.add_task(
                stage,
                total=None if stage == DRAWING else self.scenes,
            )
        self.bars.advance(self.tasks[stage], scenes)
