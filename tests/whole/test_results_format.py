"""docs/results.md: its columns are those of the file, and its snippets run."""

import dataclasses
import re

from pytest import MonkeyPatch, fixture, importorskip, mark

from fourbar import Motion, solve
from fourbar.effects import PinFriction
from fourbar.quantities import LINE_QUANTITIES, QUANTITIES
from fourbar_validation.cli import status
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.compare.rows import FORMULAS, RESULT_COLUMNS, Row
from fourbar_validation.engines.environments import choose_engines
from fourbar_validation.engines.mujoco.shipped import QUANTITY as SHIPPED
from fourbar_validation.engines.registry import (
    ENGINES,
    HARD_ENGINES,
    WORK,
    load_further,
)
from fourbar_validation.regression.changes import WHOLE_ENGINE
from fourbar_validation.regression.record import ACCEPTED, find_baseline
from fourbar_validation.run.judge import judge
from fourbar_validation.run.released import FORWARD, RELEASED_ERRORS
from fourbar_validation.run.run import Plan, run
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import Random
from tests.support.checkout import find_lines, read
from tests.support.here import judge_here
from tests.support.scenes import crank_rocker

PAGE = read("docs/results.md")
OF_A_SCENE = ("assembled", "undecided", "torque_inertia", "drive_force_inertia")
"""Of every engine, besides what it says of positions and of the linkage."""
TYPES = {"string": str, "double": float, "boolean": bool}


@fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("run") / "results"
    with MonkeyPatch.context() as monkeypatch:
        judge_here(monkeypatch)
        suite = Random(8, 1, tuple(DrawnType))
        run(Plan(suite, choose_engines("free-body"), workers=1, drawn=False), out)
    return out


def test_every_column_is_described_with_its_type():
    described = dict(find_lines(r"^\| `(\w+)` \| (string|double|boolean) \|", PAGE))
    assert tuple(described) == RESULT_COLUMNS
    assert {field.name: field.type for field in dataclasses.fields(Row)} == {
        k: TYPES[t] for k, t in described.items()
    }


def test_every_quantity_stands_in_the_row_of_its_stage_with_its_unit():
    table = PAGE.partition("| stage | quantities and units |")[2].partition("\n\n")[0]
    described = {
        (stage, name, unit)
        for stage, groups in find_lines(r"^\| (\w+) \| (.+) \|$", table)
        for names, unit in re.findall(r"((?:`\w+`(?:, )?)+) ([^`;]+)", groups)
        for name in re.findall(r"`(\w+)`", names)
    }
    assert described == {
        (q.stage or "commanded", q.name, q.unit + ", vector" * (q.kind == "vector"))
        for q in QUANTITIES
    }


def test_every_engine_is_described():
    table = PAGE.partition("## The engines")[2].partition("## The quantities")[0]
    described = find_lines(r"^\| `([\w-]+)` \| .+ \|$", table)
    assert sorted(described) == sorted(["engine", *WORK, *FORWARD])
    names = {engine.name for engine in (*ENGINES, *load_further(), *HARD_ENGINES)}
    assert names | {FORMULAS} == set(WORK)


@mark.slow
def test_every_quantity_of_a_scene_is_described(results):
    table = PAGE.partition("## Quantities of a scene")[2].partition("## Queries")[0]
    described = find_lines(r"^\| `([\w ]+)` \| [^|]+ \| .+ \|$", table)
    of_positions = {q.name for q in QUANTITIES}
    rows = [
        row
        for file in (
            results / "results.csv",
            find_baseline(ACCEPTED) / "results.parquet",
        )
        for row in read_columns(file)
    ]
    rows += judge("whole range", crank_rocker(Motion(None, 10.0)), []).rows
    identities = {row.quantity for row in rows if row.engine == FORMULAS}
    of_engines = {*WHOLE_ENGINE, *RELEASED_ERRORS, SHIPPED, *OF_A_SCENE}
    assert set(described) == (identities | of_engines) - of_positions
    assert {row.quantity for row in rows} <= {*described, *of_positions}


def test_a_solution_has_the_shapes_of_the_table_and_no_other_quantity():
    solution = solve(crank_rocker(effects=(PinFriction.at(A=(0.1, 0.01)),)), "error")
    for q in QUANTITIES:
        values = getattr(solution, q.name)
        assert (values is None) == (q.name == "time" or q.name in LINE_QUANTITIES)
        assert values is None or values.shape == (
            (len(solution), 2) if q.kind == "vector" else (len(solution),)
        )


def test_the_parquet_file_holds_the_rows_of_the_table(results):
    import pyarrow.parquet as pq

    parquet = results / "results.parquet"
    assert pq.ParquetFile(parquet).num_row_groups == 1  # of 100 000 rows each
    kept, table = (
        [*map(repr, read_columns(file))] for file in (parquet, results / "results.csv")
    )
    assert kept == table


@fixture
def beside_accepted(results, monkeypatch):
    """Where the page's programs stand: the run beside it is accepted."""
    monkeypatch.chdir(results.parent)
    assert status(["accept", "results"]) == 0


@mark.usefixtures("beside_accepted")
def test_the_pandas_snippet_runs(capsys):
    rows, accepted = re.findall("```python\n(.*?)```", PAGE, re.DOTALL)
    exec(rows, {})
    printed = capsys.readouterr().out
    assert "free-body" in printed and "0 of " in printed
    names = {}
    exec(accepted, names)
    assert "free-body" in capsys.readouterr().out
    assert not len(names["failing"]) and len(names["times"])


@mark.usefixtures("beside_accepted")
def test_the_sql_runs():
    duckdb = importorskip("duckdb", reason="DuckDB is optional")
    rows, accepted = re.findall("```sql\n(.*?)```", PAGE, re.DOTALL)
    assert ("free-body", "torque") in {row[:2] for row in duckdb.sql(rows).fetchall()}
    assert (
        len(duckdb.sql(accepted.replace("mujoco-simulated", "free-body")).fetchall())
        == 1
    )
