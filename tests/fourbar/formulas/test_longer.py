"""Pairs of doubles against many digits.

Every function that the formulas call keeps some 30 of them.
"""

import numpy as np
import pytest
from mpmath import mp

from fourbar import Bar
from fourbar.formulas.longer import Pair, change_numbers

DIGITS = 2.0**-98
"""Relative: a few roundings of pairs, 2^-104 each, and what a complex product cancels.
"""


def draw(seed, size=3.0):
    random = np.random.default_rng(seed)
    high = random.normal(0.0, size, 50)
    return Pair(high, high * random.uniform(-1.0, 1.0, 50) * 2.0**-54)


def exact(pair):
    parts = zip(pair.high, pair.low, strict=True)
    return [mp.mpc(high) + mp.mpc(low) for high, low in parts]


ALIKE = [
    lambda x, y: x + y,
    lambda x, y: x - 1j * y,
    lambda x, y: 2.5 - x * y,
    lambda x, y: x / y,
    lambda x, y: (x + 1j * y) / (y - 2j * x),
    lambda x, y: abs(x + 1j * y),
]
"""Functions of pairs that mpmath's numbers take as they are."""


@pytest.mark.parametrize(
    "function, reference",
    [
        *zip(ALIKE, ALIKE, strict=True),
        (lambda x, y: np.sqrt(abs(x)), lambda x, y: mp.sqrt(abs(x))),
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
    ],
)
def test_a_function_keeps_the_digits_of_a_pair(function, reference):
    with mp.workdps(60):
        x, y = draw(1), draw(2)
        expected = map(reference, exact(x), exact(y))
        for ours, wanted in zip(exact(function(x, y)), expected, strict=True):
            assert abs(ours - wanted) <= DIGITS * max(abs(wanted), 0.1)


def test_numbers_are_changed_within_tuples_and_dataclasses():
    bars = (Bar(0.1, 0.2, 0.3), Bar(0.2)), "m"
    doubled = change_numbers(bars, lambda number: 2.0 * number)
    assert doubled == ((Bar(0.2, 0.4, 0.6), Bar(0.4)), "m")
