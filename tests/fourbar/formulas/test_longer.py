"""Numbers of mpmath against mpmath itself, by every function that formulas call."""

import numpy as np
import pytest
from mpmath import mp

from fourbar import Bar
from fourbar.formulas.longer import change_numbers
from fourbar.formulas.many_digits import ManyDigits

DIGITS = 1e-55
"""Relative; the reference has 60 digits."""


def draw(seed, size=3.0):
    random = np.random.default_rng(seed)
    high = random.normal(0.0, size, 50)
    return ManyDigits(high) + ManyDigits(random.uniform(-1.0, 1.0, 50)) * 2.0**-54


def exact(numbers):
    return [mp.mpc(one) for one in numbers.numbers]


ALIKE = [
    lambda x, y: x + y,
    lambda x, y: x - 1j * y,
    lambda x, y: 2.5 - x * y,
    lambda x, y: x / y,
    lambda x, y: (x + 1j * y) / (y - 2j * x),
    lambda x, y: abs(x + 1j * y),
]
"""Functions that mpmath's numbers take as they are."""


@pytest.mark.parametrize(
    "function, reference",
    [
        *zip(ALIKE, ALIKE, strict=True),
        (lambda x, y: np.sqrt(np.abs(x)), lambda x, y: mp.sqrt(abs(x))),
        (
            lambda x, y: np.sin(x) + 1j * np.cos(y),
            lambda x, y: mp.sin(x) + 1j * mp.cos(y),
        ),
        (lambda x, y: np.tan(x), lambda x, y: mp.tan(x)),
        (np.arctan2, lambda x, y: mp.atan2(x.real, y.real)),
        (
            lambda x, y: np.where(x > y, x, -y),
            lambda x, y: x if x.real > y.real else -y,
        ),
        (
            lambda x, y: x - 2.0 * np.rint(x / 2.0),
            lambda x, y: x - 2 * mp.nint(x.real / 2),
        ),
        (np.fmod, lambda x, y: x - y * int(x.real / y.real)),
        (
            lambda x, y: np.conjugate(x + 1j * y).imag,
            lambda x, y: -y,
        ),
    ],
)
def test_a_function_keeps_many_digits(function, reference):
    with mp.workdps(60):
        x, y = draw(1), draw(2)
        expected = map(reference, exact(x), exact(y))
        for ours, wanted in zip(exact(function(x, y)), expected, strict=True):
            assert abs(ours - wanted) <= DIGITS * max(abs(wanted), 0.1)


def test_what_no_number_has_is_not_finite():
    with np.errstate(invalid="ignore"):
        x = ManyDigits(np.array([0.0, -1.0, np.nan]))
    assert np.isnan((x / np.zeros(3)).as_doubles()).tolist() == [True, False, True]
    assert np.isnan(np.sqrt(x)).tolist() == [False, True, True]
    assert np.isinf((1.0 / x).as_doubles()).tolist() == [True, False, False]


def test_numbers_are_changed_within_tuples_and_dataclasses():
    bars = (Bar(0.1, 0.2, 0.3), Bar(0.2)), "m"
    doubled = change_numbers(bars, lambda number: 2.0 * number)
    assert doubled == ((Bar(0.2, 0.4, 0.6), Bar(0.4)), "m")
