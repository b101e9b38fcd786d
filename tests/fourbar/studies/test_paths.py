"""Extents of paths, against closed forms and a scan of directions."""

from math import acos, cos, radians, sin

import numpy as np
from pytest import approx, mark

from fourbar import solve, units
from fourbar.files import loads
from fourbar.show.block import write_paths
from fourbar.show.lines import BLOCK_WIDTH
from fourbar.studies.paths import measure_paths

DRIVE = """\
[lengths]
ground = "22.114772314 mm"
input = "4.188803 mm"
coupler = "12.010892 mm"
output = "18.925111 mm"
ground_angle = "ANGLE deg"
[motion]
theta_2 = { from = "0 deg", to = "360 deg", steps = STEPS }
[points]
P = { bar = 3, from_pin = { x = "12.08631 mm", y = "7.475779 mm" } }
"""
"""Of a Stirling engine, whose piston goes 10 mm within 0.1 mm."""


@mark.parametrize("angle, steps", [("32.31614688136", "36"), ("52.3", "360")])
def test_the_drive_of_an_engine_is_as_straight_as_it_is_said_to_be(angle, steps):
    """Whatever the ground's angle, and however coarse the steps are."""
    text = DRIVE.replace("ANGLE", angle).replace("STEPS", steps)
    (path,) = measure_paths(solve(loads(text))).values()
    assert 1e3 * path.stroke == approx(10.0, abs=1e-6)
    assert 1e3 * path.straightness == approx(0.1, abs=1e-7)


CRANK = """\
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[points]
P = { bar = 2, from_pin = ["80 mm", "0 deg"] }
[motion]
"""
RISE = 'law = { kind = "345", theta_2 = "20 deg", rise = ["80 deg", "1 s"]'


@mark.parametrize(
    "motion, ends",
    [
        ('theta_2 = { from = "20 deg", to = "100 deg", steps = 3 }', (20, 100)),
        ('theta_2 = { from = "100 deg", to = "20 deg", steps = 3 }', (20, 100)),
        (RISE + "}", None),
        (RISE + ', dwell = "2 s" }', None),
    ],
)
def test_the_arc_of_a_crank_has_its_chord_and_its_sagitta(motion, ends):
    """Over 80 deg: chord 2 r sin 40 deg, sagitta r (1 - cos 40 deg), y to 80 mm.

    A law stands still to round-off some 10 us before it comes to rest.
    """
    (path,) = measure_paths(solve(loads(CRANK + motion))).values()
    half = radians(40.0)
    assert path.stroke == approx(0.16 * sin(half), abs=1e-12)
    assert path.straightness == approx(0.08 * (1.0 - cos(half)), abs=1e-12)
    assert path.direction == approx(radians(60.0 - 90.0), abs=1e-9)
    low, high = cos(radians(100.0)), cos(radians(20.0))
    assert path.x == approx((0.08 * low, 0.08 * high), abs=1e-12)
    assert path.y == approx((0.08 * sin(radians(20.0)), 0.08))
    if ends is None:
        assert path.ends == (0.0, 1.0)
    else:
        assert np.degrees(path.ends) == approx(ends)


def test_a_turn_past_two_circuits_has_an_arc_in_each():
    """From A to O4 it is 210 mm to 390 mm, output less coupler to both."""
    motion = 'theta_2 = { from = "0 deg", to = "360 deg", steps = 7 }'
    text = CRANK.replace("100 mm", "350 mm").replace("250 mm", "90 mm")
    solution = solve(loads(text.replace("220 mm", "300 mm") + motion))
    paths = measure_paths(solution)
    low, high = (acos((35**2 + 30**2 - e**2) / (2 * 35 * 30)) for e in (21, 39))
    half = 0.5 * (high - low)
    assert [*paths] == ["P", "P in the other circuit"]
    lines = write_paths(solution, units("mm deg"))
    assert len(lines) == 7 and max(map(len, lines)) <= BLOCK_WIDTH
    for path in paths.values():
        assert path.stroke == approx(0.16 * sin(half), abs=1e-12)
        assert path.straightness == approx(0.08 * (1.0 - cos(half)), abs=1e-12)


@mark.slow
def test_a_circle_is_as_wide_in_every_direction():
    """The polygon of the steps would be narrower by 1e-6 of it."""
    (path,) = measure_paths(solve(loads(CRANK + 'omega_2 = "1 rad/s"\n'))).values()
    extents = [path.straightness, path.stroke, np.ptp(path.x), np.ptp(path.y)]
    assert extents == approx([0.16] * 4, rel=1e-8)


def test_paths_are_printed_and_none_of_single_positions():
    motion = 'theta_2 = { from = "20 deg", to = "100 deg", steps = 3 }'
    (first, *more) = write_paths(solve(loads(CRANK + motion)), units("mm deg"))
    assert (
        first
        == "path of P: x from -13.8919 to 75.1754 mm, y from 27.3616 to 80.0000 mm"
    )
    assert more == [
        "    straightness 18.7164 mm, stroke 102.846 mm along -30 deg,",
        "    from theta_2 = 20 to 100 deg",
    ]
    assert measure_paths(solve(loads(CRANK + 'theta_2 = ["20 deg", "100 deg"]'))) == {}


def test_the_rounding_of_a_path_is_printed_as_zero():
    """The crank begins upright: its end has an x of 5e-18 m there."""
    motion = 'theta_2 = { from = "90 deg", to = "100 deg", steps = 3 }'
    first, *_ = write_paths(solve(loads(CRANK + motion)), units("mm deg"))
    assert first.startswith("path of P: x from -13.8919 to 0.00000 mm, ")


def test_a_direction_that_is_rounding_is_printed_as_zero():
    """Chebyshev's lambda is symmetric about 180 deg, where its path is level."""
    scene = loads(
        '[lengths]\nground = "2 m"\ninput = "1 m"\n'
        'coupler = "2.5 m"\noutput = "2.5 m"\n'
        '[motion]\ntheta_2 = { from = "90 deg", to = "270 deg", steps = 360 }\n'
        '[points]\nP = { bar = 3, from_pin = ["5 m", "0 deg"] }\n'
    )
    _, straight, _ = write_paths(solve(scene), units("m deg"))
    assert straight.endswith("stroke 4.00000 m along 0 deg,")
