"""Every accepted or added run in one small columnar file, history.parquet, which pandas and DuckDB read as it is.

One line per row of a run, and one per time (quantity "time": `times_formulas` is the engine's time over the
formulas' on that scene), with the run's date, commit, machine and versions in columns of their own
(`version_mujoco`). What each scene states stands once in the file's own notes, by its `scene_hash`.
"""

import hashlib
import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fourbar.errors import InputError
from fourbar.writing import write_bytes
from fourbar_validation.compare.columns import null_nan
from fourbar_validation.compare.rows import MADE_OF, Row, make_plain, sort_rows
from fourbar_validation.regression.record import About

HISTORY = "history.parquet"
SCENES = b"fourbar.scenes"
"""Of the file's notes: JSON, what each scene states by its hash."""
SEAL, UNSEALED = b"fourbar.sha256", b"0" * 64
"""Of the same notes: the SHA-256 of the file with zeros in its place."""
TIME = "time"
OF_A_ROW = tuple(MADE_OF)


@dataclass(frozen=True, slots=True)
class HistoryRun:
    """One run of a history."""

    about: About
    rows: list[Row]
    times: Mapping[tuple[str, str], float]

    @property
    def name(self) -> str:
        """Date and commit, for a reader."""
        date = self.about.date[:16].replace("T", " ") or "no date"
        return f"{date} ({self.about.commit or 'no commit'})"

    def of(self, keep: Callable[[Row], bool]) -> "HistoryRun":
        """Keep the rows that are wanted."""
        return replace(self, rows=[row for row in self.rows if keep(row)])


def append(file: Path, run: tuple[About, list[Row]], times: Mapping[tuple[str, str], float]) -> None:
    """Add a run at the end of a history, which is made where there is none; InputError where it is no history.

    A run that is in it already, by date and rows, is not added again.
    """
    import pyarrow as pa

    about, rows = run
    new = _write_table(about, rows, times)
    if file.exists():
        old = _read(file)
        if new["run"][0].as_py() in set(old["run"].to_pylist()):
            return
        scenes = {**_list_scenes(old), **_list_scenes(new)}
        new = pa.concat_tables([old, new], promote_options="default")
        new = new.replace_schema_metadata({SCENES: json.dumps(scenes, sort_keys=True).encode()})
    _write(file, new)


def read_history(file: Path) -> list[HistoryRun]:
    """Read the runs of a history by date; InputError where it is none."""
    if not file.is_file():
        raise InputError("HISTORY", str(file), "there is no such file; `accept` and `history --add` make it")
    table = _read(file)
    scenes = _list_scenes(table)
    runs: dict[str, HistoryRun] = {}
    hashes: dict[str, dict[str, str]] = {}
    for cells in table.to_pylist():
        name = cells["run"]
        if name not in runs:
            runs[name] = HistoryRun(_describe_run(cells), [], {})
        _put(runs[name], hashes.setdefault(name, {}), cells)
    for name, run in runs.items():
        stated = {scene: scenes[each] for scene, each in hashes[name].items() if each in scenes}
        runs[name] = replace(run, about=replace(run.about, scenes=stated))
    return sorted(runs.values(), key=lambda run: run.about.date)


def _put(run: HistoryRun, hashes: dict[str, str], cells: Mapping[str, Any]) -> None:
    scene, engine = make_plain(cells["scene"]), make_plain(cells["engine"])
    if cells["scene_hash"]:
        hashes[scene] = cells["scene_hash"]
    if cells["quantity"] == TIME:
        run.times[scene, engine] = float(cells["times_formulas"])  # type: ignore[index]
        return
    values: dict[str, Any] = {}
    for name in OF_A_ROW:
        cell = cells[name]
        values[name] = make_plain(cell) if isinstance(cell, str) else math.nan if cell is None else cell
    run.rows.append(Row(**values))


def _describe_run(cells: Mapping[str, Any]) -> About:
    versions = {name.removeprefix("version_"): make_plain(value) for name, value in cells.items()
                if name.startswith("version_") and value}  # fmt: skip
    settings = {make_plain(key): make_plain(value) for key, value in json.loads(cells["settings"]).items()}
    return About(
        versions, make_plain(cells["machine"]), settings, {}, make_plain(cells["date"]), make_plain(cells["commit"])
    )


def _write_table(about: About, rows: list[Row], times: Mapping[tuple[str, str], float]) -> Any:
    """Write a run as columns; words that recur are kept once."""
    import pyarrow as pa

    hashes = {name: _hash(entries) for name, entries in about.scenes.items()}
    nothing: dict[str, Any] = dict.fromkeys((*OF_A_ROW, "times_formulas"))
    lines = [nothing | {name: null_nan(getattr(row, name)) for name in OF_A_ROW} for row in sort_rows(rows)]
    for (scene, engine), ratio in sorted(times.items()):
        lines.append(nothing | {"scene": scene, "engine": engine, "quantity": TIME, "times_formulas": ratio})
    name = hashlib.sha256(repr((about.date, [tuple(line.values()) for line in lines])).encode()).hexdigest()[:16]
    of_run = {"run": name, "date": about.date, "commit": about.commit, "machine": about.machine}
    of_run |= {"settings": json.dumps(about.settings, sort_keys=True)}
    of_run |= {f"version_{name}": version for name, version in about.versions.items()}
    kinds = MADE_OF | {"times_formulas": float}
    word, number = pa.dictionary(pa.int32(), pa.string()), pa.float64()
    names = [*of_run, *OF_A_ROW, "scene_hash", "times_formulas"]
    schema = pa.schema([(name, number if kinds.get(name) is float else word) for name in names])
    kept = {hashes[name]: dict(entries) for name, entries in about.scenes.items()}
    lines = [of_run | line | {"scene_hash": hashes.get(line["scene"], "")} for line in lines]
    return pa.Table.from_pylist(lines, schema.with_metadata({SCENES: json.dumps(kept, sort_keys=True).encode()}))


def _hash(entries: Mapping[str, str]) -> str:
    return hashlib.sha256(json.dumps(dict(entries), sort_keys=True).encode()).hexdigest()[:16]


def _list_scenes(table: Any) -> dict[str, dict[str, str]]:
    kept = json.loads((table.schema.metadata or {}).get(SCENES, b"{}"))
    return {
        make_plain(key): {make_plain(k): make_plain(v) for k, v in entries.items()} for key, entries in kept.items()
    }


def _read(file: Path) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    data = file.read_bytes()
    if _seal(data) != data:
        raise InputError("HISTORY", str(file), "is damaged, or no history written by `accept`: its SHA-256 is another")
    return pq.read_table(pa.BufferReader(data))


def _seal(data: bytes) -> bytes:
    """Put the SHA-256 of a file into its notes; nothing where there is no place for one."""
    places = [each.span(1) for each in re.finditer(re.escape(SEAL) + rb"..([0-9a-f]{64})", data, re.DOTALL)]
    if not places:
        return b""
    first, last = places[-1]
    digest = hashlib.sha256(data[:first] + UNSEALED + data[last:]).hexdigest()
    return data[:first] + digest.encode() + data[last:]


def _write(file: Path, table: Any) -> None:
    """All of it or nothing."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    sink = pa.BufferOutputStream()
    notes = {**(table.schema.metadata or {}), SEAL: UNSEALED}
    pq.write_table(table.replace_schema_metadata(notes), sink, compression="zstd")
    file.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(file, _seal(sink.getvalue().to_pybytes()))
