"""What changed since the accepted state.

Real changes distinguished from round-off, the surroundings first.
"""

import csv
import errno
import html
import math
import os
import re
import struct
import xml.etree.ElementTree as ET
from dataclasses import replace

import pandas as pd
import pyarrow.parquet as pq
from pytest import fixture, mark, raises

from fourbar import Motion, Sweep, dump, load
from fourbar.errors import BAD_INPUT, FAILED, HOLDS
from fourbar_validation.cli import status
from fourbar_validation.compare.results_file import write_tables
from fourbar_validation.compare.rows import FAILS, REFUSES
from fourbar_validation.compare.tolerance import EQUIVALENCE, FULL_ACCURACY, ErrorBound
from fourbar_validation.engines import free_body, guests, limits, registry
from fourbar_validation.places import MODELS
from fourbar_validation.regression import record, render, rules
from fourbar_validation.regression.changes import Kind
from fourbar_validation.regression.history import (
    HISTORY,
    collect_history,
    find_since,
    read_history,
    summarise,
)
from fourbar_validation.regression.record import (
    NOTHING_KNOWN,
    describe_run,
    find_baseline,
    open_run,
    write_about,
)
from fourbar_validation.regression.scenes import describe_changes
from fourbar_validation.report.junit import list_cases
from fourbar_validation.scenes.suites import read_scene_files
from tests.support.here import judge_here
from tests.support.rows import read_rows, refused, slow_but
from tests.support.runs import (
    FORMS,
    HERE,
    ROW,
    changed,
    compare_made_here,
    compare_rows,
    read_run,
    save_run,
)
from tests.support.scenes import relink

TIMES = "scene,engine,-,1,1,3.0\n"
MODEL = MODELS / "crank_rocker.toml"
SCENE = load(MODEL)


@fixture
def saved(tmp_path):
    """Writes a run with these rows into a folder of this name."""

    def save(name, *rows, **more):
        return save_run(tmp_path / name, [*rows], **more)

    return save


@fixture
def call(capsys):
    """Runs a command in this process: exit status, standard output, standard error."""

    def run(*arguments):
        capsys.readouterr()
        code = status([*map(str, arguments)])
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return run


@fixture
def compare(call):
    """Compares two runs by the command: exit status, and the lines, unfolded."""

    def run(*arguments):
        code, printed, _ = call("compare", *arguments)
        assert all(len(line) <= 80 or "/" in line for line in printed.splitlines())
        return code, printed.replace("\n    ", " ").splitlines()

    return run


@fixture
def accepts(tmp_path, call):
    """Accepts a run into the folder `kept` by the command, and returns its status."""

    def run(folder, *options):
        return call("accept", folder, "--to", tmp_path / "kept", *options)[0]

    return run


def read_files(folder):
    return {path: path.read_bytes() for path in folder.iterdir()}


@mark.slow
def test_other_versions_are_reported():
    """Kernels that a processor is given are among them."""
    others = {"mujoco": "3.3.7", "cpu_features": "none", "blas_kernel": "Prescott"}
    older = replace(HERE, versions=HERE.versions | others, machine="another")
    found = compare_rows((older, [ROW]), (HERE, [ROW]))
    assert {what for what, _, _ in found.surroundings} == {*others, "machine"}
    assert "\nmujoco: 3.3.7 -> " in "\n" + render.write_differences(found)


@mark.slow
def test_accept_keeps_the_run_next_to_the_results_or_in_a_stated_folder(
    tmp_path, saved, call
):
    run = saved("run", ROW, times=TIMES)
    mine = tmp_path / "mine"
    for options, kept in (([], tmp_path / "accepted"), (["--to", mine], mine)):
        assert call("accept", run, *options)[0] == HOLDS
        assert read_run(kept) == read_run(run)
        assert open_run(kept).times().to_numpy().tolist() == [["scene", "engine", 3.0]]
        assert call("compare", kept, run)[0] == HOLDS
    assert call("accept", run, "--to", run)[0] != HOLDS
    # of this project, where no such folder is
    assert find_baseline("accepted").parent.samefile(os.path.dirname(record.__file__))


TABLE, TIMINGS, ABOUT = "results.csv", "timings.csv", "record.json"
DAMAGE = read_rows(r"""
results.csv | (.*\n){2}\Z | | states 4 rows
results.csv | \n([\s\S]*)\Z | \n\1\1 | states 4 rows
results.csv | .*engine 1.*\n | | states 4 rows
results.csv | 1e-15 | 1e-16 | states 4 rows and the SHA-256
results.csv | \A[\s\S]* | ÿ | is missing, damaged
timings.csv | 3[.]0 | 3.1 | states 1 rows
timings.csv |  |  | is missing
results.parquet | \Z | | or of another run: record.json states no rows
record.json | "K": "50.0" | "K": "51.0" | is damaged
record.json | "sha256" | "sha257" | is damaged
record.json | "rows" | "raws" | is damaged
record.json | "scenes" | "scones" | is damaged
record.json | ("machine": )".*?" | \1"another machine" | is damaged
""")
"""File of a run, a pattern in it, what stands in its place, and words of the message.

Without a pattern there is no such file.
"""


@mark.slow
def test_a_damaged_run_is_named_and_nothing_is_written(tmp_path, saved, call, accepts):
    rows = [changed(engine=f"engine {k}") for k in range(4)]
    good, run = (saved(name, *rows, times=TIMES) for name in ("good", "run"))
    kept = tmp_path / "kept"
    assert accepts(good) == HOLDS
    before = read_files(kept)
    commands = {
        "RESULTS": ("accept", run, "--to", kept),
        "OLD": ("compare", run, good),
        "NEW": ("compare", good, run),
    }
    for name, pattern, damage, words in DAMAGE:
        file = run / name
        contents = file.read_bytes() if file.exists() else None
        if pattern:
            text = (contents or b"").decode("latin-1")
            file.write_bytes(re.sub(pattern, damage, text).encode("latin-1"))
            assert file.read_bytes() != contents
        else:
            file.unlink()
        for key, command in commands.items():
            code, printed, message = call(*command)
            assert code == BAD_INPUT and not printed
            assert message.startswith(f"error: {key} = '{file}': ") and words in message
            assert message.count("\n") == 1
        assert read_files(kept) == before
        if contents is None:
            file.unlink()
        else:
            file.write_bytes(contents)
    assert {call(*command)[0] for command in commands.values()} == {HOLDS}


@mark.slow
def test_a_damaged_table_is_one_line_and_nothing_is_written(
    tmp_path, saved, call, accepts
):
    kept = tmp_path / "kept"
    assert accepts(saved("run", ROW)) == HOLDS
    file = kept / HISTORY
    contents = file.read_bytes()
    run = saved("later", changed(error=2e-15), about=replace(HERE, date="later"))
    with write_tables(tmp_path) as columns:
        columns.add([ROW])
    # a bit of a number, which the checksum of its page shows
    place = contents.index(struct.pack("<d", ROW.error))
    flipped = contents[:place] + bytes([contents[place] ^ 1]) + contents[place + 1 :]
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
        words = f"--to = '{file}': is damaged, or no table written by `accept`"
        assert (code, line) == (BAD_INPUT, f"error: {words}\n"), damaged[:20]
        assert read_files(kept) == before


@mark.slow
def test_what_has_no_record_of_its_rows_is_compared_with_a_note_and_not_accepted(
    saved, compare, accepts
):
    good, bare = (saved(name, ROW) for name in ("good", "bare"))
    (bare / ABOUT).unlink()
    code, lines = compare(bare, good)
    note = f"{bare / TABLE}: not verified, its {ABOUT} states no SHA-256 or is missing"
    assert code == HOLDS and note in lines
    assert accepts(bare) == BAD_INPUT


@mark.parametrize(
    "rows, reason",
    [
        ([], "at least one comparison"),
        ([ROW], "a run that was finished"),
        ([changed(verdict=FAILS, error=1.0)], "--even-failing: FAILS: 1 of 1"),
        ([changed(verdict=REFUSES)], "--even-failing: Nothing was compared"),
    ],
)
def test_what_is_empty_unfinished_or_fails_is_not_accepted(
    rows, reason, tmp_path, saved, call
):
    run = saved("run", *rows)
    if rows == [ROW]:
        (run / "run.json").write_text("{}")
    code, _, message = call("accept", run)
    assert code == BAD_INPUT and reason in message
    assert not (tmp_path / "accepted").exists()
    if "--even-failing" in reason:
        assert call("accept", run, "--even-failing")[0] == HOLDS
    else:
        with refused(reason):
            read_run(run)


@mark.parametrize(
    "options, words",
    read_rows("""
--type crank-rocker | say --random N too
--seed 3 | say --random N too
--random 3 --type crank | crank-rocker, drag-link
--engines , | must be among pinocchio-inverse
--against none | --against = 'none': must be a folder with results.csv
--html changes.html | say --against BASELINE too
a.toml --random 3 | leave out the scene files
--suite hard --random 3 | leave out scene files and --random
"""),
)
def test_options_of_a_run_that_would_do_nothing_are_refused_before_it(
    options, words, tmp_path, call
):
    code, _, message = call("run", *options.split(), "--out", tmp_path / "out")
    assert code == BAD_INPUT and message.startswith("error: ") and words in message
    assert message.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_run_with_too_many_rows_for_a_text_is_read_from_its_columns(tmp_path):
    """No greatest error is NaN by the columns."""
    with write_tables(tmp_path) as columns:
        columns.add([ROW, changed(quantity="watch", error=math.nan, verdict=FAILS)])
    runs = []
    for unlinked in ("run.json", TABLE):
        (tmp_path / unlinked).unlink(missing_ok=True)
        write_about(HERE, tmp_path)
        runs.append(read_run(tmp_path))
    assert repr(runs[0]) == repr(runs[1])
    assert not compare_rows(*runs).regressed
    file = tmp_path / "results.parquet"
    assert pq.read_table(file)["error"].null_count == 1
    file.write_bytes(b"no columns")
    with refused("states 2 rows"):
        read_run(tmp_path)
    (tmp_path / ABOUT).unlink()
    with refused("is not a table written by"):
        read_run(tmp_path)


def test_what_is_compared_can_be_chosen(saved, call, compare):
    """A part of a long run compares with its part, in every column that chooses."""
    rows = [changed(scene=f"scene {k:03d}") for k in range(80)]
    whole, some = saved("whole", *rows), saved("some", rows[7], rows[70])
    code, lines = compare(whole, some)
    assert code == HOLDS and lines[0] == "Not run: scene scene 000 (1 row)"
    assert lines[50] == "Not run: 28 more (28 rows)"
    assert " in 2 of 80 rows: 78 not run, 2 same" in lines[-1]
    code, (*_, verdict) = compare(whole, some, "--only", "scene 007, scene 070")
    assert code == HOLDS and " in 2 rows: 2 same" in verdict
    assert verdict.startswith(f"No regression against {whole} of {HERE.date[:10]}")
    worse = saved("worse", rows[7], replace(rows[70], quantity="F12", error=1e-9))
    held = saved("held", rows[7], replace(rows[70], quantity="F12"))
    for options, code in (
        (("--quantity", "torque"), HOLDS),
        (("--only", "scene 007"), HOLDS),
        ((), FAILED),
    ):
        assert compare(held, worse, *options)[0] == code
    expected = "error: --engines = 'motor': must be among engine\n"
    assert call("compare", whole, some, "--engines", "motor") == (2, "", expected)


SETTINGS = {**dict.fromkeys(("one", "two", "three", "formulas"), "exact"), "sim": "RK4"}


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


AT_FAULT = read_rows("""
sim F12, sim torque | only sim
one torque, sim torque | only one, sim
one torque, two torque, three torque, formulas power | all engines and the identity \
disagree: the formulas
one F12, two F12, three F12 | all engines disagree, and the identities hold: the \
formulas, or what all engines are given
formulas power | only the identities: the formulas, or what is stated of them
""")


@mark.parametrize(
    "worse, sentence",
    slow_but(AT_FAULT[:1], AT_FAULT),
)
def test_the_report_says_who_is_at_fault(worse, sentence):
    old, new = disagreeing(worse.split(", "))
    changes = compare_made_here(old, new)
    sentence += ", 3 of 3 scenes"
    assert changes.sentences == [sentence]
    for form in FORMS[1:]:
        assert sentence in html.unescape(form(changes))


@mark.slow
def test_rows_that_changed_are_grouped_by_engine_and_cause_the_worst_first():
    """One cause for all scenes, with the numbers of the worst."""
    old, new = disagreeing(["sim F12", "sim torque", "one torque"])
    better = [replace(row, error=1e-9) if row.engine == "two" else row for row in old]
    worst = next(i for i, row in enumerate(new) if row.failed and row.scene == "b")
    new[worst] = replace(new[worst], error=1.0)
    changes = compare_made_here(better, new)
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
    page = html.unescape(render.write_differences_page(changes))
    assert groups[0].partition(": ")[2] in page


EXACT = registry.Engine("engine", free_body.FreeBody, EQUIVALENCE)


def made(rows, scenes):
    """Return a run of these rows, whose record states these scenes."""
    stated = {name: describe_changes(scene) for name, scene in scenes.items()}
    return describe_run([EXACT], "suite", stated), rows


def weighted(inertia, **changes):
    """The scene with another moment of inertia of its output."""
    output = replace(SCENE.linkage.output, inertia=inertia)
    return replace(relink(SCENE, output=output), **changes)


OTHER, WRONG = changed(scene="other"), changed(error=1e-9, allowed=1e-8)
FINER = SCENE.motion.replace(angle=Sweep(0.0, 2.0 * math.pi, 720))
QUESTIONS = [
    (
        {"scene": weighted(0.05, title="another title")},
        {},
        "scene scene changed (1 row)",
        "scene scene: bars.output.inertia 0.048 -> 0.05 kg m^2",
    ),
    (
        {"scene": weighted(0.048, motion=FINER)},
        {},
        "scene scene has other positions (1 row)",
        "steps 360 -> 720",
    ),
    (
        {},
        {"setting": "RK4"},
        "scene / engine: exact -> RK4 (1 row)",
        "scene / engine: exact -> RK4 (1 row)",
    ),
]
"""Scenes of a new run, fields of its row, why it is not compared, and what is told."""


@mark.parametrize("scenes, fields, why, told", QUESTIONS)
def test_rows_that_answer_another_question_are_named_first_and_not_compared(
    scenes, fields, why, told
):
    before = {"scene": weighted(0.048), "other": SCENE}
    row = replace(WRONG, **fields)

    def compare_with(*rows):
        old = made([ROW, OTHER][: len(rows)], before)
        return compare_rows(old, made(rows, before | scenes))

    changes = compare_with(row, OTHER)
    assert changes.name_whole(Kind.NOT_COMPARED) == [why] and changes.status == HOLDS
    for form in FORMS[1:]:
        assert told in html.unescape(form(changes))
    assert compare_with(replace(row, verdict=FAILS)).regressed
    assert compare_with(row).nothing


@mark.slow
def test_a_renamed_scene_is_found_by_what_it_states(saved, compare):
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
    renamed = ["renamed: g -> gate", "renamed: h -> a"]
    for options, many, words in (
        ((), 3, "3 regressions against"),
        (("--only", "gate"), 1, "1 regression against"),
        (("--only", "h"), 1, "1 regression against"),
    ):
        code, lines = compare(*both, *options)
        assert code == FAILED and {*renamed} < {*lines}
        assert lines[-1].startswith(f"{words} {both[0]}")
        assert f" in {many} rows: {many} worse." in lines[-1]


def test_of_suites_too_long_to_be_stated_only_the_hash_says_that_scenes_changed():
    old = replace(HERE, settings=HERE.settings | {"suite": "0123456789abcdef"})
    first, *others = (changed(scene=f"another {k}") for k in range(3))
    found = compare_rows((old, [ROW, first]), (HERE, [ROW, first, *others]))
    assert not found.scenes and not found.regressed
    rows, note = found.notes
    assert rows == "2 of 4 rows are compared: the others are of one run alone"
    assert "0123456789ab -> suite" in note
    assert f"\n{rows}\n" in render.write_differences(found)


def hold(error, reason="fewer digits", **fields):
    """The engine with a tolerance that it states itself."""
    text = f"{error:g} of the scale: {reason}"
    bound = ErrorBound(guests.STATED_BY_THE_ENGINE, text, error, False)
    return replace(EXACT, tolerance=bound, **fields)


RULES = [
    (hold(1e-14), hold(1.001e-14, "because"), ["factor", "reason"]),
    (hold(1e-14), hold(1e-14), []),
    (hold(1e-6), hold(1e-6, "because"), ["reason"]),
    (hold(1e-6), hold(1e-8, "because"), []),
    (hold(1e-6), hold(1e-6, residuals=True), ["prediction"]),
    (hold(1e-6), hold(1e-6, answers=("torque",)), ["answers"]),
    (
        replace(EXACT, tolerance=FULL_ACCURACY),
        EXACT,
        ["class", "over the condition", "reason"],
    ),
]


@mark.parametrize("old, new, what", RULES)
def test_each_entry_of_a_rule_can_weaken_it(old, new, what):
    weakened = rules.list_weakened(rules.list_rules([old]), rules.list_rules([new]))
    assert [weakening.what for weakening in weakened] == what


def test_k_and_a_stated_limit_are_rules_whoever_changes_them(monkeypatch):
    monkeypatch.setattr(rules, "K", 500.0)
    harsher = limits.BOUNDARIES[0]._replace(boundary=0.5)
    monkeypatch.setattr(rules, "BOUNDARIES", (harsher, *limits.BOUNDARIES[1:]))
    found = compare_rows((HERE, [ROW]), made([ROW], {}))
    assert [str(weakening) for weakening in found.weakened] == [
        "K: factor 50.0 -> 500.0",
        f"limit of {harsher.engine}: {harsher.name}: boundary 0.05 -> 0.5",
    ]
    assert found.status == FAILED
    assert render.write_differences(found).startswith("Weaker rule: K: factor")


LOOSE = changed(
    allowed=1e-2, reason="as the engine states: 0.01 of the scale: fewer digits"
)


@mark.slow
def test_a_wider_tolerance_is_a_regression_over_two_nights(
    tmp_path, saved, call, compare, accepts
):
    """The first night widens it and is not accepted.

    The second hides an error in it.
    """
    kept = tmp_path / "kept"
    assert accepts(saved("strict", ROW)) == HOLDS
    wider = describe_run([hold(1e-2)], "suite")
    nights = [
        saved(f"{error}", replace(LOOSE, error=error), about=wider)
        for error in (1e-15, 5e-3)
    ]
    for night in nights:
        code, (first, *lines) = compare(kept, night)
        assert code == FAILED
        assert re.match("Weaker rule: engine: factor 1.11.*-> 0.01$", first)
        assert any(line.startswith("Worse: ") for line in lines) == (night == nights[1])
        code, _, refused = call("accept", night, "--to", kept)
        assert code == BAD_INPUT
        assert "--allow-weaker" in refused and "engine: factor" in refused
    assert accepts(nights[0], "--allow-weaker") == HOLDS
    assert compare(kept, nights[0])[0] == HOLDS


def test_a_run_that_leaves_out_what_was_judged_is_accepted_if_that_is_meant(
    tmp_path, saved, call, accepts
):
    assert accepts(saved("all", ROW, OTHER)) == HOLDS
    part = saved("part", ROW)
    code, _, refused = call("accept", part, "--to", tmp_path / "kept")
    assert code == BAD_INPUT and "leaves out what was judged in" in refused
    assert "(scene other (1 row)): say --allow-weaker" in refused
    assert accepts(part, "--allow-weaker") == HOLDS


def test_rows_whose_allowance_grew_are_told():
    """K eps/condition may grow at a worse position."""
    hard, easier = (
        changed(condition=1e-2, allowed=allowed) for allowed in (1e-12, 9e-14)
    )
    found = compare_rows((NOTHING_KNOWN, [ROW]), (NOTHING_KNOWN, [hard]))
    line = "scene / engine / torque: 1.0e-14 -> 1.0e-12"
    assert found.status == HOLDS and found.grown == [line]
    assert f"Allowed more: {line}\n" in render.write_differences(found)
    assert not compare_made_here([ROW], [easier]).grown


@mark.slow
def test_a_run_of_another_suite_is_never_called_no_regression(saved, call):
    """Two of eight rows stand in both: the verdict says so before anything else."""
    both = [ROW, changed(quantity="F12")]
    others = [changed(scene=f"scene {k}") for k in range(6)]
    old, new = saved("old", *both), saved("new", *both, *others)
    code, printed, error = call("compare", old, new)
    assert code == BAD_INPUT and "shares 2 of 8 rows with the new run" in error
    assert "\nRuns of two suites: no regression against" in printed


def run_free_body(call, out, *options):
    """Run scene files through the free bodies alone."""
    return call(
        "run", *options, "--engines", "free-body", "--no-pictures", "--out", out
    )


def test_the_run_itself_is_written_as_junit(tmp_path, monkeypatch, call):
    monkeypatch.setattr("fourbar_validation.report.junit.MOST_PASSING_CASES", 10)
    judge_here(monkeypatch)
    xml, out = tmp_path / "run.xml", tmp_path / "out"
    assert run_free_body(call, out, MODEL, "--junit", xml)[0] == HOLDS
    report, rows = ET.parse(xml).getroot(), read_run(out)[1]
    names = [case.get("name") for case in report.iter("testcase")]
    left_out = f"{len(rows) - 10} rows more: see results.parquet"
    assert names == [*(row.quantity for row in rows[:10]), left_out]
    assert report.get("failures") == "0" and report.get("name").startswith("All ")
    failing = [replace(row, verdict=FAILS, reason="not held") for row in rows[20:22]]
    cases = list(list_cases([*rows, *failing]))[10:]
    told = [(case.outcome, case.message.partition(": ")[2]) for case in cases]
    assert told == [("failure", "not held")] * 2 + [("skipped", "")]


HELD = changed(engine="mine", quantity="F32")
FAILED_ROW = replace(HELD, error=1e-3, verdict=FAILS)
DATES = [f"2026-01-0{night}T02:00:00+00:00" for night in (1, 2, 3, 4)]
RUNS = [
    f"the run of {date[:19].replace('T', ' ')} at commit c{night}"
    for night, date in enumerate(DATES)
]


@fixture
def nights(tmp_path, saved, accepts):
    """Accepts runs, the oldest first, and returns the folder that keeps them."""

    def accept_all(*runs):
        for night, rows in enumerate(runs):
            about, _ = made(rows, {"scene": SCENE})
            versions = about.versions | {"mujoco": f"4.{night}.0"}
            versions |= {"newcomer": "1"} if night else {}
            about = replace(
                about, versions=versions, date=DATES[night], commit=f"c{night}"
            )
            latest = saved(f"night {night}", *rows, times=TIMES, about=about)
            assert accepts(latest, "--even-failing", "--allow-weaker") == HOLDS
        return tmp_path / "kept"

    return accept_all


@mark.slow
def test_accepted_runs_are_rows_of_one_table_that_pandas_reads(
    tmp_path, nights, accepts
):
    errors = [1e-15, 2e-15, 3e-15]
    kept = nights(*([changed(error=error)] for error in errors))
    assert accepts(tmp_path / "night 1") == HOLDS  # it is in it
    table, dates = pd.read_parquet(kept / HISTORY), DATES[:3]
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
    assert all(f">c{night}<" in figure.svg for night in range(3))
    assert collect_history(tmp_path) == []
    (kept / HISTORY).write_bytes(b"no columns")
    with refused("is damaged, or no table"):
        summarise(kept / HISTORY)


ROWS = {
    "held": HELD,
    "fails": FAILED_ROW,
    "silent": replace(FAILED_ROW, quantity="all"),
    "F43": replace(HELD, quantity="F43"),
    "theirs": replace(FAILED_ROW, engine="theirs"),
    "b": replace(FAILED_ROW, scene="b"),
}
SINCE = read_rows("""
held | fails | held in {before}
held held | fails | held in {before}
fails | fails | failed too in {before}
fails fails | fails | failed too in {before}, and in every accepted run since {runs[0]}
fails held fails fails | fails | has not held since {runs[2]}; it held in {runs[1]}
# the engine broke down: nothing of it held
held silent | fails | has not held since {runs[1]}; it held in {runs[0]}
F43 | fails | is not in {before}
held F43 | fails | is not in {before}; it held in {runs[0]}
theirs | fails | is not in {before}
b | fails | is not in {before}
held | silent | answered in {before}
fails | silent | answered in {before}
held silent | silent | has not answered since {runs[1]}; it answered in {runs[0]}
""")
"""A row of each accepted run, one of a later run, and what is said of it."""


@mark.parametrize("runs, failure, words", SINCE)
def test_a_failure_is_looked_up_in_the_accepted_runs(
    runs, failure, words, tmp_path, nights
):
    """A run that was not accepted tells of itself."""
    accepted = runs.split()
    kept = nights(*([ROWS[row], replace(HELD, scene="other")] for row in accepted))
    key = ("scene", "mine", ROWS[failure].quantity)
    for folder in (kept, tmp_path / "night 0")[: 1 + (len(accepted) == 1)]:
        run = open_run(folder)
        since = find_since(read_history(run), run, [key])[key]
        assert since == words.format(before=run.describe(), runs=RUNS)


@mark.slow
def test_a_name_that_does_not_print_or_is_a_formula_is_one_name_everywhere(
    tmp_path, monkeypatch, call
):
    """Escapes change the order of names.

    A spreadsheet calculates a cell that begins with =.
    """
    judge_here(monkeypatch)
    names = ["a\x1b", "aB", "=cmd|'calc'!A0", "+1", "'quoted"]
    motion = Motion(Sweep(0.1, 1.0, 3), 1.0)
    text = dump(replace(SCENE, motion=motion))
    files = [tmp_path / f"{name}.toml" for name in (*names, "a\\x1b")]
    for file in files:
        file.write_text(text)
    run = tmp_path / "run"
    assert run_free_body(call, run, *files[:-1])[0] == HOLDS
    assert call("compare", run, run)[0] == HOLDS
    for name in (TABLE, TIMINGS):
        rows = [*csv.reader((run / name).read_text().splitlines())]
        assert not any(cell.startswith(("=", "+", "@")) for row in rows for cell in row)
    kept = open_run(run)
    printed = sorted(["a\\x1b", *names[1:]])
    assert [*kept.frame().scene.unique()] == printed == [*kept.about.scenes]
    assert [*kept.times().scene.unique()] == printed
    with refused("must have a name of its own"):
        read_scene_files([files[0], files[-1]])


@mark.parametrize(
    "name", ["lock", "run.json", TABLE, TIMINGS, "report.html", ABOUT, HISTORY]
)
def test_a_folder_where_a_file_belongs_is_one_line_and_nothing_is_written(
    name, tmp_path, saved, call, accepts
):
    out, kept = (tmp_path / folder / name for folder in ("out", "kept"))
    if name not in (ABOUT, HISTORY):
        out.mkdir(parents=True)
        message = f"error: path = '{out}': must name a file, not a folder\n"
        assert run_free_body(call, out.parent, MODEL) == (BAD_INPUT, "", message)
        assert [*out.parent.iterdir()] == [out]
    if name in (TABLE, TIMINGS, ABOUT, HISTORY):
        kept.mkdir(parents=True)
        assert accepts(saved("run", ROW)) == BAD_INPUT
        assert [*kept.parent.iterdir()] == [kept]


def test_a_full_disk_names_the_file_that_does_not_fit(tmp_path, monkeypatch, saved):
    run, kept = saved("run", ROW), tmp_path / "kept"

    def fill(source, target):
        """Raise what shutil raises."""
        words = "No space left on device"
        raise OSError(errno.ENOSPC, words, str(source), None, str(target))

    monkeypatch.setattr("fourbar_validation.regression.record.shutil.copyfile", fill)
    with raises(OSError) as caught:
        record.accept(open_run(run), kept)
    assert caught.value.filename == str(kept / TABLE)
    assert caught.value.filename2 is None


@mark.slow
def test_what_is_too_long_for_a_text_and_a_history_is_compared_and_accepted(
    tmp_path, monkeypatch, compare, accepts
):
    for module in ("compare.results_file", "regression.accept"):
        monkeypatch.setattr(f"fourbar_validation.{module}.CSV_ROWS", 40)
    old, new = tmp_path / "old", tmp_path / "new"
    for folder, times in ((old, 1.0), (new, 1e3)):
        folder.mkdir()
        with write_tables(folder) as columns:
            for k in range(101):
                error = 1e-9 * (1.0 + k * (times - 1.0))
                name = f"random-0-{k:09d}"
                columns.add([changed(scene=name, condition=1e-3, error=error)])
        write_about(HERE, folder)
        assert not (folder / TABLE).exists() and len(columns.first_lines) <= 40
    code, lines = compare(old, new)
    assert code == FAILED and lines[-1].startswith("100 regressions against")
    assert accepts(new) == HOLDS
    kept = tmp_path / "kept"
    assert {path.name for path in kept.iterdir()} == {ABOUT, "results.parquet"}
    assert compare(kept, new)[0] == HOLDS
