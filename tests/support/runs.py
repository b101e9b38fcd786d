"""Recorded runs whose rows are all at hand."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

from fourbar_validation.compare.rows import Row, sort_rows
from fourbar_validation.regression.changes import KEPT, Differences, compare_runs
from fourbar_validation.regression.record import About, open_run


def read_run(path: Path) -> tuple[About, list[Row]]:
    """What a run was made with, and all its rows."""
    run = open_run(path)
    return run.about, list(run.rows())


def compare_rows(
    old: tuple[About, Iterable[Row]], new: tuple[About, Iterable[Row]], kept: int = KEPT
) -> Differences:
    """Two runs compared whose rows stand in any order."""
    before, after = (sort_rows(run[1]) for run in (old, new))
    by_scene = (
        [(name, list(rows)) for name, rows in groupby(run, lambda row: row.scene)]
        for run in (before, after)
    )
    return compare_runs(
        (old[0], next(by_scene)),
        (new[0], next(by_scene)),
        {row.engine for row in after},
        kept,
    )
