"""A force at a point as the drive: its size, its pin forces, how a file states it."""

from dataclasses import replace
from math import pi

import numpy as np
from pytest import approx

from fourbar import Motion, Place, Point, PointDrive, solve, vary
from fourbar.files import dump, loads
from tests.support.scenes import crank_rocker
from tests.support.texts import HELD


def test_pliers_multiply_the_force_of_the_hand():
    """Right: omega_4/omega_2 0.1332544 and a force ratio of 4.26/0.1332544 = 31.969."""
    s = solve(loads(HELD))
    assert s.omega_4[0] / s.omega_2[0] == approx(0.1332544, abs=5e-8)
    grip = 4.4482216152605
    assert grip / s.drive_force[0] == approx(31.969, abs=5e-4)


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
