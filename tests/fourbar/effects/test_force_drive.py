"""The drive along a line, and at a point.

Against free bodies in balls, limiting cases, symmetry, power, and what is refused.
"""

from dataclasses import replace
from itertools import combinations
from math import pi, radians

import numpy as np
from numpy.testing import assert_allclose
from pytest import approx, mark, raises

from fourbar import (
    Friction,
    FromLimit,
    InputError,
    LinearDrive,
    Motion,
    Place,
    Point,
    PointDrive,
    Scene,
    dump,
    solve,
    uniform,
    vary,
)
from fourbar.files.scene_file import loads
from fourbar.quantities import PIN_FORCES
from fourbar.solution import write_json
from tests.support.balls import answer_in_balls
from tests.support.rows import read_rows, refused
from tests.support.scenes import (
    CRANK_ROCKER_LENGTHS,
    PARALLELOGRAM,
    UNIFORM,
    WEIGHT,
    crank_rocker,
)
from tests.support.texts import HELD, LINE_DRIVEN

PAIRS = list(combinations((1, 2, 3, 4), 2))
BARS = 10.0
"""Of an error bar, 0.64 standard deviations wide: 2 in ten billion normal errors are
beyond.
"""


def ends(start_bar, end_bar):
    return LinearDrive(Place(start_bar, (0.17, -1.1)), Place(end_bar, (0.09, 0.7)))


@mark.parametrize("start_bar, end_bar", PAIRS)
def test_beside_a_limit_of_the_input_its_digits_are_those_of_the_line(
    start_bar, end_bar
):
    """At rest forces grow without end only for a line to bar 2, without lever there."""
    link, near = uniform(0.2, 0.48, 0.55, 0.2), FromLimit(1, 1e-10)
    drive, gravity = ends(start_bar, end_bar), WEIGHT
    scene = Scene(link, Motion(near, 0.0), effects=gravity, drive=drive)
    s = solve(scene, "error")
    assert s.status == ["ok"] and s.condition[0] < 1e-4
    exact = answer_in_balls(scene)
    missed = abs(s.drive_force - exact["drive_force"])
    assert missed <= BARS * s.drive_force_error
    for name in PIN_FORCES:
        missed = np.hypot(*(s[name] - exact[name]).T)
        assert missed <= BARS * s.force_error, name
    if (start_bar, end_bar) != (1, 2):
        # of bars 3 and 4, so nearly in line, 1e-11 would be left
        largest = max(np.hypot(*s[name][0]) for name in PIN_FORCES)
        assert s.drive_force_error[0] < 1e-13 * abs(s.drive_force[0])
        assert s.force_error[0] < 1e-13 * largest


CROSSES_O2 = LinearDrive(Place(1, (0.2, 0.0)), Place(2, (0.1, 0.0)))
MEETS = LinearDrive(Place(1, (0.1, 0.5)), Place(2, (0.1, 0.0)))
ALONG_CRANK = PointDrive(Place(2, (0.1, 0.0)), 0.0, "bar")
# the cranks of a parallelogram keep their distance while they are parallel, and only
# then
PARALLEL = LinearDrive(Place(2, (0.05, 0.3)), Place(4, (0.05, 0.3)))


@mark.parametrize(
    "lengths, drive, branch, status",
    [
        (CRANK_ROCKER_LENGTHS, CROSSES_O2, 1, ["no_lever", "ok", "no_lever"]),
        (CRANK_ROCKER_LENGTHS, MEETS, 1, ["ok", "no_direction", "ok"]),
        (PARALLELOGRAM, PARALLEL, 1, ["no_lever"] * 3),
        (PARALLELOGRAM, PARALLEL, -1, ["ok"] * 3),
        (PARALLELOGRAM, ALONG_CRANK, 1, ["no_lever"] * 3),
    ],
)
def test_where_it_has_no_lever_or_no_direction_there_are_no_forces(
    lengths, drive, branch, status
):
    angles = [0.0, 0.5, pi] if lengths == CRANK_ROCKER_LENGTHS else [0.4, 0.5, 1.0]
    scene = Scene(uniform(*lengths), Motion(angles, 1.0, branch=branch), drive=drive)
    s = solve(scene, "error")
    assert s.status == status
    lost = s.status_code != 0
    for name in ("drive_force", "F12", "power"):
        assert np.isnan(s[name][lost]).all(), name
    if drive is CROSSES_O2:
        assert s.drive_condition[0] < 1e-15 and s.stroke[0] == approx(0.1)


KEEP_THEIR_DISTANCE = read_rows("""
# O2, O4, A and B
1 0 0 | 2 0.05 0.3
1 0.3 0 | 4 0.05 0.3
2 0.1 0 | 3 0.1 1
3 0.25 0 | 4 0.1 1
1 0.1 1 | 4 0 1
# O2 to A: bar 2 holds both
1 0 0 | 3 0 0
2 0.1 0 | 4 0.22 0
2 0 0 | 4 0 0
""")
"""Bar, distance and angle of both ends."""


@mark.parametrize("ends", KEEP_THEIR_DISTANCE)
def test_ends_that_keep_their_distance_are_refused_in_one_line(ends):
    rows = (map(float, end.split()) for end in ends)
    drive = LinearDrive(*(Place(int(bar), tuple(at)) for bar, *at in rows))
    with raises(
        InputError,
        match=r"^drive\.to = .*does no work",
    ):
        Scene(UNIFORM, drive=drive)


def test_it_reads_back_as_it_was_written_and_is_carried_by_studies():
    scene = loads(LINE_DRIVEN + '[tolerances]\n"drive.from.from_pin.0" = "1 mm"\n')
    again = loads(dump(scene))
    assert again.drive == scene.drive
    assert again.drive.start.bar == 1 and again.drive.end == Place(4, (0.09, 0.0))
    assert again.drive.start.from_pin == approx((0.21, radians(-60)))
    assert again.drive_bar is None
    assert '"drive_bar": null' in write_json(solve(again))
    with raises(
        InputError,
        match="a drive is a couple on a bar or a force",
    ):
        replace(scene, drive_bar=3)
    with refused("out = 'torque'"):
        solve(scene, out={"torque": np.empty(1)})
    with raises(
        InputError,
        match=r"drive\.from\.bar = .*is no number of this scene",
    ):
        vary(scene, {"drive.from.bar": [2]})


@mark.parametrize("start_bar, end_bar", PAIRS)
def test_friction_at_rest_holds_as_much_force_as_its_work(start_bar, end_bar):
    motion = Motion(np.array([0.4, 1.3, 2.0, 4.5]), 10.0)
    scene = crank_rocker(motion, drive=ends(start_bar, end_bar))
    speeds = solve(scene).stroke_speed / 10.0
    held = (*scene.effects, Friction.at(O2=0.05))
    rest = solve(replace(scene, effects=held, motion=motion.replace(speed=0.0)))
    width = rest.drive_force_high - rest.drive_force_low
    assert_allclose(width, 0.1 / abs(speeds), rtol=1e-9)


def test_a_study_and_a_file_carry_a_force_at_a_point():
    scene = loads(HELD)
    assert loads(dump(scene)) == scene
    keys = {"drive.direction": [pi / 2, 1.2], "points.handle.from_pin.0": 0.1}
    varied = solve(vary(scene, keys))
    handle = Point("handle", 2, (0.1, 0.0))
    for k, direction in enumerate((pi / 2, 1.2)):
        one = replace(
            scene,
            drive=replace(scene.drive, direction=direction),
            points=(handle, scene.points[1]),
        )
        assert varied.drive_force[k] == solve(one).drive_force
