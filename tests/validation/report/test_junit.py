"""Cases of JUnit XML, and the first table of a report: what each row counts as."""

import math
import xml.etree.ElementTree as ET
from dataclasses import replace

from pytest import approx, mark

from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES, UNDECIDED
from fourbar_validation.report import junit, overview, run_summary, scene_record
from tests.support.runs import ROW

OUTCOMES = {
    AGREES: "passed",
    DEGRADED: "passed",
    REFUSES: "skipped",
    UNDECIDED: "skipped",
    FAILS: "failure",
}


def record(*rows):
    return scene_record.Record("scene", title="Scene", rows=list(rows))


@mark.parametrize("verdict", OUTCOMES)
def test_a_verdict_is_its_outcome(verdict):
    (case,) = junit.list_cases([replace(ROW, verdict=verdict)])
    assert case.outcome == OUTCOMES[verdict]


def test_each_suite_and_the_document_count_their_cases():
    verdicts = {"a": (AGREES, FAILS, REFUSES, FAILS), "b": (UNDECIDED, AGREES, AGREES)}
    cases = junit.list_cases(
        replace(ROW, scene=scene, quantity=f"F{i}", verdict=verdict)
        for scene, some in verdicts.items()
        for i, verdict in enumerate(some)
    )
    document = ET.fromstring(junit.write_document("run", cases))
    counted = {
        suite.get("name"): tuple(
            int(suite.get(kind, "")) for kind in ("tests", "failures", "skipped")
        )
        for suite in (document, *document)
    }
    assert counted == {"run": (7, 2, 2), "a": (4, 2, 1), "b": (3, 0, 1)}


def test_the_worst_row_of_a_group_is_that_which_uses_most_of_its_allowance():
    shares = {
        "F12": 0.2,
        "F32": 0.9,
        "F43": 0.5,
        "torque": 0.3,
    }
    rows = [
        replace(ROW, quantity=name, error=share * 1e-14)
        for name, share in shares.items()
    ]
    summary = run_summary.Summary()
    summary.add(record(*rows))
    (line,) = summary.independent
    cells = [" ".join(line.cell(group)) for group in overview.OVERVIEW_GROUPS]
    assert any(cell.startswith("9.0e-15") for cell in cells)
    assert (line.counts.compared, line.counts[FAILS]) == (4, 0)


def test_a_missing_answer_uses_all_that_is_allowed():
    missing = replace(ROW, verdict=FAILS, error=math.nan)
    assert [ROW.used, missing.used] == approx([0.1, math.inf])


@mark.parametrize(
    "rows, good",
    [
        ((ROW,), True),
        ((ROW, replace(ROW, quantity="F12", verdict=FAILS)), False),
        ((replace(ROW, verdict=REFUSES),), False),
    ],
)
def test_a_run_is_good_where_something_holds_and_nothing_fails(rows, good):
    summary = run_summary.Summary()
    summary.add(record(*rows))
    assert summary.good == good
    assert ("hold" in summary.headline and "not hold" not in summary.headline) == good
    summary.missing = [("engine", "not installed")]
    assert not summary.good
