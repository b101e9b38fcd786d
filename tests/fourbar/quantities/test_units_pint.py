"""Quantities of pint in place of numbers, and pint as a second reader of units.

Every place that takes a text with a unit takes quantities.
"""

import math
import re
from fractions import Fraction
from itertools import product

import numpy as np
import pytest

import fourbar
from fourbar.errors import InputError
from fourbar.quantities.units import DEFINITIONS, UnitError, to_si

pint = pytest.importorskip("pint")
ureg = pint.UnitRegistry()
MM, KG, DEG = ureg.millimeter, ureg.kilogram, ureg.degree


def test_lengths_and_masses_are_converted_exactly() -> None:
    bar = fourbar.Bar(0.1 * ureg.inch, mass=250.0 * ureg.gram, centre=(3 * MM, 5 * DEG))
    assert bar.length == 0.00254
    assert bar.mass == 0.25
    assert bar.centre == (0.003, math.radians(5))
    assert fourbar.FourBar(3 * MM, bar, bar, bar, 15.0 * DEG).ground == 0.003


def test_arrays_of_angles_are_converted() -> None:
    angles = np.array([0.0, 90.0, 180.0])
    motion = fourbar.Motion(angles * DEG, 60.0 * ureg.rpm)
    np.testing.assert_array_equal(motion.theta_2, np.radians(angles))
    assert motion.omega_2 == 2.0 * math.pi


def test_effects_and_loads_take_them() -> None:
    gravity = fourbar.Gravity(386.08858267716535 * ureg.inch / ureg.second**2)
    assert gravity.magnitude == pytest.approx(9.80665, rel=1e-15)
    damper = fourbar.Viscous((("O2", 1.0 * ureg.N * ureg.m * ureg.s / ureg.rad),))
    assert damper.coefficients[0][1] == 1.0


@pytest.mark.parametrize(
    ("quantity", "sentence"),
    [
        (3.0 * ureg.second, "does not convert to m"),
        (math.nan * ureg.meter, "no finite number"),
        (ureg.Quantity([1.0, 2.0], "m"), "must be a finite number > 0"),
    ],
)
def test_what_is_no_length_is_refused(quantity: object, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        fourbar.Bar(quantity)  # type: ignore[arg-type]


def test_hertz_are_no_speed() -> None:
    """pint converts 10 Hz to 10 rad/s, a sixth of the speed that is meant."""
    with pytest.raises(InputError, match=r'did you mean "10\.0 rev/s"'):
        fourbar.Motion(0.0, 10.0 * ureg.hertz)


OURS = pint.UnitRegistry(None, non_int_type=Fraction)
"""A reader of our definitions that is not ours."""
OURS.load_definitions(DEFINITIONS.splitlines())
STATED = [line.split(" = ") for line in DEFINITIONS.strip().splitlines()]
WORDS = [word for name, _, *others in STATED for word in (name, *others)]
PREFIXES = ["", *(word.removesuffix("-") for word in WORDS if word.endswith("-"))]
NAMES = [word for word in WORDS if word != "pi" and not word.endswith("-")]
PRODUCTS = """\
m/s; m/s^2; m/s**2; m/s²; m per s; meters per second squared; N m; N·m; N*m; N m s/rad
N/m s; N/(m s); N/m/s; N/(m/s); (N)(m)/(s); N (m); kg^2m; m^-1; m**-2 s; pi rad; rad s
square inch; sq in; cubic feet; inch squared; kg m squared; slug ft^2; lbf in s^2/rad
m°; °s; ms; min; kp; kps; hp; psi; kg0; bars; Pas; dag; das; deg/s/s; rev/min; g_0s
/m; m/; m//; (m; m); (); m()s; m*; *m; m**s; m***s; m * /s; ss; hs; kmm; kk; k; kgs; gs
mms; Ns; lambda; m or s; None; as; m_; _; delta_m; e; j; inf; nan; N m/; (m/s; m)(s
"""


def read_by_pint(unit: str) -> tuple[Fraction, dict[str, int]] | None:
    """Return what pint makes of a unit by our definitions; None for no unit."""
    try:
        read = OURS.Quantity(Fraction(1), OURS.parse_units(unit)).to_root_units()
    except Exception:
        return None
    return read.magnitude, dict(read.dimensionality)


@pytest.mark.slow
def test_every_name_means_what_pint_reads() -> None:
    """With every prefix and in the plural, the wrong ones too."""
    mistaken = [
        name
        for prefix, unit, ending in product(PREFIXES, NAMES, ("", "s"))
        if not (prefix and unit in ("rad", "grad"))  # krad: refused, as a slip
        and (name := prefix + unit + ending) != "cW"  # clockwise
        and not means_the_same(name)
    ]
    assert not mistaken


@pytest.mark.parametrize("unit", re.split("; |\n", PRODUCTS.strip()))
def test_a_product_means_what_pint_reads(unit: str) -> None:
    assert means_the_same(unit)


def means_the_same(unit: str) -> bool:
    """Compare a unit with pint: its size in the SI unit of its dimension."""
    read = read_by_pint(unit)
    if read is None:
        with pytest.raises(UnitError):
            to_si(f"1 {unit}", "m")
        return True
    number, dimension = read
    base = {"[length]": "m", "[time]": "s", "[mass]": "g", "[angle]": "rad"}
    written = " ".join(f"{base[of]}^{power}" for of, power in dimension.items())
    return to_si(f"1 {unit}", written) == float(number)
