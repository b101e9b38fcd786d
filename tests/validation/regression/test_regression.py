"""What changed since the accepted state.

Real changes distinguished from round-off, the surroundings first.
"""

import ast
import contextlib
import csv
import errno
import html
import json
import math
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import fourbar
from fourbar.errors import InputError
from fourbar_validation.cli import status
from fourbar_validation.compare.columns import ResultsWriter
from fourbar_validation.compare.rows import AGREES, FAILS, REFUSES, Row
from fourbar_validation.compare.tolerance import (
    EQUIVALENCE,
    FULL_ACCURACY,
    ErrorBound,
)
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.guests import STATED_BY_THE_ENGINE
from fourbar_validation.engines.limits import BOUNDARIES
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression import record, render, rules
from fourbar_validation.regression.accept import accept_command, compare_command
from fourbar_validation.regression.changes import Kind, compare_runs
from fourbar_validation.regression.history import (
    HISTORY,
    collect_history,
    find_since,
    read_history,
    summarise,
)
from fourbar_validation.regression.record import (
    NOTHING_KNOWN,
    About,
    describe_run,
    find_baseline,
    open_run,
    write_about,
)
from fourbar_validation.regression.scenes import describe_changes
from fourbar_validation.report.junit import list_cases
from fourbar_validation.run.store import Store
from fourbar_validation.scenes.suites import read_scene_files
from tests.support.another_machine import CORES, ROOT, environment, why_not
from tests.support.here import judge_here
from tests.support.runs import HERE, compare_rows, read_run, save_run

WithRows = tuple[About, list[Row]]
ROW = Row(
    "scene", "engine", "exact", "torque", 1e-15, 1e-14, AGREES, "equivalence", 1.0, 1.0
)


def test_other_versions_are_reported():
    older = About({**HERE.versions, "mujoco": "3.3.7"}, HERE.machine, HERE.settings)
    found = compare_rows((older, [ROW]), (HERE, [ROW]))
    assert [what for what, _, _ in found.surroundings] == ["mujoco"]
    assert "\nmujoco: 3.3.7 -> " in "\n" + render.write_differences(found)


MODEL = [str(Path(__file__).parents[3] / "models" / "crank_rocker.toml")]


def test_command_writes_every_form_and_leaves_with_the_status(tmp_path):
    hostile = replace(ROW, scene="<script>alert(1)</script>|`x`")
    old = save_run(tmp_path / "old", [ROW, hostile])
    new = save_run(
        tmp_path / "new", [replace(ROW, error=1e-9), replace(hostile, error=1e-9)]
    )
    forms = [f"--{form}={tmp_path / form}" for form in ("markdown", "html", "junit")]
    runner = CliRunner()
    process = runner.invoke(
        compare_command,
        [str(old), str(new), *forms],
        standalone_mode=False,
    )
    assert process.return_value == 1
    assert "2 regressions" in process.output
    assert "<script>" not in (tmp_path / "html").read_text()
    assert "<script>" not in (tmp_path / "markdown").read_text()
    suites = ET.parse(tmp_path / "junit").getroot()
    assert len(suites.findall(".//failure")) == 2
    same = runner.invoke(compare_command, [str(old), str(old)], standalone_mode=False)
    assert same.return_value == 0
    assert "No regression" in same.output


def test_accept_keeps_the_run_next_to_the_results_or_in_a_stated_folder(tmp_path):
    run = save_run(tmp_path / "run", [ROW], "scene,engine,-,1,1,3.0\n")
    runner = CliRunner()
    for options, kept in (
        ([], tmp_path / "accepted"),
        (["--to", str(tmp_path / "mine")], tmp_path / "mine"),
    ):
        assert runner.invoke(accept_command, [str(run), *options]).exit_code == 0
        assert read_run(kept) == read_run(run)
        assert dict(open_run(kept).times()) == {"scene": [("engine", 3.0)]}
        assert json.loads((kept / "record.json").read_text())["machine"] == HERE.machine
        assert (
            runner.invoke(
                compare_command,
                [str(kept), str(run)],
                standalone_mode=False,
            ).return_value
            == 0
        )
    assert runner.invoke(accept_command, [str(run), "--to", str(run)]).exit_code != 0
    assert (
        find_baseline("accepted").parent == Path(record.__file__).parent
    )  # of this project, where no such folder is


def damaged(folder):
    """A run's folder damaged in one place after the other.

    The file that is to blame, and words of the message.
    """
    files = {path: path.read_bytes() for path in folder.iterdir()}
    table, times, about = (
        folder / name for name in ("results.csv", "timings.csv", "record.json")
    )
    lines = files[table].splitlines(keepends=True)
    rows = len(lines) - 1
    for words, damage in {
        f"{rows - 2} rows of {rows}": b"".join(lines[:-2]),
        f"{2 * rows} rows of {rows}": b"".join([*lines, *lines[1:]]),
        f"{rows - 1} rows of {rows}": b"".join(
            line for line in lines if b"engine 1" not in line
        ),
        f"{rows} rows of {rows}, and not the SHA-256": (
            files[table].replace(b"1e-15", b"1e-16")
        ),
        "no rows that can be read": b"\xff",
    }.items():
        table.write_bytes(damage)
        yield table, words
    table.write_bytes(files[table])
    times.write_bytes(files[times].replace(b"3.0", b"3.1"))
    yield times, "1 rows of 1"
    times.unlink()
    yield times, "is missing"
    times.write_bytes(files[times])
    (folder / "results.parquet").write_bytes(b"")
    yield folder / "results.parquet", "is not of this run"
    (folder / "results.parquet").unlink()
    for old, new in (
        (b'"K": "50.0"', b'"K": "51.0"'),
        (b'"sha256"', b'"sha257"'),
        (b'"rows"', b'"raws"'),
        (b'"scenes"', b'"scones"'),
        (HERE.machine.encode(), b"another machine"),
    ):
        assert old in files[about]
        about.write_bytes(files[about].replace(old, new))
        yield about, "is damaged"
    about.write_bytes(files[about])


def test_a_damaged_run_is_named_and_nothing_is_written(tmp_path, capsys):
    rows = [replace(ROW, engine=f"engine {k}") for k in range(4)]
    good, run = (
        save_run(tmp_path / name, rows, "scene,engine,-,1,1,3.0\n")
        for name in ("good", "run")
    )
    kept = tmp_path / "kept"
    assert status(["accept", str(good), "--to", str(kept)]) == 0
    before = {path: path.read_bytes() for path in kept.iterdir()}
    commands = {
        "RESULTS": ["accept", str(run), "--to", str(kept)],
        "OLD": ["compare", str(run), str(good)],
        "NEW": ["compare", str(good), str(run)],
    }
    capsys.readouterr()
    for file, words in damaged(run):
        for key, command in commands.items():
            assert status(command) == 2
            out, message = capsys.readouterr()
            assert (
                not out
                and message.startswith(f"error: {key} = '{file}': ")
                and words in message
            )
            assert message.count("\n") == 1
        assert {path: path.read_bytes() for path in kept.iterdir()} == before
    assert [status(command) for command in commands.values()] == [0, 0, 0]


@pytest.mark.slow
def test_a_damaged_table_is_one_line_and_nothing_is_written(tmp_path, capsys):
    run, kept = save_run(tmp_path / "run", [ROW]), tmp_path / "kept"
    assert status(["accept", str(run), "--to", str(kept)]) == 0
    file, table = kept / HISTORY, (kept / "results.csv").read_bytes()
    contents = file.read_bytes()
    run = save_run(tmp_path / "later", [replace(ROW, error=2e-15)])
    another = replace(HERE, date="later")
    write_about(another, run)
    with ResultsWriter(tmp_path) as columns:
        columns.add([ROW])
    for damage in (
        b"",
        b"no columns",
        contents[:-100],
        contents[:300] + b"\0" + contents[301:],
        (tmp_path / "results.parquet").read_bytes(),
    ):
        file.write_bytes(damage)
        capsys.readouterr()
        assert status(["accept", str(run), "--to", str(kept)]) == 2, damage[:20]
        line = capsys.readouterr().err
        assert (
            line
            == f"error: --to = '{file}': is damaged, or no table written by `accept`\n"
        )
        assert (
            kept / "results.csv"
        ).read_bytes() == table and file.read_bytes() == damage
    for place in range(
        4, len(contents)
    ):  # a bit of a number, which the checksum of its page shows
        damage = contents[:place] + bytes([contents[place] ^ 1]) + contents[place + 1 :]
        with contextlib.suppress(OSError, ValueError):
            if pq.read_table(pa.BufferReader(damage), columns=["error"])[
                "error"
            ].to_pylist() != [ROW.error]:
                break
    file.write_bytes(damage)
    assert status(["accept", str(run), "--to", str(kept)]) == 2


def test_what_has_no_record_of_its_rows_is_compared_with_a_note_and_not_accepted(
    tmp_path, capsys
):
    good, bare = (save_run(tmp_path / name, [ROW]) for name in ("good", "bare"))
    (bare / "record.json").unlink()
    assert status(["compare", str(bare), str(good)]) == 0
    assert f"{bare / 'results.csv'}: not verified" in capsys.readouterr().out
    assert status(["accept", str(bare)]) == 2 and not (tmp_path / "accepted").exists()


def test_what_is_empty_unfinished_or_fails_is_not_accepted(tmp_path):
    fails, refuses = (
        replace(ROW, verdict=FAILS, error=1.0),
        replace(ROW, verdict=REFUSES),
    )
    folders = {
        name: save_run(tmp_path / name, rows)
        for name, rows in (("empty", []), ("good", [ROW]), ("bad", [fails]))
    }
    folders |= {
        name: save_run(tmp_path / name, [row])
        for name, row in (("unfinished", ROW), ("nothing", refuses))
    }
    (folders["unfinished"] / "run.json").write_text("{}")
    reasons = {
        "empty": "at least one comparison",
        "unfinished": "a run that was finished",
        "bad": "--even-failing: 1 comparisons fail",
        "nothing": "--even-failing: nothing was compared",
    }
    for name, reason in reasons.items():
        with pytest.raises(InputError, match=reason):
            CliRunner().invoke(
                accept_command,
                [str(folders[name])],
                standalone_mode=False,
                catch_exceptions=False,
            )
        assert not (tmp_path / "accepted").exists()
    for name in ("empty", "unfinished"):
        with pytest.raises(InputError, match=reasons[name]):
            read_run(folders[name])
    for name in ("bad", "nothing"):
        assert status(["accept", str(folders[name]), "--even-failing"]) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--type", "crank-rocker"], "say --random N too"),
        (["--seed", "3"], "say --random N too"),
        (["--random", "3", "--type", "crank"], "crank-rocker, drag-link"),
        (["--engines", ","], "must be among pinocchio-inverse"),
        (
            ["--against", "no-such-run"],
            "error: --against = 'no-such-run': must be a folder with results.csv",
        ),
        (["--html", "changes.html"], "say --against BASELINE too"),
        (["a.toml", "--random", "3"], "leave out the scene files"),
        (["--suite", "hard", "--random", "3"], "leave out scene files and --random"),
    ],
)
def test_options_of_a_run_that_would_do_nothing_are_refused_before_it(
    arguments, words, tmp_path, capsys
):
    assert status(["run", *arguments, "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err.strip()
    assert message.startswith("error: ") and words in message and "\n" not in message
    assert not (tmp_path / "out").exists()


def test_a_run_with_too_many_rows_for_a_text_is_read_from_its_columns(tmp_path):
    rows = [ROW, replace(ROW, quantity="watch", error=math.nan, verdict=FAILS)]
    with ResultsWriter(tmp_path) as columns:
        columns.add(rows)
    write_about(HERE, tmp_path)
    from_text = read_run(tmp_path)
    assert (
        pq.read_table(tmp_path / "results.parquet")["error"].null_count == 1
    )  # no greatest error is NaN by it
    (tmp_path / "results.csv").unlink()
    write_about(HERE, tmp_path)
    from_columns = read_run(tmp_path)
    assert from_columns[0] == from_text[0] and repr(from_columns[1]) == repr(
        from_text[1]
    )
    assert not compare_rows(from_text, from_columns).regressed
    (tmp_path / "results.parquet").write_bytes(b"no columns")
    with pytest.raises(InputError, match="is damaged: no rows that can be read of 2"):
        read_run(tmp_path)
    (tmp_path / "record.json").unlink()
    with pytest.raises(InputError, match="is not a table written by"):
        read_run(tmp_path)


@pytest.mark.slow
def test_of_two_long_runs_every_row_is_counted_and_the_worst_are_listed(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("fourbar_validation.compare.columns.GROUP_ROWS", 60)
    for module in (
        "fourbar_validation.compare.columns",
        "fourbar_validation.regression.accept",
    ):
        monkeypatch.setattr(f"{module}.CSV_ROWS", 100)
    monkeypatch.setattr("fourbar_validation.compare.columns.BATCH_ROWS", 60)
    scenes, kept = 1000, 5
    for name, grown in (("old", 1.0), ("new", 1e3)):
        (tmp_path / name).mkdir()
        with ResultsWriter(tmp_path / name) as columns:
            for k in range(scenes):
                row = replace(
                    ROW,
                    scene=f"random-0-{k:09d}",
                    condition=1e-3,
                    error=1e-9 * (1.0 + k * (grown - 1.0)),
                )
                columns.add([replace(row, quantity="F12", error=1e-15), row])
        write_about(HERE, tmp_path / name)
        assert (
            not (tmp_path / name / "results.csv").exists()
            and len(columns.first_lines) < 60
        )
    before, after = (open_run(tmp_path / name) for name in ("old", "new"))
    changes = compare_runs((HERE, before.frame()), (HERE, after.frame()))
    assert changes.rows == 2 * scenes
    assert changes.regressed == changes.kinds[Kind.WORSE] == scenes - 1
    assert [name[-3:] for name in changes.of(Kind.WORSE).scene[:3]] == [
        "999",
        "998",
        "997",
    ]
    monkeypatch.setattr("fourbar_validation.regression.render.MOST_PASSING_CASES", kept)
    cases = ET.fromstring(render.write_junit_of_changes(changes))
    assert (
        cases.findall(".//testcase")[-1].get("name")
        == f"{2 * (scenes - kept)} rows more: see results.parquet"
    )
    arguments = ["compare", str(tmp_path / "old"), str(tmp_path / "new")]
    assert [
        status(arguments),
        status([*arguments, "--only", "random-0-000000000"]),
    ] == [1, 0]
    kept_as = tmp_path / "kept"
    assert status(["accept", str(tmp_path / "new"), "--to", str(kept_as)]) == 0
    assert {path.name for path in kept_as.iterdir()} == {
        "record.json",
        "results.parquet",
    }  # too long for a history
    assert status(["compare", str(kept_as), str(tmp_path / "new")]) == 0


def test_a_part_of_a_long_run_compares_with_its_part(tmp_path, capsys):
    rows = [replace(ROW, scene=f"scene {k:03d}") for k in range(80)]
    all_rows, some = (
        save_run(tmp_path / "whole", rows),
        save_run(tmp_path / "some", [rows[7], rows[70]]),
    )
    assert status(["compare", str(all_rows), str(some)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Not run: scene scene 000 (1 row)"
    assert lines[50] == "Not run: 28 more (28 rows)"
    assert " in 2 of 80 rows: 78 not run, 2 same" in lines[-1]
    part = ["--only", "scene 007, scene 070"]
    assert status(["compare", str(all_rows), str(some), *part]) == 0
    verdict = capsys.readouterr().out.splitlines()[-1]
    assert verdict.startswith(f"No regression against {all_rows} of {HERE.date[:10]}")
    assert " in 2 rows: 2 same" in verdict


def disagreeing(worse):
    """Two runs of three scenes by three exact engines, a simulation and an identity.

    `worse`: engine and quantity.
    """
    names = [
        (engine, quantity)
        for engine in ("one", "two", "three", "sim")
        for quantity in ("F12", "torque")
    ]
    rows = [
        replace(ROW, engine=engine, quantity=quantity)
        for engine, quantity in (*names, ("formulas", "power"))
    ]
    rows = [
        replace(row, setting="RK4 628/rev") if row.engine == "sim" else row
        for row in rows
    ]
    old = [replace(row, scene=scene) for scene in "abc" for row in rows]
    fails = {"verdict": FAILS, "error": 1e-6}
    return old, [
        (
            replace(
                row,
                **fails,
                reason=f"{ord(row.scene)}e-6 where 1e-9 was predicted",
            )  # type: ignore[arg-type]
            if (row.engine, row.quantity) in worse
            else row
        )
        for row in old
    ]


@pytest.mark.parametrize(
    ("worse", "sentence"),
    [
        ({("sim", "F12"), ("sim", "torque")}, "only sim, 3 of 3 scenes"),
        ({("one", "torque"), ("sim", "torque")}, "only one, sim, 3 of 3 scenes"),
        (
            {(engine, "torque") for engine in ("one", "two", "three")}
            | {("formulas", "power")},
            "all engines and the identity disagree: the formulas, 3 of 3 scenes",
        ),
        (
            {(engine, "F12") for engine in ("one", "two", "three")},
            (
                "all engines disagree, and the identities hold: the formulas, or what"
                " all engines are given, 3 of 3 scenes"
            ),
        ),
        (
            {("formulas", "power")},
            (
                "only the identities: the formulas, or what is stated of them, 3 of 3"
                " scenes"
            ),
        ),
    ],
)
def test_the_report_says_who_is_at_fault(worse, sentence):
    old, new = disagreeing(worse)
    changes = compare_rows((HERE, old), (HERE, new))
    assert changes.sentences == [sentence]
    for form in (
        render.write_differences,
        render.write_pull_request_comment,
        render.write_differences_page,
    ):
        assert sentence in html.unescape(form(changes))


def test_rows_that_changed_are_grouped_by_engine_and_cause_the_worst_first():
    old, new = disagreeing({("sim", "F12"), ("sim", "torque"), ("one", "torque")})
    better = [replace(row, error=1e-9) if row.engine == "two" else row for row in old]
    new = [
        (
            replace(row, error=1.0)
            if row.failed and row.engine == "one" and row.scene == "b"
            else row
        )
        for row in new
    ]
    changes_from_better = compare_rows((HERE, better), (HERE, new))
    groups = [
        line
        for line in render.write_differences(changes_from_better).splitlines()
        if "scenes, " in line and "rows (" in line
    ]
    # one cause for all scenes, with the numbers of the worst
    cause = "agrees -> fails: {}e-6 where 1e-9 was predicted".format
    in_a, in_b = cause(ord("a")), cause(ord("b"))
    assert groups == [
        f"Verdict got worse: one, 3 of 3 scenes, 3 rows (torque 3), {in_b}",
        f"Verdict got worse: sim, 3 of 3 scenes, 6 rows (F12 3, torque 3), {in_a}",
        "Better: two, 3 of 3 scenes, 6 rows (F12 3, torque 3)",
    ]
    assert [*changes_from_better.of(Kind.VERDICT_WORSE).iloc[0][:2]] == ["b", "one"]
    assert groups[0].partition(": ")[2] in html.unescape(
        render.write_differences_page(changes_from_better)
    )


SCENE = fourbar.load(Path(__file__).parents[3] / "models" / "crank_rocker.toml")


def made(rows, scenes, engines=("engine",)):
    free_bodies = [Engine(engine, FreeBody, EQUIVALENCE) for engine in engines]
    return (
        describe_run(
            free_bodies,
            "suite",
            {name: describe_changes(s) for name, s in scenes.items()},
        ),
        rows,
    )


def test_a_scene_that_changed_comes_first_and_its_rows_are_not_compared():
    output = replace(SCENE.linkage.output, inertia=0.05)
    heavier = replace(
        SCENE,
        linkage=replace(SCENE.linkage, output=output),
        title="another title",
    )
    before = replace(
        SCENE,
        linkage=replace(SCENE.linkage, output=replace(output, inertia=0.048)),
    )
    other_row, wrong = (
        replace(ROW, scene="other"),
        replace(ROW, error=1e-9, allowed=1e-8),
    )
    old = made([ROW, other_row], {"scene": before, "other": SCENE})
    changes = compare_rows(
        old, made([wrong, other_row], {"scene": heavier, "other": SCENE})
    )
    assert (
        "scene scene: bars.output.inertia 0.048 -> 0.05 kg m^2"
        in render.write_differences(changes).splitlines()
    )
    assert changes.status == 0 and changes.not_compared == [
        "scene scene changed (1 row)"
    ]
    assert compare_rows(
        old, made([replace(wrong, verdict=FAILS), other_row], {"scene": heavier})
    ).regressed
    assert compare_rows(
        made([ROW], {"scene": before}), made([wrong], {"scene": heavier})
    ).nothing
    for form in (render.write_pull_request_comment, render.write_differences_page):
        assert "bars.output.inertia 0.048" in form(changes)


def test_a_renamed_scene_is_found_by_what_it_states(tmp_path, capsys):
    heavier = replace(
        SCENE,
        linkage=replace(
            SCENE.linkage,
            output=replace(SCENE.linkage.output, inertia=0.05),
        ),
    )
    names = (
        {"g": SCENE, "h": heavier, "same": SCENE},
        {"a": heavier, "gate": SCENE, "same": SCENE},
    )
    both = []
    for folder, error, scenes in zip(("old", "new"), (1e-9, 2e-9), names, strict=True):
        stated, rows = made(
            [replace(ROW, scene=name, error=error, allowed=1e-9) for name in scenes],
            scenes,
        )
        both.append(
            str(
                save_run(
                    tmp_path / folder,
                    rows,
                    "".join(f"{n},engine,-,1,1,3.0\n" for n in scenes),
                    stated,
                )
            )
        )
    assert status(["compare", *both]) == 1
    out = capsys.readouterr().out.splitlines()
    assert {"renamed: g -> gate", "renamed: h -> a"} < {*out}
    assert out[-1].startswith(f"3 regressions against {both[0]}")
    assert " in 3 rows: 3 worse." in out[-1]
    for name in ("gate", "h"):
        assert status(["compare", *both, "--only", name]) == 1
        verdict = capsys.readouterr().out.splitlines()[-1]
        assert verdict.startswith("1 regression against") and " in 1 rows" in verdict


def test_what_grew_within_its_allowance_is_shown_and_no_regression():
    """Another kernel of the BLAS turns 3.4e-7 into 5.2e-7 where 1 is allowed.

    A wider allowance excuses nothing.
    """
    shipped = replace(ROW, quantity="as shipped", error=3.4e-7, allowed=1.0)
    changes = compare_rows((HERE, [shipped]), (HERE, [replace(shipped, error=5.2e-7)]))
    assert [*changes.table.kind] == [Kind.GREW] and changes.status == 0
    assert (
        "Grew within its allowance: scene / engine / exact / as shipped"
        in render.write_differences(changes)
    )


@pytest.mark.slow
def test_the_kernels_of_a_run_are_recorded_and_named_where_they_differ():
    """In two fresh processes, one of which takes this CPU for another."""
    code = (
        "from fourbar_validation.report.machine import find_kernels;"
        " print(find_kernels())"
    )
    possible = [core for core in CORES if why_not(core) is None]
    if not possible:
        pytest.skip("this CPU can pass for no other")
    printed = [
        subprocess.check_output(
            [sys.executable, "-c", code],
            cwd=ROOT,
            env=os.environ | more,
            text=True,
        )
        for more in ({}, environment(possible[0]))
    ]
    first, second = map(ast.literal_eval, printed)
    assert set(first) == {"cpu_features", "blas_kernel"} and first != second
    old, new = (
        replace(HERE, versions=HERE.versions | kernels) for kernels in (first, second)
    )
    text = render.write_differences(compare_rows((old, [ROW]), (new, [ROW])))
    assert any(f"{name}: {first[name]} -> {second[name]}" in text for name in first)
    assert set(first) <= set(HERE.versions)


def test_more_positions_and_other_settings_are_named_so():
    finer = replace(
        SCENE,
        motion=SCENE.motion.replace(angle=fourbar.Sweep(0.0, 2.0 * math.pi, 720)),
    )
    worse = replace(ROW, error=1e-9, allowed=1e-8)
    changes = compare_rows(
        made([ROW], {"scene": SCENE}), made([worse], {"scene": finer})
    )
    assert (
        changes.not_compared == ["scene scene has other positions (1 row)"]
        and not changes.regressed
    )
    assert "360} -> " in str(changes.scenes[0]) or "steps" in str(changes.scenes[0])
    old, new = (
        replace(ROW, setting="RK4 628/rev"),
        replace(worse, setting="RK4 1256/rev"),
    )
    changes = compare_rows(made([old], {"scene": SCENE}), made([new], {"scene": SCENE}))
    assert (
        changes.not_compared == ["scene / engine: RK4 628/rev -> RK4 1256/rev (1 row)"]
        and not changes.regressed
    )


def test_of_an_older_record_only_the_hash_can_say_that_scenes_changed():
    old = About(
        HERE.versions, HERE.machine, {**HERE.settings, "suite": "0123456789abcdef"}
    )
    changes = compare_rows((old, [ROW]), made([ROW], {"scene": SCENE}))
    assert not changes.scenes and not changes.regressed
    first, note = changes.notes
    assert (
        "0123456789ab -> suite" in note
        and "the older record does not say what they ask" in note
    )
    assert first == "1 of 1 rows are compared: the others are of one run alone"
    others = [replace(ROW, scene=f"another {k}") for k in range(3)]
    changes = compare_rows(
        (old, [ROW, others[0]]), made([ROW, *others[1:]], {"scene": SCENE})
    )
    assert "\n1 of 4 rows are compared" in render.write_differences(
        changes
    ) and "suites: no regression in 1 of 4 rows" in render.write_differences(changes)


def widen(error, reason="fewer digits"):
    """The engine with a tolerance that it states itself."""
    stated = ErrorBound(
        STATED_BY_THE_ENGINE, f"{error:g} of the scale: {reason}", error, False
    )
    return Engine("engine", FreeBody, stated)


LOOSE = replace(
    ROW,
    allowed=1e-2,
    reason="as the engine states: 0.01 of the scale: fewer digits",
)


def test_a_wider_tolerance_is_a_regression_over_two_nights(tmp_path, capsys):
    """The first night widens it and is not accepted.

    The second hides an error in it.
    """
    strict = save_run(tmp_path / "strict", [ROW])
    accepted = tmp_path / "accepted"
    assert status(["accept", str(strict), "--to", str(accepted)]) == 0
    wider = describe_run([widen(1e-2)], "suite")
    for night, error in (("first", 1e-15), ("second", 5e-3)):
        rows = [replace(LOOSE, error=error)]
        results = save_run(tmp_path / night, rows, about=wider)
        capsys.readouterr()
        assert status(["compare", str(accepted), str(results)]) == 1
        printed = capsys.readouterr().out
        first = printed.splitlines()[0]
        assert first.startswith("Weaker rule: engine: factor 1.11")
        assert first.endswith("-> 0.01")
        assert ("Worse: " in printed) == (night == "second")
        assert status(["accept", str(results), "--to", str(accepted)]) == 2
        refused = capsys.readouterr().err
        assert "--allow-weaker" in refused and "engine: factor" in refused
    both = ["accept", str(tmp_path / "first"), "--to", str(accepted)]
    assert status([*both, "--allow-weaker"]) == 0
    assert status(["compare", str(accepted), str(tmp_path / "first")]) == 0


def test_a_run_of_another_suite_is_never_called_no_regression(tmp_path, capsys):
    """Two of eight rows stand in both: the verdict says so before anything else."""
    both = [ROW, replace(ROW, quantity="F12")]
    others = [replace(ROW, scene=f"scene {k}") for k in range(6)]
    old, new = (
        save_run(tmp_path / "old", both),
        save_run(tmp_path / "new", [*both, *others]),
    )
    assert status(["compare", str(old), str(new)]) == 2
    printed = capsys.readouterr()
    verdict = printed.out.splitlines()[-1]
    assert verdict.startswith("Runs of two suites: no regression against")
    assert "shares 2 of 8 rows with the new run" in printed.err


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (widen(1e-6), widen(1e-6, "because"), ["reason"]),
        (widen(1e-6), widen(1e-8, "because"), []),
        (widen(1e-6), replace(widen(1e-6), residuals=True), ["prediction"]),
        (widen(1e-6), replace(widen(1e-6), answers=("torque",)), ["answers"]),
        (
            Engine("engine", FreeBody, FULL_ACCURACY),
            Engine("engine", FreeBody, EQUIVALENCE),
            ["class", "over the condition", "reason"],
        ),
    ],
    ids=["reason", "stricter", "prediction", "fewer answers", "class"],
)
def test_each_entry_of_a_rule_can_weaken_it(old, new, what):
    before, after = (describe_run([engine], "suite") for engine in (old, new))
    found = compare_rows((before, [ROW]), (after, [ROW]))
    assert [weakening.what for weakening in found.weakened] == what
    assert found.status == bool(what)
    assert render.write_differences(found).startswith("Weaker rule: ") == bool(what)


def test_k_and_a_stated_limit_are_rules_whoever_changes_them(monkeypatch):
    monkeypatch.setattr(rules, "K", 500.0)
    harsher = BOUNDARIES[0]._replace(boundary=0.5)
    monkeypatch.setattr(rules, "BOUNDARIES", (harsher, *BOUNDARIES[1:]))
    changed = describe_run([Engine("engine", FreeBody, EQUIVALENCE)], "suite")
    found = compare_rows((HERE, [ROW]), (changed, [ROW]))
    assert [str(weakening) for weakening in found.weakened] == [
        "K: factor 50.0 -> 500.0",
        f"limit of {harsher.engine}: {harsher.name}: boundary 0.05 -> 0.5",
    ]


def test_rows_alone_say_that_their_class_is_another():
    """Of tables without a record."""
    strict = replace(ROW, reason=EQUIVALENCE.explain(1.0))
    found = compare_rows((NOTHING_KNOWN, [strict]), (NOTHING_KNOWN, [LOOSE]))
    (weakening,) = found.weakened
    assert (weakening.name, weakening.new) == ("engine", STATED_BY_THE_ENGINE)
    assert not compare_rows(
        (NOTHING_KNOWN, [LOOSE]), (NOTHING_KNOWN, [strict])
    ).weakened


def test_an_allowance_that_grew_tenfold_is_printed_and_no_regression():
    """K eps/condition, at a worst position that is another one."""
    hard = replace(ROW, condition=1e-2, allowed=1e-12)
    found = compare_rows((HERE, [ROW]), (HERE, [hard]))
    assert found.status == 0
    (line,) = found.grown
    assert line.startswith("scene / engine / torque: 1.0e-14 -> 1.0e-12")
    assert "Allowed more: scene / engine / torque" in render.write_differences(found)
    assert not compare_rows((HERE, [ROW]), (HERE, [replace(hard, allowed=9e-14)])).grown


def test_every_form_keeps_the_reason_of_a_crash():
    """Its rows are gone, and the one in their place is new."""
    crash = Row.unmeasured(
        "scene", "engine", "", "all", FAILS, "Cannot find module 'x'"
    )
    found = compare_rows((HERE, [ROW]), (HERE, [crash]))
    forms = (
        render.write_differences,
        render.write_pull_request_comment,
        render.write_differences_page,
    )
    for form in (*forms, render.write_junit_of_changes):
        assert "Cannot find module" in html.unescape(form(found)), form


def test_what_was_not_wanted_is_not_run_and_what_was_wanted_is_gone():
    rows = [
        replace(ROW, scene=scene, engine=engine)
        for scene in ("a", "b")
        for engine in ("engine", "formulas")
    ]
    rows.append(replace(ROW, scene="a", engine="other"))
    old = made(rows, dict.fromkeys("ab", SCENE), ("engine", "other"))
    changes = compare_rows(old, made(rows[:2], {"a": SCENE}))
    assert (
        changes.not_run == ["scene b (2 rows)", "other (1 row)"] and changes.status == 0
    )
    gone = compare_rows(old, made(rows[1:2], {"a": SCENE}))
    assert [*gone.of(Kind.GONE).engine] == ["engine"]
    assert (
        compare_rows(old, (HERE, rows[:2])).not_run[0] == "scene b (2 rows)"
    )  # without a record its rows say so


def test_what_is_compared_can_be_chosen(tmp_path, capsys):
    bad = replace(ROW, quantity="F12")
    old = save_run(tmp_path / "old", [ROW, bad])
    new = save_run(tmp_path / "new", [ROW, replace(bad, error=1e-9)])
    arguments = ["compare", str(old), str(new)]
    assert [
        status([*arguments, *more])
        for more in ([], ["--quantity", "torque"], ["--only", "scene"])
    ] == [1, 0, 1]
    capsys.readouterr()
    assert status([*arguments, "--engines", "motor"]) == 2
    assert (
        capsys.readouterr().err == "error: --engines = 'motor': must be among engine\n"
    )


@pytest.mark.slow
def test_the_run_itself_is_written_as_junit(tmp_path, monkeypatch):
    monkeypatch.setattr("fourbar_validation.report.junit.MOST_PASSING_CASES", 10)
    judge_here(monkeypatch)
    xml, scene = (
        tmp_path / "run.xml",
        Path(__file__).parents[3] / "models" / "crank_rocker.toml",
    )
    arguments = [
        "run",
        str(scene),
        "--engines",
        "free-body",
        "--no-pictures",
        "--out",
        str(tmp_path / "out"),
    ]
    assert status([*arguments, "--junit", str(xml)]) == 0
    report, rows = ET.parse(xml).getroot(), read_run(tmp_path / "out")[1]
    names = [case.get("name") for case in report.iter("testcase")]
    assert names == [row.quantity for row in rows[:10]] + [
        f"{len(rows) - 10} rows more: see results.parquet"
    ]
    assert report.get("failures") == "0" and report.get("name", "").startswith("All ")
    failing = [replace(row, verdict=FAILS, reason="not held") for row in rows[20:22]]
    kinds = [
        (case.outcome, case.message.partition(": ")[2])
        for case in list_cases([*rows, *failing])
    ][10:]
    assert kinds == [("failure", "not held")] * 2 + [("skipped", "")]


def test_accepted_runs_are_rows_of_one_table_that_pandas_reads(tmp_path):
    import pandas as pd

    kept, dates = (
        tmp_path / "kept",
        [f"2026-01-0{night}T02:00:00+00:00" for night in (1, 2, 3)],
    )
    for night, date in enumerate(dates):
        record, rows = made([replace(ROW, error=1e-15 * (1 + night))], {"scene": SCENE})
        versions = {**record.versions, "mujoco": f"4.{night}.0"} | (
            {"newcomer": "1"} if night else {}
        )
        about = replace(record, versions=versions, date=date, commit=f"{night}abcdef")
        run = save_run(tmp_path / str(night), rows, "scene,engine,-,1,1,3.0\n", about)
        assert status(["accept", str(run), "--to", str(kept)]) == 0
    assert (
        status(["accept", str(tmp_path / "1"), "--to", str(kept)]) == 0
    )  # it is in it
    table = pd.read_parquet(kept / HISTORY)
    assert table.groupby("date", observed=True).size().to_dict() == dict.fromkeys(
        dates, 2
    )
    assert table[table.quantity == "torque"].error.tolist() == [
        1e-15 * n for n in (1, 2, 3)
    ]
    assert table[table.quantity == "time"].times_formulas.tolist() == [3.0] * 3
    assert (
        set(table.version_mujoco) == {"4.0.0", "4.1.0", "4.2.0"}
        and table.version_newcomer.isna().sum() == 2
    )
    assert table.scene_hash.nunique() == 1
    of_runs = summarise(kept / HISTORY)
    assert [*of_runs.date] == dates and [*of_runs.engine] == ["engine"] * 3
    assert [*of_runs.used] == [1e-15 * n / 1e-14 for n in (1, 2, 3)]
    assert [*of_runs.time] == [3.0] * 3
    (section,) = collect_history(kept)
    (figure,) = section.figures
    assert "3 accepted runs" in figure.caption
    assert all(f"{night}abcdef" in figure.svg for night in range(3))
    assert collect_history(tmp_path) == []
    (kept / HISTORY).write_bytes(b"no columns")
    with pytest.raises(InputError, match="is damaged, or no table"):
        summarise(kept / HISTORY)


HELD = replace(ROW, engine="mine", quantity="F32")
FAILED = replace(HELD, error=1e-3, verdict=FAILS)
SINCE = [
    ([[HELD]], FAILED, "held in {before}"),
    ([[HELD], [HELD]], FAILED, "held in {before}"),
    ([[FAILED]], FAILED, "failed too in {before}"),
    (
        [[FAILED], [FAILED]],
        FAILED,
        "failed too in {before}, and in every accepted run since the run of 2026-01-01"
        " at commit c0",
    ),
    (
        [[FAILED], [HELD], [FAILED], [FAILED]],
        FAILED,
        "has failed since the run of 2026-01-03 at commit c2; it held in the run of"
        " 2026-01-02 at commit c1",
    ),
    ([[replace(HELD, quantity="F43")]], FAILED, "is not in {before}"),
    ([[replace(FAILED, engine="theirs")]], FAILED, "is not in {before}"),
    ([[replace(FAILED, scene="b")]], FAILED, "is not in {before}"),
    ([[HELD]], replace(FAILED, quantity="all"), "answered in {before}"),
    ([[FAILED]], replace(FAILED, quantity="all"), "answered in {before}"),
    (
        [[HELD], [replace(FAILED, quantity="all")]],
        replace(FAILED, quantity="all"),
        "has failed since the run of 2026-01-02 at commit c1; it answered in the run of"
        " 2026-01-01 at commit c0",
    ),
]
"""Rows of accepted runs, the oldest first; a row that fails now; since when."""


@pytest.mark.parametrize(("runs", "failure", "words"), SINCE)
def test_a_failure_is_looked_up_in_the_accepted_runs(runs, failure, words, tmp_path):
    kept = tmp_path / "kept"
    other = replace(HELD, scene="other")
    for number, rows in enumerate(runs):
        record, stated = made([*rows, other], {"scene": SCENE})
        date = f"2026-01-0{number + 1}T02:00:00+00:00"
        about = replace(record, date=date, commit=f"c{number}")
        latest = save_run(tmp_path / str(number), stated, about=about)
        accepting = ["accept", str(latest), "--to", str(kept)]
        assert status([*accepting, "--even-failing", "--allow-weaker"]) == 0
    key = (failure.scene, failure.engine, failure.quantity)
    before = open_run(kept)

    def since(run):
        return find_since(read_history(run), run, [key])[key]

    assert since(before) == words.format(before=before.describe())
    if len(runs) == 1:  # a run that was not accepted tells of itself
        alone = open_run(latest)
        assert since(alone) == words.format(before=alone.describe())


def test_the_page_of_differences_begins_with_a_picture_of_what_fails_first(tmp_path):
    kept = tmp_path / "kept"
    errors = [1e-15, 2e-3, 3e-3, 4e-3]
    for number, error in enumerate(errors):
        verdict = FAILS if error > 1e-14 else AGREES
        row = replace(HELD, error=error, verdict=verdict)
        record, rows = made([row], {"scene": SCENE})
        about = replace(record, date=f"2026-01-0{number + 1}", commit=f"c{number}")
        latest = save_run(tmp_path / str(number), rows, about=about)
        if number < 3:
            accepting = ["accept", str(latest), "--to", str(kept), "--even-failing"]
            assert status(accepting) == 0
    page = tmp_path / "page.html"
    status(["compare", str(kept), str(latest), "--html", str(page)])
    text = page.read_text("utf-8")
    picture = text.index("<svg")
    assert text.index("</h1>") < picture < text.index("<h2>")
    since = "since the run of 2026-01-02 at commit c1"
    caption = f"F32: error in the accepted runs and in this one. It has failed {since}"
    assert caption in text
    assert text.count(since) == 3  # of the picture, its name, and the row
    svg = text[picture : text.index("</svg>")]
    assert all(f">{name}<" in svg for name in ("c0", "c1", "c2", "this run"))


@pytest.mark.slow
def test_a_name_that_does_not_print_or_is_a_formula_is_one_name_everywhere(
    tmp_path, monkeypatch, capsys
):
    """Escapes change the order of names.

    A spreadsheet calculates a cell that begins with =.
    """
    judge_here(monkeypatch)
    names = ["a\x1b", "aB", "b\nc", "=cmd|'calc'!A0", "+1", "'quoted"]
    text = fourbar.dump(
        replace(SCENE, motion=fourbar.Motion(fourbar.Sweep(0.1, 1.0, 3), 1.0))
    )
    for name in names:
        (tmp_path / f"{name}.toml").write_text(text)
    run, files = tmp_path / "run", [str(tmp_path / f"{name}.toml") for name in names]
    assert (
        status(
            [
                "run",
                *files,
                "--engines",
                "free-body",
                "--no-pictures",
                "--out",
                str(run),
            ]
        )
        == 0
    )
    assert status(["compare", str(run), str(run)]) == 0
    printed = sorted(["a\\x1b", "aB", "b\\nc", *names[3:]])
    cells = [
        list(csv.reader((run / name).read_text().splitlines()))
        for name in ("results.csv", "timings.csv")
    ]
    assert not any(
        cell.startswith(("=", "+", "@"))
        for rows in cells
        for row in rows
        for cell in row
    )
    assert all(len(row) == len(rows[0]) for rows in cells for row in rows)
    kept = open_run(run)
    assert (
        [*kept.frame().scene.unique()]
        == [name for name, _ in kept.times()]
        == printed
        == [*kept.about.scenes]
    )
    (tmp_path / "a\\x1b.toml").write_text(text)
    with pytest.raises(InputError, match="must have a name of its own"):
        read_scene_files([tmp_path / "a\x1b.toml", tmp_path / "a\\x1b.toml"])


@pytest.mark.parametrize(
    "name", ["lock", "run.json", "results.csv", "timings.csv", "report.html"]
)
def test_a_folder_where_a_file_of_a_run_belongs_is_one_line_before_it(
    name, tmp_path, capsys
):
    (tmp_path / "out" / name).mkdir(parents=True)
    assert (
        status(
            [
                "run",
                *MODEL,
                "--engines",
                "free-body",
                "--no-pictures",
                "--out",
                str(tmp_path / "out"),
            ]
        )
        == 2
    )
    message = capsys.readouterr().err.strip()
    assert (
        message
        == f"error: path = '{tmp_path / 'out' / name}': must name a file, not a folder"
    )
    assert [path.name for path in (tmp_path / "out").iterdir()] == [name]


@pytest.mark.parametrize(
    "name", ["results.csv", "results.parquet", "timings.csv", "record.json", HISTORY]
)
def test_accept_onto_a_folder_of_that_name_writes_nothing(name, tmp_path):
    run, kept = save_run(tmp_path / "run", [ROW]), tmp_path / "kept"
    (kept / name).mkdir(parents=True)
    assert status(["accept", str(run), "--to", str(kept)]) == 2
    assert [path.name for path in kept.iterdir()] == [name]


def test_folders_among_the_parts_of_a_run_are_swept_away(tmp_path):
    for name in ("000000", "another", ".000000.part"):
        store = Store(tmp_path / name, {"of": "this"})
        with store.held():
            (store.parts / name / "inner").mkdir(parents=True)
        with store.held():
            assert store.done() == set() and not [*store.parts.iterdir()]
    (tmp_path / "parts").write_text("a file")
    with (
        pytest.raises(
            InputError,
            match="must be a folder, in which a run keeps its parts",
        ),
        Store(tmp_path, {}).held(),
    ):
        pass


def test_a_full_disk_names_the_file_that_does_not_fit(tmp_path, monkeypatch):
    run = save_run(tmp_path / "run", [ROW])

    def full(source, target):
        raise OSError(
            errno.ENOSPC, "No space left on device", str(source), None, str(target)
        )  # as shutil does

    monkeypatch.setattr("fourbar_validation.regression.record.shutil.copyfile", full)
    with pytest.raises(OSError) as caught:
        record.accept(open_run(run), tmp_path / "kept")
    assert (caught.value.filename, caught.value.filename2) == (
        str(tmp_path / "kept" / "results.csv"),
        None,
    )
