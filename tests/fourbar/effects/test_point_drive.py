"""A force at a point as the drive, in a study and a file."""

from dataclasses import replace
from math import pi

from fourbar import Point, solve, vary
from fourbar.files import dump, loads
from tests.support.texts import HELD


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
