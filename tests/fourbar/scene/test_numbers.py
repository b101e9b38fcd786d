"""A scene's own points.

Where they are, how they move, and the columns that they fill.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pytest import raises

from fourbar import InputError, Motion, Point, load, solve, vary
from fourbar.files import dump, loads
from fourbar.solution import write_json
from tests.support.scenes import crank_rocker

POINTS = (
    Point("P", 3, (0.04, 0.4)),
    Point("on_ground", 1, (0.1, 0.5)),
    Point("tip", 4, (0.3, -0.2)),
)

STEP = 1e-6
"""s, of a central difference."""
OF_A_DIFFERENCE = 1e-8
"""m/s: STEP^2 of its third derivatives of 1000 m/s^3 is left out, and rounding
1e-16/STEP = 1e-10 m/s is added. Accelerations are ten times larger again, and their
derivatives too.
"""


def scene(*points, **changes):
    return crank_rocker(points=points, **changes)


def test_pins_and_mass_centres_are_points():
    linkage = crank_rocker().linkage
    s = solve(
        scene(
            Point("pin_A", 2, (linkage.input.length, 0.0)),
            Point("pin_B", 4, (linkage.output.length, 0.0)),
            Point("centre_3", 3, linkage.coupler.mass_centre),
        )
    )
    for point, name in (("pin_A", "A"), ("pin_B", "B"), ("centre_3", "G3")):
        for vectors, start in (
            (s.points, ""),
            (s.velocity, "v_"),
            (s.acceleration, "a_"),
        ):
            assert_allclose(
                vectors[point],
                getattr(s, start + name),
                rtol=1e-13,
                atol=1e-13,
            )


def test_velocity_and_acceleration_are_derivatives():
    """Differences over time, of an accelerated input too."""
    theta_2, h, omega_2, alpha_2 = np.linspace(0.3, 6.0, 7), STEP, 10.0, -7.0

    def solve_at(t):
        angle = theta_2 + omega_2 * t + 0.5 * alpha_2 * t * t
        motion = Motion(angle, omega_2 + alpha_2 * t, alpha_2)
        return solve(scene(*POINTS, motion=motion))

    before, here, after = map(solve_at, (-h, 0.0, h))
    for point in POINTS:
        low, high = before.points[point.name], after.points[point.name]
        assert_allclose(
            here.velocity[point.name],
            (high - low) / (2 * h),
            atol=OF_A_DIFFERENCE,
        )
        slope = (after.velocity[point.name] - before.velocity[point.name]) / (2 * h)
        assert_allclose(
            here.acceleration[point.name],
            slope,
            atol=100.0 * OF_A_DIFFERENCE,
        )
    for name in ("A", "B", "G2", "G3", "G4"):
        slope = (getattr(after, name) - getattr(before, name)) / (2 * h)
        assert_allclose(
            getattr(here, f"v_{name}"),
            slope,
            atol=OF_A_DIFFERENCE,
        )
    assert_allclose(
        here.points["on_ground"],
        [[0.1 * np.cos(0.7), 0.1 * np.sin(0.7)]] * 7,
        atol=1e-15,
    )


def test_positions_alone_have_no_velocities_of_points():
    posed = scene(*POINTS, motion=Motion(1.0))
    s = solve(posed)
    assert list(s.points) == [point.name for point in POINTS]
    assert s.velocity == {} == s.acceleration
    assert json.loads(write_json(s))["v_P"] is None
    out = {"a_P": np.zeros((1, 2))}
    s = solve(scene(*POINTS, motion=Motion(1.0, 2.0)), out=out)
    assert s.points == {} and s.acceleration["P"] is out["a_P"] and out["a_P"].all()


def test_a_study_varies_them_and_lists_its_members():
    study = vary(
        scene(*POINTS),
        {"points.P.from_pin.0": [0.0, 0.04], "lengths.coupler": [0.25, 0.26]},
    )
    s = solve(study)
    assert_allclose(s.points["P"][0], s.A[0], atol=1e-15)
    longer = replace(crank_rocker().linkage.coupler, length=0.26)
    alone = solve(
        scene(*POINTS, linkage=replace(crank_rocker().linkage, coupler=longer))
    )
    assert_array_equal(s.acceleration["P"][1], alone.acceleration["P"])
    frame = s.to_pandas()
    assert len(frame) == s.theta_2.size
    assert frame["member"].tolist() == [0] * 61 + [1] * 61
    assert np.array_equal(frame["a_P_x"].to_numpy()[61:], alone.acceleration["P"][:, 0])
    assert np.shape(json.loads(write_json(s))["torque"]) == (2, 61)
    assert "2 linkages" in s._repr_html_()


def test_a_file_holds_them(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(dump(scene(*POINTS)))
    assert load(file).points == POINTS


WRONG = {
    "a quantity's name": (
        'torque = { bar = 3, from_pin = ["1 m", "0 deg"] }',
        "is the name of a quantity",
    ),
    "a quantity's column": ('G = { bar = 3, from_pin = ["1 m"] }', "must be a pair"),
    "a velocity's name": (
        'v_P = { bar = 3, from_pin = ["1 m", "0 deg"] }',
        "not beginning with",
    ),
    "a name of two words": (
        '"two words" = { bar = 3, from_pin = ["1 m", "0 deg"] }',
        "must be a word",
    ),
    "no bar": (
        'P = { from_pin = ["1 m", "0 deg"] }',
        "is missing; must be 1 (ground), 2 (input), 3 (coupler) or 4 (output)",
    ),
    "a fifth bar": ('P = { bar = 5, from_pin = ["1 m", "0 deg"] }', "1 (ground)"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_point_is_refused_in_one_line(name):
    line, words = WRONG[name]
    with raises(InputError) as caught:
        loads(dump(scene()) + f"\n[points]\n{line}\n")
    assert words in str(caught.value)
    assert "points" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_points_of_one_name_are_refused():
    with raises(InputError, match="a name of its own"):
        scene(POINTS[0], Point("P", 2, (0.1, 0.0)))
