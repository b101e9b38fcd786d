"""A force at a point as the drive: its size, its pin forces, how a file states it."""

from dataclasses import replace
from math import pi

import numpy as np

from fourbar import Motion, Place, Point, PointDrive, solve, vary
from fourbar.files import dump, loads
from tests.support.scenes import crank_rocker
from tests.support.texts import HELD


def test_where_the_point_moves_across_the_direction_there_is_no_lever():
    """A crank pushed along itself: the point has no speed in that direction."""
    drive = PointDrive(Place(2, (0.1, 0.0)), 0.0, "bar")
    s = solve(crank_rocker(drive=drive, motion=Motion(0.7, 10.0)))
    assert s.status == ["no_lever"]
    assert np.isnan(s.drive_force[0]) and np.isnan(s.F12[0]).all()


def test_a_study_and_a_file_carry_it():
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
