"""Internal forces.

Beams of the textbook, equilibrium at the far end, and V as the slope of M.
"""

import json
import math
from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from pytest import approx, mark

from fourbar import (
    Bar,
    Flywheel,
    Gravity,
    Load,
    Motion,
    Point,
    Scene,
    internal_forces,
    solve,
)
from tests.support.rows import read_rows, refused
from tests.support.scenes import MASSLESS, crank_rocker

ROUNDED = 1e-12
"""Relative to the sum of the terms: some tens of roundings and a division by sin mu,
which is above 0.6 here.
"""


AT = Motion(1.0, 0.0)


def solved(scene, bar, stations=None):
    return internal_forces(scene, solve(scene), bar, stations)


@mark.parametrize(
    "bar, load, foot",
    read_rows("""
4 | {} | 0
3 | {} | 0.125
4 | {"from_pin": [0.22, 0]} | 0.22
3 | {"from_centre": [0.05, 3.141592653589793]} | 0.075
4 | {"point": "P"} | 0.05
4 | {"force": [0, 0], "from_pin": [0.05, 0]} | 0.05
4 | {"force": [0, 0]} | 0.11
"""),
)
def test_a_couple_bends_its_bar_from_its_place_on(bar, load, foot):
    """M(x) = T x/L before the place and T (x/L - 1) behind it, on two supports.

    Without a place the couple enters the output at O4 and the coupler at G.
    """
    bar, foot = int(bar), float(foot)
    load = Load(bar, moment=3.0, **json.loads(load))
    point = Point("P", 4, from_pin=(0.05, 0.0))
    x = np.array([0.01, 0.06, 0.12, 0.2])
    internal = solved(Scene(MASSLESS, AT, loads=(load,), points=(point,)), bar, x)
    length = MASSLESS.bar(bar).length
    assert_allclose(internal.M[0], 3.0 * (x / length - (x > foot)), atol=3.0 * ROUNDED)
    largest = 3.0 * max(foot, length - foot) / length
    assert abs(internal.largest.moment[0]) == approx(largest, rel=ROUNDED)
    assert internal.largest.x[0] == approx(foot, abs=ROUNDED)


@mark.parametrize("centre, eighths", [(None, 1.0), ((0.125, 0.0), 2.0)])
def test_a_bar_that_hangs_in_its_pins_bends_by_its_own_weight(centre, eighths):
    """w L^2/8 in the middle of a uniform bar on two pins, twice that of a mass at G.

    w is its weight per metre across the bar.
    """
    linkage = replace(MASSLESS, coupler=Bar(0.25, 2.0, centre=centre))
    scene = Scene(linkage, AT, effects=(Gravity(9.81),))
    internal, theta = solved(scene, 3), solve(scene).theta_3[0]
    weight = 2.0 * 9.81 * math.cos(theta)
    assert internal.uniform == (centre is None)
    assert internal.x[20] == internal.largest.x[0] == approx(0.125)
    middle = approx(eighths * weight * 0.25 / 8.0)
    assert internal.M[0, 20] == middle == internal.largest.moment[0]


@mark.parametrize("end", [0.4, -0.1])
def test_stations_reach_from_the_first_place_where_anything_acts_to_the_last(end):
    """There nothing bends the bar; 100 N across it bend it at the pin before."""
    load = Load(4, force=(100.0, math.pi / 2.0), from_pin=(end, 0.0), frame="bar")
    internal = solved(Scene(MASSLESS, AT, loads=(load,)), 4)
    assert [*internal.x[[0, -1]]] == [min(end, 0.0), max(end, 0.22)]
    assert_allclose(internal.M[0, [0, -1]], 0.0, atol=100.0 * ROUNDED)
    arm = max(end - 0.22, -end)
    assert abs(internal.largest.moment[0]) == approx(100.0 * arm, rel=ROUNDED)


def test_a_crank_that_turns_is_pulled_by_its_own_mass_and_bent_by_its_inertia():
    """N = m omega^2 (L^2 - x^2)/(2 L). Where it speeds up, the torque of the drive at
    O2, less what a flywheel takes, is the moment there, m L^2 alpha/3, and V falls to
    nothing at A.
    """
    linkage = replace(MASSLESS, input=Bar(0.1, 3.0))
    turning = Scene(linkage, Motion(1.0, 20.0))
    x = np.linspace(0.0, 0.099, 5)
    internal = solved(turning, 2, x)
    N = 3.0 * 20.0**2 * (0.1**2 - x**2) / (2.0 * 0.1)
    assert_allclose(internal.N[0], N, rtol=ROUNDED)
    assert abs(internal.M).max() < 1e-13
    starting = Scene(linkage, Motion(1.0, 0.0, 50.0), effects=(Flywheel(0.02),))
    internal = solved(starting, 2, x)
    assert internal.M[0, 0] == approx(1.0 - solve(starting).torque[0])
    m = 3.0 * 50.0 / 0.1
    M = m * (0.1**3 / 3.0 - 0.1**2 * x / 2.0 + x**3 / 6.0)
    assert_allclose(internal.V[0], m * (0.1**2 - x**2) / 2.0, rtol=1e-10)
    assert_allclose(internal.M[0], -M, atol=1e-12)


def test_what_cannot_be_is_refused_and_what_has_no_forces_is_nan():
    scene = crank_rocker(Motion(np.radians([30.0, 60.0])))
    moving = crank_rocker()
    for case, bar, stations, words in (
        (scene, 2, None, "solve up to the stage 'force'"),
        *((moving, bar, None, "bar") for bar in (1, 5, "3")),
        (moving, 2, [math.inf], "stations"),
    ):
        with refused(words):
            solved(case, bar, stations)
    rocking = Motion(theta_4=np.array([0.2, 2.0]), omega_4=1.0)
    internal = solved(crank_rocker(rocking), 3)
    for values in (internal.M, internal.largest.moment):
        assert np.isnan(values[0]).all() and np.isfinite(values[1]).all()


def test_beyond_its_second_pin_a_uniform_bar_bends_as_a_cantilever():
    """The mass of a uniform bar ends at its pin.

    Beyond, P (a - x) of the load alone, and nothing beyond the load.
    """
    linkage = replace(MASSLESS, output=Bar(0.22, 0.4))
    load = Load(4, (8.0, math.radians(-90.0)), from_pin=(0.3, 0.0), frame="bar")
    motion = Motion(1.1, 12.0, 30.0)
    scene = Scene(linkage, motion, loads=(load,), effects=(Gravity(9.81),))
    x = np.array([0.2200001, 0.25, 0.29, 0.31, 0.4])
    internal = solved(scene, 4, x)
    assert internal.uniform
    arms = np.maximum(0.3 - x, 0.0)
    assert_allclose(abs(internal.M[0]), 8.0 * arms, atol=1e-13)
    assert_allclose(abs(internal.V[0]), 8.0 * (arms > 0.0), atol=1e-12)
    assert_allclose(internal.N[0], 0.0, atol=1e-12)
