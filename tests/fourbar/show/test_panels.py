"""Integrals of curves over a motion against their antiderivatives."""

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest
from pytest import approx

from fourbar.show.panels import LOWER, UPPER, Wanted, fit_panels

EDGES = np.linspace(0.0, 2.0, 6)


SETTLED = 1e-9
"""Some panels of 1e-10 each."""


def fit(curve, edges=EDGES, wanted="integrated"):
    def compute(places):
        return {"curve": curve(places)}

    return fit_panels(compute, edges, {"curve": Wanted(**{wanted: True})})


def integrate_product(x):
    """Integral of (e^{-x} cos 20 x)^2, by its complex exponents."""
    fast = np.exp(complex(-2.0, 40.0) * x) / complex(-2.0, 40.0)
    return float(-0.25 * np.exp(-2.0 * x) + 0.5 * fast.real)


@pytest.mark.parametrize(
    "curve, right",
    [
        (
            lambda x: np.exp(-x) * np.cos(20.0 * x),
            integrate_product(2.0) - integrate_product(0.0),
        ),
        # 9 cos^2 + 16 sin^2 = 12.5 - 3.5 cos 2x
        (
            lambda x: np.stack((3.0 * np.cos(x), 4.0 * np.sin(x)), axis=-1),
            25.0 - 1.75 * sin(4.0),
        ),
    ],
    ids=("number", "vector"),
)
def test_the_mean_square_is_that_of_the_antiderivative(curve, right):
    assert fit(curve).find_rms("curve") ** 2 == approx(0.5 * right, rel=SETTLED)


@pytest.mark.parametrize("place", (0.4, 1.0 / 3.0, 1.999))
def test_a_jump_costs_no_digits(place):
    """On an edge or anywhere else: 2 before it and -1 after it."""
    panels = fit(lambda x: np.where(x < place, 2.0, -1.0))
    right = 2.0 * place - (2.0 - place)
    assert panels.integrate("curve") == approx(right, abs=1e-8)
    turns = panels.accumulate("curve")
    assert turns.max() == approx(2.0 * place, rel=1e-8)
    assert not panels.growing


def test_a_curve_is_integrated_from_zero_to_zero():
    """The sine of 3 x gives 2/3 in each half wave, wherever the panels end."""
    panels = fit(lambda x: np.sin(3.0 * x), np.array([0.0, 1.3, 2.0]))
    steps = np.diff(panels.accumulate("curve"))
    # the second half wave ends at 2 pi/3, beyond the motion
    assert steps[steps > 0.0].sum() == approx(2.0 / 3.0, rel=SETTLED)
    down = (1.0 + cos(6.0)) / 3.0
    assert -steps[steps < 0.0].sum() == approx(down, rel=SETTLED)


def test_the_range_of_the_integral_about_a_level():
    """Of 1/2 + sin(pi x) less its mean it is that of -cos(pi x)/pi."""
    panels = fit(lambda x: 0.5 + np.sin(pi * x), np.array([0.0, 0.7, 2.0]))
    assert panels.integrate("curve") == approx(1.0, rel=SETTLED)
    about_mean = panels.accumulate("curve", 0.5)
    assert np.ptp(about_mean) == approx(2.0 / pi, rel=SETTLED)


POLE = sqrt(0.5)


@pytest.mark.parametrize("power", (1.0, 2.0, 0.5))
def test_what_grows_without_bound_is_said_to_and_where(power):
    def compute(places):
        curve = np.abs(places - POLE) ** -power
        return {"curve": curve, "other": np.exp(places)}

    wanted = dict.fromkeys(("curve", "other"), Wanted(integrated=True))
    panels = fit_panels(compute, EDGES, wanted)
    assert panels.growing == {"curve"} and not panels.has_value("curve")
    assert panels.list_poles("curve") == [approx(POLE, abs=1e-7)]
    right = exp(2.0) - 1.0
    assert panels.integrate("other") == approx(right, rel=SETTLED)


@pytest.mark.parametrize(
    "curve, peak, place",
    [
        (lambda x: np.where(x < 0.7, np.nan, -x), 2.0, 2.0),
        (lambda x: np.where(x < 0.7, 1.0 + x, 0.3), 1.7, 0.7),
        (lambda x: 2.0 - np.abs(x - POLE), 2.0, POLE),
        (lambda x: 3.0 + np.sqrt(2.0 - x), 3.0 + sqrt(2.0), 0.0),
        (lambda x: 1.0 / (np.square(x - POLE) + 1e-10), 1e10, POLE),
        (lambda x: np.sin(7.0 * x), 1.0, 0.5 * pi / 7.0),
        (lambda x: 0.0 * x - 4.0, 4.0, 0.0),
    ],
    ids=("gap", "jump", "corner", "root", "spike", "waves", "constant"),
)
def test_the_largest_size_is_the_first_of_equal_ones(curve, peak, place):
    """Of four equal waves the first is named, of a constant its beginning."""
    panels = fit(curve)
    assert not panels.growing
    found = panels.find_peak("curve")
    assert abs(found.value) == approx(peak, rel=1e-7)
    assert found.place == approx(place, abs=2e-6)


ZEROS = [0.3, 0.8, 1.7]


def test_both_ends_of_a_range_are_found_and_the_way_back_begins_at_its_end():
    for edges in (EDGES, EDGES[::-1]):
        panels = fit(np.sin, edges)
        assert panels.find_peak("curve", UPPER).place == approx(0.5 * pi, abs=1e-5)
        assert panels.find_peak("curve", LOWER).value == approx(0.0, abs=1e-8)
        level = fit(lambda x: 1.0 + 0.0 * x, edges)
        assert level.find_peak("curve").place == approx(edges[0], abs=1e-8)


@pytest.mark.parametrize("edges", (EDGES, np.array([0.0, 0.31, 2.0])))
@pytest.mark.parametrize(
    "curve, zeros",
    [
        (lambda x: np.prod([x - zero for zero in ZEROS], axis=0), ZEROS),
        (lambda x: np.square(x - 0.8) * (x - 1.1), [1.1]),
    ],
    ids=("crosses", "touches"),
)
def test_zeros_are_changes_of_sign_on_and_off_the_ends_of_panels(curve, zeros, edges):
    assert fit(curve, edges, "zeros").find_zeros("curve") == approx(zeros, abs=1e-9)
