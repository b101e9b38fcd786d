"""A recorded run: its table and the versions, machine and settings it was made with."""

import csv
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from fourbar.errors import InputError
from fourbar.writing import write_text
from validation.compare.columns import read_columns
from validation.compare.plain import plain
from validation.compare.rows import Row, from_csv, to_csv
from validation.compare.tolerance import SIMULATED, K
from validation.report.machine import machine, versions

BASELINES = Path(__file__).parent
ACCEPTED = "accepted"
TABLE, COLUMNS, ABOUT = "results.csv", "results.parquet", "record.json"


@dataclass(frozen=True, slots=True)
class About:
    """What a run was made with."""

    versions: dict[str, str]
    machine: str
    settings: dict[str, str]
    """Engines, suite, and the factors of the tolerances."""


def about(factors: Mapping[str, float], suite: str) -> About:
    """The record of a run made here and now; `factors` are the errors allowed to each engine at condition 1."""
    simulated = factors.get("mujoco-simulated", SIMULATED.factor)
    settings = {"engines": ", ".join(factors), "suite": suite, "K": repr(K), "simulated": repr(simulated)}
    return About(versions(), machine(), settings)


def write_about(record: About, folder: Path) -> None:
    """Write record.json next to the results."""
    write_text(folder / ABOUT, json.dumps(asdict(record), indent=1, sort_keys=True) + "\n")


def read_run(path: Path) -> tuple[About, list[Row]]:
    """A run from its folder, or from a results.csv alone (then nothing is known of how it was made).

    Raises InputError where there is no readable table.
    """
    table = path / TABLE if path.is_dir() else path
    long = path / COLUMNS
    if not table.is_file() and long.is_file():  # too many rows for a text
        table = long
    if not table.is_file():
        raise InputError("RESULTS", str(path), f"must be a folder with {TABLE}, or such a file")
    try:
        rows = list(read_columns(table)) if table.suffix == ".parquet" else from_csv(table)
    except (KeyError, TypeError, ValueError, csv.Error):  # a column, a cell or a number is missing, or it is no text
        raise InputError("RESULTS", str(table), "is not a table written by `run`") from None
    record = table.parent / ABOUT
    if not record.is_file():
        return About({}, "unknown machine", {}), rows
    try:
        return _about(json.loads(record.read_text(encoding="utf-8"))), rows
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError):
        raise InputError("RESULTS", str(record), "is not a record written by `run`") from None


def _about(kept: dict[str, Any]) -> About:
    """What a file says of a run; its words are somebody's text."""
    versions, settings = (
        {plain(key): plain(value) for key, value in kept[name].items()} for name in ("versions", "settings")
    )
    return About(versions, plain(kept["machine"]), settings)


def accept(run: Path, name: str = ACCEPTED) -> Path:
    """Keep a run as the accepted state of that name; the folder it is kept in."""
    record, rows = read_run(run)
    target = BASELINES / name
    target.mkdir(parents=True, exist_ok=True)
    write_text(target / TABLE, to_csv(rows))
    write_about(record, target)
    return target


def baseline(name_or_path: str) -> Path:
    """A baseline by its name, or any run by its path."""
    named = BASELINES / name_or_path
    return named if named.is_dir() else Path(name_or_path)
