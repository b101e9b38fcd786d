"""The report as text.

Every number traceable to its row, short enough where it must be, whatever a scene is
called.
"""

import base64
import csv
import gzip
import io
import re
from dataclasses import replace
from functools import cache
from html import unescape
from importlib import import_module
from itertools import accumulate
from math import isnan, nan, radians

import numpy as np
from pytest import approx, fixture, mark

from fourbar import Free, Motion, Sweep, solve
from fourbar.quantities import PIN_FORCES
from fourbar_validation.compare.answer import Answer
from fourbar_validation.compare.compare import NO_POSITION, NO_VALUE
from fourbar_validation.compare.rows import (
    AGREES,
    FAILS,
    FORMULAS,
    REFUSES,
    UNDECIDED,
    Row,
    write_rows,
)
from fourbar_validation.compare.tolerance import magnitude
from fourbar_validation.engines.registry import WORK
from fourbar_validation.report.html import (
    ALL_OPEN,
    Section,
    write_html,
    write_summary_page,
)
from fourbar_validation.report.overview import DRIVES
from fourbar_validation.report.run_summary import PICTURED, Summary
from fourbar_validation.report.scene_pictures import (
    STRETCHES,
    draw_scene_figure,
    find_worst_of_segments,
)
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.svg import LEAST_DRAWN_ERROR
from fourbar_validation.report.terminal import print_table
from fourbar_validation.run.judge import judge_for_report
from fourbar_validation.run.question import FREE_BODY
from tests.support.here import EXACT, summary_of
from tests.support.scenes import crank_rocker

COMMENT_LIMIT = 65_536
"""Characters of a comment on GitHub."""


SCENE = crank_rocker(Motion(Sweep(0.0, 6.0, 36), 5.0))
SOLUTION = solve(SCENE, "force")


@cache
def demo(*, draw=True):
    """A small scene as two exact engines and the free bodies judge it."""
    return judge_for_report("demo", SCENE, EXACT, draw=draw)


def copies(count, *, failing=0):
    """The scene under many names; in the first ones a torque fails."""
    made = []
    for number in range(count):
        name = f"scene-{number:03d}"
        rows = [replace(row, scene=name) for row in demo().rows]
        if number < failing:
            torque = next(row for row in rows if row.quantity == "torque")
            rows[rows.index(torque)] = fail(torque, 0.5)
        made.append(replace(demo(), name=name, rows=rows))
    return made


def report(pages, **more):
    """Summary and page, the lines of results.csv counted as `run` does."""
    starts = accumulate((len(record.rows) for record in pages), initial=2)
    summary = summary_of(pages)
    lines = dict(zip((record.name for record in pages), starts))  # noqa: B905
    return summary, write_html(summary, lines, **more)


def unpacked(text):
    """The page with the packed bodies of its scenes laid open."""
    return re.sub(
        r'<script type="application/gzip">(.*?)</script>',
        lambda match: gzip.decompress(base64.b64decode(match.group(1))).decode(),
        text,
        flags=re.DOTALL,
    )


@mark.slow
@mark.parametrize("count", [2, ALL_OPEN + 1])
def test_every_link_leads_to_a_row_and_the_row_says_what_results_csv_says_there(count):
    pages = copies(count, failing=1)
    text = unpacked(report(pages)[1])
    table = write_rows(row for record in pages for row in record.rows)
    lines = list(csv.reader(io.StringIO(table)))
    rows = dict(re.findall(r'<tr id="row-(\d+)"[^>]*>(.*?)</tr>', text))
    assert {int(line) for line in rows} == set(range(2, len(lines) + 1))
    for line, shown in rows.items():
        cells = re.findall(r"<td[^>]*>(.*?)</td>", shown)[1:4]
        engine, quantity, error = (re.sub("<[^>]*>", "", cell) for cell in cells)
        record = dict(zip(lines[0], lines[int(line) - 1], strict=True))
        assert engine.split()[0] == record["engine"]
        assert quantity.strip() == record["quantity"]
        assert error.strip() == f"{float(record['error']):.2e}"
    linked = {int(line) for line in re.findall(r'href="#row-(\d+)"', text)}
    assert linked <= {int(line) for line in rows} and len(linked) > 20 * count


@mark.slow
def test_the_verdict_stands_first_and_a_failure_is_named_before_anything_else():
    summary, text = report(copies(3, failing=1))
    assert summary.headline.startswith("FAILS: ")
    body = unescape(text[text.index("<body>") :])
    parts = (summary.headline, "What fails</h2>", "Independent engines</h2>")
    places = [*map(body.index, parts)]
    assert places == sorted(places)
    assert "What fails</h2>" not in report(copies(3))[1]


@mark.slow
def test_nothing_is_fetched_and_a_section_of_another_module_is_linked():
    section = Section("hard", "Hard cases", "As predicted.", ["family"], [["toggle"]])
    _, text = report(copies(2), sections=[section])
    for part in ('<a href="#hard">Hard cases</a>', '<h2 id="hard">', ">toggle</th>"):
        assert part in text
    text = re.sub(r'xmlns(:xlink)?="[^"]*"', "", text)
    assert not re.search(r'(?:src|href)="(?!#|data:)', text)
    assert "url(" not in re.sub(r"url\(#", "", text) and "@import" not in text


@mark.slow
def test_the_comment_of_a_pull_request_holds_200_scenes_that_all_fail():
    assert len(write_summary_page(summary_of(copies(200, failing=200)))) < COMMENT_LIMIT


def test_the_errors_drawn_are_the_largest_of_their_stretches():
    error = np.random.default_rng(1).uniform(size=1000)
    for phase in (0.0, 0.3, 0.9):
        worst = find_worst_of_segments(error, phase)
        assert len(worst) == STRETCHES
        assert int(np.argmax(error)) in worst
        assert np.all(np.diff(np.roll(worst, -int(np.argmin(worst)))) > 0)
    error[worst[3]] = nan
    assert worst[3] not in find_worst_of_segments(error, 0.9)
    assert len(find_worst_of_segments(np.full(40, nan), 0.0)) == 0
    assert len(find_worst_of_segments(np.array([LEAST_DRAWN_ERROR]), 0.5)) == 1


@mark.slow
def test_the_times_of_engines_are_those_of_the_run():
    """The median over scenes.

    Of an engine that refused none, and beside our own consistency that of the formulas.
    """
    bare = demo(draw=False)
    seconds = {timing.engine: timing.seconds for timing in bare.timings}
    scenes = []
    for k in (1.0, 2.0, 8.0):
        timings = [replace(one, seconds=k * one.seconds) for one in bare.timings]
        scenes.append(replace(bare, timings=timings))
    lines = {line.engine: line for line in summary_of(scenes).engines}
    exact = {"pinocchio-inverse", "mujoco-inverse", "free-body"}
    assert set(seconds) == {"formulas", *exact}
    page = unescape(report(scenes)[1])
    for engine, taken in seconds.items():
        line = lines[engine]
        assert line.microseconds == approx(2.0 * 1e6 * taken / 37, rel=1e-12)
        assert line.times_formulas == approx(taken / seconds["formulas"], rel=1e-12)
        assert WORK[engine] in page
    refused = replace(bare.rows[0], engine="free-body", verdict=REFUSES)
    silent = summary_of([replace(bare, rows=[*bare.rows, refused])])
    (line,) = [line for line in silent.engines if line.engine == "free-body"]
    assert isnan(line.microseconds)


@mark.slow
@mark.parametrize(
    "motion, pictures, drawn",
    [
        (Motion(Sweep(0.0, 6.0, 24)), 3, ["free-body"]),
        (Motion(1.0, 5.0), 1, []),  # the linkage alone
        (Motion(1.0, 0.0, free=Free(0.2, 20)), 3, []),  # an engine has no free motion
        (Motion(Sweep(0.0, 6.0, 24), 5.0), 3, ["free-body"]),
    ],
    ids=["positions", "one position", "released", "sweep"],
)
def test_every_kind_of_scene_is_drawn(motion, pictures, drawn):
    made = judge_for_report("kind", crank_rocker(motion), [FREE_BODY])
    assert made.figure.count("<svg") == pictures and made.drawn == drawn
    assert "kind: crank-rocker" in report([made])[1]


def test_an_engine_that_is_missing_is_reported_as_failing():
    absent = replace(EXACT[0], start=lambda: import_module("tests.absent"))
    record = judge_for_report("demo", crank_rocker(), (absent,), draw=False)
    summary, text = report([record])
    assert summary.verdict.startswith("FAILS")
    assert "What fails</h2>" in text and "No module named" in text and ">inf<" in text


@mark.slow
def test_many_scenes_give_a_short_report_of_the_worst(monkeypatch):
    monkeypatch.setattr("fourbar_validation.report.run_summary.SCENES_SHOWN", 20)
    pages = copies(100)
    for number, record in enumerate(pages):
        record.rows[0] = replace(record.rows[0], error=number * 8e-3, allowed=1.0)
        words = f"falls to {number * 1e-3:.1e}; below 0.05 it is not simulated"
        record.left_out = [f"mujoco-simulated: {words}"]
        setting = f"RK4 {628 + number}/rev"
        simulated = replace(record.timings[0], engine="sim", setting=setting)
        record.timings = [*record.timings, simulated]
    summary, text = report(pages)
    worst = [worst.scene for worst in summary.worst[:2]]
    assert worst == ["scene-099", "scene-098"]
    shown = {f"scene-0{number}" for number in range(80, 100)}
    assert {scene.name for scene in summary.shown} == shown
    refusal = "falls to 0.0e+00; below 0.05 it is not simulated"
    refusal += ", with other numbers in the others"
    assert summary.refusals == [("mujoco-simulated", refusal, 100)]
    assert summary.judged == 400
    page = write_summary_page(summary)
    assert "the 80 of 400 scenes and engines" in page and page.count("\n") < 160
    # 20 scenes, each with 30 kB of compressed rows; the table of all of them is
    # compressed too
    assert len(text) < 1.0e6


@fixture
def printed(tmp_path, capsys):
    """Prints the table of a run, and returns its text."""

    def print_run(summary, **how):
        capsys.readouterr()
        print_table(summary, tmp_path, **how)
        return capsys.readouterr().out

    return print_run


@mark.parametrize(
    "error, allowed, cell",
    [(2.5e-7, 1e-5, "2.5e-07 of 1e-05"), (1.16e-9, 1.28e-9, "1.2e-09 of 1.3e-09")],
)
def test_a_run_prints_one_row_an_engine_and_the_rest_on_demand(
    tmp_path, printed, error, allowed, cell, monkeypatch
):
    """Beside the error what is allowed to it; a share of undecided numbers is no error.

    Our own rows are one.
    """
    monkeypatch.setenv("COLUMNS", "100")
    simulated = ("first", "mujoco-simulated", "RK4", "F12")
    row = Row(*simulated, error, allowed, AGREES, "", radians(40.0), 1.0)
    share = replace(row, quantity="undecided", error=0.4, allowed=0.5)
    identity = replace(row, engine="formulas", quantity="torque", error=0.0)
    torque = replace(row, quantity="torque", error=1e-12, allowed=1e-6)
    refused = replace(row, quantity="theta_3", verdict=REFUSES, reason="too fast")
    rows = [row, share, identity, torque, refused]
    summary = summary_of([record_of("first", rows, left_out=["equilibria: too near"])])
    first, second = summary.engines
    assert (first.engine, second.engine) == ("mujoco-simulated", "formulas")
    assert first.worst[""] == row and first.undecided == 0.4
    text = printed(summary)
    words = " ".join(text.split())
    version = summary.versions["mujoco"]
    cells = re.escape(f"1.0e-12 of 1e-06 {cell}")
    assert re.search(rf"MuJoCo \S+ (simulated )?{cells} - 3", words), words
    for part in (
        # the numbers say what they are
        "error of allowed torque pin forces motion compared",
        "without an engine: 1 identity of the formulas",
        "all hold",
        "2 not compared: 1 where a check does not apply",
    ):
        assert part in words
    assert "study" not in words, "what is no engine's stands in no row"
    assert words.startswith(summary.headline)
    assert words.endswith(f"Report: {tmp_path / 'report.html'}")
    assert len(text.splitlines()) <= 25
    words = " ".join(printed(summary, verbose=True).split())
    assert "not compared: equilibria in 1 scene: too near" in words
    text = write_summary_page(summary)
    head, _, line = text[text.index("| largest") :].splitlines()[:3]
    cells = "error of allowed | torque | pin forces | motion | compared"
    assert head == f"| largest {cells} |"
    assert line.startswith(
        f"| MuJoCo {version}, simulated | 1.0e-12 of 1e-06 | {cell} | - | 3"
    )


def record_of(name, rows, **parts):
    return Record(name, title=name, rows=rows, **parts)


def summary_of_rows(*rows, **parts):
    """What a run of one scene comes to that has these rows."""
    return summary_of([record_of("a", [*rows], **parts)])


def fail(row, error=1e-3):
    return replace(row, error=error, verdict=FAILS)


OF_MINE = Row(
    "a", "mine", "exact", "torque", 1e-15, 1e-14, AGREES, "", radians(120.0), 1.0
)


def mine(quantity="torque", **fields):
    """Return OF_MINE of a quantity, and with other fields."""
    return replace(OF_MINE, quantity=quantity, **fields)


def test_failures_are_one_line_an_engine_and_cause(printed):
    """A mistake that explains more scenes is named before one that fits a few by
    chance.
    """
    swapped = "F32 and F43 are exchanged: F32, F43, all else agrees"
    scenes = []
    for k in range(23):
        of_scene = mine(scene=f"scene {k:02d}")
        wrong = [fail(replace(of_scene, quantity=name)) for name in ("F32", "F43")]
        causes = {"mine": ["sign reversed"] * (k < 3) + [swapped]}
        scenes.append(record_of(of_scene.scene, [of_scene, *wrong], causes=causes))
    said = "said what is no JSON (Expecting ','); it said: "
    for scene, numbers in zip(scenes[:2], ("[0.25, 0.5", "[-0.125"), strict=True):
        died = f"{said}{numbers}"
        scene.rows.append(Row.unmeasured(scene.name, "theirs", "", "all", FAILS, died))
    summary = summary_of(scenes)
    assert [str(cause) for cause in summary.causes] == [
        f"mine: {swapped}: 23 scenes; worst scene 00 120 deg",
        f"theirs: no answer: {said}[0.25, 0.5: 2 scenes; worst scene 00",
    ]
    assert [line.engine for line in summary.independent] == ["mine", "theirs"]
    assert summary.headline.startswith(f"FAILS: mine is wrong: {swapped}")
    assert "F32 of scene 00 120 deg" in summary.headline
    text = printed(summary)
    assert len(text.splitlines()) <= 40
    assert "fails scene" not in text, "rows stay in the files"


def draw_answer(*rows, **numbers):
    """Draw the scene with these rows of an engine and what it answered."""
    answer = Answer("mine", "exact", SOLUTION.at, SOLUTION.assembled, numbers)
    record = Record("s", rows=[*rows])
    return draw_scene_figure(record, SCENE, SOLUTION, [answer]) or ""


@mark.slow
def test_a_red_figure_draws_the_error_and_the_limit_of_the_guest():
    """A reversed force lies on the curve of its size."""
    row = mine("F43", error=2.0, allowed=1e-6, verdict=FAILS)
    largest = int(np.argmax(np.max(abs(SOLUTION.F43), axis=0)))
    drawn = draw_answer(row, torque=SOLUTION.torque, F43=-SOLUTION.F43)
    assert f"F43 {'xy'[largest]} (N)" in drawn and "allowed to mine" in drawn
    held = replace(row, verdict=AGREES, allowed=1e-14)
    drawn = draw_answer(held, torque=SOLUTION.torque, F43=-SOLUTION.F43)
    assert "allowed to mine" not in drawn


RIGHT = [mine(name) for name in ("F12", "theta_3")]
OPEN = mine("assembled", error=9.0, allowed=0.0, verdict=FAILS)
DEAD = Row.unmeasured("a", "mine", "", "all", FAILS, "exit status 3 after 4 s")
ALARM = Row.unmeasured("a", "mine", "", "watch", FAILS, "3 resets")
UNKNOWN = "no known mistake explains it"
CAUSES = [
    ([fail(OF_MINE)], f"torque differs, pin forces and motion agree; {UNKNOWN}"),
    (
        [fail(mine("closure"))],
        f"closure differs, pin forces and motion agree; {UNKNOWN}",
    ),
    (
        [OPEN],
        f"positions at which the loop closes differ, pin forces and motion agree;"
        f" {UNKNOWN}",
    ),
    (
        [fail(mine("torque_inertia"))],
        f"inertial part of the torque differs, pin forces and motion agree; {UNKNOWN}",
    ),
    (
        [fail(mine(name), 3e-8) for name in ("torque", "F32")],
        "torque and pin forces differ, motion agrees: the first 7 digits agree",
    ),
    ([fail(OF_MINE, nan)], "no number for torque"),
    (
        [fail(OF_MINE, nan), replace(OPEN, error=nan)],
        "no number at any position",
    ),
    ([fail(OF_MINE, 1e6), DEAD], "no answer: exit status 3 after 4 s"),
    ([fail(OF_MINE), ALARM], "alarm: 3 resets"),
]


@mark.parametrize("wrong, words", CAUSES)
def test_what_no_known_mistake_explains_is_told_by_what_differs_and_what_agrees(
    wrong, words
):
    """Missing digits are no missing term, and a number beside no answer no reason."""
    right = RIGHT if "agree" in words else []
    (cause,) = summary_of_rows(*wrong, *right, causes={"mine": []}).causes
    assert cause.text == words


def test_what_differs_from_two_engines_is_listed_and_shown_first():
    """The identity that fails with it has the larger error, and is a consequence."""
    rows = [
        fail(mine("power", engine=FORMULAS), 0.9),
        fail(mine(engine="one"), 0.3),
        fail(mine("torque_inertia", engine="one"), 0.2),
    ]
    against = {key: ["one", "two"] for key in ("torque", *PIN_FORCES, "theta_3")}
    (cause,) = summary_of_rows(*rows, against=against).causes
    words = "one, two agree with each other, and differ from it in"
    assert (cause.engine, cause.worst.quantity) == (FORMULAS, "torque")
    assert cause.text == f"{words} torque, F12, F32, F43, F14, ..."


BROKEN = fail(mine("force_sum", engine=FORMULAS))
ALONE = fail(mine("a_G3"), 0.5)
NAMED = fail(mine("F12", engine="named"))
ALONE_TOO = replace(ALONE, engine="two")


@mark.parametrize(
    "rows, against, wrong",
    [
        ([], {"alpha_3": ["mine", "two"]}, {FORMULAS}),
        ([OF_MINE, BROKEN], {}, {FORMULAS}),
        ([fail(OF_MINE), BROKEN], {}, {FORMULAS}),
        ([fail(OF_MINE), replace(BROKEN, quantity="status")], {}, {FORMULAS, "mine"}),
        ([fail(OF_MINE), NAMED, BROKEN], {}, {FORMULAS, "named"}),
        ([fail(mine("energy"))], {"F12": ["mine", "two"]}, {FORMULAS}),
        ([OF_MINE], {}, {"mine"}),
        ([OF_MINE, ALONE_TOO, BROKEN], {}, {FORMULAS, "mine", "two"}),
    ],
)
def test_who_alone_answers_a_quantity_is_believed_if_fourbar_is_wrong(
    rows, against, wrong
):
    """At an angular acceleration on which two agree, or in a sum of forces unless a
    known mistake explains its own; a free motion follows from its forces.
    """
    named = {"named": ["gravity is left out"]}
    summary = summary_of_rows(*rows, ALONE, against=against, causes=named)
    assert {cause.engine for cause in summary.causes} == wrong


def test_pin_forces_of_which_one_fails_do_not_agree():
    """Its row is fourbar's cause, as two other engines blame fourbar for it."""
    wrong = (fail(mine(name)) for name in ("F12", "torque"))
    summary = summary_of_rows(*wrong, mine("F14"), against={"F12": ["one", "two"]})
    causes = {cause.engine: cause.text for cause in summary.causes}
    assert causes["mine"] == "torque differs; mistakes are not looked for there"


def test_an_engine_that_broke_down_alone_is_named_without_a_quantity():
    words = "mine is wrong: no answer: exit status 3 after 4 s, in 1 scene; a."
    assert summary_of_rows(DEAD).headline == f"FAILS: {words}"


@mark.parametrize("row, pictured", [(fail(OF_MINE), 30), (OF_MINE, PICTURED)])
def test_all_scenes_that_fail_have_pictures_and_some_that_hold(row, pictured):
    summary = summary_of(record_of(f"s{k}", [row]) for k in range(30))
    assert len(summary.pictured) == pictured


def refuse(scene, reason):
    return Row.unmeasured(scene, "theirs", "", "all", REFUSES, reason)


def test_a_reason_keeps_its_numbers_and_counts_those_like_it():
    """Reasons that differ in their numbers alone are one."""
    rows = [refuse(f"s{k}", f"signs {[1] * k} are lost") for k in (2, 3, 4)]
    rows.append(refuse("s", "it reads no cylinder"))
    alike = [refuse(f"s{k}", "4 bars, not 5") for k in (1, 2)]
    others = "signs [1, 1] are lost, with other numbers in the others"
    for refusals, words in (
        (rows, f"(3 scenes): {others}"),
        (alike, "(2 scenes): 4 bars, not 5"),
    ):
        summary = summary_of(record_of(row.scene, [row]) for row in refusals)
        assert [*summary.silent.values()] == [f"theirs: nothing compared {words}"]


@mark.parametrize("pictures", [1, 2, 3])
def test_the_first_two_pictures_of_a_scene_are_shown_small_too(pictures):
    """Of a single position there is the linkage alone."""
    figure = "".join(f"<svg>p{number}</svg>\n" for number in range(pictures))
    _, text = report([replace(demo(draw=False), figure=figure)])
    assert text.count("<svg>") == text.count("</svg>")
    sketch = text[text.index('<div class="sketches">') :]
    assert sketch.index("</a>") > sketch.index(f"p{min(pictures, 2) - 1}")
    assert "p2" not in sketch[: sketch.index("</a>")]


def test_an_engine_that_drew_nothing_is_not_in_the_caption_of_a_picture():
    rows = [*demo().rows, refuse("demo", "it reads no cylinder")]
    _, text = report([replace(demo(), rows=rows)])
    (caption,) = re.findall("answers at some of the positions: (.*?). Beneath", text)
    assert "free-body" in caption and "theirs" not in caption


@mark.parametrize(
    "verdict, reason, kind",
    [
        (REFUSES, "nothing acts", "at declared limits of an engine"),
        (REFUSES, f"{NO_VALUE}: 1 singular", "where the formulas state no value"),
        (UNDECIDED, "eps/condition = 0.1", "with no digit left to decide by"),
        (UNDECIDED, f"{NO_POSITION} both", "at no position that can be judged"),
    ],
)
def test_what_was_not_compared_is_counted_by_its_reason(verdict, reason, kind):
    row = mine("torque_inertia", verdict=verdict, reason=reason)
    assert summary_of_rows(row).not_compared == {kind: 1}


def test_a_weaker_rule_stands_before_a_verdict_that_holds():
    summary = summary_of_rows(OF_MINE)
    assert summary.good
    summary.weaker = ["mine: factor 1e-14 -> 0.01", "mine: class a -> b"]
    summary.baseline = "last night"
    summary.gone = ["engine b"]
    assert summary.headline.startswith("GONE: engine b, against last night. WEAKER")
    summary.gone = []
    assert not summary.good
    assert summary.headline.startswith(
        "WEAKER RULE: mine: factor 1e-14 -> 0.01, and 1 more, against last night. All 1"
    )


@mark.parametrize("declared, confirmed", [(1e-4, 1), (1.1e-4, 0)])
def test_two_engines_must_compare_torque_and_all_pin_forces_of_a_scene(
    declared, confirmed
):
    """Only engines that declare few errors are independent."""
    overview = Summary()
    overview.declared = {"one": 1e-14, "two": declared}
    overview.listed = {"two": dict.fromkeys(["friction", "gravity", *DRIVES, "F12"])}
    for name, counts in (("a", (5, 5)), ("b", (5, 4)), ("c", (5, 0))):
        rows = [
            mine(quantity, scene=name, engine=engine)
            for engine, count in zip(("one", "two"), counts, strict=True)
            for quantity in ("torque", *PIN_FORCES)[:count]
        ]
        overview.add(replace(record_of(name, rows), needs=["gravity"]))
    needs = ["friction"]  # inertia alone is asked without it
    bare = mine("drive_force_inertia", scene="d", engine="two")
    overview.add(replace(record_of("d", [bare]), needs=needs))
    assert "two lists friction: compared in no scene" in overview.notes
    assert overview.checked_twice == confirmed
    words = f"Torque and pin forces of {confirmed} of 3 scenes:"
    assert any(note.startswith(words) for note in overview.notes)


@mark.parametrize("columns", ["80", "40"])
@mark.parametrize("theta_2, at", [(0.5, "28.6"), (nan, "-")])
def test_a_value_far_beyond_what_is_allowed_leaves_the_numbers_of_the_table_whole(
    columns, theta_2, at, monkeypatch, printed
):
    monkeypatch.setenv("COLUMNS", columns)
    scene = "thesis_printed_inertias"
    key = (scene, "mujoco-simulated", "RK4", "limit_positions")
    row = Row(*key, 3.14, 1e-9, FAILS, "", theta_2, 0.3)
    text = printed(summary_of([record_of(scene, [row])]), verbose=True)
    cells = ["limit_positions", "3.14e+00", "1.00e-09", "3.1e+09", at]
    shown = re.findall("^ mujoco-simulated, \\w*(.*)", text, re.MULTILINE)
    assert " ".join(shown).split() == cells


@mark.slow
def test_the_picture_shows_the_pin_force_that_fails():
    """Without a failure it shows the largest."""
    sizes = {name: magnitude(SOLUTION[name]).max() for name in PIN_FORCES}
    largest, other = max(sizes, key=sizes.get), min(sizes, key=sizes.get)
    numbers = {name: SOLUTION[name] for name in ("torque", *PIN_FORCES)}
    assert f">{largest} " in draw_answer(**numbers)
    rows = fail(mine(other), error=0.5), fail(mine(largest))
    drawn = draw_answer(*rows, **numbers)
    assert f">{other} " in drawn and f">{largest} " not in drawn
