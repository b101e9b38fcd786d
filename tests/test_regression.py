"""What changed since the accepted state: real changes distinguished from round-off, the surroundings first."""

import json
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from fourbar.errors import InputError
from validation.cli import status
from validation.compare.columns import write_columns
from validation.compare.rows import AGREES, FAILS, Row, write_results
from validation.compare.tolerance import EPS
from validation.regression import record, render
from validation.regression.accept import accept_command, compare
from validation.regression.changes import Kind, differences
from validation.regression.record import About, about, read_run, write_about

ROW = Row("scene", "engine", "exact", "torque", 1e-15, 1e-14, AGREES, "equivalence", 1.0, 1.0)
HERE = about({"engine": 1.0}, "suite")


def kinds(old: list[Row], new: list[Row]) -> list[Kind]:
    return [change.kind for change in differences((HERE, old), (HERE, new)).changes]


@pytest.mark.parametrize(
    ("changed", "kind"),
    [
        ({}, Kind.SAME),
        ({"error": 9e-15}, Kind.ROUND_OFF),
        ({"error": 1e-10, "allowed": 1e-9}, Kind.WORSE),
        ({"error": math.nan, "verdict": FAILS}, Kind.VERDICT_WORSE),
        ({"quantity": "F12"}, Kind.GONE),
    ],
)
def test_each_kind_of_change(changed: dict[str, object], kind: Kind) -> None:
    assert kind in kinds([ROW], [replace(ROW, **changed)])  # type: ignore[arg-type]


def test_round_off_grows_with_the_condition() -> None:
    hard = replace(ROW, error=1e-9, condition=1e-6)
    assert kinds([hard], [replace(hard, error=5e-9)]) == [Kind.ROUND_OFF]
    assert kinds([replace(hard, condition=1.0)], [replace(hard, error=5e-9, condition=1.0)]) == [Kind.WORSE]
    beyond = 60 * EPS / 1e-6
    assert kinds([hard], [replace(hard, error=1e-9 + beyond)]) == [Kind.WORSE]


def test_better_and_new_rows_are_no_regression_but_a_new_failure_is() -> None:
    simulated = replace(ROW, error=4e-6, allowed=1e-5)
    found = differences((HERE, [simulated]), (HERE, [replace(simulated, error=1e-6), replace(ROW, quantity="F12")]))
    assert {change.kind for change in found.changes} == {Kind.BETTER, Kind.NEW}
    assert not found.regressions
    failing = replace(ROW, quantity="F12", verdict=FAILS)
    assert differences((HERE, [ROW]), (HERE, [ROW, failing])).regressions


def test_other_versions_are_reported_first() -> None:
    other = About({**HERE.versions, "mujoco": "3.3.7"}, HERE.machine, HERE.settings)
    found = differences((other, [ROW]), (HERE, [ROW]))
    assert [what for what, _, _ in found.surroundings] == ["mujoco"]
    assert render.text(found).startswith("mujoco: 3.3.7 -> ")


def save(folder: Path, rows: list[Row]) -> Path:
    folder.mkdir()
    write_results(rows, folder / "results.csv")
    write_about(HERE, folder)
    return folder


def test_command_writes_every_form_and_leaves_with_the_status(tmp_path: Path) -> None:
    hostile = replace(ROW, scene="<script>alert(1)</script>|`x`")
    old = save(tmp_path / "old", [ROW, hostile])
    new = save(tmp_path / "new", [replace(ROW, error=1e-9), replace(hostile, error=1e-9)])
    forms = [f"--{form}={tmp_path / form}" for form in ("markdown", "html", "junit")]
    runner = CliRunner()
    result = runner.invoke(compare, [str(old), str(new), *forms], standalone_mode=False)
    assert result.return_value == 1
    assert "2 regressions" in result.output
    assert "<script>" not in (tmp_path / "html").read_text()
    assert "<script>" not in (tmp_path / "markdown").read_text()
    suites = ET.parse(tmp_path / "junit").getroot()
    assert len(suites.findall(".//failure")) == 2
    same = runner.invoke(compare, [str(old), str(old)], standalone_mode=False)
    assert same.return_value == 0
    assert "No regression" in same.output


def test_accept_records_the_run_under_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "BASELINES", tmp_path / "baselines")
    run = save(tmp_path / "run", [ROW])
    runner = CliRunner()
    assert runner.invoke(accept_command, [str(run), "--as", "mine"]).exit_code == 0
    kept = tmp_path / "baselines" / "mine"
    assert read_run(kept) == read_run(run)
    assert json.loads((kept / "record.json").read_text())["machine"] == HERE.machine
    result = runner.invoke(compare, ["mine", str(run)], standalone_mode=False)
    assert result.return_value == 0
    assert runner.invoke(accept_command, [str(run), "--as", "../out"]).exit_code != 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--type", "crank-rocker"], "say --random N too"),
        (["--seed", "3"], "say --random N too"),
        (["--random", "3", "--type", "crank"], "crank-rocker, drag-link"),
        (["--engines", ","], "must be among pinocchio-inverse"),
        (["--against", "no-such-run"], "must be a folder with results.csv"),
        (["--against", "accepted", "--python", "python"], "cannot be combined with --python"),
        (["--junit", "changes.xml"], "say --against BASELINE or --python PATH too"),
        (["--name", "coupler=link"], "names a body or site of --mjcf"),
    ],
)
def test_options_of_a_run_that_would_do_nothing_are_refused_before_it(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status(["run", *arguments, "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err.strip()
    assert message.startswith("error: ") and words in message and "\n" not in message
    assert not (tmp_path / "out").exists()


def test_what_stood_for_a_failure_and_is_gone_is_no_regression() -> None:
    alarm = replace(ROW, quantity="watch", verdict=FAILS, error=math.nan)
    assert kinds([ROW, alarm], [ROW]) == [Kind.SAME, Kind.GONE_FAILURE]
    assert not differences((HERE, [ROW, alarm]), (HERE, [ROW])).regressions
    failed = replace(ROW, verdict=FAILS)
    assert differences((HERE, [failed]), (HERE, [])).regressions  # a comparison that failed and is not made any more


def test_another_python_without_the_libraries_is_one_line_and_status_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = tmp_path / "python"
    bare.write_text("#!/bin/sh\necho \"ModuleNotFoundError: No module named 'click'\" >&2\nexit 1\n")
    bare.chmod(0o755)
    earlier = tmp_path / "out" / "elsewhere" / "results.csv"
    earlier.parent.mkdir(parents=True)
    earlier.write_text("of an earlier run")
    scene = Path(__file__).parent.parent / "models" / "crank_rocker.toml"
    assert status(["run", str(scene), "--python", str(bare), "--out", str(tmp_path / "out")]) == 3
    message = capsys.readouterr().err.strip()
    assert "did not run there: ModuleNotFoundError: No module named 'click' (it needs" in message
    assert "\n" not in message


def test_a_run_with_too_many_rows_for_a_text_is_read_from_its_columns(tmp_path: Path) -> None:
    rows = [ROW, replace(ROW, quantity="watch", error=math.nan, verdict=FAILS)]
    write_columns(iter([rows]), tmp_path)
    write_about(HERE, tmp_path)
    from_text = read_run(tmp_path)
    (tmp_path / "results.csv").unlink()
    from_columns = read_run(tmp_path)
    assert from_columns[0] == from_text[0] and repr(from_columns[1]) == repr(from_text[1])
    assert not differences(from_text, from_columns).regressions
    (tmp_path / "results.parquet").write_bytes(b"no columns")
    with pytest.raises(InputError, match="is not a table written by"):
        read_run(tmp_path)
