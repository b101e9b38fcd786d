"""The results of a run as results.csv and, for pandas and DuckDB, results.parquet.

Both hold the columns of `validation.compare.rows.Row`, sorted by scene, engine, setting and quantity;
the Parquet file has one row group per chunk of scenes and is written as the chunks are read.
"""

import os
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from validation.compare.plain import plain
from validation.compare.rows import COLUMNS, Row, to_csv

CSV_ROWS = 1_000_000
"""Rows beyond this are in results.parquet alone: a text table of that size serves nobody."""


def write_columns(chunks: Iterator[list[Row]], out: Path) -> dict[str, int]:
    """Stream the rows into both files; the line of results.csv at which each scene starts."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {str: pa.string(), float: pa.float64(), bool: pa.bool_()}
    schema = pa.schema([(field.name, kinds[field.type]) for field in fields(Row)])  # type: ignore[index]
    text, columns = out / ".results.csv.part", out / ".results.parquet.part"
    first_lines: dict[str, int] = {}
    line = 2
    with text.open("w", encoding="utf-8", newline="") as csv, pq.ParquetWriter(columns, schema) as parquet:
        csv.write(to_csv([]))
        for rows in chunks:
            for row in rows:
                first_lines.setdefault(row.scene, line)
                line += 1
            parquet.write_table(pa.table(_by_column(rows), schema=schema))
            if line <= CSV_ROWS:
                csv.write(to_csv(rows).partition("\n")[2])
    os.replace(columns, out / "results.parquet")
    if line <= CSV_ROWS:
        os.replace(text, out / "results.csv")
    else:
        text.unlink()
        (out / "results.csv").unlink(missing_ok=True)
    return first_lines


def read_columns(path: Path) -> Iterator[Row]:
    """The rows of a results.parquet, a row group at a time; words that recur are kept once."""
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        for batch in file.iter_batches():
            for cells in batch.to_pylist():
                kept: dict[str, Any] = {name: _kept_once(cell) for name, cell in cells.items() if name != "passed"}
                yield Row(**kept)


def _kept_once(cell: Any) -> Any:
    return sys.intern(plain(cell)) if isinstance(cell, str) else cell


def _by_column(rows: list[Row]) -> dict[str, list[Any]]:
    return {name: [getattr(row, name) for row in rows] for name in COLUMNS}
