"""What changed since the accepted state.

Real changes distinguished from round-off, the surroundings first.
"""

import ast
import csv
import errno
import html
import math
import os
import re
import struct
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

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
from fourbar_validation.places import MODELS
from fourbar_validation.regression import accept, record, render, rules
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
from tests.support.shares import slow_but

ROW = Row(
    "scene", "engine", "exact", "torque", 1e-15, 1e-14, AGREES, "equivalence", 1.0, 1.0
)
TIMES = "scene,engine,-,1,1,3.0\n"
MODEL = MODELS / "crank_rocker.toml"
SCENE = fourbar.load(MODEL)
FORMS = (
    render.write_differences,
    render.write_pull_request_comment,
    render.write_differences_page,
)


def changed(**fields):
    return replace(ROW, **fields)


@pytest.fixture
def saved(tmp_path):
    """Writes a run with these rows into a folder of this name."""

    def save(name, *rows, times="", about=HERE):
        return save_run(tmp_path / name, [*rows], times, about)

    return save


@pytest.fixture
def call(capsys):
    """Runs a command in this process: exit status, standard output, standard error."""

    def run(*arguments):
        capsys.readouterr()
        code = status([*map(str, arguments)])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


def read_files(folder):
    return {path: path.read_bytes() for path in folder.iterdir()}


def last_line(printed):
    return printed.splitlines()[-1]


def test_other_versions_are_reported():
    older = replace(HERE, versions=HERE.versions | {"mujoco": "3.3.7"})
    found = compare_rows((older, [ROW]), (HERE, [ROW]))
    assert [what for what, _, _ in found.surroundings] == ["mujoco"]
    assert "\nmujoco: 3.3.7 -> " in "\n" + render.write_differences(found)


def test_command_writes_every_form_and_leaves_with_the_status(tmp_path, saved, call):
    rows = [ROW, changed(scene="<script>alert(1)</script>|`x`")]
    old = saved("old", *rows)
    new = saved("new", *(replace(row, error=1e-9) for row in rows))
    forms = [f"--{form}={tmp_path / form}" for form in ("markdown", "html", "junit")]
    code, printed, _ = call("compare", old, new, *forms)
    assert code == 1 and "2 regressions" in printed
    for form in ("html", "markdown"):
        assert "<script>" not in (tmp_path / form).read_text()
    assert len(ET.parse(tmp_path / "junit").getroot().findall(".//failure")) == 2
    code, printed, _ = call("compare", old, old)
    assert code == 0 and "No regression" in printed


def test_accept_keeps_the_run_next_to_the_results_or_in_a_stated_folder(
    tmp_path, saved, call
):
    run = saved("run", ROW, times=TIMES)
    mine = tmp_path / "mine"
    for options, kept in (([], tmp_path / "accepted"), (["--to", mine], mine)):
        assert call("accept", run, *options)[0] == 0
        assert read_run(kept) == read_run(run)
        assert dict(open_run(kept).times()) == {"scene": [("engine", 3.0)]}
        assert call("compare", kept, run)[0] == 0
    assert call("accept", run, "--to", run)[0] != 0
    # of this project, where no such folder is
    assert find_baseline("accepted").parent.samefile(os.path.dirname(record.__file__))


TABLE, ABOUT = "results.csv", "record.json"
DAMAGE = (
    (TABLE, lambda text: b"".join(text.splitlines(True)[:-2]), "2 rows of 4"),
    (TABLE, lambda text: text + text.partition(b"\n")[2], "8 rows of 4"),
    (TABLE, lambda text: re.sub(rb".*engine 1.*\n", b"", text), "3 rows of 4"),
    (
        TABLE,
        lambda text: text.replace(b"1e-15", b"1e-16"),
        "4 rows of 4, and not the SHA-256",
    ),
    (TABLE, lambda _: b"\xff", "no rows that can be read"),
    ("timings.csv", lambda text: text.replace(b"3.0", b"3.1"), "1 rows of 1"),
    ("timings.csv", None, "is missing"),
    ("results.parquet", lambda _: b"", "is not of this run"),
    *(
        (ABOUT, lambda text, old=old, new=new: text.replace(old, new), "is damaged")
        for old, new in (
            (b'"K": "50.0"', b'"K": "51.0"'),
            (b'"sha256"', b'"sha257"'),
            (b'"rows"', b'"raws"'),
            (b'"scenes"', b'"scones"'),
            (HERE.machine.encode(), b"another machine"),
        )
    ),
)
"""File of a run, what it then holds, if anything, and words of the message."""


@pytest.mark.slow
def test_a_damaged_run_is_named_and_nothing_is_written(tmp_path, saved, call):
    rows = [changed(engine=f"engine {k}") for k in range(4)]
    good, run = (saved(name, *rows, times=TIMES) for name in ("good", "run"))
    kept = tmp_path / "kept"
    assert call("accept", good, "--to", kept)[0] == 0
    before = read_files(kept)
    commands = {
        "RESULTS": ("accept", run, "--to", kept),
        "OLD": ("compare", run, good),
        "NEW": ("compare", good, run),
    }
    for name, change, words in DAMAGE:
        file = run / name
        contents = file.read_bytes() if file.exists() else None
        if change is None:
            file.unlink()
        else:
            file.write_bytes(change(contents))
            assert file.read_bytes() != contents
        for key, command in commands.items():
            code, printed, message = call(*command)
            assert code == 2 and not printed
            assert message.startswith(f"error: {key} = '{file}': ") and words in message
            assert message.count("\n") == 1
        assert read_files(kept) == before
        if contents is None:
            file.unlink()
        else:
            file.write_bytes(contents)
    assert [call(*command)[0] for command in commands.values()] == [0, 0, 0]


@pytest.mark.slow
def test_a_damaged_table_is_one_line_and_nothing_is_written(tmp_path, saved, call):
    kept = tmp_path / "kept"
    assert call("accept", saved("run", ROW), "--to", kept)[0] == 0
    file = kept / HISTORY
    contents = file.read_bytes()
    later = replace(HERE, date="later")
    run = saved("later", changed(error=2e-15), about=later)
    with ResultsWriter(tmp_path) as columns:
        columns.add([ROW])
    # a bit of a number, which the checksum of its page shows
    place = contents.index(struct.pack("<d", ROW.error))
    flipped = contents[:place] + bytes([contents[place] ^ 1]) + contents[place + 1 :]
    (read,) = pq.read_table(pa.BufferReader(flipped))["error"].to_pylist()
    assert read != ROW.error
    for damaged in (
        b"",
        b"no columns",
        contents[:-100],
        contents[:300] + b"\0" + contents[301:],
        (tmp_path / "results.parquet").read_bytes(),
        flipped,
    ):
        file.write_bytes(damaged)
        before = read_files(kept)
        code, _, line = call("accept", run, "--to", kept)
        assert code == 2, damaged[:20]
        damage_of = "is damaged, or no table written by `accept`"
        assert line == f"error: --to = '{file}': {damage_of}\n"
        assert read_files(kept) == before


@pytest.mark.slow
def test_what_has_no_record_of_its_rows_is_compared_with_a_note_and_not_accepted(
    tmp_path, saved, call
):
    good, bare = (saved(name, ROW) for name in ("good", "bare"))
    (bare / "record.json").unlink()
    code, printed, _ = call("compare", bare, good)
    assert code == 0 and f"{bare / 'results.csv'}: not verified" in printed
    assert call("accept", bare)[0] == 2 and not (tmp_path / "accepted").exists()


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([], "at least one comparison"),
        ([ROW], "a run that was finished"),
        ([changed(verdict=FAILS, error=1.0)], "--even-failing: 1 comparisons fail"),
        ([changed(verdict=REFUSES)], "--even-failing: nothing was compared"),
    ],
)
def test_what_is_empty_unfinished_or_fails_is_not_accepted(
    rows, reason, tmp_path, saved, call
):
    run = saved("run", *rows)
    if rows == [ROW]:
        (run / "run.json").write_text("{}")
    code, _, message = call("accept", run)
    assert code == 2 and reason in message
    assert not (tmp_path / "accepted").exists()
    if "--even-failing" in reason:
        assert call("accept", run, "--even-failing")[0] == 0
    else:
        with pytest.raises(InputError, match=reason):
            read_run(run)


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
    arguments, words, tmp_path, call
):
    code, _, message = call("run", *arguments, "--out", tmp_path / "out")
    assert code == 2 and message.startswith("error: ") and words in message
    assert message.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_run_with_too_many_rows_for_a_text_is_read_from_its_columns(tmp_path):
    """No greatest error is NaN by the columns."""
    with ResultsWriter(tmp_path) as columns:
        columns.add([ROW, changed(quantity="watch", error=math.nan, verdict=FAILS)])
    write_about(HERE, tmp_path)
    from_text = read_run(tmp_path)
    assert pq.read_table(tmp_path / "results.parquet")["error"].null_count == 1
    (tmp_path / "results.csv").unlink()
    write_about(HERE, tmp_path)
    from_columns = read_run(tmp_path)
    assert repr(from_columns) == repr(from_text)
    assert not compare_rows(from_text, from_columns).regressed
    (tmp_path / "results.parquet").write_bytes(b"no columns")
    with pytest.raises(InputError, match="is damaged: no rows that can be read of 2"):
        read_run(tmp_path)
    (tmp_path / "record.json").unlink()
    with pytest.raises(InputError, match="is not a table written by"):
        read_run(tmp_path)


@pytest.mark.slow
def test_of_two_long_runs_every_row_is_counted_and_the_worst_are_listed(
    tmp_path, monkeypatch, call
):
    """They are too long for a text, and for a history."""
    scenes, shown = 300, 5
    for name, few in (
        ("compare.columns.GROUP_ROWS", 60),
        ("compare.columns.BATCH_ROWS", 60),
        ("compare.columns.CSV_ROWS", 100),
        ("regression.accept.CSV_ROWS", 100),
        ("regression.render.MOST_PASSING_CASES", shown),
    ):
        monkeypatch.setattr(f"fourbar_validation.{name}", few)
    for name, grown in (("old", 1.0), ("new", 1e3)):
        (tmp_path / name).mkdir()
        with ResultsWriter(tmp_path / name) as columns:
            for k in range(scenes):
                error = 1e-9 * (1.0 + k * (grown - 1.0))
                row = changed(scene=f"random-0-{k:09d}", condition=1e-3, error=error)
                columns.add([replace(row, quantity="F12", error=1e-15), row])
        write_about(HERE, tmp_path / name)
        assert not (tmp_path / name / "results.csv").exists()
        assert len(columns.first_lines) < 60
    old, new, kept = (tmp_path / name for name in ("old", "new", "kept"))
    changes = compare_runs(*((HERE, open_run(folder).frame()) for folder in (old, new)))
    assert changes.rows == 2 * scenes
    assert changes.regressed == changes.kinds[Kind.WORSE] == scenes - 1
    worst = [name[-3:] for name in changes.of(Kind.WORSE).scene[:3]]
    assert worst == ["299", "298", "297"]
    *_, last = ET.fromstring(render.write_junit_of_changes(changes)).iter("testcase")
    assert last.get("name") == f"{2 * (scenes - shown)} rows more: see results.parquet"
    assert call("compare", old, new)[0] == 1
    assert call("compare", old, new, "--only", "random-0-000000000")[0] == 0
    assert call("accept", new, "--to", kept)[0] == 0
    assert {path.name for path in kept.iterdir()} == {"record.json", "results.parquet"}
    assert call("compare", kept, new)[0] == 0


@pytest.mark.slow
def test_a_part_of_a_long_run_compares_with_its_part(saved, call):
    rows = [changed(scene=f"scene {k:03d}") for k in range(80)]
    whole, some = saved("whole", *rows), saved("some", rows[7], rows[70])
    code, printed, _ = call("compare", whole, some)
    assert code == 0
    lines = printed.splitlines()
    assert lines[0] == "Not run: scene scene 000 (1 row)"
    assert lines[50] == "Not run: 28 more (28 rows)"
    assert " in 2 of 80 rows: 78 not run, 2 same" in lines[-1]
    code, printed, _ = call("compare", whole, some, "--only", "scene 007, scene 070")
    verdict = last_line(printed)
    assert code == 0 and " in 2 rows: 2 same" in verdict
    assert verdict.startswith(f"No regression against {whole} of {HERE.date[:10]}")


def disagreeing(worse):
    """Two runs of three scenes by three exact engines, a simulation and an identity.

    `worse`: engines and quantities that fail.
    """
    old = [
        changed(scene=scene, engine=engine, quantity=quantity, setting=setting)
        for scene in "abc"
        for engine, setting in SETTINGS.items()
        for quantity in (("power",) if engine == "formulas" else ("F12", "torque"))
    ]
    new = []
    for row in old:
        reason = f"{ord(row.scene)}e-6 where 1e-9 was predicted"
        failed = replace(row, verdict=FAILS, error=1e-6, reason=reason)
        new.append(failed if f"{row.engine} {row.quantity}" in worse else row)
    return old, new


SETTINGS = {**dict.fromkeys(("one", "two", "three", "formulas"), "exact"), "sim": "RK4"}


@pytest.mark.parametrize(
    ("worse", "sentence"),
    [
        ("sim F12, sim torque", "only sim"),
        ("one torque, sim torque", "only one, sim"),
        (
            "one torque, two torque, three torque, formulas power",
            "all engines and the identity disagree: the formulas",
        ),
        (
            "one F12, two F12, three F12",
            "all engines disagree, and the identities hold: the formulas, or what"
            " all engines are given",
        ),
        (
            "formulas power",
            "only the identities: the formulas, or what is stated of them",
        ),
    ],
)
def test_the_report_says_who_is_at_fault(worse, sentence):
    old, new = disagreeing(worse.split(", "))
    changes = compare_rows((HERE, old), (HERE, new))
    sentence += ", 3 of 3 scenes"
    assert changes.sentences == [sentence]
    for form in FORMS:
        assert sentence in html.unescape(form(changes))


@pytest.mark.slow
def test_rows_that_changed_are_grouped_by_engine_and_cause_the_worst_first():
    """One cause for all scenes, with the numbers of the worst."""
    old, new = disagreeing(["sim F12", "sim torque", "one torque"])
    better = [replace(row, error=1e-9) if row.engine == "two" else row for row in old]
    worst = next(i for i, row in enumerate(new) if row.failed and row.scene == "b")
    assert new[worst].engine == "one"
    new[worst] = replace(new[worst], error=1.0)
    changes = compare_rows((HERE, better), (HERE, new))
    lines = render.write_differences(changes).splitlines()
    groups = [line for line in lines if "scenes, " in line and "rows (" in line]
    in_a, in_b = (
        f"agrees -> fails: {ord(scene)}e-6 where 1e-9 was predicted" for scene in "ab"
    )
    assert groups == [
        f"Verdict got worse: one, 3 of 3 scenes, 3 rows (torque 3), {in_b}",
        f"Verdict got worse: sim, 3 of 3 scenes, 6 rows (F12 3, torque 3), {in_a}",
        "Better: two, 3 of 3 scenes, 6 rows (F12 3, torque 3)",
    ]
    assert [*changes.of(Kind.VERDICT_WORSE).iloc[0][:2]] == ["b", "one"]
    page = html.unescape(render.write_differences_page(changes))
    assert groups[0].partition(": ")[2] in page


def made(rows, scenes, engines=("engine",)):
    free_bodies = [Engine(engine, FreeBody, EQUIVALENCE) for engine in engines]
    stated = {name: describe_changes(scene) for name, scene in scenes.items()}
    return describe_run(free_bodies, "suite", stated), rows


def weighted(inertia, **changes):
    """The scene with another moment of inertia of its output."""
    linkage = SCENE.linkage
    output = replace(linkage.output, inertia=inertia)
    return replace(SCENE, linkage=replace(linkage, output=output), **changes)


@pytest.mark.slow
def test_a_scene_that_changed_comes_first_and_its_rows_are_not_compared():
    before, heavier = weighted(0.048), weighted(0.05, title="another title")
    other, wrong = changed(scene="other"), changed(error=1e-9, allowed=1e-8)
    stated = {"scene": heavier, "other": SCENE}
    old = made([ROW, other], {"scene": before, "other": SCENE})
    changes = compare_rows(old, made([wrong, other], stated))
    line = "scene scene: bars.output.inertia 0.048 -> 0.05 kg m^2"
    assert line in render.write_differences(changes).splitlines()
    assert changes.status == 0
    assert changes.not_compared == ["scene scene changed (1 row)"]
    for form in FORMS:
        assert "bars.output.inertia 0.048" in form(changes)
    fails = replace(wrong, verdict=FAILS)
    assert compare_rows(old, made([fails, other], {"scene": heavier})).regressed
    alone = made([ROW], {"scene": before})
    assert compare_rows(alone, made([wrong], {"scene": heavier})).nothing


@pytest.mark.slow
def test_a_renamed_scene_is_found_by_what_it_states(saved, call):
    heavier = weighted(0.05)
    both = []
    for folder, error, scenes in (
        ("old", 1e-9, {"g": SCENE, "h": heavier, "same": SCENE}),
        ("new", 2e-9, {"a": heavier, "gate": SCENE, "same": SCENE}),
    ):
        rows = [changed(scene=name, error=error, allowed=1e-9) for name in scenes]
        about, _ = made(rows, scenes)
        times = "".join(f"{name},engine,-,1,1,3.0\n" for name in scenes)
        both.append(saved(folder, *rows, times=times, about=about))
    code, printed, _ = call("compare", *both)
    assert code == 1
    assert {"renamed: g -> gate", "renamed: h -> a"} < {*printed.splitlines()}
    assert last_line(printed).startswith(f"3 regressions against {both[0]}")
    assert " in 3 rows: 3 worse." in last_line(printed)
    for name in ("gate", "h"):
        code, printed, _ = call("compare", *both, "--only", name)
        verdict = last_line(printed)
        assert code == 1 and " in 1 rows" in verdict
        assert verdict.startswith("1 regression against")


def test_what_grew_within_its_allowance_is_shown_and_no_regression():
    """Another kernel of the BLAS turns 3.4e-7 into 5.2e-7 where 1 is allowed.

    A wider allowance excuses nothing.
    """
    shipped = changed(quantity="as shipped", error=3.4e-7, allowed=1.0)
    changes = compare_rows((HERE, [shipped]), (HERE, [replace(shipped, error=5.2e-7)]))
    assert [*changes.table.kind] == [Kind.GREW] and changes.status == 0
    line = "Grew within its allowance: scene / engine / exact / as shipped"
    assert line in render.write_differences(changes)


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

    def find_kernels(more):
        line, env = [sys.executable, "-c", code], os.environ | more
        return ast.literal_eval(
            subprocess.check_output(line, cwd=ROOT, env=env, text=True)
        )

    first, second = find_kernels({}), find_kernels(environment(possible[0]))
    assert set(first) == {"cpu_features", "blas_kernel"} and first != second
    old, new = (
        replace(HERE, versions=HERE.versions | kernels) for kernels in (first, second)
    )
    text = render.write_differences(compare_rows((old, [ROW]), (new, [ROW])))
    assert any(f"{name}: {first[name]} -> {second[name]}" in text for name in first)
    assert set(first) <= set(HERE.versions)


def test_more_positions_and_other_settings_are_named_so():
    motion = SCENE.motion.replace(angle=fourbar.Sweep(0.0, 2.0 * math.pi, 720))
    finer = replace(SCENE, motion=motion)
    worse = changed(error=1e-9, allowed=1e-8)
    more = compare_rows(made([ROW], {"scene": SCENE}), made([worse], {"scene": finer}))
    assert more.not_compared == ["scene scene has other positions (1 row)"]
    assert "360} -> " in str(more.scenes[0]) or "steps" in str(more.scenes[0])
    old, new = changed(setting="RK4 628/rev"), replace(worse, setting="RK4 1256/rev")
    other = compare_rows(*(made([row], {"scene": SCENE}) for row in (old, new)))
    assert other.not_compared == ["scene / engine: RK4 628/rev -> RK4 1256/rev (1 row)"]
    assert not more.regressed and not other.regressed


@pytest.mark.slow
def test_of_an_older_record_only_the_hash_can_say_that_scenes_changed():
    settings = HERE.settings | {"suite": "0123456789abcdef"}
    old = About(HERE.versions, HERE.machine, settings)
    changes = compare_rows((old, [ROW]), made([ROW], {"scene": SCENE}))
    assert not changes.scenes and not changes.regressed
    first, note = changes.notes
    assert first == "1 of 1 rows are compared: the others are of one run alone"
    assert "0123456789ab -> suite" in note
    assert "the older record does not say what they ask" in note
    first, *others = (changed(scene=f"another {k}") for k in range(3))
    new = made([ROW, *others], {"scene": SCENE})
    text = render.write_differences(compare_rows((old, [ROW, first]), new))
    assert "\n1 of 4 rows are compared" in text
    assert "suites: no regression in 1 of 4 rows" in text


def widen(error, reason="fewer digits"):
    """The engine with a tolerance that it states itself."""
    text = f"{error:g} of the scale: {reason}"
    bound = ErrorBound(STATED_BY_THE_ENGINE, text, error, False)
    return Engine("engine", FreeBody, bound)


LOOSE = changed(
    allowed=1e-2, reason="as the engine states: 0.01 of the scale: fewer digits"
)


@pytest.mark.slow
def test_a_wider_tolerance_is_a_regression_over_two_nights(tmp_path, saved, call):
    """The first night widens it and is not accepted.

    The second hides an error in it.
    """
    accepted = tmp_path / "accepted"
    assert call("accept", saved("strict", ROW), "--to", accepted)[0] == 0
    wider = describe_run([widen(1e-2)], "suite")
    for night, error in (("first", 1e-15), ("second", 5e-3)):
        results = saved(night, replace(LOOSE, error=error), about=wider)
        code, printed, _ = call("compare", accepted, results)
        first = printed.splitlines()[0]
        assert code == 1 and first.startswith("Weaker rule: engine: factor 1.11")
        assert first.endswith("-> 0.01")
        assert ("Worse: " in printed) == (night == "second")
        code, _, refused = call("accept", results, "--to", accepted)
        assert code == 2
        assert "--allow-weaker" in refused and "engine: factor" in refused
    first = tmp_path / "first"
    assert call("accept", first, "--to", accepted, "--allow-weaker")[0] == 0
    assert call("compare", accepted, first)[0] == 0


@pytest.mark.slow
def test_a_run_of_another_suite_is_never_called_no_regression(saved, call):
    """Two of eight rows stand in both: the verdict says so before anything else."""
    both = [ROW, changed(quantity="F12")]
    others = [changed(scene=f"scene {k}") for k in range(6)]
    old, new = saved("old", *both), saved("new", *both, *others)
    code, printed, error = call("compare", old, new)
    assert code == 2 and "shares 2 of 8 rows with the new run" in error
    verdict = last_line(printed)
    assert verdict.startswith("Runs of two suites: no regression against")


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        (widen(1e-6), widen(1e-6, "because"), ["reason"]),
        pytest.param(widen(1e-6), widen(1e-8, "because"), [], marks=pytest.mark.slow),
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
    after, _ = made([], {})
    found = compare_rows((HERE, [ROW]), (after, [ROW]))
    assert [str(weakening) for weakening in found.weakened] == [
        "K: factor 50.0 -> 500.0",
        f"limit of {harsher.engine}: {harsher.name}: boundary 0.05 -> 0.5",
    ]


def test_rows_alone_say_that_their_class_is_another():
    """Of tables without a record."""
    strict, loose = (
        (NOTHING_KNOWN, [row])
        for row in (changed(reason=EQUIVALENCE.explain(1.0)), LOOSE)
    )
    (weakening,) = compare_rows(strict, loose).weakened
    assert (weakening.name, weakening.new) == ("engine", STATED_BY_THE_ENGINE)
    assert not compare_rows(loose, strict).weakened


@pytest.mark.slow
def test_an_allowance_that_grew_tenfold_is_printed_and_no_regression():
    """K eps/condition, at a worst position that is another one."""
    hard = changed(condition=1e-2, allowed=1e-12)
    found = compare_rows((HERE, [ROW]), (HERE, [hard]))
    assert found.status == 0
    (line,) = found.grown
    assert line.startswith("scene / engine / torque: 1.0e-14 -> 1.0e-12")
    assert "Allowed more: scene / engine / torque" in render.write_differences(found)
    assert not compare_rows((HERE, [ROW]), (HERE, [replace(hard, allowed=9e-14)])).grown


@pytest.mark.slow
def test_every_form_keeps_the_reason_of_a_crash():
    """Its rows are gone, and the one in their place is new."""
    died = "Cannot find module 'x'"
    crash = Row.unmeasured("scene", "engine", "", "all", FAILS, died)
    found = compare_rows((HERE, [ROW]), (HERE, [crash]))
    for form in (*FORMS, render.write_junit_of_changes):
        assert died in html.unescape(form(found)), form


@pytest.mark.slow
def test_without_a_record_what_is_missing_in_the_rows_was_not_wanted():
    rows = [changed(scene=s, engine=e) for s in "ab" for e in ("engine", "formulas")]
    old = made(rows, dict.fromkeys("ab", SCENE))
    assert compare_rows(old, (HERE, rows[:2])).not_run == ["scene b (2 rows)"]


@pytest.mark.parametrize(
    ("options", "code"),
    slow_but(
        {(("--quantity", "torque"), 0)},
        [((), 1), (("--quantity", "torque"), 0), (("--only", "scene"), 1)],
    ),
)
def test_what_is_compared_can_be_chosen(options, code, saved, call):
    bad = changed(quantity="F12")
    both = saved("old", ROW, bad), saved("new", ROW, replace(bad, error=1e-9))
    assert call("compare", *both, *options)[0] == code
    expected = "error: --engines = 'motor': must be among engine\n"
    assert call("compare", *both, "--engines", "motor") == (2, "", expected)


def run_free_body(call, out, *options):
    """Run scene files through the free bodies alone."""
    return call(
        "run", *options, "--engines", "free-body", "--no-pictures", "--out", out
    )


def test_the_run_itself_is_written_as_junit(tmp_path, monkeypatch, call):
    monkeypatch.setattr("fourbar_validation.report.junit.MOST_PASSING_CASES", 10)
    judge_here(monkeypatch)
    xml, out = tmp_path / "run.xml", tmp_path / "out"
    assert run_free_body(call, out, MODEL, "--junit", xml)[0] == 0
    report, rows = ET.parse(xml).getroot(), read_run(out)[1]
    names = [case.get("name") for case in report.iter("testcase")]
    left_out = f"{len(rows) - 10} rows more: see results.parquet"
    assert names == [*(row.quantity for row in rows[:10]), left_out]
    assert report.get("failures") == "0" and report.get("name").startswith("All ")
    failing = [replace(row, verdict=FAILS, reason="not held") for row in rows[20:22]]
    cases = list(list_cases([*rows, *failing]))[10:]
    told = [(case.outcome, case.message.partition(": ")[2]) for case in cases]
    assert told == [("failure", "not held")] * 2 + [("skipped", "")]


@pytest.mark.slow
def test_accepted_runs_are_rows_of_one_table_that_pandas_reads(tmp_path, saved, call):
    kept = tmp_path / "kept"
    dates = [f"2026-01-0{night}T02:00:00+00:00" for night in (1, 2, 3)]
    errors = [1e-15, 2e-15, 3e-15]
    for night, (date, error) in enumerate(zip(dates, errors, strict=True)):
        about, rows = made([changed(error=error)], {"scene": SCENE})
        more = {"mujoco": f"4.{night}.0"} | ({"newcomer": "1"} if night else {})
        about = replace(about, versions=about.versions | more, date=date)
        about = replace(about, commit=f"{night}abcdef")
        run = saved(str(night), *rows, times=TIMES, about=about)
        assert call("accept", run, "--to", kept)[0] == 0
    assert call("accept", tmp_path / "1", "--to", kept)[0] == 0  # it is in it
    table = pd.read_parquet(kept / HISTORY)
    assert table.date.value_counts().to_dict() == dict.fromkeys(dates, 2)
    assert table[table.quantity == "torque"].error.tolist() == errors
    assert table[table.quantity == "time"].times_formulas.tolist() == [3.0] * 3
    assert set(table.version_mujoco) == {"4.0.0", "4.1.0", "4.2.0"}
    assert table.version_newcomer.isna().sum() == 2
    assert table.scene_hash.nunique() == 1
    of_runs = summarise(kept / HISTORY)
    assert [*of_runs.date] == dates and [*of_runs.engine] == ["engine"] * 3
    assert [*of_runs.used] == [error / ROW.allowed for error in errors]
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
SILENT = replace(FAILED, quantity="all")
RUNS = [f"the run of 2026-01-0{number + 1} at commit c{number}" for number in range(4)]
SINCE = [
    ([[HELD]], FAILED, "held in {before}"),
    ([[HELD], [HELD]], FAILED, "held in {before}"),
    ([[FAILED]], FAILED, "failed too in {before}"),
    (
        [[FAILED], [FAILED]],
        FAILED,
        "failed too in {before}, and in every accepted run since {runs[0]}",
    ),
    (
        [[FAILED], [HELD], [FAILED], [FAILED]],
        FAILED,
        "has failed since {runs[2]}; it held in {runs[1]}",
    ),
    ([[replace(HELD, quantity="F43")]], FAILED, "is not in {before}"),
    ([[replace(FAILED, engine="theirs")]], FAILED, "is not in {before}"),
    ([[replace(FAILED, scene="b")]], FAILED, "is not in {before}"),
    ([[HELD]], SILENT, "answered in {before}"),
    ([[FAILED]], SILENT, "answered in {before}"),
    (
        [[HELD], [SILENT]],
        SILENT,
        "has failed since {runs[1]}; it answered in {runs[0]}",
    ),
]
"""Rows of accepted runs, the oldest first; a row that fails now; since when."""


@pytest.fixture
def nights(tmp_path, saved, call):
    """Accepts runs, the oldest first, and returns the folder that keeps them."""
    kept = tmp_path / "kept"

    def accept(*runs):
        for number, rows in enumerate(runs):
            about, _ = made(rows, {"scene": SCENE})
            date = f"2026-01-0{number + 1}T02:00:00+00:00"
            about = replace(about, date=date, commit=f"c{number}")
            latest = saved(f"night {number}", *rows, about=about)
            options = ("--to", kept, "--even-failing", "--allow-weaker")
            assert call("accept", latest, *options)[0] == 0
        return kept

    return accept


@pytest.mark.parametrize(("runs", "failure", "words"), SINCE)
def test_a_failure_is_looked_up_in_the_accepted_runs(
    runs, failure, words, tmp_path, nights
):
    """A run that was not accepted tells of itself."""
    other = replace(HELD, scene="other")
    kept = nights(*([*rows, other] for rows in runs))
    key = (failure.scene, failure.engine, failure.quantity)
    for folder in (kept, tmp_path / "night 0")[: 1 + (len(runs) == 1)]:
        run = open_run(folder)
        since = find_since(read_history(run), run, [key])[key]
        assert since == words.format(before=run.describe(), runs=RUNS)


def test_the_history_is_read_once(tmp_path, monkeypatch, saved, call, nights):
    """What the page says since when, and what it draws, is of one table."""
    read, drawn = [], []

    def read_and_count(before):
        read.append(read_history(before))
        return read[-1]

    monkeypatch.setattr(accept, "read_history", read_and_count)
    monkeypatch.setattr(
        accept, "draw_row", lambda history, row: drawn.append(history) or ""
    )
    kept = nights([HELD])
    about, rows = made([FAILED], {"scene": SCENE})
    latest = saved("latest", *rows, about=replace(about, date="2026-01-04"))
    call("compare", kept, latest, "--html", tmp_path / "page.html")
    (history,) = read
    assert drawn[0] is history


@pytest.mark.slow
def test_the_page_of_differences_begins_with_a_picture_of_what_fails_first(
    tmp_path, saved, call, nights
):
    failing = [replace(FAILED, error=error) for error in (2e-3, 3e-3, 4e-3)]
    kept = nights([HELD], *([row] for row in failing[:2]))
    about, rows = made(failing[2:], {"scene": SCENE})
    latest = saved("latest", *rows, about=replace(about, date="2026-01-04"))
    page = tmp_path / "page.html"
    call("compare", kept, latest, "--html", page)
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
    tmp_path, monkeypatch, call
):
    """Escapes change the order of names.

    A spreadsheet calculates a cell that begins with =.
    """
    judge_here(monkeypatch)
    names = ["a\x1b", "aB", "b\nc", "=cmd|'calc'!A0", "+1", "'quoted"]
    motion = fourbar.Motion(fourbar.Sweep(0.1, 1.0, 3), 1.0)
    text = fourbar.dump(replace(SCENE, motion=motion))
    files = [tmp_path / f"{name}.toml" for name in names]
    for file in files:
        file.write_text(text)
    run = tmp_path / "run"
    assert run_free_body(call, run, *files)[0] == 0
    assert call("compare", run, run)[0] == 0
    for name in ("results.csv", "timings.csv"):
        rows = list(csv.reader((run / name).read_text().splitlines()))
        assert {len(row) for row in rows} == {len(rows[0])}
        assert not any(cell.startswith(("=", "+", "@")) for row in rows for cell in row)
    kept = open_run(run)
    printed = sorted(["a\\x1b", "aB", "b\\nc", *names[3:]])
    assert [*kept.frame().scene.unique()] == printed == [*kept.about.scenes]
    assert [name for name, _ in kept.times()] == printed
    (tmp_path / "a\\x1b.toml").write_text(text)
    with pytest.raises(InputError, match="must have a name of its own"):
        read_scene_files([tmp_path / "a\x1b.toml", tmp_path / "a\\x1b.toml"])


@pytest.mark.parametrize(
    "name", ["lock", "run.json", "results.csv", "timings.csv", "report.html"]
)
def test_a_folder_where_a_file_of_a_run_belongs_is_one_line_before_it(
    name, tmp_path, call
):
    out = tmp_path / "out"
    (out / name).mkdir(parents=True)
    message = f"error: path = '{out / name}': must name a file, not a folder\n"
    assert run_free_body(call, out, MODEL) == (2, "", message)
    assert [path.name for path in out.iterdir()] == [name]


@pytest.mark.parametrize(
    "name", ["results.csv", "results.parquet", "timings.csv", "record.json", HISTORY]
)
def test_accept_onto_a_folder_of_that_name_writes_nothing(name, tmp_path, saved, call):
    kept = tmp_path / "kept"
    (kept / name).mkdir(parents=True)
    assert call("accept", saved("run", ROW), "--to", kept)[0] == 2
    assert [path.name for path in kept.iterdir()] == [name]


def test_folders_among_the_parts_of_a_run_are_swept_away(tmp_path):
    for name in ("000000", "another", ".000000.part"):
        store = Store(tmp_path / name, {"of": "this"})
        with store.held():
            (store.parts / name / "inner").mkdir(parents=True)
        with store.held():
            assert store.done() == set() and not [*store.parts.iterdir()]
    (tmp_path / "parts").write_text("a file")
    words = "must be a folder, in which a run keeps its parts"
    with pytest.raises(InputError, match=words), Store(tmp_path, {}).held():
        pass


def test_a_full_disk_names_the_file_that_does_not_fit(tmp_path, monkeypatch, saved):
    run, kept = saved("run", ROW), tmp_path / "kept"

    def fill(source, target):
        """Raise what shutil raises."""
        words = "No space left on device"
        raise OSError(errno.ENOSPC, words, str(source), None, str(target))

    monkeypatch.setattr("fourbar_validation.regression.record.shutil.copyfile", fill)
    with pytest.raises(OSError) as caught:
        record.accept(open_run(run), kept)
    assert caught.value.filename == str(kept / "results.csv")
    assert caught.value.filename2 is None
