"""Recorded runs whose rows are all at hand."""

from dataclasses import replace

from pandas import DataFrame

from fourbar_validation.compare.rows import (
    AGREES,
    COLUMN_TYPES,
    VERDICTS,
    Row,
    write_results,
)
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression import changes, record, render

HERE = record.describe_run([Engine("engine", FreeBody, EQUIVALENCE)], "suite")
"""What a run of one engine was made with."""
ROW = Row(
    "scene", "engine", "exact", "torque", 1e-15, 1e-14, AGREES, "equivalence", 1.0, 1.0
)
"""A row that agrees."""
WORDS = {verdict.partition(" ")[0]: verdict for verdict in VERDICTS}
"""Verdicts by their first words."""
FORMS = (
    render.write_junit_of_changes,
    render.write_differences,
    render.write_pull_request_comment,
    render.write_differences_page,
)
"""What writes the changes between two runs."""
HEAD = "scene,engine,setting,positions,seconds,times_formulas\n"
"""First line of a table of times."""


def changed(**fields):
    """Return ROW with other fields."""
    return replace(ROW, **fields)


def save_run(folder, rows, times="", about=HERE):
    """Write the folder of a run with these rows.

    Lines of times are written if there are any.
    """
    folder.mkdir()
    write_results(rows, folder / "results.csv")
    if times:
        (folder / "timings.csv").write_text(HEAD + times)
    record.write_about(about, folder)
    return folder


def read_run(path):
    """What a run was made with, and all its rows."""
    run = record.open_run(path)
    return run.about, list(run.rows())


def compare_rows(old, new):
    """Two runs compared by their rows."""
    before, after = (
        DataFrame(
            [[getattr(row, name) for name in COLUMN_TYPES] for row in rows],
            columns=[*COLUMN_TYPES],
        ).astype(COLUMN_TYPES)
        for _, rows in (old, new)
    )
    return changes.compare_runs((old[0], before), (new[0], after))


def compare_made_here(old, new):
    """Two runs that were made alike compared by their rows."""
    return compare_rows((HERE, old), (HERE, new))


def kinds(old, new):
    """Kind of change of each line of two runs, in the order of the table."""
    return [*compare_made_here(old, new).table.kind]
