"""Extents of paths, against closed forms and a scan of directions."""

import math
from math import cos, radians, sin

import numpy as np
import pytest
from pytest import approx
from scipy.spatial import ConvexHull

from fourbar.files import loads
from fourbar.show.path_rows import write_paths
from fourbar.show.shown_units import units
from fourbar.solving import solve
from fourbar.studies.paths import measure_paths
from tests.support.shares import slow_but

STIRLING = ("22.114772314 4.188803 12.010892 18.925111", complex(12.08631, 7.475779))
"""mm: lengths of an engine's drive, and its piston, which goes 10 mm within 0.1 mm."""
CUTTER = ("657.64732 100 700 1000", 1000.0 * np.exp(-1j * radians(36.87)))
TRAINER = ("50 8 33 34", 12.0 * np.exp(1j * radians(167.0)))
"""The same of a web cutter with its blade, and of an elliptical trainer's pedal."""
TWO_WAYS = ("78 12 126 147", 64.0 - 123.0j)
"""An arc that is narrow in two directions, by nearly as much."""
DRIVE = """\
[lengths]
ground = "{d} mm"
input = "{a} mm"
coupler = "{b} mm"
output = "{c} mm"
ground_angle = "{angle} deg"
[motion]
theta_2 = {{ from = "{first} deg", to = "{last} deg", steps = {steps} }}
[points]
P = {{ bar = 3, from_pin = {{ x = "{place.real} mm", y = "{place.imag} mm" }} }}
"""
SCANNED = 1e-9
"""Relative: the scan misses an extreme by the square of its step."""
LENGTH_OF_AN_OVAL = 1e-5
"""Relative: its width is flat in the direction, and its length is not."""


def find_hull(lengths, place, angle, ends, steps):
    """Return the convex hull of a coupler's path, mm, by the cosine rule in A B O4."""
    d, a, b, c = lengths
    A = a * np.exp(1j * np.linspace(*np.radians(ends), steps + 1))
    to_O4 = d * np.exp(1j * radians(angle)) - A
    side = np.abs(to_O4)
    at_A = np.arccos((b * b + side * side - c * c) / (2.0 * b * side))
    path = A + place * to_O4 / side * np.exp(1j * at_A)
    hull = ConvexHull(np.stack([path.real, path.imag], axis=1))
    return np.asarray(path[hull.vertices])


def scan(path, directions):
    """Return width, length and direction of the narrowest strip, mm."""
    turned = path[:, None] * np.exp(-1j * directions)
    widths = np.ptp(turned.imag, axis=0)
    least = int(np.argmin(widths))
    return widths[least], np.ptp(turned.real[:, least]), directions[least]


@pytest.mark.parametrize(
    "curve, angle, ends, steps",
    slow_but(
        [(STIRLING, 32.31614688136, (0, 360), 36)],
        [
            (STIRLING, 32.31614688136, (0, 360), 36),
            (STIRLING, 52.31614688136, (0, 360), 360),
            (CUTTER, 0.0, (0, 360), 36),
            (TRAINER, 0.0, (0, 360), 36),
            (TWO_WAYS, 0.0, (126, 415), 36),
        ],
    ),
)
def test_straightness_is_the_distance_of_the_nearest_two_lines(
    curve, angle, ends, steps
):
    """Whatever the ground's angle, and however coarse the steps are.

    Of an oval the width turns slowly, and every side of it decides.
    """
    named, place = curve
    d, a, b, c = lengths = [float(length) for length in named.split()]
    shown = {"d": d, "a": a, "b": b, "c": c, "angle": angle, "place": place}
    text = DRIVE.format(first=ends[0], last=ends[1], steps=steps, **shown)
    (path,) = measure_paths(solve(loads(text))).values()
    if curve is STIRLING:
        assert 1e3 * path.stroke == approx(10.0, abs=1e-6)
        assert 1e3 * path.straightness == approx(0.1, abs=1e-7)
    coarse = find_hull(lengths, place, angle, ends, 2000)
    # one of the two lines goes along a side of the hull
    _, _, direction = scan(coarse, np.angle(np.roll(coarse, -1) - coarse))
    in_full = find_hull(lengths, place, angle, ends, 200_000)
    for step in 0.02 * 0.1 ** np.arange(9):
        beside = direction + np.linspace(-step, step, 21)
        width, length, direction = scan(in_full, beside)
    assert 1e3 * path.straightness == approx(width, rel=SCANNED, abs=2e-9)
    close = SCANNED if curve is STIRLING else LENGTH_OF_AN_OVAL
    assert 1e3 * path.stroke == approx(length, rel=close)
    if curve is STIRLING:
        away = path.direction - direction
        assert math.remainder(away, math.pi) == approx(0.0, abs=1e-7)


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


@pytest.mark.parametrize(
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


@pytest.mark.slow
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
