"""Runs judged in this process, where it is not their workers that are tested."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest

from fourbar_validation.engines import workers
from fourbar_validation.report.record import Record
from fourbar_validation.report.summary import Summary
from fourbar_validation.run.plan import Progress


class Heard(Progress):
    """Listener that keeps what a run told: its notes, and the scenes of each stage."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.scenes: Counter[str] = Counter()

    def note(self, line: str) -> None:
        self.lines.append(line)

    def advance(self, stage: str, scenes: int) -> None:
        self.scenes[stage] += scenes


def summary_of(records: Iterable[Record]) -> Summary:
    """What a run comes to in which these scenes were judged."""
    summary = Summary()
    for record in records:
        summary.add(record)
    return summary


def judge_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do the items of the workers in this process, one after another."""

    def over_none(
        function: Callable[[Any], Any],
        tasks: Iterable[workers.Task],
        *_: object,
        **__: object,
    ) -> Iterator[tuple[int, list[Any]]]:
        for number, items in tasks:
            yield number, [function(item) for item in items]

    monkeypatch.setattr(workers, "apply_over_processes", over_none)
