"""Quantities of pint in place of numbers.

Every place that takes a text with a unit takes them.
"""

import math

import numpy as np
from numpy.testing import assert_array_equal
from pytest import importorskip, mark

from fourbar import Bar, FourBar, Motion
from fourbar.quantities.units import PARSED_UNITS, ask_library
from tests.support.rows import refused

ureg = importorskip("pint").UnitRegistry()
MM, DEG = ureg.millimeter, ureg.degree


def test_lengths_and_masses_are_converted_exactly():
    bar = Bar(0.1 * ureg.inch, mass=250.0 * ureg.gram, centre=(3 * MM, 5 * DEG))
    assert bar.length == 0.00254
    assert bar.mass == 0.25
    assert bar.centre == (0.003, math.radians(5))
    assert FourBar(3 * MM, bar, bar, bar, 15.0 * DEG).ground == 0.003


def test_arrays_of_angles_are_converted():
    angles = np.array([0.0, 90.0, 180.0])
    motion = Motion(angles * DEG, 60.0 * ureg.rpm)
    assert_array_equal(motion.theta_2, np.radians(angles))
    assert motion.omega_2 == 2.0 * math.pi


@mark.parametrize(
    "quantity, sentence",
    [
        (3.0 * ureg.second, "does not convert to m"),
        (math.nan * ureg.meter, "no finite number"),
        (ureg.Quantity([1.0, 2.0], "m"), "must be a finite number > 0"),
    ],
)
def test_what_is_no_length_is_refused(quantity, sentence):
    with refused(sentence):
        Bar(quantity)


def test_hertz_are_no_speed():
    """pint converts 10 Hz to 10 rad/s, a sixth of the speed that is meant."""
    with refused('"Hz" is not known'):
        Motion(0.0, 10.0 * ureg.hertz)


@mark.parametrize("unit", PARSED_UNITS)
def test_a_common_unit_is_what_the_library_makes_of_it(unit):
    number, dimension = ask_library(unit)
    # which power comes first hangs on what the library has read before
    powers = {f"{base[1:-1]}^{power}" for base, power in dimension.items()}
    stated, *bases = PARSED_UNITS[unit].split()
    assert stated == str(number)
    assert {base if "^" in base else f"{base}^1" for base in bases} == powers
