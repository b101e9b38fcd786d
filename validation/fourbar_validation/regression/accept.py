"""`fourbar-validation compare` and `accept`.

`changes.py` compares the rows of two runs, `rules.py` the rules.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fourbar.errors import HOLDS, InputError, list_allowed
from fourbar.writing import write_text
from fourbar_validation.compare.results_file import CSV_ROWS
from fourbar_validation.compare.rows import Counts
from fourbar_validation.engines.programs import bound_memory
from fourbar_validation.regression import render
from fourbar_validation.regression.changes import (
    WITHOUT_SETTING,
    Differences,
    Kind,
    compare_runs,
)
from fourbar_validation.regression.history import (
    HISTORY,
    append,
    draw_row,
    find_since,
    read_history,
)
from fourbar_validation.regression.record import (
    ABOUT_FILE,
    ACCEPTED,
    RECORD_FILES,
    Recorded,
    accept,
    find_baseline,
    is_half_accepted,
    open_run,
)
from fourbar_validation.report.sentences import print_sentence

if TYPE_CHECKING:
    from pandas import DataFrame

CommandFunction = Callable[..., Any]
FORMS: dict[str, Callable[[Differences], str]] = {
    "markdown": render.write_pull_request_comment,
    "html": render.write_differences_page,
    "junit": render.write_junit_of_changes,
}
"""Forms in which the differences can be written, besides the text that is printed."""
_FORM_NAMES = {"markdown": "Markdown", "html": "HTML", "junit": "JUnit"}
"""Names of these forms in help texts."""
_CHOICES = {"only": "scene", "engines": "engine", "quantity": "quantity"}
"""Option, and the column that it chooses by."""


def add_output_options(junit: str = "") -> Callable[[CommandFunction], CommandFunction]:
    """Make a decorator that adds --markdown, --html and --junit.

    `junit`: end of the help of --junit.
    """
    path = click.Path(path_type=Path, dir_okay=False)
    ends = {"junit": junit}

    def add(command: CommandFunction) -> CommandFunction:
        for form, name in reversed(_FORM_NAMES.items()):
            text = f"Write the differences as {name} too{ends.get(form, '')}."
            command = click.option(f"--{form}", type=path, help=text)(command)
        return command

    return add


def _add_choosing_options(command: CommandFunction) -> CommandFunction:
    """Add the options --only, --engines and --quantity."""
    for option, column in reversed(_CHOICES.items()):
        text = f"These alone, comma-separated: names of column {column}."
        command = click.option(f"--{option}", metavar="NAMES", help=text)(command)
    return command


def find_differences(
    before: Recorded,
    after: Recorded,
    chosen: dict[str, str | None],
) -> Differences:
    """Compare two runs, by the rows that options choose."""
    bound_memory()  # a table of somebody else may ask for any
    rows = before.frame(), after.frame()
    choice = _read_choice(chosen, rows)
    return compare_runs((before.about, rows[0]), (after.about, rows[1]), choice)


def report_differences(
    old: Path,
    new: Path,
    forms: dict[str, Path | None],
    chosen: dict[str, str | None] | None = None,
) -> int:
    """Print the differences, and write the forms wanted.

    Return 1 on a regression, or if nothing was compared.
    """
    before = open_run(old, "OLD")
    after = open_run(new, "NEW")
    differences = find_differences(before, after, chosen or {})
    differences.baseline = before.describe()
    differences.notes += [
        f"{run.table}: not verified, its {ABOUT_FILE} states no SHA-256 or is missing"
        for run in (before, after)
        if not run.verified
    ]
    _add_since(differences, before, draw=forms.get("html") is not None)
    for form, path in forms.items():
        if path is not None:
            write_text(path, FORMS[form](differences))
    for line in render.write_differences(differences).splitlines():
        print_sentence(line)
    if differences.strange:
        raise InputError(
            "OLD",
            str(old),
            f"shares {differences.shared} of {len(differences.table)} rows with the new"
            " run, fewer than half of what it was asked for: name a run of the same"
            " suite, or compare a part of it with --only and --engines",
        )
    return differences.status


def _add_since(differences: Differences, before: Recorded, *, draw: bool) -> None:
    """Say since which accepted run the rows fail that are written; draw the first."""
    failing = differences.failing[: render.MOST_ROWS_ON_THE_PAGE]
    keys = [*failing[WITHOUT_SETTING].itertuples(index=False, name=None)]
    history = read_history(before)
    since = find_since(history, before, keys)
    differences.table.loc[failing.index, "since"] = [since[key] for key in keys]
    if draw and len(failing):
        differences.picture = draw_row(history, next(failing.itertuples()))
        differences.caption = (
            f"{' / '.join(keys[0])}: error in the accepted runs and in this one. It"
            f" {since[keys[0]]}."
        )


def _read_choice(
    chosen: dict[str, str | None],
    tables: tuple["DataFrame", "DataFrame"],
) -> dict[str, set[str]]:
    """Return the names that the options choose in each column.

    Raises InputError for a name that does not stand in its column.
    """
    choice = {}
    for option, text in chosen.items():
        if text is not None:
            column = _CHOICES[option]
            offered = {*tables[0][column], *tables[1][column]}
            names = {*filter(None, map(str.strip, text.split(",")))}
            for name in sorted(names - offered) or [text] * (not names):
                allowed = list_allowed(name, sorted(offered))
                raise InputError(f"--{option}", name, allowed)
            choice[column] = names
    return choice


@click.command("compare")
@click.argument("old")
@click.argument("new", type=click.Path(path_type=Path))
@_add_choosing_options
@add_output_options()
def compare_command(old: str, new: Path, **stated: Any) -> int:
    """Say what changed from OLD to NEW.

    OLD is a run's folder, its results.csv, or an accepted name. Rows that answer
    another question (a scene that changed, other settings or positions) are named and
    not compared; what the new run was not asked for is "not run". Exit status 1 on a
    regression or if nothing was compared, 2 where the runs share fewer than half of
    the rows that both were asked for.
    """
    chosen = {option: stated.pop(option) for option in _CHOICES}
    return report_differences(find_baseline(old), new, stated, chosen)


def _require_as_strict(run: Recorded, target: Path) -> None:
    """Refuse a run with weaker rules than the accepted one, or less that it judges."""
    if not (target / ABOUT_FILE).is_file() or is_half_accepted(run, target):
        return
    accepted = open_run(target, "--to")
    differences = find_differences(accepted, run, {})
    weakened = [*map(str, differences.weakened)]
    left_out = differences.name_whole(Kind.ENGINE_GONE, Kind.SCENE_GONE)
    left_out += differences.name_whole(Kind.NOT_RUN)
    why = (
        "is held to weaker rules than" if weakened else "leaves out what was judged in"
    )
    if what := weakened or left_out:
        more = f", and {len(what) - 1} more" * (len(what) > 1)
        raise InputError(
            "RESULTS",
            str(run.table.parent),
            f"{why} {accepted.describe()} ({what[0]}{more}): say --allow-weaker if that"
            " is meant",
        )


@click.command(name="accept")
@click.argument("results", type=click.Path(path_type=Path))
@click.option(
    "--to",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    help=f"Folder that keeps it (default: {ACCEPTED}/ next to RESULTS).",
)
@click.option(
    "--even-failing",
    is_flag=True,
    help="Accept a run in which a comparison fails, or none was made.",
)
@click.option(
    "--allow-weaker",
    is_flag=True,
    help="Accept a run with weaker rules, or fewer engines or scenes, than before.",
)
def accept_command(
    results: Path,
    to: Path | None,
    even_failing: bool,
    allow_weaker: bool,
) -> None:
    """Record a run as the accepted state.

    RESULTS is the run's folder. Later runs are compared with it. It is kept in DIR, and
    its rows are appended to DIR/history.parquet, a table for pandas or DuckDB.
    """
    folder = results if results.is_dir() else results.parent
    target = folder.absolute().parent / ACCEPTED if to is None else to
    if target.resolve() == folder.resolve():
        why = "must be another folder than that of the results"
        raise InputError("--to", str(target), why)
    for name in (*RECORD_FILES, ABOUT_FILE, HISTORY):
        if (target / name).is_dir():
            why = "must name a file, not a folder"
            raise InputError("--to", str(target / name), why)
    bound_memory()
    run = open_run(results)
    counts = Counts(run.rows())
    if counts.status != HOLDS and not even_failing:
        why = f"must hold, or say --even-failing: {counts.sentence()}"
        raise InputError("RESULTS", str(results), why)
    if not run.verified:  # the record does not say whether it lost some of its rows
        why = f"needs a {ABOUT_FILE} with its rows and SHA-256; `run` writes one"
        raise InputError(run.key, str(run.table), why)
    if not allow_weaker:
        _require_as_strict(run, target)
    history = f"too many for {HISTORY}"
    if counts.total <= CSV_ROWS:  # first: if the table is damaged nothing is written
        append(target / HISTORY, run)
        history = f"appended to {target / HISTORY}"
    accept(run, target)
    click.echo(f"accepted: {target} ({counts.total} rows; {history})")
