"""A recorded run: its tables, and record.json with what it was made with.

Recorded are versions, machine, settings and scenes. The record of one scene is in
`report/scene_record.py`.
"""

import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.errors import InputError
from fourbar.linkage import record
from fourbar.writing import write_text
from fourbar_validation.compare.results_file import (
    count_rows,
    draft_file,
    read_columns,
    read_frame,
)
from fourbar_validation.compare.rows import Row, escape_controls, read_cell_text
from fourbar_validation.compare.tolerance import SIMULATED, K
from fourbar_validation.engines.guests import Guest
from fourbar_validation.engines.registry import Engine
from fourbar_validation.places import CHECKOUT
from fourbar_validation.regression.rules import Rules, list_rules
from fourbar_validation.report.machine import find_kernels, list_versions, name_machine

if TYPE_CHECKING:
    from pandas import DataFrame

SHIPPED = Path(__file__).parent
"""Folder of the accepted state of this project's models."""
ACCEPTED = "accepted"
CSV_FILE = "results.csv"
PARQUET_FILE = "results.parquet"
ABOUT_FILE = "record.json"
TIMINGS_FILE = "timings.csv"
RECORD_FILES = (CSV_FILE, PARQUET_FILE, TIMINGS_FILE)
UNFINISHED = "run.json"
"""File that a run keeps in its folder until it is finished."""
MOST_ROWS_COMPARED = 3_000_000
"""Rows of a run that are held in memory at once, in four gigabytes."""


@record
class About:
    """Versions, machine and settings with which a run was made."""

    versions: dict[str, str]
    """Versions of what decides a number, including the kernels chosen for the CPU."""
    machine: str
    settings: dict[str, str]
    """Engines, suite, and the factors of the tolerances."""
    scenes: dict[str, dict[str, str]] = field(default_factory=dict)
    """Entries of each scene, by its name. Empty in suites too long for it."""
    date: str = ""
    """UTC, ISO 8601."""
    commit: str = ""
    """Commit of the checkout that the run was made in; empty if there is none."""
    rules: Rules = field(default_factory=dict)
    """Tolerances, predictions and limits of the engines."""

    @property
    def engines(self) -> list[str]:
        """Return the engines that were run, as far as the record says."""
        return self._list("engines")

    @property
    def guests(self) -> list[str]:
        """Return those that are no engines of the harness or the lab."""
        return self._list("guests")

    @property
    def guests_by_option(self) -> list[str]:
        """Return the guests that --guest named: --engines did not choose them."""
        entries = self.settings.get("chosen", "").split(",")
        chosen = [{*entry.split()} for entry in entries]  # a name, with its version
        return [
            guest
            for guest in self.guests
            if not any(words >= {*guest.split()} for words in chosen)
        ]

    def _list(self, name: str) -> list[str]:
        return [*filter(None, self.settings.get(name, "").split(", "))]


def describe_run(
    engines: Sequence[Engine],
    suite: str,
    scenes: Mapping[str, Mapping[str, str]] | None = None,
    asked: Mapping[str, str] | None = None,
) -> About:
    """Describe a run made here and now.

    `asked`: settings that say which part of its engines and scenes was asked for
    (`Plan.asked`).
    """
    guests = [engine for engine in engines if isinstance(engine, Guest)]
    simulated = next(
        (engine.tolerance.factor for engine in engines if engine.tolerance.in_time),
        SIMULATED.factor,
    )
    settings = {
        "engines": ", ".join(engine.name for engine in engines),
        "guests": ", ".join(guest.name for guest in guests),
        "suite": suite,
        "K": repr(K),
        "simulated": repr(simulated),
    }
    now = datetime.now(UTC).isoformat(timespec="seconds")
    versions = {guest.name: guest.version for guest in guests if guest.version}
    return About(
        list_versions() | find_kernels() | versions,
        name_machine(),
        settings | dict(asked or {}),
        {name: dict(entries) for name, entries in (scenes or {}).items()},
        now,
        _find_commit(),
        list_rules(engines),
    )


def _find_commit() -> str:
    """Return the commit of the harness's folder, "-dirty" if it has changes.

    The commit that a CI service states in the environment goes first.
    """
    if stated := os.environ.get("GITHUB_SHA") or os.environ.get("CI_COMMIT_SHA"):
        return stated[:12]
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    if CHECKOUT is None:
        return ""
    try:
        done = subprocess.run(
            command,
            cwd=CHECKOUT,
            capture_output=True,
            encoding="utf-8",
            check=True,
            timeout=10,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def write_about(record: About, folder: Path) -> None:
    """Write record.json next to the results.

    The file states the rows and SHA-256 of each table, and its own SHA-256.
    """
    tables = {
        path.name: {"rows": count_rows(path), "sha256": _hash_file(path)}
        for path in map(folder.joinpath, RECORD_FILES)
        if path.is_file()
    }
    kept = asdict(record) | {"tables": tables}
    kept["sha256"] = _hash_own(kept)
    text = json.dumps(kept, indent=1, sort_keys=True)
    write_text(folder / ABOUT_FILE, f"{text}\n")


def _hash_file(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _hash_own(kept: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()


NOTHING_KNOWN = About({}, "unknown machine", {})


@record
class Recorded:
    """A recorded run, read from its folder.

    Rows of its table are read one scene at a time: the table may not fit in memory.
    """

    about: About
    table: Path
    key: str = "RESULTS"
    """Name in an error message: the argument or option that named the record."""

    @property
    def verified(self) -> bool:
        """Return whether a record says that its tables are those it was written with.

        A table alone has none.
        """
        return self.about is not NOTHING_KNOWN

    def describe(self) -> str:
        """Say in words which run it is: where it lies, of which date and commit."""
        folder = self.table.parent
        shipped = folder.resolve().is_relative_to(SHIPPED.resolve())
        words = ["the run that comes with fourbar" if shipped else str(folder)]
        if self.about.date:
            words.append(f"of {self.about.date.partition('T')[0]}")
        if self.about.commit:
            words.append(f"at commit {self.about.commit}")
        return " ".join(words)

    def rows(self) -> Iterator[Row]:
        """Yield the rows in their order; InputError if the table is damaged."""
        with self._name_damage():
            yield from read_columns(self.table)

    def frame(self) -> "DataFrame":
        """Return the rows as a table; InputError if it is damaged or too long."""
        with self._name_damage():
            rows = count_rows(self.table)
            if rows <= MOST_ROWS_COMPARED:
                return read_frame(self.table)
        raise InputError(
            self.key,
            str(self.table),
            f"has {rows} rows; at most {MOST_ROWS_COMPARED} are compared: run fewer"
            " scenes, or compare the tables by pandas or DuckDB",
        )

    def times(self) -> "DataFrame":
        """Return `scene`, `engine` and its time over that of the formulas.

        The table has no rows if no times were kept.
        """
        import pandas

        kinds = {"scene": str, "engine": str, "times_formulas": float}
        table = self.table.with_name(TIMINGS_FILE)
        if not table.is_file():
            return pandas.DataFrame(columns=[*kinds]).astype(kinds)
        with name_damage(self.key, table, "is not a table of times written by `run`"):
            times = pandas.read_csv(
                table, usecols=[*kinds], dtype=str, keep_default_na=False
            ).astype(kinds)
        for column in ("scene", "engine"):
            times[column] = times[column].map(read_cell_text).map(escape_controls)
        return times

    def _name_damage(self) -> AbstractContextManager[None]:
        return name_damage(self.key, self.table, "is not a table written by `run`")


@contextmanager
def name_damage(key: str, path: Path, why: str) -> Iterator[None]:
    """Raise an InputError where a file cannot be read as what it should be."""
    try:
        yield
    except (
        AttributeError,
        KeyError,
        NotImplementedError,
        OSError,
        RecursionError,
        TypeError,
        ValueError,
    ):  # a column, a cell or a number is missing, or is no text
        raise InputError(key, str(path), why) from None


def open_run(path: Path, key: str = "RESULTS") -> Recorded:
    """Open a run by its folder, or by a results.csv only.

    A lone results.csv does not tell how the run was made.

    Raises InputError where there is no readable table, an empty or a damaged one, or
    that of an unfinished run.
    """
    table = path / CSV_FILE if path.is_dir() else path
    long = path / PARQUET_FILE
    if not table.is_file() and long.is_file():  # too many rows for a text
        table = long
    if not table.is_file():
        why = f"must be a folder with {CSV_FILE} or {PARQUET_FILE}, or such a file"
        raise InputError(key, str(path), why)
    if table.with_name(UNFINISHED).is_file():
        why = "must be of a run that was finished: run it again, and it is resumed"
        raise InputError(key, str(table), why)
    record = table.with_name(ABOUT_FILE)
    about = NOTHING_KNOWN
    if record.is_file():
        about = _read_about(record, table, key)
    run = Recorded(about, table, key)
    if next(run.rows(), None) is None:
        why = "must hold at least one comparison: it has none"
        raise InputError(key, str(table), why)
    return run


def _read_about(record: Path, table: Path, key: str) -> About:
    """Read what the record of a table says.

    Raises InputError if it is damaged, and names the first table that it does not
    describe: one that is missing or unnamed, or has another SHA-256.
    """
    text = record.read_bytes()
    with name_damage(key, record, "is not a record written by `run`"):
        kept = json.loads(text)
        if kept.pop("sha256", None) != _hash_own(kept):
            why = "is damaged: it is not what `run` wrote"
            raise InputError(key, str(record), why)
        tables = kept.pop("tables")
        about = About(**_escape_texts(kept))
    folder = table.parent
    present = {name for name in RECORD_FILES if (folder / name).is_file()}
    for name in sorted({*tables, *present, table.name}):
        stated = tables.get(name, {"rows": "no", "sha256": "none"})
        if name not in present or _hash_file(folder / name) != stated["sha256"]:
            why = (
                f"is missing, damaged or of another run: {ABOUT_FILE} states"
                f" {stated['rows']} rows and the SHA-256 {stated['sha256']}"
            )
            raise InputError(key, str(folder / name), why)
    return about


def _escape_texts(value: Any) -> Any:
    """Escape somebody's text, or all texts of nested entries."""
    if isinstance(value, dict):
        return {escape_controls(key): _escape_texts(x) for key, x in value.items()}
    return escape_controls(value)


def find_baseline(name_or_path: str) -> Path:
    """Find a run by its path, or the accepted state by its name.

    The accepted state is that of this project's models.
    """
    shipped = SHIPPED / name_or_path
    if not Path(name_or_path).exists() and (shipped / ABOUT_FILE).is_file():
        return shipped
    return Path(name_or_path)


def accept(run: Recorded, target: Path) -> None:
    """Keep a run, with its times, as the accepted state in a folder.

    Of its two tables the compressed one is kept, if it has it.
    """
    target.mkdir(parents=True, exist_ok=True)
    table = _find_kept_table(run)
    # first: by it `is_half_accepted` knows the run
    kept = (table, run.table.with_name(TIMINGS_FILE))
    for source in kept:
        if source.is_file():
            with draft_file(target / source.name) as draft:
                shutil.copyfile(source, draft)
    for name in {*RECORD_FILES} - {path.name for path in kept if path.is_file()}:
        (target / name).unlink(missing_ok=True)  # a file of the previous state
    write_about(run.about, target)


def _find_kept_table(run: Recorded) -> Path:
    compressed = run.table.with_name(PARQUET_FILE)
    return compressed if compressed.is_file() else run.table


def is_half_accepted(run: Recorded, target: Path) -> bool:
    """Tell whether `accept` of the run was killed once its table was in place.

    The record is then that of the previous state, which does not describe the table.
    """
    table = _find_kept_table(run)
    there = target / table.name
    if not there.is_file() or _hash_file(there) != _hash_file(table):
        return False
    try:
        open_run(target)
    except InputError:
        return True
    return False
