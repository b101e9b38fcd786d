"""Where forces act.

Places of bars in every form, loads at them, and the cases that people brought.
"""

import cmath

import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pytest import approx, raises

import fourbar
from fourbar import Point, Spring, solve
from fourbar.effects import Load, Place
from fourbar.errors import InputError
from fourbar.files import loads
from tests.support.scenes import crank_rocker
from tests.support.texts import HUNG, PULL

PRINTED = 6e-7
"""N m: a half of the last digit of right values with six decimals."""


def test_a_weight_hung_at_the_tip_of_the_rocker():
    """Right values by virtual work and circles that meet, apart from this program."""
    torque = solve(loads(HUNG)).torque
    right = [0.441477, -0.417152, -0.621733, 0.532516]
    assert_allclose(torque, right, atol=PRINTED, rtol=0.0)


def test_a_pull_at_the_tip_of_massless_bars():
    torque = solve(loads(PULL)).torque
    assert torque[0] == approx(1.656231, abs=PRINTED)


def test_one_place_in_three_forms_is_one_load_one_spring_and_one_cylinder():
    place = cmath.rect(0.19, -0.4)
    point = Point("P", 3, cmath.polar(place))
    ground = Place(1, (0.2, 2.0))
    forms = (
        {"from_pin": cmath.polar(place)},
        {"from_centre": cmath.polar(place - crank_rocker().linkage.coupler.to_centre)},
        {"point": "P"},
    )
    drives = []
    for form in forms:
        load, end = Load(3, (5.0, 1.2), **form), Place(3, **form)
        spring = fourbar.Springs((Spring(ground, end, 200.0, 0.05),))
        loaded = crank_rocker(loads=(load,), points=(point,))
        sprung = crank_rocker(effects=(spring,), points=(point,))
        pushed = crank_rocker(drive=fourbar.LinearDrive(ground, end), points=(point,))
        pushing = solve(pushed).drive_force
        torques = solve(loaded).torque, solve(sprung).torque
        drives.append([*torques, pushing])
        settled = loaded.settled().loads[0].place
        assert settled.vector() == approx(place)
    assert_allclose(drives[1], drives[0], rtol=1e-9)
    assert_array_equal(drives[2], drives[0])


@pytest.mark.parametrize(
    "make",
    [
        lambda: Load(3, (1.0, 0.0), from_pin=(0.1, 0.0), arm=(0.1, 0.0)),
        lambda: Load(3, None, arm=(0.1, 0.0), moment=1.0),
        lambda: Load(3, (1.0, 0.0), arm=(0.1, 0.0), frame="bar"),
        lambda: crank_rocker(loads=(Load(3, (1.0, 0.0), point="P"),)),
        lambda: crank_rocker(
            loads=(Load(3, (1.0, 0.0), point="P"),),
            points=(Point("P", 4, (0.1, 0.0)),),
        ),
        lambda: Point("P", 1, from_centre=(0.1, 0.0)),
        lambda: Point("P", 3),
        lambda: Spring(Place(1), Place(4, (0.1, 0.0)), 1.0),
        lambda: Spring(Place(1, from_centre=(0.1, 0.0)), Place(4, (0.1, 0.0)), 1.0),
    ],
)
def test_python_refuses_what_is_no_place(make):
    with raises(InputError):
        make()
