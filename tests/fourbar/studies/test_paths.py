"""Extents of paths, against closed forms and a scan of directions."""

import math
from math import cos, radians, sin

import numpy as np
import pytest
from pytest import approx
from scipy.spatial import ConvexHull

from fourbar.evaluation import free_motion
from fourbar.files import loads
from fourbar.show.paths import write_paths
from fourbar.show.units import units
from fourbar.solving import solve
from fourbar.studies.paths import measure_paths
from tests.support.shares import slow_but

LENGTHS = (22.114772314, 4.188803, 12.010892, 18.925111)
"""mm: a Stirling engine's drive, whose piston goes 10 mm within 0.1 mm."""
PISTON = complex(12.08631, 7.475779)
DRIVE = """\
[lengths]
ground = "22.114772314 mm"
input = "4.188803 mm"
coupler = "12.010892 mm"
output = "18.925111 mm"
ground_angle = "{angle} deg"
[motion]
{motion}
[points]
piston = {{ bar = 3, from_pin = {{ x = "12.08631 mm", y = "7.475779 mm" }} }}
"""
ANGLE = 32.31614688136
SCANNED = 2e-9
"""mm: the scan misses an extreme by the square of its step."""
AT_REST = 1e-5
"""s: at its ends a 3-4-5 law stands still to round-off for as long."""


def close(steps):
    """Return the convex hull of the piston's path, mm, by the cosine rule in A B O4."""
    d, a, b, c = LENGTHS
    A = a * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, steps + 1))
    to_O4 = d * np.exp(1j * radians(ANGLE)) - A
    side = np.abs(to_O4)
    at_A = np.arccos((b * b + side * side - c * c) / (2.0 * b * side))
    path = A + PISTON * to_O4 / side * np.exp(1j * at_A)
    hull = ConvexHull(np.stack([path.real, path.imag], axis=1))
    return np.asarray(path[hull.vertices])


def scan(path, directions):
    """Return width, length and direction of the narrowest strip, mm."""
    turned = path[:, None] * np.exp(-1j * directions)
    widths = np.ptp(turned.imag, axis=0)
    least = int(np.argmin(widths))
    return widths[least], np.ptp(turned.real[:, least]), directions[least]


@pytest.mark.parametrize(
    "turned, steps", slow_but({(20.0, 360)}, [(0.0, 36), (20.0, 360)])
)
@pytest.mark.slow
def test_straightness_is_the_distance_of_the_nearest_two_lines(turned, steps):
    """Whatever the ground's angle, and however coarse the steps are."""
    sweep = f'theta_2 = {{ from = "0 deg", to = "360 deg", steps = {steps} }}'
    scene = loads(DRIVE.format(angle=ANGLE + turned, motion=sweep))
    (path,) = measure_paths(solve(scene)).values()
    assert 1e3 * path.stroke == approx(10.0, abs=1e-6)
    assert 1e3 * path.straightness == approx(0.1, abs=1e-7)
    width, length, direction = scan(close(2000), np.linspace(0.0, np.pi, 181))
    path_in_full = close(200_000)
    for step in 0.02 * 0.1 ** np.arange(9):
        beside = direction + np.linspace(-step, step, 21)
        width, length, direction = scan(path_in_full, beside)
    assert 1e3 * path.straightness == approx(width, abs=SCANNED)
    assert 1e3 * path.stroke == approx(length, abs=SCANNED)
    away = path.direction - radians(turned) - direction
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


@pytest.mark.parametrize(
    "motion, ends",
    [
        ('theta_2 = { from = "20 deg", to = "100 deg", steps = 3 }', (20, 100)),
        ('theta_2 = { from = "100 deg", to = "20 deg", steps = 3 }', (20, 100)),
        ('law = { kind = "345", theta_2 = "20 deg", rise = ["80 deg", "1 s"] }', None),
    ],
)
def test_the_arc_of_a_crank_has_its_chord_and_its_sagitta(motion, ends):
    """Over 80 deg: chord 2 r sin 40 deg, sagitta r (1 - cos 40 deg), y to 80 mm."""
    (path,) = measure_paths(solve(loads(CRANK + motion))).values()
    half = radians(40.0)
    assert path.stroke == approx(0.16 * sin(half), abs=1e-12)
    assert path.straightness == approx(0.08 * (1.0 - cos(half)), abs=1e-12)
    assert path.direction == approx(radians(60.0 - 90.0), abs=1e-9)
    low, high = cos(radians(100.0)), cos(radians(20.0))
    assert path.x == approx((0.08 * low, 0.08 * high), abs=1e-12)
    assert path.y == approx((0.08 * sin(radians(20.0)), 0.08))
    if ends is None:
        assert path.ends == approx((0.0, 1.0), abs=AT_REST)
    else:
        assert np.degrees(path.ends) == approx(ends)


CUTTER = ((0.65764732, 0.1, 0.7, 1.0), 1.0, -36.87)
"""m, deg: ground, input, coupler and output of a web cutter, and its blade."""
TRAINER = ((50.0, 8.0, 33.0, 34.0), 12.0, 167.0)
"""The same of an elliptical trainer and its pedal."""


@pytest.mark.parametrize(
    "lengths, distance, angle", slow_but({TRAINER}, [CUTTER, TRAINER])
)
@pytest.mark.slow
def test_a_wide_curve_is_no_narrower_than_by_a_scan(lengths, distance, angle):
    """Of an oval the width turns slowly, and every side of it decides."""
    ground, crank, coupler, output = lengths
    bars = zip(("ground", "input", "coupler", "output"), lengths, strict=True)
    text = "".join(f'{bar} = "{length} m"\n' for bar, length in bars)
    text = f"[lengths]\n{text}[motion]\n[points]\n"
    text += f'P = {{ bar = 3, from_pin = ["{distance} m", "{angle} deg"] }}'
    (path,) = measure_paths(solve(loads(text))).values()
    A = crank * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 7201))
    side = np.abs(ground - A)
    at_A = np.arccos((coupler**2 + side**2 - output**2) / (2.0 * coupler * side))
    unit = (ground - A) / side * np.exp(1j * at_A)
    curve = A + distance * unit * np.exp(1j * radians(angle))
    width, length, _ = scan(curve, np.linspace(0.0, np.pi, 7201))
    assert path.straightness == approx(width, rel=1e-6)
    assert path.stroke == approx(length, rel=1e-3)


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


@pytest.mark.slow
def test_a_release_is_integrated_once_for_its_path(monkeypatch):
    """The crank swings as far beyond the rest of its spring as it is let go before."""
    runs = []
    begin = free_motion._Run.begin

    def count(*arguments):
        runs.append(arguments)
        begin(*arguments)

    monkeypatch.setattr(free_motion._Run, "begin", count)
    motion = 'theta_2 = "20 deg"\nomega_2 = "0 rad/s"\n'
    free = 'free = { duration = "1.5 s", steps = 15 }\n'
    spring = f'{{ stiffness = "1 N m/rad", rest = "{20.0 + math.degrees(0.5)} deg" }}'
    acts = f'[bars.input]\nmass = "1 kg"\n[effects]\ntorsion = {{ O2 = {spring} }}\n'
    solution = solve(loads(CRANK + motion + free + acts))
    (path,) = measure_paths(solution).values()
    assert len(runs) == 1
    assert path.stroke == approx(0.16 * sin(0.5), abs=1e-9)
