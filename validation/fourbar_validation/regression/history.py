"""The history of accepted runs: one table, history.parquet, for pandas and DuckDB.

A line is a row of a run, or a time (quantity "time": `times_formulas` is the engine's
time over that of the formulas on the scene), with the run's date, commit, machine and
versions in columns of their own (`version_mujoco`).
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from fourbar.errors import InputError
from fourbar.writing import write_bytes
from fourbar_validation.regression.record import Recorded

HISTORY = "history.parquet"
TIME = "time"


def append(file: Path, run: Recorded) -> None:
    """Append a run to the table, which is made if there is none.

    A run with the same date and rows is appended once. InputError if the file is
    damaged or no such table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = _make_table(run)
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


def _make_table(run: Recorded) -> Any:
    """Return the rows and times of a run; a text that recurs is kept once."""
    import pandas
    import pyarrow as pa

    about = run.about
    rows = run.frame()
    times = pandas.DataFrame(
        [
            (scene, engine, TIME, ratio)
            for scene, some in run.times()
            for engine, ratio in some
        ],
        columns=["scene", "engine", "quantity", "times_formulas"],
    )
    lines = pandas.concat([rows, times], ignore_index=True)
    digest = hashlib.sha256(f"{about.date}\n{lines.to_csv()}".encode())
    entries = {
        scene: hashlib.sha256(json.dumps(stated, sort_keys=True).encode())
        for scene, stated in about.scenes.items()
    }
    hashes = {scene: one.hexdigest()[:16] for scene, one in entries.items()}
    stated = {
        "run": digest.hexdigest()[:16],
        "date": about.date,
        "commit": about.commit,
        "machine": about.machine,
        "settings": json.dumps(about.settings, sort_keys=True),
    }
    stated |= {f"version_{name}": text for name, text in about.versions.items()}
    lines = pandas.concat(
        [
            pandas.DataFrame(stated, index=lines.index),
            lines.drop(columns="times_formulas").assign(
                scene_hash=[hashes.get(scene, "") for scene in lines.scene],
                times_formulas=lines.times_formulas.astype(float),
            ),
        ],
        axis=1,
    )
    word = pa.dictionary(pa.int32(), pa.string())
    schema = pa.schema(
        [
            (name, pa.float64() if kind.kind == "f" else word)
            for name, kind in lines.dtypes.items()
        ]
    )
    return pa.Table.from_pandas(
        lines, schema, preserve_index=False
    ).replace_schema_metadata()
