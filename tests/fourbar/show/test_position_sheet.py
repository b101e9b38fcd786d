"""The sheet of one position.

Every number is that of the solution, in the units of the scene.
"""

import re
from dataclasses import replace
from math import pi

import numpy as np
from pytest import approx, mark

from fourbar import (
    Bar,
    FourBar,
    Free,
    Gravity,
    Law,
    Load,
    Motion,
    Point,
    Rise,
    Scene,
    Sweep,
    solve,
)
from fourbar.files import loads
from fourbar.scene import command_at
from fourbar.show.located import locate
from fourbar.show.position_sheet import PositionSheet
from fourbar.show.shown_units import COMMON, units
from fourbar.studies import course
from tests.support.rows import slow_but
from tests.support.scenes import (
    UNIFORM,
    UNIFORM_PARALLELOGRAM,
    crank_rocker,
)
from tests.support.texts import PLIERS

SIX_DIGITS = 6e-6


ONE = crank_rocker(Motion(1.0, 10.0, 3.0), points=(Point("P", 3, (0.1, 0.7)),))


def numbers(line):
    return [float(x) for x in re.findall(r"(?<!\S)-?[\d.]+(?:e[-+]\d+)?(?!\S)", line)]


@mark.parametrize(
    "motion, rates",
    [
        (Motion(1.0), []),
        (Motion(1.0, 0.0), []),
        (Motion(1.0, 0.0, 3.0), ["omega", "alpha"]),
    ],
)
def test_what_a_scene_has_not_is_left_out(motion, rates):
    """A static position has no rates, and one without a speed no forces."""
    sheet = PositionSheet(solve(replace(ONE, motion=motion, points=())), COMMON)
    heading = sheet.write_bars()[0]
    assert "theta" in heading
    assert [name for name in ("omega", "alpha") if name in heading] == rates
    points = [line[:3] for line in sheet.write_points()]
    assert ("a_A" in points) == bool(rates)
    forces = any(line.startswith("F_") for line in sheet.write_ratios())
    assert motion.speed is not None or not forces


def test_rounding_is_shown_as_zero_and_a_far_centre_by_a_dash():
    lift = Scene(UNIFORM_PARALLELOGRAM, Motion(pi / 2.0, 1.0))
    text = "\n".join(
        line
        for sheet in [PositionSheet(solve(lift), COMMON)]
        for line in (*sheet.write_points(), *sheet.write_ratios())
    )
    assert "e-1" not in text and "-0 " not in text
    assert re.search(r"^centre I13 +- +- +mm$", text, re.MULTILINE)


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
    rows = PositionSheet(solve(scene), COMMON).write_ratios()
    (row,) = [row for row in rows if row.startswith("F_jaw/drive_force")]
    ratio = numbers(row)[0]
    assert ratio == approx(31.969 * np.sin(pi / 3.0), rel=2e-5)
    assert not any(row.startswith("F_handle/drive_force") for row in rows)
    held = Load(4, (1.0, -0.5 * pi), point="jaw", frame="bar")
    loaded = solve(replace(scene, loads=(held,)))
    assert 1.0 / loaded.drive_force[0] == approx(ratio, rel=SIX_DIGITS)


PARALLELOGRAM = FourBar(0.3, Bar(0.1, 0.1), Bar(0.3, 0.3), Bar(0.1, 0.1))
"""Uniform bars of 1 kg/m, all in one line at theta_2 = 0 and 180 deg."""
ALONG = Gravity(9.81, 0.0)
ACROSS = Gravity(9.81, -0.5 * pi)
LIMITS = "on the change point: the limits from both sides"


def write_forces(motion, gravity=ALONG, at=None, **parts):
    """Return the rows of pin forces, by position or where a quantity has a value."""
    scene = Scene(PARALLELOGRAM, motion, effects=(gravity,), **parts)
    places = None if at is None else locate(scene, *at).part(slice(0, 1))
    solution = solve(scene, at=places)
    assert solution.status == ["change_point"]
    return PositionSheet(solution, units("N m")).write_pin_forces(), solution


@mark.parametrize("theta_2, sense", ((0.0, 1.0), (pi, -1.0)))
def test_pin_forces_that_are_bounded_on_a_change_point_have_their_limit(theta_2, sense):
    """Weights along the line of all bars ask for no moment there.

    On the frame the bars then act with their weights less m a, and each side has the
    limit.
    """
    rows, _ = write_forces(Motion(theta_2, 6.0))
    assert rows[-1] == LIMITS
    # of G2 and G4 half of the acceleration of the coupler
    mass_times_acceleration = -sense * 0.1 * 36.0 * (0.1 * 0.5 + 0.3 + 0.1 * 0.5)
    along = 0.5 * 9.81 - mass_times_acceleration
    assert numbers(rows[5]) == approx([along, 0.0, along], rel=SIX_DIGITS)
    assert numbers(rows[6]) == [0.0]
    beside = Motion(theta_2 + np.array([-1e-5, 1e-5]), 6.0)
    two = solve(Scene(PARALLELOGRAM, beside, effects=(ALONG,)))
    for row, name in zip(rows[1:5], ("F12", "F32", "F43", "F14"), strict=True):
        mean = two[name].mean(axis=0)
        assert numbers(row)[:2] == approx(mean, rel=SIX_DIGITS, abs=1e-8)


def test_pin_forces_that_have_no_bound_on_a_change_point_have_no_value():
    rows, _ = write_forces(Motion(0.0, 6.0), ACROSS)
    assert [row.split()[-4:-1] for row in rows[1:6]] == [["-", "-", "-"]] * 5
    assert rows[-1] == "on the change point no pin force has a limit"


@mark.slow
@mark.parametrize("gravity", [ALONG, ACROSS])
def test_a_release_has_the_limits_of_its_own_motion(gravity):
    """No torque acts: forces are bounded under any weight.

    On the frame the bars act with their weights less m a. Each arm turns about the
    same angle, so that half of it all is at each pin.
    """
    motion = Motion(0.5, 6.0, free=Free(2.0, 100))
    rows, solution = write_forces(motion, gravity, ("theta_2", "0 rad"))
    assert rows[-1] == LIMITS
    lost = 0.1 * solution.a_G2 + 0.3 * solution.a_G3 + 0.1 * solution.a_G4
    direction = np.array([np.cos(gravity.angle), np.sin(gravity.angle)])
    shaking = numbers(rows[5])[:2]
    assert shaking == approx(9.81 * 0.5 * direction - lost[0], rel=SIX_DIGITS, abs=1e-6)
    halves = [-0.5 * x for x in shaking]
    assert numbers(rows[1])[:2] == approx(halves, rel=SIX_DIGITS, abs=1e-6)


RELEASED = Motion(0.0, 6.0, free=Free(1.0, 10))
ONE_SIDED = [
    Motion(law=Rise("cycloidal", (1.0, 1.0), theta_2=0.0)),
    Motion(law=Law((-0.3, -0.2, -0.1, 0.0), (-0.3, -0.2, -0.1, 0.0), ends="free")),
    RELEASED,
    RELEASED.replace(speed=0.0),
]


@mark.parametrize("motion", slow_but(ONE_SIDED[:2], ONE_SIDED))
def test_a_motion_that_begins_ends_or_stands_still_has_no_limit(motion):
    rows, _ = write_forces(motion, at=("time", "0 s"))
    assert "begins, ends or stands still there, and has one side alone" in rows[-1]
    assert numbers(rows[1]) == []


def test_a_rate_within_the_rounding_of_its_place_is_zero_and_an_angle_is_not():
    """At the limit of bar 4 its speed is zero; a whole turn later the angle is 2 pi."""
    scene = Scene(UNIFORM, Motion(None, 10.0))
    at_limit = locate(scene, "theta_4", "max")
    rows = PositionSheet(solve(scene, at=at_limit), units("N m")).write_bars()
    assert abs(solve(scene, at=at_limit).omega_4[0]) > 0.0
    assert rows[3].split()[3] == "0" and rows[2].split()[3] != "0"
    parallel = PositionSheet(solve(scene, at=locate(scene, "theta_3", "max")), COMMON)
    assert parallel.write_ratios()[4].split()[2] == "-"
    turned = Scene(PARALLELOGRAM, Motion(Sweep(0.0, 2.0 * pi, 4), 1.0))
    one = solve(turned, at=command_at(turned, np.array([2.0 * pi])))
    course.follow(turned, one)
    rows = PositionSheet(one, units("N m")).write_bars()
    assert rows[3].split()[2] == "6.2832"
