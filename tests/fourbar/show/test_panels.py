"""Integrals of curves over a motion against their antiderivatives."""

from math import exp, pi, sqrt

import numpy as np
from pytest import approx, mark

from fourbar.show.panels import Wanted, fit_panels

EDGES = np.linspace(0.0, 2.0, 6)


SETTLED = 1e-9
"""Some panels of 1e-10 each."""


def fit(curve, edges=EDGES, wanted="integrated"):
    def compute(places):
        return {"curve": (curve(places), Wanted(**{wanted: True}))}

    return fit_panels(compute, edges)


@mark.parametrize("place", (0.4, 1.0 / 3.0, 1.999))
def test_a_jump_costs_no_digits(place):
    """On an edge or anywhere else: 2 before it and -1 after it."""
    panels = fit(lambda x: np.where(x < place, 2.0, -1.0))
    assert panels.accumulate("curve")[-1] == approx(
        2.0 * place - (2.0 - place), abs=1e-8
    )
    assert panels.accumulate("curve").max() == approx(2.0 * place, rel=1e-8)
    assert not panels.growing


POLE = sqrt(0.5)


@mark.parametrize("power", (1.0, 2.0, 0.5))
def test_what_grows_without_bound_is_said_to_and_where(power):
    def compute(places):
        curve = abs(places - POLE) ** -power
        wanted = Wanted(integrated=True)
        return {"curve": (curve, wanted), "other": (np.exp(places), wanted)}

    panels = fit_panels(compute, EDGES)
    assert panels.growing == {"curve"} and not panels.has_value("curve")
    assert panels.list_poles("curve") == [approx(POLE, abs=1e-7)]
    assert panels.accumulate("other")[-1] == approx(exp(2.0) - 1.0, rel=SETTLED)


@mark.parametrize(
    "curve, peak, place",
    [
        (lambda x: np.where(x < 0.7, np.nan, -x), 2.0, 2.0),
        (lambda x: np.where(x < 0.7, 1.0 + x, 0.3), 1.7, 0.7),
        (lambda x: 2.0 - abs(x - POLE), 2.0, POLE),
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


@mark.parametrize("edges", (EDGES, np.array([0.0, 0.31, 2.0])))
@mark.parametrize(
    "curve, zeros",
    [
        (lambda x: np.prod([x - zero for zero in ZEROS], axis=0), ZEROS),
        (lambda x: np.square(x - 0.8) * (x - 1.1), [1.1]),
    ],
    ids=("crosses", "touches"),
)
def test_zeros_are_changes_of_sign_on_and_off_the_ends_of_panels(curve, zeros, edges):
    assert fit(curve, edges, "zeros").find_zeros("curve") == approx(zeros, abs=1e-9)


@mark.parametrize("frequency", (400.0, 800.0))
def test_a_panel_that_is_not_settled_exceeds_no_peak(frequency):
    """Of many equal peaks the settled ones are right to a part of 1e-9."""

    panels = fit(
        lambda x: np.exp(0.5 * np.sin(frequency * x)),
        np.linspace(0.0, 0.7, 13),
        "ranged",
    )
    assert panels.find_peak("curve").value == approx(exp(0.5), rel=SETTLED)
