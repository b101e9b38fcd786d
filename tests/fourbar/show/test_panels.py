"""Integrals of curves over a motion against their antiderivatives."""

import math

import numpy as np
import pytest

from fourbar.quantities import Array
from fourbar.show.panels import Panels, fit_panels

EDGES = np.linspace(0.0, 2.0, 6)
SETTLED = 1e-9
"""Some panels of 1e-10 each."""


def fit(curve: Array | object, edges: Array = EDGES, rounding: float = 0.0) -> Panels:
    def compute(places: Array) -> dict[str, Array]:
        return {"curve": curve(places)}  # type: ignore[operator]

    return fit_panels(compute, edges, {"curve": rounding})


def test_the_mean_square_of_a_smooth_curve_is_that_of_its_antiderivative() -> None:
    """The integral of (e^{-x} cos 20 x)^2 is known, here by its complex exponents."""
    panels = fit(lambda x: np.exp(-x) * np.cos(20.0 * x))

    def primitive(x: float) -> float:
        slow = -0.25 * math.exp(-2.0 * x)
        exponent = complex(-2.0, 40.0)
        fast = 0.5 * (np.exp(exponent * x) / exponent).real
        return float(slow + fast)

    right = 0.5 * (primitive(2.0) - primitive(0.0))
    assert panels.find_mean_square("curve") == pytest.approx(right, rel=SETTLED)


def test_a_vector_has_the_sum_of_its_components() -> None:
    panels = fit(lambda x: np.stack((3.0 * np.cos(x), 4.0 * np.sin(x)), axis=-1))
    # 9 cos^2 + 16 sin^2 = 12.5 - 3.5 cos 2x
    right = 12.5 - 3.5 * math.sin(4.0) / 4.0
    assert panels.find_mean_square("curve") == pytest.approx(right, rel=SETTLED)


@pytest.mark.parametrize("place", (0.4, 1.0 / 3.0, 1.999))
def test_a_jump_costs_no_digits(place: float) -> None:
    """On an edge or anywhere else: 2 before it and -1 after it."""
    panels = fit(lambda x: np.where(x < place, 2.0, -1.0))
    right = 2.0 * place - (2.0 - place)
    assert panels.integrate("curve") == pytest.approx(right, abs=1e-8)
    turns = panels.accumulate("curve")
    assert turns.max() == pytest.approx(2.0 * place, rel=1e-8)


def test_a_curve_is_integrated_from_zero_to_zero() -> None:
    """The sine of 3 x gives 2/3 in each half wave, wherever the panels end."""
    panels = fit(lambda x: np.sin(3.0 * x), np.array([0.0, 1.3, 2.0]))
    steps = np.diff(panels.accumulate("curve"))
    # the second half wave ends at 2 pi/3, beyond the motion
    assert steps[steps > 0.0].sum() == pytest.approx(2.0 / 3.0, rel=SETTLED)
    down = (1.0 + math.cos(6.0)) / 3.0
    assert -steps[steps < 0.0].sum() == pytest.approx(down, rel=SETTLED)


def test_the_range_of_the_integral_about_a_level() -> None:
    """Of 1/2 + sin(pi x) less its mean it is that of -cos(pi x)/pi."""
    panels = fit(lambda x: 0.5 + np.sin(math.pi * x), np.array([0.0, 0.7, 2.0]))
    assert panels.integrate("curve") == pytest.approx(1.0, rel=SETTLED)
    about_mean = panels.accumulate("curve", 0.5)
    assert np.ptp(about_mean) == pytest.approx(2.0 / math.pi, rel=SETTLED)


def draw_noise(places: Array) -> Array:
    return np.random.default_rng(len(places)).normal(size=len(places))


@pytest.mark.parametrize(
    "curve",
    [
        lambda x: 1.0 / (x - math.sqrt(0.5)),
        lambda x: np.where(x < 0.7, np.nan, 1.0),
        draw_noise,
    ],
    ids=("pole", "gap", "noise"),
)
def test_what_has_no_integral_is_left_out(curve: object) -> None:
    def compute(places: Array) -> dict[str, Array]:
        return {"curve": curve(places), "other": np.exp(places)}  # type: ignore[operator]

    panels = fit_panels(compute, EDGES, {"curve": 0.0, "other": 0.0})
    assert panels.values.keys() == {"other"}
    right = math.exp(2.0) - 1.0
    assert panels.integrate("other") == pytest.approx(right, rel=SETTLED)


def test_rounding_need_not_settle() -> None:
    panels = fit(lambda x: 1e-13 * draw_noise(x), rounding=1e-12)
    assert math.sqrt(panels.find_mean_square("curve")) < 1e-12
