"""Texts with units where a scene is described in Python.

The same numbers as SI gives, and one line for a mistake.
"""

import json
import re
from fractions import Fraction
from math import pi

from pytest import approx, mark, raises

import fourbar
from fourbar import InputError, Load, Motion, Place, Spring, Sweep
from fourbar.quantities.units import UnitError, half_unit_of_text, to_si
from tests.support.rows import read_rows

ENDS = Place(1, (0.1, 0.0)), Place(4, (0.2, pi))
STATED = read_rows("""
Bar | ["9 cm", "2 g", "2 g m^2", ["5 cm", "180 deg"]] | [0.09, 0.002, 0.002, [0.05, PI]]
uniform | ["6 in", 0.05, "127 mm", "4 in"] | [0.1524, 0.05, 0.127, 0.1016]
FromLimit | [1, "180 deg"] | [1, PI]
Free | ["0.5 min", 4] | [30.0, 4]
Motion | ["180 deg", "30 rpm", "180 deg/s^2"] | [PI, PI, PI]
Law | [["0 s", "0.5 min"], ["0 deg", 2], 4, "rest"] | [[0, 30], [0, 2], 4, "rest"]
Point | ["P", 3, ["5 cm", "180 deg"]] | ["P", 3, [0.05, PI]]
Table | [["0 deg", "180 deg"], [1.0, 2.0]] | [[0.0, PI], [1.0, 2.0]]
Gravity | ["1 g_0", "180 deg"] | [9.80665, PI]
Viscous | [[["A", "2 N mm s/rad"]]] | [[["A", 0.002]]]
PinFriction | [[["A", 0.1, "8 mm"]]] | [[["A", 0.1, 0.008]]]
Torsion | [[["A", "2 N m/rad", "180 deg", "1 N cm"]]] | [[["A", 2.0, PI, 0.01]]]
""")
"""Names, and the numbers with and without their units."""


def read(cell):
    """Read a list of JSON, in which PI is a number."""
    return json.loads(cell.replace("PI", repr(pi)))


SAME = [
    *((getattr(fourbar, name), read(a), read(b)) for name, a, b in STATED),
    (
        lambda bar, force, at, moment: Load(bar, force, from_pin=at, moment=moment),
        (4, ("2 kN", "180 deg"), ("5 cm", 0), "3 N cm"),
        (4, (2000.0, pi), (0.05, 0.0), 0.03),
    ),
    (
        lambda *swept: Motion(Sweep(*swept)),
        ("180 deg", "2 rad", 4),
        (pi, 2.0, 4),
    ),
    (
        Spring,
        (
            Place(1, ("10 cm", 0)),
            Place(4, ("20 cm", "180 deg")),
            "2 N/mm",
            "5 cm",
            "3 N",
        ),
        (*ENDS, 2000.0, 0.05, 3.0),
    ),
    (
        Spring.gas,
        (*ENDS, "50 cm", "20 cm", "400 N", "0.5 kN"),
        (*ENDS, 0.5, 0.2, 400.0, 500.0),
    ),
]


@mark.parametrize("make, texts, numbers", SAME)
def test_a_text_with_a_unit_is_its_number(make, texts, numbers):
    assert make(*texts) == make(*numbers)


@mark.parametrize(
    "name, stated, words",
    read_rows(r"""
uniform | ["6", 1, 1, 1] | lengths.ground = '6': the unit is missing.*like \"1 m\"
uniform | [1, "6 kg", 1, 1] | lengths.input = '6 kg'.*does not convert to m
uniform | [1, "-6 in", 1, 1] | lengths.input = '-6 in': must be a finite number > 0
Motion | ["60", 1.0] | motion.theta_2 = '60': the unit is missing
Motion | [1.0, 0.0, 0.0, "opne"] | motion.branch = 'opne': must be \+1 \(open\)
PinFriction | [[["A", "0.1", 1]]] | coefficient = '0.1': must be a finite number
"""),
)
def test_a_mistake_is_one_line(name, stated, words):
    with raises(InputError, match=words):
        getattr(fourbar, name)(*read(stated))


PI = Fraction(314159265358979323846264338327950288419716939937510582097494459, 10**62)
"""To 63 digits (A000796 of the On-Line Encyclopedia of Integer Sequences)."""
FOOT = Fraction(3048, 10_000)
"""m, exact by definition."""
OF_NAMES = read_rows("""
meter m metre | m | 1
inch in inches | m | 0.0254
foot ft feet | m | 0.3048
yard yd | m | 0.9144
second s sec | s | 1
minute min | s | 60
hour h | s | 3600
gram g | kg | 0.001
tonne t | kg | 1000
pound lb lbm | kg | 0.45359237
ounce oz | kg | 0.028349523125
radian rad | rad | 1
newton N | kg m/s^2 | 1
standard_gravity g_0 g0 | m/s^2 | 9.80665
kilogram_force kgf kp | N | 9.80665
pound_force lbf | N | 4.4482216152605
ounce_force ozf | N | 0.27801385095378125
newton_meter Nm | N m | 1
newton_centimeter Ncm | N m | 0.01
newton_millimeter Nmm | N m | 0.001
joule J | kg m^2/s^2 | 1
watt W | kg m^2/s^3 | 1
horsepower hp | W | 745.69987158227022
metric_horsepower PS | W | 735.49875
pascal Pa | N/m^2 | 1
bar | N/m^2 | 100000
""")
"""Each unit in SI units: A. Thompson, B. N. Taylor, Guide for the Use of the SI, NIST
SP 811 (2008), tables 1 to 8 and
appendix B.8; slug, hp and PS by their definitions there.
"""
LBF = Fraction("4.4482216152605")
OF_NAMES += [
    ("degree deg °", "rad", PI / 180),
    ("gradian grad gon", "rad", PI / 200),
    ("revolution rev turn r", "rad", 2 * PI),
    ("rpm RPM", "rad/s", 2 * PI / 60),
    ("rps", "rad/s", 2 * PI),
    ("slug", "kg", LBF / FOOT),
    ("blob", "kg", 12 * LBF / FOOT),
    ("psi", "N/m^2", LBF * 144 / FOOT**2),
]
UNITS = [
    (name, unit, Fraction(exact))
    for names, unit, exact in OF_NAMES
    for name in names.split()
]
POWERS = {
    "nano n": -9,
    "micro \u00b5 \u03bc u": -6,
    "milli m": -3,
    "centi c": -2,
    "deci d": -1,
    "deca da": 1,
    "kilo k": 3,
    "mega M": 6,
    "giga G": 9,
}
"""Powers of ten: NIST SP 811, table 5."""
PREFIXES = {name: power for names, power in POWERS.items() for name in names.split()}


@mark.parametrize("name, unit, exact", UNITS)
def test_every_unit_is_its_fraction(name, unit, exact):
    assert to_si(f"1 {name}", unit) == float(exact)
    assert to_si(f"0.7 {name}", unit) == float(exact * Fraction(7, 10))


CONVERTED = read_rows("""
111192.75 kg cm^2 | kg m^2 | 11.119275
0.2924725333 kg·cm² | kg m^2 | 0.00002924725333
1 kg cm/s^2 | N | 0.01
9.81 m s^-2 | m/s^2 | 9.81
3 N m/(rad/s) | N m s/rad | 3
2 kNm | N m | 2000
3 Nm | N m | 3
15 N⋅m | N m | 15
15 N×m | N m | 15
15 N•m | N m | 15
15 kg·m²·s⁻² | N m | 15
10 kgm^2 | kg m^2 | 10
10 kgm² | kg m^2 | 10
10 kgm2 | kg m^2 | 10
88500 kg mm2 | kg m^2 | 0.0885
-26 rad/s2 | rad/s^2 | -26
7.8 g/cm3 | kg/m^3 | 7800
2 g0 | m/s^2 | 19.6133
12 1/2 in | m | 0.3175
12-1/2" | m | 0.3175
12.5 in. | m | 0.3175
25/2 inches | m | 0.3175
12.5″ | m | 0.3175
2/3 yd | m | 0.6096
1'6" | m | 0.4572
1' 6 1/2" | m | 0.4699
1'-6.5" | m | 0.4699
0′12″ | m | 0.3048
-1'6" | m | -0.4572
-1 1/2 in | m | -0.0381
-1-1/2 in | m | -0.0381
-3/8 in | m | -0.009525
−40 mm | m | -0.04
+3/8 in | m | 0.009525
""")
"""A foot is 0.3048 m."""


@mark.parametrize(
    "text, unit, value",
    [
        *CONVERTED,
        ("5e-324 rad", "rad", 5e-324),
        *((text, "rad", PI / 4) for text in ("45º", "45˚", "0.125 rev")),
    ],
)
def test_units_are_converted_exactly_and_rounded_once(text, unit, value):
    assert to_si(text, unit) == float(Fraction(value))


NO_LENGTHS = """
1

m
nan m
inf m
1e309 m
1e400 m
1_0 m
1 kg
1 s
20 degC
1 rad
1 m^99
1 m**2**9
1 ((cm^9)^9)^9
1 cm²²
1 cm22
1 m + 1 m
1 m; import os
1 __import__('os')
1 (((((((
0x10 m
1,5 m
1.2.3 m
1e9999999 m
1'6
1'6'
6"1'
1'6 lb
1'-"
1'6""
1'-6-"
""".splitlines()


@mark.parametrize(
    "text, unit",
    [
        *((text, "rad/s") for text in ("1 Hz", "1 1/s", "1 s^-1", "1 rad", "1 deg")),
        *((text, "m") for text in (*NO_LENGTHS, "1 m" + " m" * 99, "9" * 200 + " m")),
    ],
)
def test_what_is_no_number_of_the_dimension_is_refused(text, unit):
    """An angle is a dimension."""
    with raises(UnitError):
        to_si(text, unit)


@mark.parametrize(
    "text, unit, meant",
    read_rows("""
5 lb | N | 5 lbf
5 lbf | kg | 5 lb
3 oz in | N m | 3 ozf in
"""),
)
def test_what_may_have_been_meant_is_one(text, unit, meant):
    with raises(UnitError, match=re.escape(f'did you mean "{meant}"?')):
        to_si(text, unit)
    assert to_si(meant, unit) > 0.0


def test_a_force_is_not_taken_for_a_length():
    with raises(UnitError, match=r'"lb" does not convert to m$'):
        to_si("5 lb", "m")


@mark.parametrize(
    "text, half",
    read_rows("""
0.10 m | 5e-3
−12.5 mm | 5e-5
1.00e-2 m | 5e-5
1.5e+1 mm | 5e-4
3 m | 0
1e-2 m | 0
1 1/2 in | 0
"""),
)
def test_half_a_unit_of_the_last_decimal(text, half):
    assert half_unit_of_text(text, "m") == approx(float(half), rel=1e-15)


@mark.parametrize("prefix", PREFIXES)
def test_every_prefix_is_its_power_of_ten(prefix):
    assert to_si(f"3 {prefix}N", "N") == float(3 * Fraction(10) ** PREFIXES[prefix])


@mark.parametrize("text", ["84 rad/s cw", "5 rpm CCW", "-5 rpm clockwise"])
def test_a_sense_of_turning_is_a_sign(text):
    with raises(UnitError, match="counter-clockwise is positive"):
        to_si(text, "rad/s")
