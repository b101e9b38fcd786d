"""A run held against an earlier one says how the failure that its verdict names stood
there.
"""

import html
from dataclasses import replace

from pytest import fixture, mark

from fourbar_validation.compare.rows import FAILS, FORMULAS, REFUSES, Row
from fourbar_validation.compare.tolerance import EQUIVALENCE, ErrorBound
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.guests import STATED_BY_THE_ENGINE, Guest
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression.record import describe_run, open_run
from fourbar_validation.report.run_summary import Summary
from fourbar_validation.report.scene_record import Record
from fourbar_validation.run.run import Job, Plan, _judge_by_engine, run
from tests.support.here import judge_here
from tests.support.runs import changed, save_run
from tests.support.unlucky import Few

ROW = changed(scene="a", engine="mine", quantity="F32")
OF_MINE = Engine("mine", FreeBody, EQUIVALENCE)
MINE = describe_run([OF_MINE], "suite")
FAILED = replace(ROW, error=1e-3, verdict=FAILS)


DECLARED = ErrorBound(
    STATED_BY_THE_ENGINE, "0.01 of the scale: fewer digits", 1e-2, False
)


@fixture
def run_against(tmp_path, monkeypatch):
    """Runs scenes with these records against a run with these rows, and returns the
    summary and how the earlier run is named.
    """
    judge_here(monkeypatch)

    def run_records(before, *records, engine=OF_MINE, **suite):
        by_name = {record.name: record for record in records}
        monkeypatch.setattr(
            "fourbar_validation.run.run.judge_job", lambda job: by_name[job.name]
        )
        same_suite = replace(MINE, settings=MINE.settings | {"scenes of": "few"})
        saved = open_run(save_run(tmp_path / "before", before, about=same_suite))
        options = dict(drawn=False, against=saved.table.parent)
        plan = Plan(Few(tuple(by_name)), (engine,), **options, suite_name="few")
        return run(plan, tmp_path / "now"), saved.describe()

    return run_records


WIDER = Engine("mine", FreeBody, DECLARED)


@mark.parametrize(
    "before, engine, error, words",
    [
        ([ROW], WIDER, 1e-15, "WEAKER RULE: mine: factor 1.11"),
        ([ROW, replace(ROW, scene="b")], OF_MINE, 1e-15, "GONE: scene b is gone (1 "),
        ([replace(ROW, quantity="F12"), ROW], OF_MINE, 1e-15, "GONE: a / mine / exa"),
        ([ROW], OF_MINE, 8e-13, "WORSE: a / mine / exact / F32: error 1.00e-15 -> 8"),
        ([ROW], OF_MINE, 1.0, "FAILS: mine is wrong"),
    ],
)
def test_what_got_worse_stands_before_comparisons_that_hold(
    before, engine, error, words, tmp_path, run_against
):
    """Everything else holds, by a wider tolerance at first: the run is not green."""
    row = replace(ROW, error=error, allowed=1e-2) if error < 1.0 else FAILED
    summary, baseline = run_against(before, Record("a", rows=[row]), engine=engine)
    assert summary.headline.startswith(words) and not summary.good
    held = f"against {baseline}. All 1 comparison"
    assert (held in summary.headline) == (row is not FAILED)
    page = html.unescape((tmp_path / "now" / "report.html").read_text("utf-8"))
    assert f'<h1 class="bad">{words}' in page


def test_the_verdict_says_since_when_of_the_failure_that_it_names(
    tmp_path, run_against
):
    """The cause of most scenes is named.

    The first scene that fails does not have it.
    """
    first = replace(FAILED, quantity="torque")
    swapped = {"mine": ["F32 and F43 are exchanged"]}
    summary, baseline = run_against(
        [first, *(replace(ROW, scene=name) for name in "bc")],
        Record("a", rows=[first]),
        Record("b", rows=[replace(FAILED, scene="b")], causes=swapped),
        Record("c", rows=[replace(FAILED, scene="c", error=1e-2)], causes=swapped),
    )
    assert "mine is wrong: F32 and F43 are exchanged" in summary.headline
    assert "worst F32 of c" in summary.headline
    assert summary.headline.endswith(f" It held in {baseline}.")
    assert "It held in" in (tmp_path / "now" / "report.md").read_text("utf-8")


@mark.parametrize(
    "kind, chosen, status",
    [(Guest, "", 1), (Engine, "mine,other", 1), (Engine, "", 0)],
)
def test_an_engine_that_was_asked_for_and_compared_nothing_is_no_success(
    kind, chosen, status
):
    plan = Plan(
        Few(("a",)), (OF_MINE, kind("other", FreeBody, EQUIVALENCE)), chosen=chosen
    )
    summary = Summary(plan.engines, plan.missing, bool(plan.chosen))
    refusal = Row.unmeasured("a", "other", "exact", "all", REFUSES, "no licence")
    summary.add(Record("a", rows=[ROW, refusal], left_out=["mine: in part"]))
    words = "NOT CHECKED: other: nothing compared (1 scene): no licence. All 1 comp"
    assert plan.conclude(summary) == status
    assert summary.headline.startswith(words) == bool(status) != summary.good


@mark.parametrize("broken", ["", "mine"])
def test_whoever_breaks_down_alone_is_blamed(broken):
    error = ZeroDivisionError("division by zero")

    def attempt(job):
        names = [engine.name for engine in job.engines]
        return error if not broken or broken in names else Record(job.name)

    engines = [Engine(name, FreeBody, EQUIVALENCE) for name in ("mine", "other")]
    job = Job(
        Few(("a",)),
        0,
        engines,
        draw=False,
    )
    (row,) = _judge_by_engine(job, error, attempt).rows
    assert row.engine == (broken or FORMULAS)
    assert row.reason == "ZeroDivisionError: division by zero"
