"""Prediction, retry and verdict of a quantity.

The unit of an error where nothing is allowed is tested too.
"""

from dataclasses import replace
from math import nan

import numpy as np
from pytest import approx, mark

from fourbar_validation.compare.compare import Errors, judge_errors
from fourbar_validation.compare.rows import AGREES, DEGRADED, FAILS, UNDECIDED
from fourbar_validation.compare.scales import Scale
from fourbar_validation.compare.tolerance import EPS as LAST_DIGIT
from fourbar_validation.compare.tolerance import EQUIVALENCE, K

ALLOWED = 1e-14


def judge_quantity(
    *error,
    predicted=None,
    allowed=ALLOWED,
    relative=True,
    cancellation=1.0,
    tolerance=EQUIVALENCE,
):
    """Judge the errors of a quantity."""
    ones = np.ones(len(error))
    mask = ones.astype(bool)
    errors = Errors(
        np.array(error),
        allowed * ones,
        Scale(ones, cancellation * ones, ~mask),
        mask & relative,
        ones,
        mask,
        tolerance,
        nan * ones,
    )
    return judge_errors(errors, predicted)


@mark.parametrize(
    "predicted, verdict, allowed",
    [
        (None, FAILS, ALLOWED),
        (1e-14, FAILS, 1e-13),
        (2e-13, DEGRADED, 2e-12),
        (0.99, DEGRADED, 9.9),
        (1.0, UNDECIDED, 10.0),
    ],
)
def test_an_error_beyond_the_allowed_one_is_held_to_its_prediction(
    predicted, verdict, allowed
):
    expected = None if predicted is None else np.array([0.0, predicted, 0.0])
    worst = judge_quantity(1e-15, 1e-12, 0.0, predicted=expected)
    assert (worst.position, worst.verdict) == (1, verdict)
    assert worst.allowed == approx(allowed, abs=0)


def test_within_what_is_allowed_no_prediction_is_needed_and_no_number_fails():
    worst = judge_quantity(1e-15, 9e-15, 0.0)
    assert (worst.position, worst.verdict, worst.decided) == (1, AGREES, 3)
    for allowed, verdict in ((0.9, FAILS), (1.0, UNDECIDED)):
        worst = judge_quantity(nan, 0.0, allowed=allowed)
        assert (worst.position, worst.verdict) == (0, verdict)
        assert worst.reason.startswith("NaN") == (verdict == FAILS)


@mark.parametrize(
    "allowed, declared, verdict",
    [
        (0.049, K * LAST_DIGIT, FAILS),
        (0.051, K * LAST_DIGIT, UNDECIDED),
        (0.2, 0.2, FAILS),
        (0.21, 0.2, UNDECIDED),
    ],
)
def test_a_position_at_which_too_much_is_allowed_is_undecided(
    allowed, declared, verdict
):
    """One position that decides is enough for a row."""
    tolerance = replace(EQUIVALENCE, factor=declared)

    def judge(*allowed):
        held = {"cancellation": 123.0, "tolerance": tolerance}
        worst = judge_quantity(1.0, 0.0, allowed=np.array(allowed), **held)
        assert "the terms cancel 1.2e+02-fold" in worst.reason
        return worst.verdict, worst.decided

    decided = 2 if verdict == FAILS else 0
    assert judge(allowed, allowed) == (verdict, decided)
    assert judge(allowed, ALLOWED) == ((FAILS, 2) if verdict == FAILS else (AGREES, 1))


def test_a_prediction_of_the_whole_value_leaves_no_digit_but_in_a_unit_of_its_own():
    """At a scale of 0 a prediction of 2 is 2 N and not twice the value."""
    none = {"allowed": 0.0, "relative": False}
    for changes, verdict in ((none, DEGRADED), ({}, UNDECIDED)):
        worst = judge_quantity(1.0, predicted=np.array([2.0]), **changes)
        assert worst.verdict == verdict
    for predicted, verdict in ((2.0, FAILS), (np.inf, UNDECIDED)):
        worst = judge_quantity(nan, predicted=np.array([predicted]))
        assert worst.verdict == verdict
