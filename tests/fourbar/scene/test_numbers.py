"""A scene's own points.

Where they are, how they move, and the columns that they fill.
"""

import json
from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from pytest import mark

from fourbar import Point, solve, vary
from fourbar.files import dump, loads
from fourbar.solution import write_json
from tests.support.rows import read_rows, refused
from tests.support.scenes import crank_rocker

POINTS = (
    Point("P", 3, (0.04, 0.4)),
    Point("on_ground", 1, (0.1, 0.5)),
    Point("tip", 4, (0.3, -0.2)),
)


def scene(*points, **changes):
    return crank_rocker(points=points, **changes)


def test_a_study_varies_them_and_lists_its_members():
    study = vary(
        scene(*POINTS),
        {"points.P.from_pin.0": [0.0, 0.04], "lengths.coupler": [0.25, 0.26]},
    )
    s = solve(study)
    assert_allclose(s.points["P"][0], s.A[0], atol=1e-15)
    coupler = replace(crank_rocker().linkage.coupler, length=0.26)
    longer = replace(crank_rocker().linkage, coupler=coupler)
    alone = solve(scene(*POINTS, linkage=longer))
    assert_array_equal(s.acceleration["P"][1], alone.acceleration["P"])
    frame = s.to_pandas()
    assert frame["member"].tolist() == [0] * 61 + [1] * 61
    assert_array_equal(frame["a_P_x"][61:], alone.acceleration["P"][:, 0])
    assert np.shape(json.loads(write_json(s))["torque"]) == (2, 61)
    assert "2 linkages" in s._repr_html_()


WRONG = read_rows("""
torque = { bar = 3, from_pin = ["1 m", "0 deg"] } | is the name of a quantity
G = { bar = 3, from_pin = ["1 m"] } | must be a pair
v_P = { bar = 3, from_pin = ["1 m", "0 deg"] } | not beginning with
"two words" = { bar = 3, from_pin = ["1 m", "0 deg"] } | must be a word
P = { from_pin = ["1 m", "0 deg"] } | is missing; must be 1 (ground), 2 (input), 3
P = { bar = 5, from_pin = ["1 m", "0 deg"] } | 1 (ground)
""")


@mark.parametrize("line, words", WRONG)
def test_a_wrong_point_is_refused_in_one_line(line, words):
    with refused("points", words):
        loads(dump(scene()) + f"\n[points]\n{line}\n")


@mark.parametrize("name", ["V_max", "A_", "_", "p" * 40])
def test_a_word_that_is_no_rate_names_a_point(name):
    assert scene(Point(name, 3, (0.1, 0.2))).points[0].name == name
    with refused("must be a word"):
        Point("p" * 41, 3, (0.1, 0.2))


def test_two_points_of_one_name_are_refused():
    with refused("a name of its own"):
        scene(POINTS[0], Point("P", 2, (0.1, 0.0)))
