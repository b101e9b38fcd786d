"""A run held against an earlier one says how the failure that its verdict names stood
there.
"""

from dataclasses import replace

import pytest

from fourbar_validation.compare.rows import FAILS, FORMULAS
from fourbar_validation.compare.tolerance import EQUIVALENCE, ErrorBound
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.guests import STATED_BY_THE_ENGINE
from fourbar_validation.engines.registry import Engine
from fourbar_validation.regression.record import (
    describe_run,
    open_run,
)
from fourbar_validation.report.scene_record import Record
from fourbar_validation.run.jobs import Job, _judge_by_engine
from fourbar_validation.run.plan import Plan, RunOptions
from fourbar_validation.run.run import run
from tests.support.here import judge_here
from tests.support.runs import changed, save_run
from tests.support.unlucky import Few

ROW = changed(scene="a", engine="mine", quantity="F32")
OF_MINE = Engine("mine", FreeBody, EQUIVALENCE)
MINE = describe_run([OF_MINE], "suite")
FAILED = replace(ROW, error=1e-3, verdict=FAILS)


def save(folder, rows):
    return open_run(save_run(folder, rows, about=MINE))


def test_a_rule_that_is_weaker_than_before_stands_first(tmp_path, monkeypatch):
    """Everything holds by the wider tolerance: the run is not green."""
    judge_here(monkeypatch)
    before = save(tmp_path / "before", [ROW])
    stated = ErrorBound(
        STATED_BY_THE_ENGINE, "0.01 of the scale: fewer digits", 1e-2, False
    )
    monkeypatch.setattr(
        "fourbar_validation.run.jobs.judge_job",
        lambda job: Record(job.name, rows=[replace(ROW, allowed=1e-2)]),
    )
    options = RunOptions(drawn=False, against=before.table.parent)
    engine = Engine("mine", FreeBody, stated)
    summary = run(Plan(Few(("a",)), (engine,), options), tmp_path / "now")
    assert summary.headline.startswith("WEAKER RULE: mine: factor 1.11")
    assert f"against {before.describe()}. All 1 comparison" in summary.headline
    assert not summary.good
    page = (tmp_path / "now" / "report.html").read_text("utf-8")
    assert '<h1 class="bad">WEAKER RULE: mine' in page


@pytest.mark.parametrize(
    "before, error, words",
    [
        ([ROW, replace(ROW, scene="b")], 1e-15, "GONE: scene b is gone (1 row), "),
        ([replace(ROW, quantity="F12"), ROW], 1e-15, "GONE: a / mine / exact / F12: "),
        ([ROW], 8e-13, "WORSE: a / mine / exact / F32: error 1.00e-15 -> 8.00e-13; "),
        ([ROW], 1.0, "FAILS: mine is wrong"),
    ],
)
def test_what_got_worse_stands_before_comparisons_that_hold(
    before, error, words, tmp_path, monkeypatch
):
    judge_here(monkeypatch)
    row = replace(ROW, error=error, allowed=1e-2) if error < 1.0 else FAILED
    monkeypatch.setattr(
        "fourbar_validation.run.jobs.judge_job",
        lambda job: Record(job.name, rows=[row]),
    )
    same_suite = replace(MINE, settings=MINE.settings | {"scenes of": "few"})
    saved = open_run(save_run(tmp_path / "before", before, about=same_suite))
    options = RunOptions(drawn=False, against=saved.table.parent)
    plan = Plan(Few(("a",)), (OF_MINE,), options, suite_name="few")
    summary = run(plan, tmp_path / "now")
    assert summary.headline.startswith(words) and not summary.good
    held = f"against {saved.describe()}. All 1 comparison"
    assert (held in summary.headline) == (row is not FAILED)


def test_the_verdict_says_since_when_of_the_failure_that_it_names(
    tmp_path, monkeypatch
):
    """The cause of most scenes is named.

    The first scene that fails does not have it.
    """
    judge_here(monkeypatch)
    rows = {
        "a": [replace(FAILED, quantity="torque")],
        "b": [replace(FAILED, scene="b")],
        "c": [replace(FAILED, scene="c", error=1e-2)],
    }
    monkeypatch.setattr(
        "fourbar_validation.run.jobs.judge_job",
        lambda job: Record(
            job.name,
            rows=rows[job.name],
            causes={} if job.name == "a" else {"mine": ["F32 and F43 are exchanged"]},
        ),
    )
    before = save(
        tmp_path / "before",
        [rows["a"][0], replace(ROW, scene="b"), replace(ROW, scene="c")],
    )
    options = RunOptions(drawn=False, against=before.table.parent)
    engine = Engine("mine", FreeBody, EQUIVALENCE)
    summary = run(Plan(Few(("a", "b", "c")), (engine,), options), tmp_path / "now")
    assert "mine is wrong: F32 and F43 are exchanged" in summary.headline
    assert "worst F32 of c" in summary.headline
    assert summary.headline.endswith(f" It held in {before.describe()}.")
    assert "It held in" in (tmp_path / "now" / "report.md").read_text("utf-8")


@pytest.mark.parametrize("broken", ["", "mine"])
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
