"""The results of a run as results.csv and, for pandas and DuckDB, results.parquet.

The columns are those of `fourbar_validation.compare.rows.Row`, sorted by scene, engine,
setting and quantity; both files are written as the tasks are read.
"""

import math
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fourbar.writing import name_file
from fourbar_validation.compare.rows import (
    COLUMN_TYPES,
    RESULT_COLUMNS,
    Row,
    escape_controls,
    read_cell_text,
    write_rows,
)

if TYPE_CHECKING:
    from pandas import DataFrame

GROUP_ROWS = 100_000
"""Rows of a row group of the Parquet file. Each group costs some kilobytes of footer,
whatever it holds.
"""
BATCH_ROWS = 20_000
"""Rows in memory while the file is read."""
LONGEST_CELL = 100_000
"""Most characters of a cell. The longest that a run writes is an engine's message, of
some thousands.
"""
CSV_ROWS = 1_000_000
"""Most rows of the text table. Further ones are in results.parquet alone."""


class ResultsWriter:
    """Writer of both files, which are complete at the end of a `with`.

    Neither file exists if the writer fails.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.first_lines: dict[str, int] = {}
        """The line of results.csv at which each scene starts."""
        self._line = 2
        self._waiting: list[Any] = []
        """Arrow tables that wait to be a row group. Rows themselves would take five
        times the memory.
        """
        self._files = ExitStack()

    def __enter__(self) -> "ResultsWriter":
        import pyarrow as pa
        import pyarrow.parquet as pq

        kinds = {str: pa.string(), float: pa.float64(), bool: pa.bool_()}
        self._schema = pa.schema(
            [(field.name, kinds[field.type]) for field in fields(Row)]  # type: ignore[index]
        )
        self._text, self._columns = (
            self.out / f".results.{kind}.part" for kind in ("csv", "parquet")
        )
        with self._files:
            self._files.enter_context(
                name_file(self.out / "results.csv")
            )  # a failure on closing is named too
            self._csv = self._files.enter_context(
                self._text.open("w", encoding="utf-8", newline="")
            )
            self._files.enter_context(name_file(self.out / "results.parquet"))
            self._parquet = self._files.enter_context(
                pq.ParquetWriter(self._columns, self._schema)
            )
            self._csv.write(write_rows([]))
            self._files = self._files.pop_all()
        return self

    def add(self, rows: Sequence[Row]) -> None:
        """Add the rows that come next, and keep them until they fill a row group."""
        import pyarrow as pa

        for row in rows:
            if self._line <= CSV_ROWS:
                self.first_lines.setdefault(row.scene, self._line)
            self._line += 1
        if rows:
            # NaN is no number: as null no greatest error is NaN by it
            columns = [
                pa.array([getattr(row, name) for row in rows], kind, from_pandas=True)
                for name, kind in zip(RESULT_COLUMNS, self._schema.types, strict=True)
            ]
            self._waiting.append(pa.table(columns, schema=self._schema))
        if self._line <= CSV_ROWS:
            with name_file(self.out / "results.csv"):
                self._csv.write(write_rows(rows).partition("\n")[2])
        if sum(map(len, self._waiting)) >= GROUP_ROWS:
            self._write_group()

    def _write_group(self) -> None:
        import pyarrow as pa

        group = pa.concat_tables(self._waiting).combine_chunks()
        with name_file(self.out / "results.parquet"):
            self._parquet.write_table(group)
        self._waiting.clear()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Put both in place, the text only where it is not too long."""
        with self._files:
            if kind is None and self._waiting:
                self._write_group()
        if kind is not None:
            return
        os.replace(self._columns, self.out / "results.parquet")
        if self._line <= CSV_ROWS:
            os.replace(self._text, self.out / "results.csv")
        else:
            self._text.unlink()
            (self.out / "results.csv").unlink(missing_ok=True)


def read_columns(path: Path) -> Iterator[Row]:
    """Read the rows of a results.parquet or results.csv, some thousands at a time."""
    for columns in _read_cells(path):
        yield from map(Row, *columns)


def read_frame(path: Path) -> "DataFrame":
    """Read a results.parquet or results.csv as a table of pandas."""
    import pandas

    parts = [
        pandas.DataFrame(dict(zip(COLUMN_TYPES, columns, strict=True)))
        for columns in _read_cells(path)
    ]
    return pandas.concat(parts, ignore_index=True)


def _read_cells(path: Path) -> Iterator[list[list[Any]]]:
    """Read the columns that make a row, some thousands of rows at a time.

    Words that recur are kept once.
    """
    for batch in _read_batches(path, COLUMN_TYPES):
        words: dict[str, str] = {}
        yield [
            (
                [math.nan if cell is None else cell for cell in column.to_pylist()]
                if kind is float
                else _read_words(column, words)
            )
            for column, kind in zip(batch, COLUMN_TYPES.values(), strict=True)
        ]


def count_rows(path: Path) -> int:
    """Return how many rows a table of scenes has."""
    if path.suffix == ".parquet":
        import pyarrow.parquet as pq

        return int(pq.read_metadata(path).num_rows)
    return sum(len(column) for (column,) in _read_batches(path, ["scene"]))


def _read_batches(path: Path, columns: Iterable[str]) -> Iterator[list[Any]]:
    """Read columns of Arrow, some thousands of rows at a time.

    Texts are columns of indices and words, as a word may be long and recur.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq
    from pyarrow import csv

    names = list(columns)
    texts = [name for name in names if COLUMN_TYPES[name] is not float]
    with ExitStack() as files:
        if path.suffix == ".parquet":
            table = files.enter_context(pq.ParquetFile(path, read_dictionary=texts))
            batches = table.iter_batches(BATCH_ROWS, columns=names)
        else:
            word = pa.dictionary(pa.int32(), pa.string())
            kinds = {name: word if name in texts else pa.float64() for name in names}
            wanted = csv.ConvertOptions(column_types=kinds, include_columns=names)
            lines = csv.ParseOptions(newlines_in_values=True)
            batches = files.enter_context(csv.open_csv(path, None, lines, wanted))
        for batch in batches:
            yield [batch.column(name) for name in names]


def _read_words(column: Any, words: dict[str, str]) -> list[str]:
    known = []
    for word in column.dictionary.to_pylist():
        if len(word) > LONGEST_CELL:
            raise ValueError(f"a cell of {len(word)} characters")
        if word not in words:
            words[word] = sys.intern(escape_controls(read_cell_text(word)))
        known.append(words[word])
    return [known[index] for index in column.indices.to_pylist()]
