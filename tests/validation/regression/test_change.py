"""What happens to one row from a run to the next, and what a run ends with."""

import math
from dataclasses import replace

import pytest

from fourbar.errors import FAILED, HOLDS
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, REFUSES, Row
from fourbar_validation.regression.change import KindOfChange, compare_row
from fourbar_validation.regression.changes import Differences
from fourbar_validation.regression.rules import list_weakened
from tests.support.runs import HERE, compare_rows

EPS = 2.0**-52
ROW = Row("scene", "engine", "exact", "torque", 1e-15, 1e-9, AGREES, "", 1.0, 1.0)
KEY = ("scene", "engine", "exact", "torque")


def changed(**fields: object) -> Row:
    return replace(ROW, **fields)  # type: ignore[arg-type]


def compare(old: list[Row], new: list[Row]) -> Differences:
    return compare_rows((HERE, old), (HERE, new))


@pytest.mark.parametrize(
    ("moves", "kind"), [(40, KindOfChange.ROUND_OFF), (60, KindOfChange.WORSE)]
)
def test_fifty_last_digits_are_round_off_and_more_are_not(
    moves: int,
    kind: KindOfChange,
) -> None:
    worse = changed(error=ROW.error + moves * EPS, allowed=1e-14)
    assert compare_row(KEY, changed(allowed=1e-15), worse).kind is kind
    hard = changed(error=ROW.error + 50 * moves * EPS, condition=0.01, allowed=1e-13)
    assert compare_row(KEY, changed(allowed=1e-15), hard).kind is KindOfChange.ROUND_OFF


@pytest.mark.parametrize(
    ("factor", "kind"), [(1.2, KindOfChange.SAME), (1.3, KindOfChange.WORSE)]
)
def test_a_quarter_more_is_noticed(factor: float, kind: KindOfChange) -> None:
    old = changed(error=1e-6, allowed=1e-7)
    assert compare_row(KEY, old, replace(old, error=factor * 1e-6)).kind is kind


@pytest.mark.parametrize(
    ("old", "new", "status"),
    [
        ([ROW], [ROW], HOLDS),
        ([ROW], [], FAILED),
        ([ROW], [changed(quantity="F12")], FAILED),
        ([ROW, changed(quantity="F12")], [ROW], FAILED),
        ([ROW], [changed(verdict=DEGRADED)], FAILED),
        ([ROW], [changed(verdict=REFUSES, error=math.nan)], FAILED),
        ([ROW], [changed(verdict=FAILS)], FAILED),
        ([ROW], [ROW, changed(quantity="F12", verdict=FAILS)], FAILED),
        ([ROW], [ROW, changed(quantity="F12")], HOLDS),
        ([], [ROW], FAILED),
        ([changed(verdict=REFUSES)], [changed(verdict=REFUSES)], FAILED),
    ],
)
def test_a_comparison_ends_with_1_for_a_regression_and_for_nothing(
    old: list[Row],
    new: list[Row],
    status: int,
) -> None:
    assert compare(old, new).status == status


def test_of_two_rows_of_one_name_the_worse_counts_in_either_order() -> None:
    bad = changed(verdict=FAILS)
    for twice in ([ROW, bad], [bad, ROW]):
        assert compare([ROW], twice).regressed and not compare(twice, twice).regressed
        assert compare(twice, [ROW]).kinds[KindOfChange.VERDICT_BETTER] == 1


def test_a_factor_that_grew_by_a_thousandth_is_a_weaker_rule() -> None:
    rule = {"engine": {"factor": "1e-14"}}
    for factor, weaker in (("1.001e-14", True), ("1e-14", False), ("9e-15", False)):
        assert bool(list_weakened(rule, {"engine": {"factor": factor}})) == weaker
