"""The results of a run as results.csv and, for pandas and DuckDB, results.parquet.

The columns are those of `fourbar_validation.compare.rows.Row`, sorted by scene, engine,
setting and quantity; both files are written as the tasks are read.
"""

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

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
    """Writer of the rows of both files, as `write_tables` opens them."""

    def __init__(self, out: Path, text: IO[str], columns: Any) -> None:
        self.out = out
        self.first_lines: dict[str, int] = {}
        """The line of results.csv at which each scene starts."""
        self._line = 2
        self._text = text
        self._columns = columns
        self._waiting: list[Any] = []
        """Arrow tables that wait to be a row group. Rows themselves would take five
        times the memory.
        """

    def add(self, rows: Sequence[Row]) -> None:
        """Add the rows that come next, and keep them until they fill a row group."""
        import pyarrow as pa

        for row in rows:
            if self._line <= CSV_ROWS:
                self.first_lines.setdefault(row.scene, self._line)
            self._line += 1
        schema = self._columns.schema
        # NaN is no number: as null no greatest error is NaN by it
        columns = [
            pa.array([getattr(row, name) for row in rows], kind, from_pandas=True)
            for name, kind in zip(RESULT_COLUMNS, schema.types, strict=True)
        ]
        self._waiting.append(pa.table(columns, schema=schema))
        if self._line <= CSV_ROWS:
            with name_file(self.out / "results.csv"):
                self._text.write(write_rows(rows).partition("\n")[2])
        if sum(map(len, self._waiting)) >= GROUP_ROWS:
            self.write_group()

    def write_group(self) -> None:
        """Write the rows that wait as a row group."""
        import pyarrow as pa

        if self._waiting:
            group = pa.concat_tables(self._waiting).combine_chunks()
            with name_file(self.out / "results.parquet"):
                self._columns.write_table(group)
            self._waiting.clear()

    def finish(self) -> None:
        """Write the last rows; a text that is too long is emptied, and not kept."""
        self.write_group()
        if self._line > CSV_ROWS:
            self._text.truncate(0)


@contextmanager
def write_tables(out: Path) -> Iterator[ResultsWriter]:
    """Write both files, which are complete at the end of a `with`.

    Neither file exists if the writer fails.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds: dict[Any, Any] = {str: pa.string(), float: pa.float64(), bool: pa.bool_()}
    schema = pa.schema([(field.name, kinds[field.type]) for field in fields(Row)])
    with (
        draft_file(out / "results.csv") as text,
        draft_file(out / "results.parquet") as table,
        pq.ParquetWriter(table, schema) as columns,
        text.open("w", encoding="utf-8", newline="") as lines,
    ):
        lines.write(write_rows([]))
        writer = ResultsWriter(out, lines, columns)
        yield writer
        writer.finish()


@contextmanager
def draft_file(path: Path) -> Iterator[Path]:
    """Yield where a file, however long, is drafted.

    The file is in place once it is complete, and is removed if it is empty.
    """
    draft = path.with_name(f".{path.name}.part")
    with name_file(path):
        try:
            yield draft
            if draft.stat().st_size:
                os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)


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
    """Read the columns that make a row, some thousands of rows at a time."""
    for batch in _read_batches(path, COLUMN_TYPES):
        yield [
            column.to_numpy(zero_copy_only=False).tolist()
            if kind is float
            else _read_words(column)
            for column, kind in zip(batch, COLUMN_TYPES.values(), strict=True)
        ]


def _read_words(column: Any) -> list[str]:
    """Read the cells of a column of indices and words; words that recur are kept once.

    Raises ValueError for a cell that is longer than LONGEST_CELL.
    """
    words = column.dictionary.to_pylist()
    if max(map(len, words), default=0) > LONGEST_CELL:
        raise ValueError("a cell is too long")
    words = [sys.intern(escape_controls(read_cell_text(word))) for word in words]
    return [words[index] for index in column.indices.to_pylist()]


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
    if path.suffix == ".parquet":
        with pq.ParquetFile(path, read_dictionary=texts) as table:
            for batch in table.iter_batches(BATCH_ROWS, columns=names):
                yield [batch.column(name) for name in names]
        return
    word = pa.dictionary(pa.int32(), pa.string())
    kinds = {name: word if name in texts else pa.float64() for name in names}
    wanted = csv.ConvertOptions(column_types=kinds, include_columns=names)
    lines = csv.ParseOptions(newlines_in_values=True)
    with csv.open_csv(path, None, lines, wanted) as batches:
        yield from (batch.columns for batch in batches)
