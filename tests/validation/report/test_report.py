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
    _, text = report(pages)
    text = unpacked(text)
    lines = list(
        csv.reader(
            io.StringIO(write_rows(row for record in pages for row in record.rows))
        )
    )
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
def test_the_page_carries_results_csv_to_the_byte():
    pages = copies(3)
    _, text = report(pages)
    data = re.search(
        r'download="results.csv.gz" href="data:application/gzip;base64,([^"]*)"', text
    )
    assert data is not None
    assert gzip.decompress(base64.b64decode(data.group(1))).decode() == write_rows(
        row for page in pages for row in page.rows
    )


@pytest.mark.slow
def test_the_verdict_stands_first_and_a_failure_is_named_before_anything_else():
    summary, text = report(copies(3, failing=1))
    assert summary.headline.startswith("FAILS: ")
    body = unescape(text[text.index("<body>") :])
    assert (
        body.index(summary.headline)
        < body.index("What fails</h2>")
        < body.index("Independent engines</h2>")
    )
    assert "What fails</h2>" not in report(copies(3))[1]


@pytest.mark.slow
def test_a_scene_cannot_write_into_the_demo():
    hostile = replace(
        demo(),
        title=HOSTILE,
        source=HOSTILE,
        name=HOSTILE,
        left_out=[HOSTILE],
    )
    summary, text = report(
        [hostile],
        sections=[Section("more", HOSTILE, HOSTILE, [HOSTILE], [[HOSTILE]])],
    )
    assert "<img src=x" not in text
    assert len(re.findall("<script", text)) == 1
    assert "<img" not in write_summary_page(summary)


@pytest.mark.slow
def test_nothing_is_fetched():
    _, text = report(
        copies(2),
        pictures={"scene-000": "iVBORw0KGgo="},
        no_pictures="none",
    )
    text = re.sub(r'xmlns(:xlink)?="[^"]*"', "", text)
    assert not re.search(r'(?:src|href)="(?!#|data:)', text)
    assert "url(" not in re.sub(r"url\(#", "", text) and "@import" not in text


@pytest.mark.slow
def test_the_comment_of_a_pull_request_holds_200_scenes_that_all_fail():
    assert len(write_summary_page(summary_of(copies(200, failing=200)))) < COMMENT_LIMIT


@pytest.mark.slow
def test_a_section_of_another_module_is_shown_and_linked():
    _, text = report(
        copies(2),
        sections=[
            Section("hard", "Hard cases", "As predicted.", ["family"], [["toggle"]])
        ],
    )
    assert (
        '<a href="#hard">Hard cases</a>' in text
        and '<h2 id="hard">' in text
        and ">toggle</th>" in text
    )


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


def test_the_times_of_engines_are_those_of_the_run():
    """The median over scenes.

    Of an engine that refused none, and beside our own consistency that of the formulas.
    """
    scenes = []
    for k in (1.0, 2.0, 8.0):
        timings = [
            replace(timing, seconds=k * timing.seconds) for timing in demo().timings
        ]
        scenes.append(replace(demo(draw=False), timings=timings))
    lines = {line.name: line for line in summary_of(scenes).engines}
    of_one = {timing.engine: timing for timing in demo().timings}
    assert set(of_one) == {
        "formulas",
        "pinocchio-inverse",
        "mujoco-inverse",
        "free-body",
    }
    for engine, timing in of_one.items():
        line = lines[OWN_CONSISTENCY if engine == "formulas" else engine]
        assert line.microseconds == pytest.approx(
            2.0 * 1e6 * timing.seconds / 37,
            rel=1e-12,
        )
        assert line.times_formulas == pytest.approx(
            timing.seconds / of_one["formulas"].seconds,
            rel=1e-12,
        )
        assert WORK[engine] in unescape(report(scenes)[1]) and line.work == WORK[engine]
    refused = replace(demo().rows[0], engine="free-body", verdict=REFUSES)
    silent = summary_of([replace(demo(draw=False), rows=[*demo().rows, refused])])
    assert math.isnan(
        next(line for line in silent.engines if line.name == "free-body").microseconds
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "pictures"),
    [
        (
            fourbar.Motion(fourbar.Sweep(0.0, 6.0, 24)),
            3,
        ),  # positions only: angles are drawn
        (fourbar.Motion(1.0, 5.0), 1),  # one position: the linkage alone
        (fourbar.Motion(1.0, 0.0, free=fourbar.Free(0.2, 20)), 3),
        (fourbar.Motion(fourbar.Sweep(0.0, 6.0, 24), 5.0), 3),
    ],
    ids=["positions", "one position", "released", "sweep"],
)
def test_every_kind_of_scene_is_drawn(motion, pictures, monkeypatch):
    engines = tuple(w for w in ENGINES if w.name == "free-body")
    made = judge_for_report("kind", crank_rocker(motion=motion), engines)
    assert made.figure is not None and made.figure.count("<svg") == pictures
    _, text = report([made])
    assert "kind: crank-rocker" in text


def test_an_engine_that_is_missing_is_reported_as_failing():
    absent = replace(
        ENGINES[0],
        start=lambda: import_module("fourbar_validation.engines.absent").Absent(),
    )
    summary, text = report(
        [judge_for_report("demo", crank_rocker(), (absent,), draw=False)]
    )
    assert summary.verdict.startswith("FAILS")
    assert "What fails</h2>" in text and "No module named" in text and "∞" in text


@pytest.mark.slow
def test_many_scenes_give_a_short_report_of_the_worst(monkeypatch):
    monkeypatch.setattr("fourbar_validation.report.summary.SCENES_SHOWN", 20)
    pages = copies(100)
    for number, record in enumerate(pages):
        record.rows[0] = replace(record.rows[0], error=number * 8e-3, allowed=1.0)
        record.left_out = [
            f"mujoco-simulated: falls to {number * 1e-3:.1e}; below 0.05 it is not"
            " simulated"
        ]
        record.evidence = {
            "sim": {
                "error_at_4h": 1e-3,
                "error_at_2h": 1e-4,
                "observed_order": 3.0 + number,
            }
        }
        record.timings = [
            *record.timings,
            replace(record.timings[0], engine="sim", setting=f"RK4 {628 + number}/rev"),
        ]
    summary, text = report(pages)
    assert [w.row.scene for w in summary.worst[:2]] == ["scene-099", "scene-098"]
    assert {scene.name for scene in summary.shown} == {
        f"scene-0{number}" for number in range(80, 100)
    }
    assert summary.refusals == [
        ("mujoco-simulated", "falls to 0.0e+00; below 0.05 it is not simulated", 100)
    ]
    assert summary.orders[0][0] == "scene-000"
    assert (
        f"the 80 of {summary.judged} scenes and engines" in write_summary_page(summary)
        and summary.judged == 400
    )
    assert write_summary_page(summary).count("\n") < 160
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


def test_a_run_prints_one_row_an_engine_and_the_rest_on_demand(tmp_path, capsys):
    """Beside the error what is allowed to it; a share of undecided numbers is no error.

    Our own rows are one.
    """
    row = Row(
        "first",
        "mujoco-simulated",
        "RK4",
        "F12",
        2.5e-7,
        1e-5,
        AGREES,
        "",
        math.radians(40.0),
        1.0,
    )
    share = replace(row, quantity="undecided", error=0.4, allowed=0.5, theta_2=math.nan)
    identity = replace(row, engine="formulas", quantity="torque", error=0.0)
    pages = [
        replace(
            demo(draw=False),
            name="first",
            rows=[row, share, identity],
            left_out=["equilibria: too near"],
        )
    ]
    summary = summary_of(pages)
    assert [line.name for line in summary.engines] == [
        "mujoco-simulated",
        "our own consistency",
    ]
    assert summary.engines[0].worst == row and summary.engines[0].undecided == 0.4
    print_table(summary, tmp_path)
    printed = capsys.readouterr().out
    words = " ".join(printed.split())
    version = summary.versions["mujoco"]
    row_of_table = r"MuJoCo \S+ (simulated )?- 2\.5e-07 of 1e-05 - \d"
    assert re.search(row_of_table, words), words
    # the numbers say what they are
    assert "error of allowed torque pin forces motion compared" in words
    assert (
        "without an engine: 1 identity of the formulas" in words and "all hold" in words
    )
    assert "study" not in words, "what is no engine's stands in no row"
    assert "1 not compared: 1 where a check does not apply" in words
    assert words.startswith(summary.headline)
    assert words.endswith(f"Report: {tmp_path / 'report.html'}")
    assert len(printed.splitlines()) <= 25
    print_table(summary, tmp_path, verbose=True)
    assert "not compared: equilibria in 1 scene: too near" in " ".join(
        capsys.readouterr().out.split()
    )
    text = write_summary_page(summary)
    table = text[text.index("| largest") :].splitlines()
    assert (
        table[0]
        == "| largest error of allowed | torque | pin forces | motion | compared |"
    )
    assert table[2].startswith(f"| MuJoCo {version}, simulated | - | 2.5e-07 of 1e-05")


@pytest.mark.slow
def test_the_picture_shows_the_pin_force_that_fails():
    """Without a failure it shows the largest."""
    scene = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 36), 5.0))
    solution = fourbar.solve(scene, "force")
    sizes = {name: magnitude(getattr(solution, name)).max() for name in PIN_FORCES}
    largest = max(sizes, key=sizes.__getitem__)
    other = min(sizes, key=sizes.__getitem__)
    answer = Answer(
        "free-body",
        "exact",
        command(scene),
        quantities={"torque": solution.torque},
    )
    for name in PIN_FORCES:
        answer.quantities[name] = getattr(solution, name)
    record = Record("demo", scene, solution=solution, answers=[answer])
    assert f"|{largest}|" in (draw_scene_figure(record) or "")
    record.rows = [
        fail(replace(OF_MINE, quantity=other), error=0.5),
        fail(replace(OF_MINE, quantity=largest)),
    ]
    drawn = draw_scene_figure(record) or ""
    assert f"|{other}|" in drawn and f"|{largest}|" not in drawn


def record_of(name, rows, **parts):
    return Record(name, title=name, rows=rows, **parts)  # type: ignore[arg-type]


def fail(row, error=1e-3):
    return replace(row, error=error, verdict=FAILS)


OF_MINE = Row(
    "a", "mine", "exact", "torque", 1e-15, 1e-14, AGREES, "", math.radians(120.0), 1.0
)


def test_failures_are_one_line_an_engine_and_cause(tmp_path, capsys):
    """A mistake that explains more scenes is named before one that fits a few by
    chance.
    """
    swapped, sign = "F32 and F43 are exchanged: F32, F43", "sign reversed"
    scenes = [
        record_of(
            f"scene {k:02d}",
            [
                replace(OF_MINE, scene=f"scene {k:02d}"),
                *(
                    fail(replace(OF_MINE, scene=f"scene {k:02d}", quantity=name))
                    for name in ("F32", "F43")
                ),
            ],
            causes={"mine": [sign, swapped] if k < 3 else [swapped]},
        )
        for k in range(23)
    ]
    dead = Row.unmeasured(
        "scene 00", "theirs", "", "all", FAILS, "exit status 3: Cannot find module 'x'"
    )
    scenes[0].rows.append(dead)
    summary = summary_of(scenes)
    lines = [str(cause) for cause in summary.overview.causes]
    assert lines == [
        f"mine: {swapped}, all else agrees: 23 scenes; worst scene 00 120 deg",
        (
            "theirs: no answer: exit status 3: Cannot find module 'x': 1 scene; "
            "worst scene 00"
        ),
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
    answer = Answer(
        "mine",
        "exact",
        solution.at,
        np.ones(len(solution), dtype=bool),
        {"torque": solution.torque, "F43": -solution.F43},
    )
    row = Row("s", "mine", "exact", "F43", 2.0, 1e-6, FAILS, "", 1.0, 1.0)
    largest = int(np.argmax(np.max(np.abs(solution.F43), axis=0)))
    record = Record("s", scene, rows=[row], solution=solution, answers=[answer])
    drawn = draw_scene_figure(record) or ""
    assert f"F43 {'xy'[largest]} (N)" in drawn and "allowed to mine" in drawn
    held = replace(record, rows=[replace(row, verdict=AGREES, allowed=1e-14)])
    drawn = draw_scene_figure(held) or ""
    assert "F43 " not in drawn and "allowed to mine" not in drawn


def test_what_no_known_mistake_explains_is_told_by_what_differs_and_what_agrees():
    rows = [
        fail(OF_MINE),
        *(replace(OF_MINE, quantity=name) for name in ("F12", "theta_3")),
    ]
    record = replace(record_of("a", rows), causes={"mine": []})
    (cause,) = summary_of([record]).overview.causes
    assert (
        cause.text
        == "torque differs, pin forces and motion agree; no known mistake explains it"
    )
    nothing = replace(OF_MINE, error=math.nan, verdict=FAILS)
    (cause,) = summary_of([record_of("a", [nothing])]).overview.causes
    assert cause.text == "no number for torque"


def test_digits_that_are_missing_are_no_missing_term():
    rows = [fail(replace(OF_MINE, quantity=name), 3e-8) for name in ("torque", "F12")]
    rows.append(replace(OF_MINE, quantity="theta_3"))
    (cause,) = summary_of([record_of("a", rows)]).overview.causes
    assert (
        cause.text
        == "torque and pin forces differ, motion agrees: the first 7 digits agree"
    )


def test_an_engine_that_broke_down_alone_is_named_without_a_quantity():
    dead = Row.unmeasured("a", "theirs", "", "all", FAILS, "exit status 3: no licence")
    headline = summary_of([record_of("a", [dead])]).headline
    assert (
        headline == "FAILS: theirs is wrong: no answer: exit status 3: no licence, in 1"
        " scene; a."
    )


def refuse(scene, reason):
    return Row.unmeasured(scene, "theirs", "", "all", REFUSES, reason)


def test_a_reason_keeps_its_numbers_and_counts_those_like_it():
    """Reasons that differ in their numbers alone are one."""
    rows = [refuse(f"s{k}", f"2 of {k} signs were predicted") for k in (7, 8, 9)]
    rows.append(refuse("s", "it reads no cylinder"))
    overview = summary_of([record_of(row.scene, [row]) for row in rows]).overview
    assert overview.silent == [
        "theirs: nothing compared (3 scenes): 2 of 7 signs were predicted (and 2 more"
        " like it, with other numbers)"
    ]
    alike = [record_of(f"s{k}", [refuse(f"s{k}", "4 bars, not 5")]) for k in (1, 2)]
    assert summary_of(alike).overview.silent == [
        "theirs: nothing compared (2 scenes): 4 bars, not 5"
    ]


def test_an_engine_without_an_answer_is_named_with_its_numbers():
    """A failing number beside it does not take the place of the reason."""
    dead = Row.unmeasured("a", "theirs", "", "all", FAILS, "exit status 3 after 4 s")
    beside = fail(replace(OF_MINE, engine="theirs"), error=1e6)
    (cause,) = summary_of([record_of("a", [beside, dead])]).overview.causes
    assert cause.text == "no answer: exit status 3 after 4 s"


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
    names = ("torque", "F12", "F32", "F43", "F14")

    def scene(name, *engines):
        return record_of(
            name,
            [
                replace(OF_MINE, scene=name, engine=engine, quantity=quantity)
                for engine, count in engines
                for quantity in names[:count]
            ],
        )

    summary = summary_of(
        [
            scene("a", ("one", 5), ("two", 5)),
            scene("b", ("one", 5), ("two", 4)),
            scene("c", ("one", 5)),
        ]
    )
    assert any(
        note.startswith("Torque and pin forces of 1 of 3 scenes:")
        for note in summary.overview.notes
    )


@pytest.mark.parametrize("columns", ["80", "40"])
def test_a_value_far_beyond_what_is_allowed_leaves_the_numbers_of_the_table_whole(
    columns, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("COLUMNS", columns)
    row = Row(
        "thesis_printed_inertias",
        "mujoco-simulated",
        "RK4",
        "limit_positions",
        3.14,
        1e-9,
        FAILS,
        "",
        0.5,
        0.3,
    )
    for theta_2, at in ((0.5, "28.6"), (float("nan"), "-")):
        placed = replace(row, theta_2=theta_2)
        print_table(
            summary_of([replace(demo(draw=False), name=row.scene, rows=[placed])]),
            tmp_path,
            verbose=True,
        )
        rows = [
            line.split()
            for line in capsys.readouterr().out.splitlines()
            if line.startswith("   mujoco-simulated")
        ]
        cells = ["limit_positions", "3.1e+00", "1.0e-09", "3.1e+09", at]
        assert [cell for _, *some in rows for cell in some] == cells
