"""The report as text.

Every number traceable to its row, short enough where it must be, whatever a scene is
called.
"""

import base64
import csv
import gzip
import io
import json
import math
import re
import shlex
from dataclasses import replace
from functools import cache
from html import unescape
from importlib import import_module

import numpy as np
import pytest

import fourbar
from fourbar.quantities import PIN_FORCES
from fourbar.scene import command
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.rows import AGREES, FAILS, REFUSES, Row, write_rows
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines import guests
from fourbar_validation.engines.registry import ENGINES, WORK, load_further
from fourbar_validation.engines.table import choose_engines, fill_table
from fourbar_validation.report import svg
from fourbar_validation.report.figures import (
    STRETCHES,
    draw_scene_figure,
    find_worst_of_segments,
)
from fourbar_validation.report.html import (
    ALL_OPEN,
    Section,
    write_html,
    write_summary_page,
)
from fourbar_validation.report.record import Record
from fourbar_validation.report.summary import OWN_CONSISTENCY
from fourbar_validation.report.svg import LEAST_DRAWN_ERROR
from fourbar_validation.report.terminal import print_table
from fourbar_validation.run.judge import judge_for_report
from tests.support.guests import write_program
from tests.support.here import summary_of
from tests.support.scenes import crank_rocker

COMMENT_LIMIT = 65_536
"""Characters of a comment on GitHub."""
HOSTILE = "</script><img src=x onerror=alert(1)>\"'&|`*"


@cache
def demo(*, draw=True):
    """A small scene as two exact engines and the free bodies judge it."""
    scene = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 36), 5.0))
    return judge_for_report(
        "demo",
        scene,
        tuple(w for w in ENGINES if w.name != "mujoco-simulated"),
        draw=draw,
    )


def copies(count, *, failing=0):
    """The scene under many names; in the first ones a torque fails."""
    made = []
    for number in range(count):
        name = f"scene-{number:03d}"
        rows = [replace(row, scene=name) for row in demo().rows]
        if number < failing:
            index = next(i for i, row in enumerate(rows) if row.quantity == "torque")
            rows[index] = replace(rows[index], error=0.5, verdict=FAILS)
        made.append(replace(demo(), name=name, rows=rows))
    return made


def report(pages, **more):
    """Summary and page, the lines of results.csv counted as `run` does."""
    lines, line = {}, 2
    for record in pages:
        lines[record.name] = line
        line += len(record.rows)
    summary = summary_of(pages)
    return summary, write_html(summary, lines, **more)


def unpacked(text):
    """The page with the packed bodies of its scenes laid open."""
    return re.sub(
        r'<script type="application/gzip">(.*?)</script>',
        lambda match: gzip.decompress(base64.b64decode(match.group(1))).decode(),
        text,
        flags=re.DOTALL,
    )


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, ALL_OPEN + 1])
def test_every_link_leads_to_a_row_and_the_row_says_what_results_csv_says_there(count):
    pages = copies(count, failing=1)
    text = unpacked(report(pages)[1])
    table = write_rows(row for record in pages for row in record.rows)
    lines = list(csv.reader(io.StringIO(table)))
    rows = dict(re.findall(r'<tr id="row-(\d+)"[^>]*>(.*?)</tr>', text))
    assert {int(line) for line in rows} == set(range(2, len(lines) + 1))
    for line, shown in rows.items():
        cells = [
            re.sub(r"<[^>]*>", "", cell).split()
            for cell in re.findall(r"<td[^>]*>(.*?)</td>", shown)
        ]
        record = dict(zip(lines[0], lines[int(line) - 1], strict=True))
        assert cells[1][0] == record["engine"] and cells[2] == [record["quantity"]]
        assert cells[3] == [f"{float(record['error']):.2e}"]
    linked = {int(line) for line in re.findall(r'href="#row-(\d+)"', text)}
    assert linked <= {int(line) for line in rows} and len(linked) > 20 * count


@pytest.mark.slow
def test_the_verdict_stands_first_and_a_failure_is_named_before_anything_else():
    summary, text = report(copies(3, failing=1))
    assert summary.headline.startswith("FAILS: ")
    body = unescape(text[text.index("<body>") :])
    parts = (summary.headline, "What fails</h2>", "Independent engines</h2>")
    places = [body.index(part) for part in parts]
    assert places == sorted(places)
    assert "What fails</h2>" not in report(copies(3))[1]


@pytest.mark.slow
def test_a_scene_cannot_write_into_the_demo():
    words = dict.fromkeys(("title", "source", "name"), HOSTILE)
    hostile = replace(demo(), **words, left_out=[HOSTILE])
    section = Section("more", HOSTILE, HOSTILE, [HOSTILE], [[HOSTILE]])
    summary, text = report([hostile], sections=[section])
    assert "<img src=x" not in text
    assert len(re.findall("<script", text)) == 1
    assert "<img" not in write_summary_page(summary)


@pytest.mark.slow
def test_nothing_is_fetched():
    pictures = {"scene-000": "iVBORw0KGgo="}
    _, text = report(copies(2), pictures=pictures, no_pictures="none")
    text = re.sub(r'xmlns(:xlink)?="[^"]*"', "", text)
    assert not re.search(r'(?:src|href)="(?!#|data:)', text)
    assert "url(" not in re.sub(r"url\(#", "", text) and "@import" not in text


@pytest.mark.slow
def test_the_comment_of_a_pull_request_holds_200_scenes_that_all_fail():
    assert len(write_summary_page(summary_of(copies(200, failing=200)))) < COMMENT_LIMIT


@pytest.mark.slow
def test_a_section_of_another_module_is_shown_and_linked():
    section = Section("hard", "Hard cases", "As predicted.", ["family"], [["toggle"]])
    _, text = report(copies(2), sections=[section])
    for part in ('<a href="#hard">Hard cases</a>', '<h2 id="hard">', ">toggle</th>"):
        assert part in text


def test_the_errors_drawn_are_the_largest_of_their_stretches():
    error = np.random.default_rng(1).uniform(size=1000)
    for phase in (0.0, 0.3, 0.9):
        worst = find_worst_of_segments(error, phase)
        assert STRETCHES <= len(worst) <= STRETCHES + 1
        assert int(np.argmax(error)) in worst
        assert np.all(np.diff(worst) > 0)
    error[worst[3]] = np.nan
    assert worst[3] not in find_worst_of_segments(error, 0.9)
    assert len(find_worst_of_segments(np.full(40, np.nan), 0.0)) == 0
    assert len(find_worst_of_segments(np.array([LEAST_DRAWN_ERROR]), 0.5)) == 1


@pytest.mark.slow
def test_the_times_of_engines_are_those_of_the_run():
    """The median over scenes.

    Of an engine that refused none, and beside our own consistency that of the formulas.
    """
    whole, bare = demo(), demo(draw=False)
    scenes = []
    for k in (1.0, 2.0, 8.0):
        timings = [replace(one, seconds=k * one.seconds) for one in whole.timings]
        scenes.append(replace(bare, timings=timings))
    lines = {line.name: line for line in summary_of(scenes).engines}
    seconds = {timing.engine: timing.seconds for timing in whole.timings}
    exact = {"pinocchio-inverse", "mujoco-inverse", "free-body"}
    assert set(seconds) == {"formulas", *exact}
    page = unescape(report(scenes)[1])
    for engine, taken in seconds.items():
        line = lines[OWN_CONSISTENCY if engine == "formulas" else engine]
        assert line.microseconds == pytest.approx(2.0 * 1e6 * taken / 37, rel=1e-12)
        times = taken / seconds["formulas"]
        assert line.times_formulas == pytest.approx(times, rel=1e-12)
        assert line.work == WORK[engine] and WORK[engine] in page
    refused = replace(whole.rows[0], engine="free-body", verdict=REFUSES)
    silent = summary_of([replace(bare, rows=[*whole.rows, refused])])
    (line,) = [line for line in silent.engines if line.name == "free-body"]
    assert math.isnan(line.microseconds)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "pictures"),
    [
        (fourbar.Motion(fourbar.Sweep(0.0, 6.0, 24)), 3),
        (fourbar.Motion(1.0, 5.0), 1),  # the linkage alone
        (fourbar.Motion(1.0, 0.0, free=fourbar.Free(0.2, 20)), 3),
        (fourbar.Motion(fourbar.Sweep(0.0, 6.0, 24), 5.0), 3),
    ],
    ids=["positions", "one position", "released", "sweep"],
)
def test_every_kind_of_scene_is_drawn(motion, pictures, monkeypatch):
    engines = tuple(w for w in ENGINES if w.name == "free-body")
    made = judge_for_report("kind", crank_rocker(motion=motion), engines)
    assert made.figure.count("<svg") == pictures
    assert "kind: crank-rocker" in report([made])[1]


def test_an_engine_that_is_missing_is_reported_as_failing():
    absent = replace(ENGINES[0], start=lambda: import_module("tests.absent"))
    record = judge_for_report("demo", crank_rocker(), (absent,), draw=False)
    summary, text = report([record])
    assert summary.verdict.startswith("FAILS")
    assert "What fails</h2>" in text and "No module named" in text and "∞" in text


@pytest.mark.slow
def test_many_scenes_give_a_short_report_of_the_worst(monkeypatch):
    monkeypatch.setattr("fourbar_validation.report.summary.SCENES_SHOWN", 20)
    pages = copies(100)
    for number, record in enumerate(pages):
        record.rows[0] = replace(
            record.rows[0],
            error=number * 8e-3,
            allowed=1.0,
        )
        record.left_out = [
            f"mujoco-simulated: falls to {number * 1e-3:.1e}; below 0.05 it is not"
            " simulated"
        ]
        errors = {"error_at_4h": 1e-3, "error_at_2h": 1e-4}
        record.evidence = {"sim": {**errors, "observed_order": 3.0 + number}}
        first = record.timings[0]
        simulated = replace(first, engine="sim", setting=f"RK4 {628 + number}/rev")
        record.timings = [*record.timings, simulated]
    summary, text = report(pages)
    assert [worst.row.scene for worst in summary.worst[:2]] == [
        "scene-099", "scene-098"
    ]  # fmt: skip
    shown = {f"scene-0{number}" for number in range(80, 100)}
    assert {scene.name for scene in summary.shown} == shown
    refusal = "falls to 0.0e+00; below 0.05 it is not simulated"
    assert summary.refusals == [("mujoco-simulated", refusal, 100)]
    assert summary.orders[0][0] == "scene-000" and summary.judged == 400
    page = write_summary_page(summary)
    assert "the 80 of 400 scenes and engines" in page and page.count("\n") < 160
    # 20 scenes, each with 30 kB of compressed rows; the table of all of them is
    # compressed too
    assert len(text) < 1.0e6


@pytest.mark.slow
def test_every_engine_of_a_report_has_a_mark_of_its_own(monkeypatch, tmp_path):
    """Whoever is drawn first, and in whatever process: the engine says its number."""
    monkeypatch.setattr(svg, "STYLE_NUMBERS", {})
    classes = "tests.support.hostile_class:"
    program = shlex.split(write_program(tmp_path, "plain"))
    (tmp_path / "engines.toml").write_text(
        f'[[engine]]\nname = "one"\ncommand = {json.dumps(program)}\n'
        f'[[engine]]\nname = "another"\ncommand = {json.dumps(program)}\n'
    )
    table = fill_table([tmp_path], [f"{classes}Right", f"{classes}Leaves"])
    engines = [
        engine
        for engine in choose_engines("free-body,one,another", table)
        if isinstance(engine, guests.Guest)
    ]
    assert len(engines) == 4
    names = [engine.name for engine in (*ENGINES, *load_further(), *engines)]
    svg.STYLE_NUMBERS.update(guests.number_guests(engines))
    marks = {
        name: (svg.choose_style(name).symbol, svg.choose_style(name).marker)
        for name in names
    }
    assert (
        len({mark for mark, _ in marks.values()})
        == len({marker for _, marker in marks.values()})
        == len(names)
    )
    svg.STYLE_NUMBERS.clear()
    svg.STYLE_NUMBERS.update(
        guests.number_guests(engines[1:])
    )  # a scene in which the first broke down
    assert svg.choose_style(names[-1]).symbol == marks[names[-1]][0]
    assert all(svg.choose_style(name).variable in svg.LIGHT_COLOURS for name in names)


@pytest.mark.parametrize(
    ("error", "allowed", "cell"),
    [(2.5e-7, 1e-5, "2.5e-07 of 1e-05"), (1.16e-9, 1.28e-9, "1.2e-09 of 1.3e-09")],
)
def test_a_run_prints_one_row_an_engine_and_the_rest_on_demand(
    tmp_path, capsys, error, allowed, cell
):
    """Beside the error what is allowed to it; a share of undecided numbers is no error.

    Our own rows are one.
    """
    simulated = ("first", "mujoco-simulated", "RK4", "F12")
    row = Row(*simulated, error, allowed, AGREES, "", math.radians(40.0), 1.0)
    share = replace(row, quantity="undecided", error=0.4, allowed=0.5, theta_2=math.nan)
    identity = replace(row, engine="formulas", quantity="torque", error=0.0)
    rows, left_out = [row, share, identity], ["equilibria: too near"]
    record = replace(
        demo(draw=False),
        name="first",
        rows=rows,
        left_out=left_out,
    )
    summary = summary_of([record])
    first, second = summary.engines
    assert (first.name, second.name) == ("mujoco-simulated", "our own consistency")
    assert first.worst == row and first.undecided == 0.4
    print_table(summary, tmp_path)
    printed = capsys.readouterr().out
    words = " ".join(printed.split())
    version = summary.versions["mujoco"]
    row_of_table = rf"MuJoCo \S+ (simulated )?- {re.escape(cell)} - \d"
    assert re.search(row_of_table, words), words
    # the numbers say what they are
    assert "error of allowed torque pin forces motion compared" in words
    assert "without an engine: 1 identity of the formulas" in words
    assert "all hold" in words
    assert "study" not in words, "what is no engine's stands in no row"
    assert "1 not compared: 1 where a check does not apply" in words
    assert words.startswith(summary.headline)
    assert words.endswith(f"Report: {tmp_path / 'report.html'}")
    assert len(printed.splitlines()) <= 25
    print_table(summary, tmp_path, verbose=True)
    words = " ".join(capsys.readouterr().out.split())
    assert "not compared: equilibria in 1 scene: too near" in words
    text = write_summary_page(summary)
    table = text[text.index("| largest") :].splitlines()
    head = "| largest error of allowed | torque | pin forces | motion | compared |"
    assert table[0] == head
    assert table[2].startswith(f"| MuJoCo {version}, simulated | - | {cell}")


@pytest.mark.slow
def test_the_picture_shows_the_pin_force_that_fails():
    """Without a failure it shows the largest."""
    scene = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 36), 5.0))
    solution = fourbar.solve(scene, "force")
    sizes = {name: magnitude(solution[name]).max() for name in PIN_FORCES}
    largest, other = max(sizes, key=sizes.get), min(sizes, key=sizes.get)
    numbers = {name: solution[name] for name in ("torque", *PIN_FORCES)}
    answer = Answer("free-body", "exact", command(scene), quantities=numbers)
    record = Record("demo", scene, solution=solution, answers=[answer])
    assert f"|{largest}|" in (draw_scene_figure(record) or "")
    record.rows = [
        fail(replace(OF_MINE, quantity=other), error=0.5),
        fail(replace(OF_MINE, quantity=largest)),
    ]
    drawn = draw_scene_figure(record) or ""
    assert f"|{other}|" in drawn and f"|{largest}|" not in drawn


def record_of(name, rows, **parts):
    return Record(name, title=name, rows=rows, **parts)


def fail(row, error=1e-3):
    return replace(row, error=error, verdict=FAILS)


OF_MINE = Row(
    "a", "mine", "exact", "torque", 1e-15, 1e-14, AGREES, "", math.radians(120.0), 1.0
)


def test_failures_are_one_line_an_engine_and_cause(tmp_path, capsys):
    """A mistake that explains more scenes is named before one that fits a few by
    chance.
    """
    swapped = "F32 and F43 are exchanged: F32, F43, all else agrees"
    sign = "sign reversed"
    scenes = []
    for k in range(23):
        of_scene = replace(OF_MINE, scene=f"scene {k:02d}")
        wrong = [fail(replace(of_scene, quantity=name)) for name in ("F32", "F43")]
        causes = {"mine": [sign, swapped] if k < 3 else [swapped]}
        scenes.append(record_of(of_scene.scene, [of_scene, *wrong], causes=causes))
    died = "exit status 3: Cannot find module 'x'"
    scenes[0].rows.append(Row.unmeasured("scene 00", "theirs", "", "all", FAILS, died))
    summary = summary_of(scenes)
    assert [str(cause) for cause in summary.overview.causes] == [
        f"mine: {swapped}: 23 scenes; worst scene 00 120 deg",
        f"theirs: no answer: {died}: 1 scene; worst scene 00",
    ]
    assert [line.engine for line in summary.lines] == ["mine", "theirs"]
    assert summary.headline.startswith(f"FAILS: mine is wrong: {swapped}")
    assert "F32 of scene 00 120 deg" in summary.headline
    print_table(summary, tmp_path)
    printed = capsys.readouterr().out
    assert len(printed.splitlines()) <= 40
    assert "fails scene" not in printed, "rows stay in the files"


@pytest.mark.slow
def test_a_red_figure_draws_the_error_and_the_limit_of_the_guest():
    """A reversed force lies on the curve of its size."""
    scene = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 36), 5.0))
    solution = fourbar.solve(scene, "force")
    assembled = np.ones(len(solution), dtype=bool)
    numbers = {"torque": solution.torque, "F43": -solution.F43}
    answer = Answer("mine", "exact", solution.at, assembled, numbers)
    row = Row(
        "s",
        "mine",
        "exact",
        "F43",
        2.0,
        1e-6,
        FAILS,
        "",
        1.0,
        1.0,
    )
    largest = int(np.argmax(np.max(np.abs(solution.F43), axis=0)))
    record = Record(
        "s",
        scene,
        rows=[row],
        solution=solution,
        answers=[answer],
    )
    drawn = draw_scene_figure(record) or ""
    assert f"F43 {'xy'[largest]} (N)" in drawn and "allowed to mine" in drawn
    held = replace(record, rows=[replace(row, verdict=AGREES, allowed=1e-14)])
    drawn = draw_scene_figure(held) or ""
    assert "F43 " not in drawn and "allowed to mine" not in drawn


def find_cause(*rows, **parts):
    """Return what is wrong in a scene with these rows, as the report puts it."""
    (cause,) = summary_of([record_of("a", rows, **parts)]).overview.causes
    return cause.text


def test_what_no_known_mistake_explains_is_told_by_what_differs_and_what_agrees():
    right = [replace(OF_MINE, quantity=name) for name in ("F12", "theta_3")]
    words = "torque differs, pin forces and motion agree; no known mistake explains it"
    assert find_cause(fail(OF_MINE), *right, causes={"mine": []}) == words
    assert find_cause(fail(OF_MINE, math.nan)) == "no number for torque"


def test_digits_that_are_missing_are_no_missing_term():
    rows = [fail(replace(OF_MINE, quantity=name), 3e-8) for name in ("torque", "F12")]
    words = "torque and pin forces differ, motion agrees: the first 7 digits agree"
    assert find_cause(*rows, replace(OF_MINE, quantity="theta_3")) == words


def test_an_engine_that_broke_down_alone_is_named_without_a_quantity():
    dead = Row.unmeasured("a", "theirs", "", "all", FAILS, "exit status 3: no licence")
    words = "theirs is wrong: no answer: exit status 3: no licence, in 1 scene; a."
    assert summary_of([record_of("a", [dead])]).headline == f"FAILS: {words}"


def refuse(scene, reason):
    return Row.unmeasured(scene, "theirs", "", "all", REFUSES, reason)


def test_a_reason_keeps_its_numbers_and_counts_those_like_it():
    """Reasons that differ in their numbers alone are one."""
    rows = [refuse(f"s{k}", f"2 of {k} signs were predicted") for k in (7, 8, 9)]
    rows.append(refuse("s", "it reads no cylinder"))
    alike = [refuse(f"s{k}", "4 bars, not 5") for k in (1, 2)]
    for refusals, words in (
        (
            rows,
            "(3 scenes): 2 of 7 signs were predicted (and 2 more like it, with other"
            " numbers)",
        ),
        (alike, "(2 scenes): 4 bars, not 5"),
    ):
        summary = summary_of(record_of(row.scene, [row]) for row in refusals)
        assert summary.overview.silent == [f"theirs: nothing compared {words}"]


def test_an_engine_without_an_answer_is_named_with_its_numbers():
    """A failing number beside it does not take the place of the reason."""
    dead = Row.unmeasured("a", "theirs", "", "all", FAILS, "exit status 3 after 4 s")
    beside = fail(replace(OF_MINE, engine="theirs"), error=1e6)
    assert find_cause(beside, dead) == "no answer: exit status 3 after 4 s"


def test_a_weaker_rule_stands_before_a_verdict_that_holds():
    summary = summary_of([record_of("a", [OF_MINE])])
    assert summary.good
    summary.overview.weaker = ["mine: factor 1e-14 -> 0.01", "mine: class a -> b"]
    summary.overview.baseline = "last night"
    assert not summary.good
    assert summary.headline.startswith(
        "WEAKER RULE: mine: factor 1e-14 -> 0.01, and 1 more, against last night. All 1"
    )


def test_two_engines_must_compare_torque_and_all_pin_forces_of_a_scene():
    scenes = []
    for name, counts in (
        ("a", {"one": 5, "two": 5}),
        ("b", {"one": 5, "two": 4}),
        ("c", {"one": 5}),
    ):
        rows = [
            replace(OF_MINE, scene=name, engine=engine, quantity=quantity)
            for engine, count in counts.items()
            for quantity in ("torque", *PIN_FORCES)[:count]
        ]
        scenes.append(record_of(name, rows))
    notes = summary_of(scenes).overview.notes
    words = "Torque and pin forces of 1 of 3 scenes:"
    assert any(note.startswith(words) for note in notes)


@pytest.mark.parametrize("columns", ["80", "40"])
def test_a_value_far_beyond_what_is_allowed_leaves_the_numbers_of_the_table_whole(
    columns, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("COLUMNS", columns)
    simulated = ("thesis_printed_inertias", "mujoco-simulated", "RK4")
    row = Row(
        *simulated,
        "limit_positions",
        3.14,
        1e-9,
        FAILS,
        "",
        0.5,
        0.3,
    )
    for theta_2, at in ((0.5, "28.6"), (float("nan"), "-")):
        placed = [replace(row, theta_2=theta_2)]
        record = replace(
            demo(draw=False),
            name=row.scene,
            rows=placed,
        )
        print_table(summary_of([record]), tmp_path, verbose=True)
        rows = [
            line.split()
            for line in capsys.readouterr().out.splitlines()
            if line.startswith("   mujoco-simulated")
        ]
        cells = ["limit_positions", "3.1e+00", "1.0e-09", "3.1e+09", at]
        assert [cell for _, *some in rows for cell in some] == cells
