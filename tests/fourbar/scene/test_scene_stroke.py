"""Commands of a stroke: the stroke returns itself, its bar moves as when it is
commanded alone, and an impossible stroke is refused.
"""

import json
from dataclasses import replace

import numpy as np
from pytest import approx, mark, raises

import fourbar
from fourbar import (
    FourBarError,
    Free,
    InputError,
    LinearDrive,
    Motion,
    Place,
    Sweep,
    dump,
    solve,
    vary,
)
from fourbar.mjcf import write_mjcf
from fourbar_lab.stability import compute_reference
from tests.support.rows import read_rows, refused
from tests.support.scenes import WEIGHT, cis, crank_rocker, recommand

BARS = 10.0
"""Of an error bar, as `stability` allows."""
OF_LONGER_NUMBERS = 1.1
"""Of an error bar: what the longer numbers lose themselves is a thousandth of what
doubles lose, or some of them.
"""
ENDS = {2: Place(2, (0.12, 0.4)), 4: Place(4, (0.15, -0.6))}
GROUND = Place(1, (0.3, 2.2))


def scene(bar, stroke, side="left", **motion):
    return crank_rocker(
        Motion(stroke=stroke, side=side, **motion),
        drive=LinearDrive(GROUND, ENDS[bar]),
        effects=WEIGHT,
    )


def test_the_sides_are_left_and_right_of_the_line_from_pin_to_ground_end():
    for side, sign in (("left", 1.0), ("right", -1.0)):
        end = 0.12 * cis(solve(scene(2, 0.3, side)).theta_2[0] + 0.4)
        ground = 0.3 * cis(2.2 + crank_rocker().linkage.ground_angle)
        assert sign * (np.conj(ground) * end).imag > 0.0


def test_strokes_with_rates_of_their_own_are_each_alone():
    profile = np.array([[0.2, 0.0, 0.4], [0.3, 0.1, 0.0], [0.4, 0.0, -0.4]])
    stroke, speed, acceleration = profile.T
    rates = {"stroke_speed": speed, "stroke_acceleration": acceleration}
    of_each = solve(fourbar.files.loads(dump(scene(2, stroke, **rates))))
    for row, (length, v, a) in enumerate(profile.tolist()):
        alone = solve(scene(2, length, stroke_speed=v, stroke_acceleration=a))
        assert of_each.drive_force[row] == approx(alone.drive_force[0], rel=1e-14)
        assert of_each.F14[row] == approx(alone.F14[0], rel=1e-13)


@mark.parametrize("bar, strokes", [(2, [0.181, 0.4, 0.4199999]), (4, [0.4, 0.45, 0.5])])
def test_error_bars_hold_what_the_angle_of_a_stroke_loses(bar, strokes):
    """The ground turned with all that is on it.

    The same force, every number of which rounds otherwise. Against balls, and not the
    median of the doubles, which all lose the same in what does not turn.
    """
    by_stroke = replace(
        scene(bar, np.array(strokes), stroke_speed=0.2, stroke_acceleration=0.1),
        effects=(),
        loads=(),
    )
    angles = by_stroke.linkage.ground_angle + np.linspace(0.0, 3.0, 100)
    s = solve(vary(by_stroke, {"lengths.ground_angle": angles}), "error")
    assert (s.status_code == 0).all()
    for place, stroke in enumerate(strokes):
        reference = compute_reference(recommand(by_stroke, angle=stroke), 1, stroke)
        exact = reference[0]["drive_force"]
        error = np.array(
            [
                abs(float((force - exact).mid()))
                for force in s.drive_force[:, place].tolist()
            ]
        )
        off = error / s.drive_force_error[:, place]
        assert np.quantile(off, 0.5) < OF_LONGER_NUMBERS and off.max() < BARS
        assert np.quantile(off, 0.9) > 0.1  # no bar is wide enough to hide anything


def test_where_the_line_passes_the_pin_the_stroke_is_at_its_end_and_singular():
    s = solve(scene(2, np.array([0.42, 0.3]), stroke_speed=0.1))
    assert list(s.status) == ["singular", "ok"]
    assert np.isnan(s.omega_3[0]) and s.condition[0] < 1e-7


@mark.parametrize(
    "motion, says",
    read_rows("""
{"stroke": 0.9, "side": "left"} | 0.18 to 0.42 m
{"stroke": 0.3} | left
{"stroke": 0.3, "side": "left", "theta_2": 1} | one bar
{"stroke": 0, "side": "left"} | above 0
"""),
)
def test_what_cannot_be_is_refused_in_one_line(motion, says):
    with refused(says):
        by_stroke = Motion(**json.loads(motion))
        solve(crank_rocker(by_stroke, drive=LinearDrive(GROUND, ENDS[2])))


def test_who_does_not_take_it_says_so():
    with refused("no release besides"):
        Motion(stroke=0.3, side="left", free=Free(1.0, 2))
    with raises(InputError, match=r"motion\.stroke.*cylinder"):
        crank_rocker(Motion(stroke=0.3, side="left"))
    by_stroke = scene(2, Sweep(0.25, 0.35, 8), stroke_speed=0.2)
    with raises(FourBarError, match=r"motion\.stroke"):
        write_mjcf(by_stroke)
    assert replace(by_stroke, title="b") != by_stroke


@mark.parametrize(
    "keywords, words",
    [
        ({"theta_2": Sweep("10 cm", "20 cm", 4)}, "motion.theta_2"),
        (
            {"stroke": Sweep("10 deg", "20 deg", 4), "side": "left"},
            "motion.stroke",
        ),
    ],
)
def test_a_sweep_of_texts_is_read_by_the_unit_that_they_state(keywords, words):
    motion = Motion(stroke=Sweep("10 cm", "0.2 m", 4), side="left")
    assert motion.angle == Sweep(0.1, 0.2, 4)
    with refused(words):
        Motion(**keywords)
