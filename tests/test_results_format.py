"""docs/results-format.md: its columns are those of the file, and its snippets run."""

import dataclasses
import math
import re
from pathlib import Path

import pytest

from validation.report.summary import SCENES_SHOWN
from validation.results import COLUMNS, Row, from_csv
from validation.run import CHUNK, run
from validation.suite.columns import read_columns
from validation.suite.random import LinkageType
from validation.suite.scenes import Random
from validation.suite.selection import chosen

PAGE = (Path(__file__).parents[1] / "docs" / "results-format.md").read_text()
TYPES = {"string": str, "double": float, "boolean": bool}


def block(language: str) -> str:
    found = re.search(f"```{language}\n(.*?)```", PAGE, re.DOTALL)
    assert found is not None
    return found[1]


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    list(run(Random(SCENES_SHOWN + 5, 1, tuple(LinkageType)), folder / "results", chosen("free-body"), workers=1))
    return folder


def test_every_column_is_described_with_its_type() -> None:
    described = dict(re.findall(r"^\| `(\w+)` \| (string|double|boolean) \|", PAGE, re.MULTILINE))
    assert tuple(described) == COLUMNS
    assert {field.name: field.type for field in dataclasses.fields(Row)} == {k: TYPES[t] for k, t in described.items()}


def test_the_parquet_file_holds_the_rows_of_the_table(results: Path) -> None:
    import pyarrow.parquet as pq

    file = pq.ParquetFile(results / "results" / "results.parquet")
    assert file.num_row_groups == math.ceil((SCENES_SHOWN + 5) / CHUNK[False])
    kept = list(read_columns(results / "results" / "results.parquet"))
    table = from_csv(results / "results" / "results.csv")
    assert len(kept) == len(table)
    for one, other in zip(kept, table, strict=True):
        for ours, theirs in zip(dataclasses.astuple(one), dataclasses.astuple(other), strict=True):
            assert ours == theirs or (math.isnan(ours) and math.isnan(theirs))


def test_the_pandas_snippet_runs(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pandas", reason="pandas is optional")
    monkeypatch.chdir(results)
    exec(block("python"), {})
    told = capsys.readouterr().out
    assert "free-body" in told
    assert "0 of " in told


def test_the_sql_runs(results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    duckdb = pytest.importorskip("duckdb", reason="DuckDB is optional")
    monkeypatch.chdir(results)
    assert ("free-body", "torque") in {row[:2] for row in duckdb.sql(block("sql")).fetchall()}
