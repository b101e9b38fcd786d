"""Where forces act.

Places of bars in every form, loads at them, and the cases that people brought.
"""

import json

from numpy.testing import assert_allclose
from pytest import approx, mark, raises

import fourbar
from fourbar import InputError, Load, Place, Point, Spring, solve
from fourbar.files import loads
from tests.support.rows import read_rows
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
    assert solve(loads(PULL)).torque[0] == approx(1.656231, abs=PRINTED)


@mark.parametrize(
    "make, stated",
    [
        *(
            (getattr(fourbar, name), json.loads(stated))
            for name, stated in read_rows("""
Load | {"bar": 3, "force": [1, 0], "from_pin": [0.1, 0], "arm": [0.1, 0]}
Load | {"bar": 3, "arm": [0.1, 0], "moment": 1}
Load | {"bar": 3, "force": [1, 0], "arm": [0.1, 0], "frame": "bar"}
Point | {"name": "P", "bar": 1, "from_centre": [0.1, 0]}
Point | {"name": "P", "bar": 3}
""")
        ),
        *(
            (Spring, {"start": start, "end": Place(4, (0.1, 0.0)), "stiffness": 1.0})
            for start in (Place(1), Place(1, from_centre=(0.1, 0.0)))
        ),
    ],
)
def test_python_refuses_what_is_no_place(make, stated):
    with raises(InputError):
        make(**stated)


@mark.parametrize("points", [(), (Point("P", 4, (0.1, 0.0)),)])
def test_python_refuses_a_load_at_a_point_that_its_bar_has_not(points):
    with raises(InputError):
        crank_rocker(loads=(Load(3, (1.0, 0.0), point="P"),), points=points)
