"""Lengths as they were stated, of which decimals make a change point."""

import math
from fractions import Fraction

import numpy as np
import pytest

import fourbar
from fourbar import Motion, Scene, uniform
from fourbar_validation.engines.balls import compute_exact_sines
from fourbar_validation.engines.description import find_stated_lengths
from fourbar_validation.run.identities import check_status
from fourbar_validation.run.judge import make_question

pytest.importorskip("flint")
INCH = 0.0254


@pytest.mark.parametrize(
    "unit, stated",
    [
        (1e-3, ("80", "100", "120", "60")),
        (1e-3, ("100.1", "70.3", "60.7", "109.7")),
        (INCH, ("3.15", "3.94", "4.72", "2.37")),
        (INCH, ("8.1", "4.3", "9.9", "2.5")),
    ],
)
def test_decimals_whose_sums_are_equal_meet_in_one_line(unit, stated):
    """In their doubles the bars miss the line by the root of a rounding, 1e-8."""
    linkage = uniform(*(float(number) * unit for number in stated))
    scale = Fraction("0.0254") if unit == INCH else Fraction(1, 1000)
    exact = [Fraction(text) * scale for text in stated]
    assert find_stated_lengths(linkage.lengths) == exact
    command = fourbar.command(Scene(linkage, Motion([0.0, math.pi], 1.0)))
    assert np.nanmin(abs(compute_exact_sines(linkage, command))) < 1e-15
    d, *others = linkage.lengths
    longer = uniform(d, *(x * (1 + 1e-9) for x in others))
    assert np.all(~(abs(compute_exact_sines(longer, command)) < 1e-6))


def test_the_status_on_a_change_point_in_decimals_is_right():
    linkage = uniform(0.08, 0.1, 0.12, 0.06)
    motion = Motion(fourbar.Sweep(0.0, math.tau, 36), 10.0)
    (row,) = check_status(make_question("s", Scene(linkage, motion), ()))
    assert row.passed and "1 change_point" in row.reason
