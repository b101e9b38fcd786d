"""What is counted as agreeing: no refusal, no missing number, no empty table.

Every form says the same.
"""

import html
import math
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.errors import FAILED, HOLDS
from fourbar.formulas.mobility import limit_positions
from fourbar.scene import Scene, command
from fourbar_validation.cli import status
from fourbar_validation.compare.answer import Answer, ReleasedAnswer
from fourbar_validation.compare.columns import read_columns
from fourbar_validation.compare.compare import Comparison, Demands
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
from fourbar_validation.engines.registry import ENGINES, Engine
from fourbar_validation.regression import render
from fourbar_validation.report.html import write_html as page_of
from fourbar_validation.report.html import write_summary_page
from fourbar_validation.run import released as free
from fourbar_validation.run.judge import judge, judge_for_report
from tests.support.here import judge_here, summary_of
from tests.support.runs import HERE, compare_rows
from tests.support.scenes import bare, crank_rocker
from tests.validation.regression.test_regression import ROW
from tests.validation.run.test_judge import Echo, Refuses

NAN = math.nan


def rows(**counts):
    """So many rows of each verdict."""
    names = ("agree", "degraded", "undecided", "refuse", "fail")
    verdicts = dict(
        zip(names, (AGREES, DEGRADED, UNDECIDED, REFUSES, FAILS), strict=True)
    )
    return [
        replace(ROW, verdict=verdicts[name])
        for name, many in counts.items()
        for _ in range(many)
    ]


def test_a_quantity_that_every_row_calls_degraded_is_counted_and_named():
    scenes = {
        "one": [
            ("a", "F12", DEGRADED, 1e-3),
            ("b", "F12", DEGRADED, 2e-4),
            ("a", "F43", AGREES, 1e-14),
        ],
        "two": [
            ("a", "F12", DEGRADED, 1.0),
            ("b", "F12", AGREES, 1e-14),
            ("b", "F43", FAILS, NAN),
        ],
        "three": [("a", "torque", DEGRADED, 0.5), ("b", "torque", REFUSES, NAN)],
    }
    judged = judge_for_report("", crank_rocker(), (), draw=False)
    records = [
        replace(
            judged,
            name=scene,
            rows=[
                replace(
                    ROW,
                    scene=scene,
                    engine=engine,
                    quantity=quantity,
                    verdict=verdict,
                    allowed=allowed,
                )
                for engine, quantity, verdict, allowed in many
            ],
        )
        for scene, many in scenes.items()
    ]
    summary = summary_of(records)
    assert (summary.loose, summary.pairs) == (2, 5)
    stated = "2 of 5 quantities of a scene are at best"
    named = "torque of three (allowed 5.0e-01), F12 of one (allowed 2.0e-04)"
    page = page_of(summary, dict.fromkeys(scenes, 2))
    for form in (write_summary_page(summary), page):
        assert stated in html.unescape(form) and named in html.unescape(form)
    assert stated not in write_summary_page(summary_of(records[1:2]))


IDENTITY = replace(ROW, engine="formulas", quantity="closure")


@pytest.mark.parametrize(
    ("rows", "sentence", "status"),
    [
        (rows(agree=2), "All 2 comparisons hold: 2 agree", HOLDS),
        (
            rows(agree=1, degraded=2, undecided=1, refuse=3),
            (
                "All 3 comparisons hold: 1 agrees, 2 degraded as predicted; not"
                " compared: 1 undecided, 3 refuse"
            ),
            HOLDS,
        ),
        (
            rows(agree=1, fail=2, refuse=1),
            (
                "FAILS: 2 of 3 comparisons do not hold: 1 agrees, 2 fail; not compared:"
                " 1 refuses"
            ),
            FAILED,
        ),
        (rows(refuse=2), "Nothing was compared: 2 refuse", FAILED),
        (rows(undecided=1), "Nothing was compared: 1 undecided", FAILED),
        ([], "Nothing was compared", FAILED),
        (
            [IDENTITY],
            "Nothing was compared: 1 of the formulas' own identities hold",
            FAILED,
        ),
        (
            [replace(IDENTITY, verdict=FAILS)],
            "FAILS: 1 identities of the formulas do not hold",
            FAILED,
        ),
    ],
)
def test_all_hold_counts_what_was_compared_alone(rows, sentence, status):
    counts = Counts(rows)
    assert (counts.sentence(), counts.status) == (sentence, status)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_row_passes_where_it_was_compared_and_holds(verdict):
    passes = verdict in (AGREES, DEGRADED)
    assert replace(ROW, verdict=verdict).passed == passes


@pytest.mark.parametrize(
    "changed",
    [{"error": NAN}, {"verdict": DEGRADED, "error": NAN}, {"verdict": "passes"}],
)
def test_a_row_without_a_number_or_of_another_word_has_no_verdict(changed):
    with pytest.raises(ValueError, match="no verdict"):
        replace(ROW, **changed)


def test_a_table_cannot_say_that_a_refusal_passed(tmp_path):
    file = tmp_path / "results.csv"
    write_results(rows(refuse=1), file)
    text = file.read_text()
    assert ",false,refuses," in text
    file.write_text(text.replace(",false,", ",true,"))
    assert [row.passed for row in read_columns(file)] == [False]
    file.write_text(text.replace("refuses", "FAILED"))
    assert status(["compare", str(tmp_path), str(tmp_path)]) == 2


class OnlyWithEffects(Echo):
    """Refuses the scene without loads and effects."""

    def answer(self, scene, command):
        if scene.effects:
            return super().answer(scene, command)
        return Answer("echo", "exact", refusal="nothing acts")


class AlarmedWithoutEffects(Echo):
    """Its watch on itself finds something wrong where nothing acts."""

    def answer(self, scene, command):
        answer = super().answer(scene, command)
        answer.alarms += [] if scene.effects else ["it shakes"]
        return answer


class SilentWithoutEffects(Echo):
    """Does not say where the loop closes where nothing acts."""

    def answer(self, scene, command):
        answer = super().answer(scene, command)
        return answer if scene.effects else replace(answer, assembled=None)


@pytest.mark.parametrize(
    ("adapter", "verdict", "reason"),
    [
        (OnlyWithEffects, REFUSES, "nothing acts"),
        (AlarmedWithoutEffects, FAILS, "watch: it shakes"),
        (
            SilentWithoutEffects,
            FAILS,
            "assembled: the engine did not say where the loop closes",
        ),
    ],
)
def test_what_is_wrong_with_the_inertia_alone_is_a_row(adapter, verdict, reason):
    engine = Engine("echo", adapter, EQUIVALENCE)
    rows = judge("scene", crank_rocker(), [engine]).rows
    (row,) = [row for row in rows if row.quantity == "torque_inertia"]
    assert (row.verdict, row.reason) == (verdict, reason)


def test_where_no_loop_closes_no_identity_is_counted_as_held():
    """Beyond the limits of the input."""
    apart = fourbar.Motion(fourbar.Sweep(2.0, 4.0, 5), 1.0)
    scene = Scene(fourbar.uniform(0.3, 0.25, 0.1, 0.22), apart)
    assert not fourbar.solve(scene).assembled.any()
    exact = [engine for engine in ENGINES if engine.name == "free-body"]
    rows = judge("scene", scene, exact).rows
    verdicts = {(row.engine, row.quantity): row.verdict for row in rows}
    assert verdicts["formulas", "closure"] == UNDECIDED
    assert verdicts["free-body", "torque"] == UNDECIDED
    assert verdicts["free-body", "assembled"] == AGREES


def test_an_identity_that_is_due_nowhere_is_not_counted_as_held(monkeypatch):
    monkeypatch.setattr(
        "fourbar_validation.run.question.mark_reversing",
        lambda scene, solution, _: np.ones(len(solution), bool),
    )
    rows = judge("scene", crank_rocker(), []).rows
    verdicts = {row.quantity: row.verdict for row in rows}
    expected = {"closure": AGREES, "force_sum": UNDECIDED, "moment_sum": UNDECIDED}
    assert verdicts.items() >= expected.items()


def test_formulas_without_an_answer_fail():
    scene = crank_rocker()
    commanded = command(scene)
    answer = Echo().answer(scene, commanded)
    positions = fourbar.solve(scene, "position", at=commanded)
    demands = Demands(EQUIVALENCE, ("torque",))
    rows = Comparison("", scene, answer, positions, demands).rows()
    (row,) = [row for row in rows if row.quantity == "torque"]
    assert (row.verdict, row.reason) == (FAILS, "the formulas have no answer")


@pytest.mark.slow
def test_a_run_in_which_nothing_was_compared_says_so_everywhere_and_ends_with_1(
    tmp_path, monkeypatch, capsys
):
    """A simulation needs more than one position."""
    judge_here(monkeypatch)
    file, out = tmp_path / "scene.toml", tmp_path / "out"
    linkage = bare(4.0, 1.0, 3.0, 3.0)
    fourbar.save(Scene(linkage, fourbar.Motion(math.radians(10.0), 1.0)), file)
    line = ["run", str(file), "--no-pictures", "--out", str(out), "--engines"]
    assert status([*line, "mujoco-simulated"]) == FAILED
    sentence = "Nothing was compared on 1 scene: 9 of the formulas' own identities hold"
    assert sentence in " ".join(capsys.readouterr().out.split())
    assert sentence in (out / "report.md").read_text()
    page = html.unescape((out / "report.html").read_text())
    assert f'<h1 class="bad">{sentence}</h1>' in page
    assert '<span class="bad">nothing compared</span>' in page
    assert status([*line, "mujoco-simulated,free-body"]) == HOLDS


@pytest.mark.slow
def test_every_form_of_a_report_says_the_same_counts():
    """Rows of the formulas themselves are of both scenes, the others of free bodies."""
    refused = Engine("echo", Refuses, EQUIVALENCE)
    (exact,) = [engine for engine in ENGINES if engine.name == "free-body"]
    summary = summary_of(
        judge_for_report(name, crank_rocker(title=name), engines, draw=False)
        for name, engines in (("good", (exact, refused)), ("refused", (refused,)))
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


def test_a_free_motion_that_every_engine_refuses_is_not_held(monkeypatch):
    class Refusing:
        def __init__(self, step):
            self.step = step

        def release(self, scene, times):
            return ReleasedAnswer.refused("refusing", "-", "a declared limit")

    monkeypatch.setattr(
        free,
        "FORWARD",
        {name: (Refusing, *rest) for name, (_, *rest) in free.FORWARD.items()},
    )
    scene = crank_rocker(motion=fourbar.Motion(1.0, 0.0, free=fourbar.Free(0.2, 20)))
    page = judge_for_report("free", scene, (), draw=False)
    sentence = (
        "Nothing was compared on 1 scene: 1 of the formulas' own identities hold; 2"
        " refuse"
    )
    assert summary_of([page]).verdict == sentence


def junit(old, new):
    changes = compare_rows((HERE, old), (HERE, new))
    return ET.fromstring(render.write_junit_of_changes(changes))


def test_junit_skips_what_was_not_compared_and_fails_what_fails_as_before():
    agrees, *others = (
        replace(ROW, quantity=quantity, verdict=verdict, error=error)
        for quantity, verdict, error in (
            ("torque", AGREES, 1e-15),
            ("all", REFUSES, NAN),
            ("F12", UNDECIDED, NAN),
            ("F14", FAILS, NAN),
        )
    )
    suites = junit([agrees, *others], [agrees, *others])
    tags = {
        case.get("name"): [child.tag for child in case]
        for case in suites.iter("testcase")
    }
    assert tags == {
        "torque": [],
        "all": ["skipped"],
        "F12": ["skipped"],
        "F14": ["failure"],
    }
    counts = {name: suites.get(name) for name in ("tests", "failures", "skipped")}
    assert counts == {"tests": "4", "failures": "1", "skipped": "2"}
    worse = junit([agrees], [replace(agrees, verdict=REFUSES, error=NAN)])
    assert next(child.tag for case in worse.iter("testcase") for child in case) == (
        "failure"
    )
    nothing = junit(others[:1], others[:1])
    assert nothing.get("failures") == "1" and nothing.get("skipped") == "1"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "sentence", "code"),
    [
        (
            {"agree": 1},
            {"agree": 1},
            "No regression in 1 rows: 1 same. New run: All 1 comparisons hold",
            HOLDS,
        ),
        (
            {"refuse": 1},
            {"refuse": 1},
            "Nothing was compared in 1 rows: 1 same",
            FAILED,
        ),
        (
            {"fail": 1},
            {"fail": 1},
            "No regression in 1 rows: 1 fails as before. New run: FAILS: 1 of 1",
            HOLDS,
        ),
        (
            {"agree": 1},
            {"refuse": 1},
            "1 regression in 1 rows: 1 verdict got worse",
            FAILED,
        ),
    ],
)
def test_two_runs_without_a_comparison_in_common_are_no_success(
    old, new, sentence, code
):
    changes = compare_rows((HERE, rows(**old)), (HERE, rows(**new)))
    assert changes.status == code
    verdict = render.write_verdict(changes)
    assert sentence in re.sub(r" against .* in (\d)", r" in \1", verdict)
    for write in (
        render.write_differences,
        render.write_differences_page,
        render.write_pull_request_comment,
    ):
        assert verdict in html.unescape(write(changes))


def test_numbers_without_a_digit_do_not_agree(tmp_path, capsys):
    """1e-13 rad from a limit of theta_2 that is the condition of the accelerations."""
    rocker = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    limit = limit_positions(rocker)[0].theta_2
    scene, *_ = (
        near
        for side in (1.0, -1.0)
        for near in [Scene(rocker, fourbar.Motion(limit + side * 1e-13, 1.0))]
        if fourbar.solve(near).assembled.all()
    )
    file, theirs = tmp_path / "scene.toml", tmp_path / "theirs.csv"
    fourbar.save(scene, file)
    theirs.write_text(f"theta_2, torque\n{scene.motion.theta_2!r}, 17.0\n")
    assert status(["check", str(file), str(theirs)]) == FAILED
    told = "Nothing was compared; no digit left to judge 1 more by"
    assert told in capsys.readouterr().out


@pytest.mark.slow
def test_a_study_in_which_no_law_is_fitted_is_no_success(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(
        "fourbar_validation.cost.study.CostStudy.points", lambda _: iter(())
    )
    monkeypatch.setattr("fourbar_validation.cost.cost.write_cost", lambda *_: [])
    law = ErrorLaw("order", "torque", 4.0, 0.1, 4.0, 9)
    for found, code in (
        ([], FAILED),
        ([replace(law, points=1)], FAILED),
        ([law], HOLDS),
    ):
        monkeypatch.setattr(
            "fourbar_validation.cost.cost.fit_laws", lambda _, found=found: found
        )
        assert status(["cost", "--out", str(tmp_path)]) == code
        assert ("Nothing was compared" in capsys.readouterr().out) == (code == FAILED)


@pytest.mark.parametrize(
    ("error", "allowed", "mask", "verdict", "worst"),
    [
        ([0.0, 2.0, 1.0], 2.0, None, AGREES, 1),
        ([0.0, 2.0, 1.0], [1.0, 3.0, 0.5], None, FAILS, 2),
        ([0.0, math.nan, 1.0], 2.0, None, FAILS, 1),
        ([0.0, math.inf, 1.0], math.inf, None, FAILS, 1),
        ([0.0, 0.0, 0.0], 0.0, None, AGREES, 0),
        ([0.0, 1e-300, 0.0], 0.0, None, FAILS, 1),
        ([0.0, math.nan, 1.0], 2.0, [True, False, True], AGREES, 2),
        ([9.0, math.nan, 9.0], 2.0, [False, False, False], UNDECIDED, 0),
    ],
)
def test_one_rule_of_agreement(error, allowed, mask, verdict, worst):
    mask, places = None if mask is None else np.array(mask), np.array([1.0, 2.0, 3.0])
    bound = np.array(allowed) if isinstance(allowed, list) else allowed
    row = Row.judged(
        ("a", "b", "c"), "F12", np.array(error), bound, "", places, 1.0, mask
    )
    assert (row.verdict, row.theta_2) == (verdict, worst + 1.0)


def test_every_row_counts_however_many_there_are():
    many = rows(agree=70, fail=1)
    assert Counts(many)[AGREES] == 70 and Counts(many)[FAILS] == 1
    assert Counts(many).status == FAILED and Counts(rows(agree=70)).status == HOLDS
    counts = Counts()
    counts.add_scene(rows(agree=40))
    counts.add_scene(rows(refuse=3))
    assert (counts.scenes, counts.scenes_compared, counts.total) == (2, 1, 43)


@pytest.mark.parametrize(("part", "passed"), [(0.9, True), (1.1, False)])
def test_a_lone_number_agrees_up_to_what_is_allowed(part, passed):
    row = Row.judged(
        ("a", "b", "-"),
        "c",
        part * 1e-12,
        1e-12,
        "why",
    )
    assert row.passed == passed
