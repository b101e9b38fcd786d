"""Rows of every accepted run in one table, history.parquet, which pandas and DuckDB read.

One line per row, and one per time (quantity "time": `times_formulas` is the engine's time over that of the formulas on
the scene), with the run's date, commit, machine and versions in columns of their own (`version_mujoco`).
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fourbar.errors import InputError
from fourbar.writing import write_bytes
from fourbar_validation.compare.columns import null_nan
from fourbar_validation.compare.rows import MADE_OF, Row, sort_rows
from fourbar_validation.regression.record import About

HISTORY = "history.parquet"
TIME = "time"


def append(file: Path, about: About, rows: list[Row], times: Mapping[tuple[str, str], float]) -> None:
    """Append a run to the table, which is made if there is none.

    A run with the same date and rows is appended once. InputError if the file is damaged or no such table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = _write_table(about, rows, times)
    if file.exists():
        try:
            old = pq.read_table(pa.BufferReader(file.read_bytes()), page_checksum_verification=True)
            if table["run"][0].as_py() in set(old["run"].to_pylist()):
                return
            table = pa.concat_tables([old, table], promote_options="default")
        except (OSError, ValueError, KeyError, TypeError, pa.ArrowException):
            raise InputError("--to", str(file), "is damaged, or no table written by `accept`") from None
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(file, sink.getvalue().to_pybytes())


def _write_table(about: About, rows: list[Row], times: Mapping[tuple[str, str], float]) -> Any:
    """Write a run as columns; a text that recurs is kept once."""
    import pyarrow as pa

    nothing: dict[str, Any] = dict.fromkeys((*MADE_OF, "times_formulas"))
    lines = [nothing | {name: null_nan(getattr(row, name)) for name in MADE_OF} for row in sort_rows(rows)]
    for (scene, engine), ratio in sorted(times.items()):
        lines.append(nothing | {"scene": scene, "engine": engine, "quantity": TIME, "times_formulas": ratio})
    name = hashlib.sha256(repr((about.date, [tuple(line.values()) for line in lines])).encode()).hexdigest()[:16]
    run = {"run": name, "date": about.date, "commit": about.commit, "machine": about.machine}
    run |= {"settings": json.dumps(about.settings, sort_keys=True)}
    run |= {f"version_{name}": version for name, version in about.versions.items()}
    hashes = {
        scene: hashlib.sha256(json.dumps(dict(entries), sort_keys=True).encode()).hexdigest()[:16]
        for scene, entries in about.scenes.items()
    }
    kinds = MADE_OF | {"times_formulas": float}
    word, number = pa.dictionary(pa.int32(), pa.string()), pa.float64()
    names = [*run, *MADE_OF, "scene_hash", "times_formulas"]
    schema = pa.schema([(name, number if kinds.get(name) is float else word) for name in names])
    return pa.Table.from_pylist(
        [run | line | {"scene_hash": hashes.get(line["scene"], "")} for line in lines], schema=schema
    )
