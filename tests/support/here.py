"""Runs judged in this process, where it is not their workers that are tested."""

from collections.abc import Iterable, Iterator

import pytest

from fourbar_validation.engines.witnesses import Witness
from fourbar_validation.report.record import Record
from fourbar_validation.report.summary import Summary
from fourbar_validation.run import pool
from fourbar_validation.scenes.suites import Suite


def summary_of(records: Iterable[Record]) -> Summary:
    """What a run comes to in which these scenes were judged."""
    summary = Summary()
    for each in records:
        summary.add(each)
    return summary


def judge_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run whose workers are not under test starts none: its scenes are judged one after the other."""

    def over_none(
        suite: Suite, chunks: Iterable[pool.Chunk], who: tuple[Witness, ...], draw: bool, *_: object
    ) -> Iterator[tuple[int, list[Record]]]:
        for number, scenes in chunks:
            yield number, pool.judge_chunk(suite, scenes, who, draw)

    monkeypatch.setattr(pool, "over_processes", over_none)
