"""`python -m validation compare` and `accept`.

The latter keeps the rows of every accepted run in one table. The table is
history.parquet, which pandas and DuckDB read: one line per row, and one per time
(quantity "time": `times_formulas` is the engine's time over that of the formulas on the
scene), with the run's date, commit, machine and versions in columns of their own
(`version_mujoco`).
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from fourbar.errors import HOLDS, InputError
from fourbar.writing import write_bytes, write_text
from fourbar_validation.compare.columns import CSV_ROWS, number_or_null
from fourbar_validation.compare.rows import COLUMN_TYPES, FAILS, Counts, Row, sort_rows
from fourbar_validation.regression import render
from fourbar_validation.regression.changes import Differences, compare_runs
from fourbar_validation.regression.record import (
    ABOUT_FILE,
    ACCEPTED,
    RECORD_FILES,
    About,
    Recorded,
    accept,
    find_baseline,
    open_run,
)
from fourbar_validation.regression.rules import list_weakened
from fourbar_validation.regression.scenes import find_renamed

HISTORY = "history.parquet"
TIME = "time"
CommandFunction = Callable[..., Any]


def append(
    file: Path,
    about: About,
    rows: list[Row],
    times: Mapping[tuple[str, str], float],
) -> None:
    """Append a run to the table, which is made if there is none.

    A run with the same date and rows is appended once. InputError if the file is
    damaged or no such table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = _write_record_table(about, rows, times)
    if file.exists():
        try:
            old = pq.read_table(
                pa.BufferReader(file.read_bytes()),
                page_checksum_verification=True,
            )
            if table["run"][0].as_py() in set(old["run"].to_pylist()):
                return
            table = pa.concat_tables([old, table], promote_options="default")
        except (OSError, ValueError, KeyError, TypeError, pa.ArrowException):
            raise InputError(
                "--to",
                str(file),
                "is damaged, or no table written by `accept`",
            ) from None
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(file, sink.getvalue().to_pybytes())


def _write_record_table(
    about: About,
    rows: list[Row],
    times: Mapping[tuple[str, str], float],
) -> Any:
    """Write a run as columns; a text that recurs is kept once."""
    import pyarrow as pa

    nothing: dict[str, Any] = dict.fromkeys((*COLUMN_TYPES, "times_formulas"))
    lines = [
        nothing | {name: number_or_null(getattr(row, name)) for name in COLUMN_TYPES}
        for row in sort_rows(rows)
    ]
    for (scene, engine), ratio in sorted(times.items()):
        lines.append(
            nothing
            | {
                "scene": scene,
                "engine": engine,
                "quantity": TIME,
                "times_formulas": ratio,
            }
        )
    name = hashlib.sha256(
        repr((about.date, [tuple(line.values()) for line in lines])).encode()
    ).hexdigest()[:16]
    run = {
        "run": name,
        "date": about.date,
        "commit": about.commit,
        "machine": about.machine,
    }
    run |= {"settings": json.dumps(about.settings, sort_keys=True)}
    run |= {f"version_{name}": version for name, version in about.versions.items()}
    hashes = {
        scene: (
            hashlib.sha256(
                json.dumps(dict(entries), sort_keys=True).encode()
            ).hexdigest()[:16]
        )
        for scene, entries in about.scenes.items()
    }
    kinds = COLUMN_TYPES | {"times_formulas": float}
    word = pa.dictionary(pa.int32(), pa.string())
    number = pa.float64()
    names = [*run, *COLUMN_TYPES, "scene_hash", "times_formulas"]
    schema = pa.schema(
        [(name, number if kinds.get(name) is float else word) for name in names]
    )
    return pa.Table.from_pylist(
        [run | line | {"scene_hash": hashes.get(line["scene"], "")} for line in lines],
        schema=schema,
    )


FORMS: dict[str, Callable[[Differences], str]] = {
    "markdown": render.write_pull_request_comment,
    "html": render.write_differences_page,
    "junit": render.write_junit_of_changes,
}
"""Forms in which the differences can be written, besides the text that is printed."""
_FORM_NAMES = {"markdown": "Markdown", "html": "HTML", "junit": "JUnit"}
"""Names of these forms in help texts."""
MOST_NAMES_LISTED = 50
"""Names of a column that a message lists."""
_CHOICES = {"only": "scene", "engines": "engine", "quantity": "quantity"}
"""Option, and the column that it chooses by."""


def add_output_options(junit: str = "") -> Callable[[CommandFunction], CommandFunction]:
    """Make a decorator that adds --markdown, --html and --junit.

    `junit`: end of the help of --junit.
    """

    def add(command: CommandFunction) -> CommandFunction:
        for form in reversed(FORMS):
            path = click.Path(path_type=Path, dir_okay=False)
            end = junit if form == "junit" else ""
            text = f"Write the differences as {_FORM_NAMES[form]} too{end}."
            command = click.option(f"--{form}", type=path, help=text)(command)
        return command

    return add


def _add_choosing_options(command: CommandFunction) -> CommandFunction:
    """Add the options --only, --engines and --quantity."""
    for option, column in reversed(_CHOICES.items()):
        text = f"These alone, comma-separated: names of column {column}."
        command = click.option(f"--{option}", metavar="NAMES", help=text)(command)
    return command


def report_differences(
    old: Path,
    new: Path,
    forms: dict[str, Path | None],
    chosen: dict[str, str | None] | None = None,
) -> int:
    """Print the differences, and write the forms wanted.

    Return 1 on a regression, or if nothing was compared.
    """
    from rich.console import Console
    from rich.progress import track

    before = open_run(old, "OLD")
    after = open_run(new, "NEW")
    names = find_renamed(before.about.scenes, after.about.scenes)
    keep = _is_chosen(
        chosen or {},
        lambda column: chain(before.words(column), after.words(column)),
        names,
    )
    engines = set(after.words("engine"))
    console = Console(stderr=True)
    scenes = track(
        after.scenes(keep),
        "comparing",
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    differences = compare_runs(
        (before.about, before.scenes(keep)),
        (after.about, scenes),
        engines,
    )
    differences.baseline = before.describe()
    unproven = [str(run.table) for run in (before, after) if not run.verified]
    differences.notes += [
        f"{table}: not verified, its {ABOUT_FILE} states no SHA-256 or is missing"
        for table in unproven
    ]
    for form, path in forms.items():
        if path is not None:
            write_text(path, FORMS[form](differences))
    click.echo(render.write_differences(differences), nl=False)
    if differences.strange:
        raise InputError(
            "OLD",
            str(old),
            f"shares {differences.shared} of {differences.rows} rows with the new run, "
            "fewer than half: name a run of the same suite, or compare a part of it "
            "with --only and --engines",
        )
    return differences.status


def _is_chosen(
    chosen: dict[str, str | None],
    words: Callable[[str], Iterable[str]],
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> Callable[[Row], bool]:
    """Return a test for rows that the options name.

    Raises InputError for a name that does not stand in its column.

    `find_renamed`: of a scene with an old and a new name either means both.
    """
    wanted: dict[str, set[str]] = {}
    for option, text in chosen.items():
        if text is None:
            continue
        names = {name.strip() for name in text.split(",") if name.strip()}
        missing = set(names)
        offered = set[str]()
        for word in words(_CHOICES[option]):
            missing.discard(word)
            if len(offered) < MOST_NAMES_LISTED:
                offered.add(word)
        for name in sorted(missing) or ([] if names else [text]):
            raise InputError(
                f"--{option}",
                name,
                "must be among " + ", ".join(sorted(offered)),
            )
        if option == "only":
            both = {
                name for pair in renamed.items() if names & {*pair} for name in pair
            }
        else:
            both = set()
        wanted[_CHOICES[option]] = names | both
    return lambda row: all(
        getattr(row, column) in names for column, names in wanted.items()
    )


@click.command("compare")
@click.argument("old")
@click.argument("new", type=click.Path(path_type=Path))
@_add_choosing_options
@add_output_options()
def compare_command(
    old: str,
    new: Path,
    only: str | None,
    engines: str | None,
    quantity: str | None,
    **forms: Path | None,
) -> int:
    """Say what changed from OLD to NEW.

    OLD is a run's folder, its results.csv, or an accepted name. Scenes that changed
    come first, entry by entry; their rows, and those with other settings or at other
    positions, are named and not compared. What the new run was not asked for is "not
    run", and no regression. Exit status 1 on a regression: a rule that is weaker than
    it was (a wider tolerance, another class or reason, a limit that is met earlier), a
    verdict that got worse, an error that grew beyond round-off and its allowance, a row
    that was run for and is gone, a new row that fails; and where nothing was compared.
    Exit status 2 where the runs share fewer than half of their rows.
    """
    return report_differences(
        find_baseline(old),
        new,
        forms,
        {"only": only, "engines": engines, "quantity": quantity},
    )


def _require_as_strict(run: Recorded, target: Path) -> None:
    """Refuse a run whose rules are weaker than those of the accepted one."""
    if not (target / ABOUT_FILE).is_file():
        return
    accepted = open_run(target, "--to")
    weakened = list_weakened(accepted.about.rules, run.about.rules)
    if weakened:
        if len(weakened) > 1:
            more = f", and {len(weakened) - 1} more"
        else:
            more = ""
        raise InputError(
            "RESULTS",
            str(run.table.parent),
            f"is held to weaker rules than {accepted.describe()} ({weakened[0]}{more}):"
            " say --allow-weaker if that is meant",
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
    help="Accept a run that is held to weaker rules than the accepted one.",
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
    if results.is_dir():
        folder = results
    else:
        folder = results.parent
    if to is None:
        target = folder.absolute().parent / ACCEPTED
    else:
        target = to
    if target.resolve() == folder.resolve():
        raise InputError(
            "--to",
            str(target),
            "must be another folder than that of the results",
        )
    for name in (*RECORD_FILES, ABOUT_FILE, HISTORY):
        if (target / name).is_dir():
            raise InputError(
                "--to",
                str(target / name),
                "must name a file, not a folder",
            )
    run = open_run(results)
    counts = Counts(run.rows())
    if counts.status != HOLDS and not even_failing:
        if counts[FAILS]:
            why = f"{counts[FAILS]} comparisons fail"
        else:
            why = "nothing was compared"
        raise InputError(
            "RESULTS",
            str(results),
            f"must hold, or say --even-failing: {why}",
        )
    if not run.verified:  # the record does not say whether it lost some of its rows
        raise InputError(
            run.key,
            str(run.table),
            f"needs a {ABOUT_FILE} with its rows and SHA-256; `run` writes one",
        )
    if not allow_weaker:
        _require_as_strict(run, target)
    too_long = counts.total > CSV_ROWS
    if not too_long:  # first: if the table is damaged nothing is written
        times = {
            (scene, engine): time
            for scene, some in run.times()
            for engine, time in some
        }
        append(target / HISTORY, run.about, list(run.rows()), times)
    accept(run, target)
    if too_long:
        history = f"too many for {HISTORY}"
    else:
        history = f"appended to {target / HISTORY}"
    click.echo(f"accepted: {target} ({counts.total} rows; {history})")
