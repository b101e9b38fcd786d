"""What is counted as agreeing: no refusal, no missing number, no empty table.

Every form says the same.
"""

import html
import math
import xml.etree.ElementTree as ET
from collections import defaultdict
from dataclasses import replace
from functools import partial

import numpy as np
from pytest import mark, raises

from fourbar import Motion, Sweep, save, solve
from fourbar.errors import BAD_INPUT, FAILED, HOLDS
from fourbar.scene import Scene, command
from fourbar_validation.cli import status
from fourbar_validation.compare.compare import Comparison, Demands
from fourbar_validation.compare.results_file import read_columns
from fourbar_validation.compare.rows import (
    AGREES,
    DEGRADED,
    FAILS,
    REFUSES,
    UNDECIDED,
    VERDICTS,
    Counts,
    Row,
    write_results,
)
from fourbar_validation.compare.tolerance import EQUIVALENCE
from fourbar_validation.cost.laws import ErrorLaw
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression import render
from fourbar_validation.report.html import write_html as page_of
from fourbar_validation.report.html import write_summary_page
from fourbar_validation.report.scene_record import Record
from fourbar_validation.run.judge import judge, judge_for_report
from fourbar_validation.run.question import FREE_BODY
from tests.support.here import judge_here, summary_of
from tests.support.rows import read_rows
from tests.support.runs import ROW, WORDS, changed, compare_made_here
from tests.support.scenes import bare, crank_rocker
from tests.validation.run.test_judge import NEAR_ITS_LIMIT, ROCKER, Echo, echo, refuse

NAN = math.nan


def rows(text):
    """So many rows of each verdict, and perhaps of the formulas."""
    entries = (entry.split() for entry in text.split(", ") if entry)
    return [
        changed(verdict=WORDS[word], engine=(*engine, ROW.engine)[0])
        for count, word, *engine in entries
        for _ in range(int(count))
    ]


def test_a_quantity_that_every_row_calls_degraded_is_counted():
    by_scene = defaultdict(list)
    for scene, engine, quantity, word, allowed in read_rows("""
one | a | F12 | degraded | 1e-3
one | b | F12 | degraded | 2e-4
one | a | F43 | agrees | 1e-14
two | b | F12 | agrees | 1e-14
two | a | F12 | degraded | 1
two | b | F43 | fails | nan
three | a | torque | degraded | 0.5
three | b | torque | refuses | nan
"""):
        key = {"scene": scene, "engine": engine, "quantity": quantity}
        row = changed(**key, verdict=WORDS[word], allowed=float(allowed))
        by_scene[scene].append(row)
    records = [Record(scene, rows=rows) for scene, rows in by_scene.items()]
    summary = summary_of(records)
    assert (summary.loose, summary.pairs) == (2, 5)
    stated = "2 of 5 quantities of a scene are at best"
    page = page_of(summary, dict.fromkeys(by_scene, 2))
    for form in (write_summary_page(summary), page):
        assert stated in html.unescape(form)
    assert stated not in write_summary_page(summary_of(records[1:2]))


@mark.parametrize(
    "text, sentence, status",
    read_rows("""
2 agrees | All 2 comparisons hold: 2 agree | 0
1 agrees, 2 degraded, 1 undecided, 3 refuses | All 3 comparisons hold: 1 agrees, 2 \
degraded as predicted; not compared: 1 undecided, 3 refuse | 0
1 agrees, 2 fails, 1 refuses | FAILS: 2 of 3 comparisons do not hold: 1 agrees, 2 \
fail; not compared: 1 refuses | 1
70 agrees, 1 fails | FAILS: 1 of 71 comparisons do not hold: 70 agree, 1 fails | 1
2 refuses | Nothing was compared: 2 refuse | 1
1 undecided | Nothing was compared: 1 undecided | 1
 | Nothing was compared | 1
1 agrees formulas | Nothing was compared: 1 of the formulas' own identities hold | 1
1 fails formulas | FAILS: 1 identities of the formulas do not hold | 1
"""),
)
def test_all_hold_counts_what_was_compared_alone(text, sentence, status):
    counts = Counts(rows(text))
    assert (counts.sentence(), counts.status) == (sentence, int(status))


def test_scenes_are_counted_and_a_row_passes_where_it_was_compared_and_holds():
    counts = Counts()
    counts.add_scene(rows("40 agrees"))
    counts.add_scene(rows("3 refuses"))
    assert (counts.scenes, counts.scenes_compared, counts.total) == (2, 1, 43)
    passing = {verdict for verdict in VERDICTS if changed(verdict=verdict).passed}
    assert passing == {AGREES, DEGRADED}


@mark.parametrize(
    "fields",
    [{"error": NAN}, {"verdict": DEGRADED, "error": NAN}, {"verdict": "passes"}],
)
def test_a_row_without_a_number_or_of_another_word_has_no_verdict(fields):
    with raises(ValueError, match="no verdict"):
        changed(**fields)


def test_a_table_cannot_say_that_a_refusal_passed(tmp_path):
    file = tmp_path / "results.csv"
    write_results(rows("1 refuses"), file)
    text = file.read_text()
    assert ",false,refuses," in text
    file.write_text(text.replace(",false,", ",true,"))
    assert [row.passed for row in read_columns(file)] == [False]
    file.write_text(text.replace("refuses", "FAILED"))
    assert status(["compare", str(tmp_path), str(tmp_path)]) == BAD_INPUT


REFUSAL = {"refusal": "nothing acts", "quantities": {}, "assembled": None}
WITHOUT_EFFECTS = [
    (REFUSAL, REFUSES, "nothing acts"),
    ({"alarms": ["it shakes"]}, FAILS, "watch: it shakes"),
    (
        {"assembled": None},
        FAILS,
        "assembled: the engine did not say where the loop closes",
    ),
]
"""What an answer says where nothing acts, and the row of the inertia alone."""


@mark.parametrize("said, verdict, reason", WITHOUT_EFFECTS)
def test_what_is_wrong_with_the_inertia_alone_is_a_row(said, verdict, reason):
    class WithoutEffects(Echo):
        def answer(self, scene, command):
            answer = super().answer(scene, command)
            return answer if scene.effects else replace(answer, **said)

    engine = Engine("echo", partial(WithoutEffects, echo), EQUIVALENCE)
    rows = judge("scene", crank_rocker(), [engine]).rows
    (row,) = [row for row in rows if row.quantity == "torque_inertia"]
    assert (row.verdict, row.reason) == (verdict, reason)


def find_verdicts(scene, *engines):
    rows = judge("scene", scene, engines).rows
    return {(row.engine, row.quantity): row.verdict for row in rows}


def test_what_is_due_nowhere_is_not_counted_as_held(monkeypatch):
    """No loop closes beyond the limits of the input; or dry friction reverses."""
    apart = Scene(ROCKER, Motion(Sweep(2.0, 4.0, 5), 1.0))
    assert not solve(apart).assembled.any()
    verdicts = find_verdicts(apart, FREE_BODY)
    assert verdicts["formulas", "closure"] == UNDECIDED
    assert verdicts["free-body", "torque"] == UNDECIDED
    assert verdicts["free-body", "assembled"] == AGREES
    monkeypatch.setattr(
        "fourbar_validation.run.question.mark_reversing",
        lambda scene, solution, _: np.ones(len(solution), bool),
    )
    verdicts = find_verdicts(crank_rocker())
    assert verdicts["formulas", "closure"] == AGREES
    for quantity in ("force_sum", "moment_sum"):
        assert verdicts["formulas", quantity] == UNDECIDED


def test_formulas_without_an_answer_fail():
    scene = crank_rocker()
    commanded = command(scene)
    rows = Comparison(
        "",
        scene,
        Echo(echo).answer(scene, commanded),
        solve(scene, "position", at=commanded),
        Demands(EQUIVALENCE, ("torque",)),
    ).rows()
    (row,) = [row for row in rows if row.quantity == "torque"]
    assert (row.verdict, row.reason) == (FAILS, "the formulas have no answer")


@mark.slow
def test_a_run_in_which_nothing_was_compared_says_so_everywhere_and_ends_with_1(
    tmp_path, monkeypatch, capsys
):
    """A simulation needs more than one position."""
    judge_here(monkeypatch)
    file, out = tmp_path / "scene.toml", tmp_path / "out"
    save(Scene(bare(4.0, 1.0, 3.0, 3.0), Motion(math.radians(10.0), 1.0)), file)
    line = ["run", str(file), "--no-pictures", "--out", str(out), "--engines"]
    assert status([*line, "mujoco-simulated"]) == FAILED
    sentence = "Nothing was compared on 1 scene: 9 of the formulas' own identities hold"
    assert sentence in " ".join(capsys.readouterr().out.split())
    assert sentence in (out / "report.md").read_text()
    page = html.unescape((out / "report.html").read_text())
    assert f'<h1 class="bad">{sentence}</h1>' in page
    assert '<span class="bad">nothing compared</span>' in page
    # nor is it green beside an engine that compares all
    assert status([*line, "mujoco-simulated,free-body"]) == FAILED
    assert " ".join(capsys.readouterr().out.split()).startswith(
        "NOT CHECKED: mujoco-simulated: nothing compared (1 scene): "
    )
    assert status([*line, "free-body"]) == HOLDS


@mark.slow
def test_every_form_of_a_report_says_the_same_counts():
    """Rows of the formulas themselves are of both scenes, the others of free bodies."""
    refused = Engine("echo", partial(Echo, refuse), EQUIVALENCE)
    summary = summary_of(
        judge_for_report(name, crank_rocker(title=name), engines, draw=False)
        for name, engines in (("good", (FREE_BODY, refused)), ("refused", (refused,)))
    )
    sentence = (
        "All 35 comparisons on 1 of 2 scenes hold: 35 agree; not compared: 2 refuse"
    )
    assert summary.verdict == sentence == summary.counts.sentence() and summary.good
    page = page_of(summary, {})
    for form in (page, write_summary_page(summary)):
        assert sentence in html.unescape(form)
    assert page.count('class="cell refuses"') == 4
    assert ">nothing compared</span>" in page


def test_junit_skips_what_was_not_compared_and_fails_what_fails_as_before():
    def junit(old, new):
        changes = compare_made_here(old, new)
        suites = ET.fromstring(render.write_junit_of_changes(changes))
        tags = {
            case.get("name"): [child.tag for child in case]
            for case in suites.iter("testcase")
        }
        counts = [suites.get(name) for name in ("tests", "failures", "skipped")]
        return tags, counts

    refused = changed(quantity="all", verdict=REFUSES, error=NAN)
    others = [
        refused,
        changed(quantity="F12", verdict=UNDECIDED, error=NAN),
        changed(quantity="F14", verdict=FAILS, error=NAN),
    ]
    tags = {
        "torque": [],
        "all": ["skipped"],
        "F12": ["skipped"],
        "F14": ["failure"],
    }
    assert junit([ROW, *others], [ROW, *others]) == (tags, ["4", "1", "2"])
    worse, _ = junit([ROW], [changed(verdict=REFUSES, error=NAN)])
    assert worse["torque"] == ["failure"]
    assert junit([refused], [refused])[1] == ["2", "1", "1"]


def test_numbers_without_a_digit_do_not_agree(tmp_path, capsys):
    file, theirs = tmp_path / "scene.toml", tmp_path / "theirs.csv"
    save(NEAR_ITS_LIMIT, file)
    theirs.write_text(f"theta_2, torque\n{NEAR_ITS_LIMIT.motion.theta_2!r}, 17.0\n")
    assert status(["check", str(file), str(theirs)]) == FAILED
    told = "Nothing was compared; no digit left to judge 1 more by"
    assert told in capsys.readouterr().out


@mark.slow
def test_a_study_in_which_no_law_is_fitted_is_no_success(tmp_path, monkeypatch, capsys):
    cost = "fourbar_validation.cost."
    monkeypatch.setattr(f"{cost}work_precision.CostStudy.points", lambda _: iter(()))
    monkeypatch.setattr(f"{cost}cost.write_cost", lambda *_: [])
    law = ErrorLaw("order", "torque", 4.0, 0.1, 4.0, 9)
    for laws, code in (
        ([], FAILED),
        ([replace(law, points=1)], FAILED),
        ([law], HOLDS),
    ):
        monkeypatch.setattr(f"{cost}cost.fit_laws", lambda _, laws=laws: laws)
        assert status(["cost", "--out", str(tmp_path)]) == code
        printed = capsys.readouterr().out
        assert ("Nothing was compared" in printed) == (code == FAILED)
        sentences, _, _ = printed.partition("Pictures, laws and every point")
        assert len(sentences.splitlines()) > 3
        assert max(map(len, sentences.splitlines())) <= 80


@mark.parametrize(
    "error, allowed, mask, verdict, worst",
    read_rows("""
0 2 1 | 2 |  | agrees | 1
0 2.1 1 | 2 |  | fails | 1
0 2 1 | 1 3 0.5 |  | fails | 2
0 nan 1 | 2 |  | fails | 1
0 inf 1 | inf |  | fails | 1
0 0 0 | 0 |  | agrees | 0
0 1e-300 0 | 0 |  | fails | 1
0 nan 1 | 2 | 1 0 1 | agrees | 2
9 nan 9 | 2 | 0 0 0 | undecided | 0
"""),
)
def test_one_rule_of_agreement(error, allowed, mask, verdict, worst):
    """A lone number is judged by the same rule.

    What is allowed is one number or one each, and the mask, if any, says what counts.
    """
    errors, bounds = (np.array(text.split(), float) for text in (error, allowed))
    where = np.array(mask.split()) == "1" if mask else None
    bound = bounds if len(bounds) > 1 else bounds[0]
    key, place = ("a", "b", "c"), int(worst)
    row = Row.judged(
        key, "F12", errors, bound, "", np.array([1.0, 2.0, 3.0]), 1.0, where
    )
    assert (row.verdict, row.theta_2) == (verdict, place + 1.0)
    lone = Row.judged(key, "F12", errors[place], bounds[place % len(bounds)], "")
    assert lone.passed == (verdict == AGREES)
