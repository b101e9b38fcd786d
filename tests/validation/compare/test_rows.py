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
from tests.support.runs import HERE, compare_rows, save_run
from tests.support.scenes import crank_rocker
from tests.validation.regression.test_regression import ROW
from tests.validation.run.test_judge import Echo, Refuses

NAN = math.nan


def rows(**counts):
    """So many rows of each verdict."""
    names = {
        "agree": AGREES,
        "degraded": DEGRADED,
        "undecided": UNDECIDED,
        "refuse": REFUSES,
        "fail": FAILS,
    }
    return [
        replace(ROW, verdict=names[name])
        for name, many in counts.items()
        for _ in range(many)
    ]


def test_a_quantity_that_every_row_calls_degraded_is_counted_and_named():
    def row(scene, engine, quantity, verdict, allowed):
        return replace(
            ROW,
            scene=scene,
            engine=engine,
            quantity=quantity,
            verdict=verdict,
            allowed=allowed,
        )

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
        replace(judged, name=name, rows=[row(name, *values) for values in many])
        for name, many in scenes.items()
    ]
    summary = summary_of(records)
    assert (summary.loose, summary.pairs) == (2, 5)
    stated = "2 of 5 quantities of a scene are at best"
    for form in (
        write_summary_page(summary),
        page_of(summary, dict.fromkeys(scenes, 2)),
    ):
        text = html.unescape(form)
        assert (
            stated in text
            and "torque of three (allowed 5.0e-01), F12 of one (allowed 2.0e-04)"
            in text
        )
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


def test_a_row_passes_where_it_was_compared_and_holds():
    assert {verdict: replace(ROW, verdict=verdict).passed for verdict in VERDICTS} == {
        **dict.fromkeys((AGREES, DEGRADED), True),
        **dict.fromkeys((UNDECIDED, REFUSES, FAILS), False),
    }
    for changed in (
        {"error": NAN},
        {"verdict": DEGRADED, "error": NAN},
        {"verdict": "passes"},
    ):
        with pytest.raises(ValueError, match="no verdict"):
            replace(ROW, **changed)  # type: ignore[arg-type]


def test_a_table_cannot_say_that_a_refusal_passed(tmp_path):
    write_results(rows(refuse=1), tmp_path / "results.csv")
    text = (tmp_path / "results.csv").read_text()
    assert ",false,refuses," in text
    (tmp_path / "results.csv").write_text(text.replace(",false,", ",true,"))
    assert [row.passed for row in read_columns(tmp_path / "results.csv")] == [False]
    (tmp_path / "results.csv").write_text(text.replace("refuses", "FAILED"))
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
    inertial_rows = [
        row
        for row in judge("scene", crank_rocker(), [engine]).rows
        if row.quantity == "torque_inertia"
    ]
    assert [(row.verdict, row.reason) for row in inertial_rows] == [(verdict, reason)]


def test_where_no_loop_closes_no_identity_is_counted_as_held():
    apart = fourbar.Motion(
        fourbar.Sweep(2.0, 4.0, 5), 1.0
    )  # beyond the limits of this input
    scene = Scene(fourbar.uniform(0.3, 0.25, 0.1, 0.22), apart)
    assert not fourbar.solve(scene).assembled.any()
    rows = judge("scene", scene, [w for w in ENGINES if w.name == "free-body"]).rows
    verdicts = {(row.engine, row.quantity): row.verdict for row in rows}
    assert (
        verdicts["formulas", "closure"] == verdicts["free-body", "torque"] == UNDECIDED
    )
    assert verdicts["free-body", "assembled"] == AGREES


def test_an_identity_that_is_due_nowhere_is_not_counted_as_held(monkeypatch):
    monkeypatch.setattr(
        "fourbar_validation.run.question.mark_reversing",
        lambda scene, solution, _: np.ones(len(solution), bool),
    )
    verdicts = {
        row.quantity: row.verdict for row in judge("scene", crank_rocker(), []).rows
    }
    expected = {"closure": AGREES, "force_sum": UNDECIDED, "moment_sum": UNDECIDED}
    assert verdicts.items() >= expected.items()


def test_formulas_without_an_answer_fail():
    scene = crank_rocker()
    commanded = command(scene)
    answer = Echo().answer(scene, commanded)
    positions = fourbar.solve(scene, "position", at=commanded)
    (row,) = [
        r
        for r in Comparison(
            "", scene, answer, positions, Demands(EQUIVALENCE, ("torque",))
        ).rows()
        if r.quantity == "torque"
    ]
    assert (row.verdict, row.reason) == (FAILS, "the formulas have no answer")


ONE_POSITION = """
[lengths]
ground = "4 m"
input = "1 m"
coupler = "3 m"
output = "3 m"
[motion]
theta_2 = "10 deg"
omega_2 = "1 rad/s"
"""


@pytest.mark.slow
def test_a_run_in_which_nothing_was_compared_says_so_everywhere_and_ends_with_1(
    tmp_path, monkeypatch, capsys
):
    judge_here(monkeypatch)
    (tmp_path / "scene.toml").write_text(ONE_POSITION)
    out = tmp_path / "out"
    arguments = [
        "run",
        str(tmp_path / "scene.toml"),
        "--no-pictures",
        "--out",
        str(out),
    ]
    assert (
        status([*arguments, "--engines", "mujoco-simulated"]) == FAILED
    )  # a simulation needs more than one position
    sentence = "Nothing was compared on 1 scene: 9 of the formulas' own identities hold"
    assert sentence in " ".join(capsys.readouterr().out.split())
    assert sentence in (out / "report.md").read_text()
    page = html.unescape((out / "report.html").read_text())
    assert (
        f'<h1 class="bad">{sentence}</h1>' in page
        and '<span class="bad">nothing compared</span>' in page
    )
    assert status([*arguments, "--engines", "mujoco-simulated,free-body"]) == HOLDS


@pytest.mark.slow
def test_every_form_of_a_report_says_the_same_counts():
    refused = Engine("echo", Refuses, EQUIVALENCE)
    exact = next(w for w in ENGINES if w.name == "free-body")
    good, bad = (
        judge_for_report(name, crank_rocker(title=name), engines, draw=False)
        for name, engines in (("good", (exact, refused)), ("refused", (refused,)))
    )
    summary = summary_of([good, bad])
    # the rows of the formulas themselves stand on both scenes; the others are of the
    # free bodies
    sentence = (
        "All 35 comparisons on 1 of 2 scenes hold: 35 agree; not compared: 2 refuse"
    )
    assert summary.verdict == sentence == summary.counts.sentence() and summary.good
    assert sentence in write_summary_page(summary)
    page = page_of(summary, {})
    assert sentence in html.unescape(page)
    assert (
        page.count('class="cell refuses"') == 4 and ">nothing compared</span>" in page
    )
    assert Counts().status == FAILED


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
    return ET.fromstring(
        render.write_junit_of_changes(compare_rows((HERE, old), (HERE, new)))
    )


def test_junit_skips_what_was_not_compared_and_fails_what_fails_as_before():
    def of(quantity, verdict):
        return replace(
            ROW,
            quantity=quantity,
            verdict=verdict,
            error=1e-15 if verdict == AGREES else NAN,
        )

    both = [
        of("torque", AGREES),
        of("all", REFUSES),
        of("F12", UNDECIDED),
        of("F14", FAILS),
    ]
    suites = junit(both, both)
    kinds = {
        case.get("name"): [child.tag for child in case]
        for case in suites.iter("testcase")
    }
    assert kinds == {
        "torque": [],
        "all": ["skipped"],
        "F12": ["skipped"],
        "F14": ["failure"],
    }
    assert (suites.get("tests"), suites.get("failures"), suites.get("skipped")) == (
        "4",
        "1",
        "2",
    )
    worse = junit([of("torque", AGREES)], [of("torque", REFUSES)])
    assert (
        next(child.tag for case in worse.iter("testcase") for child in case)
        == "failure"
    )
    nothing = junit(both[1:2], both[1:2])
    assert nothing.get("failures") == "1" and nothing.get("skipped") == "1"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "sentence", "code"),
    [
        (
            rows(agree=1),
            rows(agree=1),
            "No regression in 1 rows: 1 same. New run: All 1 comparisons hold",
            HOLDS,
        ),
        (
            rows(refuse=1),
            rows(refuse=1),
            "Nothing was compared in 1 rows: 1 same",
            FAILED,
        ),
        (
            rows(fail=1),
            rows(fail=1),
            "No regression in 1 rows: 1 fails as before. New run: FAILS: 1 of 1",
            HOLDS,
        ),
        (
            rows(agree=1),
            rows(refuse=1),
            "1 regression in 1 rows: 1 verdict got worse",
            FAILED,
        ),
    ],
)
def test_two_runs_without_a_comparison_in_common_are_no_success(
    old, new, sentence, code, tmp_path, capsys
):
    folders = [
        str(save_run(tmp_path / name, rows))
        for name, rows in (("old", old), ("new", new))
    ]
    assert status(["compare", *folders]) == code
    printed = re.sub(r" against .* in (\d)", r" in \1", capsys.readouterr().out)
    assert sentence in printed
    changes = compare_rows((HERE, old), (HERE, new))
    sentence = render.write_verdict(changes)
    assert sentence in html.unescape(
        render.write_differences_page(changes)
    ) and sentence in render.write_pull_request_comment(changes)


def test_of_two_rows_of_one_name_the_worse_one_counts():
    both = [*rows(fail=1), *rows(agree=1)]
    assert compare_rows((HERE, rows(agree=1)), (HERE, both)).regressed


def test_numbers_without_a_digit_do_not_agree(tmp_path, capsys):
    # 1e-13 rad from a limit of theta_2 the condition of the accelerations is about
    # 1e-13
    rocker = fourbar.uniform(0.3, 0.25, 0.1, 0.22)
    limit = limit_positions(rocker)[0].theta_2
    near = (
        Scene(rocker, fourbar.Motion(limit + side * 1e-13, 1.0)) for side in (1.0, -1.0)
    )
    scene = next(
        candidate for candidate in near if fourbar.solve(candidate).assembled.all()
    )
    (tmp_path / "scene.toml").write_text(fourbar.dump(scene))
    (tmp_path / "theirs.csv").write_text(
        f"theta_2, torque\n{scene.motion.theta_2!r}, 17.0\n"
    )
    assert (
        status(["check", str(tmp_path / "scene.toml"), str(tmp_path / "theirs.csv")])
        == FAILED
    )
    assert (
        "Nothing was compared; no digit left to judge 1 more by"
        in capsys.readouterr().out
    )


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


def test_nothing_compared_is_no_success_whatever_was_refused():
    for none in (rows(refuse=5), rows(undecided=5), [IDENTITY, IDENTITY], []):
        assert Counts(none).nothing and Counts(none).status == FAILED
    assert not any(row.passed for row in rows(refuse=1, undecided=1, fail=1))


@pytest.mark.parametrize(("part", "passed"), [(0.9, True), (1.1, False), (8.0, False)])
def test_a_row_agrees_up_to_what_is_allowed(part, passed):
    errors = np.array([0.0, part, 0.5]) * 1e-12
    row = Row.judged(("a", "b", "-"), "c", errors, 1e-12, "why", np.arange(3.0))
    assert row.passed == passed and row.theta_2 == 1.0
    lone = Row.judged(("a", "b", "-"), "c", part * 1e-12, 1e-12, "why")
    assert lone.passed == passed
