"""Recorded runs whose rows are all at hand."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

from fourbar_validation.compare.rows import Row, sort_rows, write_results
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression.changes import ROWS_LISTED, Differences, compare_runs
from fourbar_validation.regression.record import (
    About,
    describe_run,
    open_run,
    write_about,
)

HERE = describe_run([Engine("engine", FreeBody, EQUIVALENCE)], "suite")
"""What a run of one engine was made with."""
HEAD = "scene,engine,setting,positions,seconds,times_formulas\n"
"""First line of a table of times."""


def save_run(
    folder: Path,
    rows: list[Row],
    times: str = "",
    about: About = HERE,
) -> Path:
    """Write the folder of a run with these rows.

    Lines of times are written if there are any.
    """
    folder.mkdir()
    write_results(rows, folder / "results.csv")
    if times:
        (folder / "timings.csv").write_text(HEAD + times)
    write_about(about, folder)
    return folder


def read_run(path: Path) -> tuple[About, list[Row]]:
    """What a run was made with, and all its rows."""
    run = open_run(path)
    return run.about, list(run.rows())


def compare_rows(
    old: tuple[About, Iterable[Row]],
    new: tuple[About, Iterable[Row]],
    kept: int = ROWS_LISTED,
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
