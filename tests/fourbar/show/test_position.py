"""The sheet of one position.

Every number is that of the solution, in the units of the scene.
"""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar import Motion, solve
from fourbar.files import loads
from fourbar.show.located import locate
from fourbar.show.position import PositionSheet
from fourbar.show.units import COMMON, units
from tests.support.scenes import crank_rocker
from tests.support.texts import PLIERS

SIX_DIGITS = 6e-6
ONE = crank_rocker(
    motion=Motion(1.0, 10.0, 3.0), points=(fourbar.Point("P", 3, (0.1, 0.7)),)
)


def numbers(line):
    return [float(x) for x in re.findall(r"(?<!\S)-?[\d.]+(?:e[-+]\d+)?(?!\S)", line)]


def test_bars_points_and_forces_are_those_of_the_solution():
    s = solve(ONE)
    shown = {**COMMON, **units("m N N.m rad/s")}
    sheet = PositionSheet(ONE, s, shown)
    bars = [numbers(line)[1:] for line in sheet.write_bars()[1:]]
    for bar, row in zip((2, 3, 4), bars, strict=True):
        rates = [getattr(s, f"{letter}_{bar}")[0] for letter in ("omega", "alpha")]
        assert row[1:] == approx(rates, rel=SIX_DIGITS)
        angle = np.degrees(getattr(s, f"theta_{bar}")[0])
        assert row[0] == approx(angle, abs=6e-5)
    points = sheet.write_points()
    at = next(i for i, line in enumerate(points) if line.startswith("P "))
    place, speed, growth = (numbers(line) for line in points[at : at + 3])
    assert place == approx(s.points["P"][0], rel=SIX_DIGITS)
    for row, vector in ((speed, s.velocity["P"][0]), (growth, s.acceleration["P"][0])):
        assert row == approx([*vector, np.hypot(*vector)], rel=SIX_DIGITS)
    forces = sheet.write_pin_forces()[1:5]
    for line, name in zip(forces, ("F12", "F32", "F43", "F14"), strict=True):
        vector = getattr(s, name)[0]
        assert line.startswith(name)
        assert numbers(line) == approx([*vector, np.hypot(*vector)], rel=SIX_DIGITS)


def test_what_a_scene_has_not_is_left_out():
    still = replace(ONE, motion=Motion(1.0), points=())
    sheet = PositionSheet(still, solve(still), COMMON)
    assert "omega" not in sheet.write_bars()[0]
    assert not any(line.startswith("  v") for line in sheet.write_points())
    assert not any(line.startswith("F_") for line in sheet.write_ratios())


def test_a_static_position_shows_no_rates():
    still = replace(ONE, motion=Motion(1.0, 0.0))
    sheet = PositionSheet(still, solve(still), COMMON)
    assert "theta" in sheet.write_bars()[0]
    assert "omega" not in sheet.write_bars()[0]
    assert not any(line.startswith(("  v", "  a")) for line in sheet.write_points())
    starting = replace(ONE, motion=Motion(1.0, 0.0, 3.0))
    sheet = PositionSheet(starting, solve(starting), COMMON)
    assert "alpha" in sheet.write_bars()[0]


def test_rounding_is_shown_as_zero_and_a_far_centre_by_a_word():
    lift = fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.3, 0.1), Motion(np.pi / 2.0, 1.0))
    text = "\n".join(
        line
        for sheet in [PositionSheet(lift, solve(lift), COMMON)]
        for line in (*sheet.write_points(), *sheet.write_ratios())
    )
    assert "e-1" not in text and "-0 " not in text
    assert re.search(r"^centre I13 +at infinity$", text, re.MULTILINE)


@pytest.mark.parametrize("turns", [0, 2777777777, 10**16])
def test_columns_of_an_angle_of_many_turns_stay_apart(turns):
    angle = 1.0 + math.tau * turns
    scene = replace(ONE, motion=Motion(angle, 10.0, 3.0))
    solution = solve(scene)
    rows = PositionSheet(scene, solution, COMMON).write_bars()[1:]
    for bar, row in enumerate(rows, 2):
        of_bar = [getattr(solution, f"{name}_{bar}")[0] for name in ("theta", "omega")]
        written = numbers(row.partition(str(bar))[2])[:2]
        shown = np.radians(written[0]), written[1] * math.tau / 60.0
        assert shown == approx(of_bar, rel=SIX_DIGITS)


PRESSED = (
    PLIERS.replace("[points]", 'omega_2 = "0 rad/s"\n[points]')
    + """\
[drive]
point = "handle"
direction = "60 deg"
frame = "bar"
"""
)


def test_the_force_of_a_drive_is_related_to_that_of_a_point():
    """Pliers with 31.969 across the handle: at 60 deg from it sin 60 deg of that.

    The work of a pull of 1 lbf against the jaw's path says the same.
    """
    scene = loads(PRESSED, "pliers.toml")
    rows = PositionSheet(scene, solve(scene), COMMON).write_ratios()
    (row,) = [row for row in rows if row.startswith("F_jaw/drive_force")]
    ratio = numbers(row)[0]
    assert ratio == approx(31.969 * np.sin(np.pi / 3.0), rel=2e-5)
    assert not any(row.startswith("F_handle/drive_force") for row in rows)
    held = fourbar.Load(4, (1.0, -0.5 * np.pi), point="jaw", frame="bar")
    loaded = solve(replace(scene, loads=(held,)))
    assert 1.0 / loaded.drive_force[0] == approx(ratio, rel=SIX_DIGITS)


@pytest.mark.parametrize("name", ["theta_3", "theta_4"])
def test_the_centre_of_a_bar_that_turns_back_is_at_infinity(name):
    """It lies 1e8 lengths away where the place has its last digits."""
    scene = replace(ONE, motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 90), 10.0))
    at = locate(scene, name, "max")
    sheet = PositionSheet(scene, fourbar.solve(scene, at=at), COMMON)
    rows = {line.split()[1]: line.split()[2:] for line in sheet.write_ratios()[-2:]}
    is_far = {centre: cells[:2] == ["at", "infinity"] for centre, cells in rows.items()}
    assert is_far == {"I13": name == "theta_3", "I24": False}
