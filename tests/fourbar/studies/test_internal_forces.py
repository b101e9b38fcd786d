"""Internal forces.

Beams of the textbook, equilibrium at the far end, and V as the slope of M.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pytest import approx, raises

import fourbar
from fourbar import (
    Bar,
    Gravity,
    Load,
    Motion,
    Scene,
    Spring,
    Sweep,
    internal_forces,
    solve,
)
from fourbar.effects import Place
from fourbar.errors import InputError
from tests.oracle.oracles import judge_by
from tests.support.scenes import ON_COUPLER, crank_rocker

ROUNDED = 1e-12
"""Relative to the sum of the terms: some tens of roundings and a division by sin mu,
which is above 0.6 here.
"""
BARE = fourbar.FourBar(0.3, Bar(0.1), Bar(0.25), Bar(0.22))
AT = Motion(1.0, 0.0)


def solved(scene, bar, stations=None):
    return internal_forces(scene, solve(scene), bar, stations)


def test_a_force_across_the_coupler_bends_it_as_a_beam_on_two_supports():
    """P a b/L under a load P at a from one end.

    Sagging to the right of the bar, which is clockwise before it.
    """
    load = Load(
        3, (8.0, math.radians(-90.0)), from_centre=(0.05, math.pi), frame="bar"
    )  # 75 mm from A
    internal = solved(Scene(BARE, AT, loads=(load,)), 3, [0.0, 0.03, 0.08, 0.1, 0.25])
    M = 8.0 * np.array([0.0, 0.03 * 0.175, 0.075 * 0.17, 0.075 * 0.15, 0.0]) / 0.25
    assert_allclose(internal.M[0], M, atol=1e-14)
    assert_allclose(internal.V[0], [5.6, 5.6, -2.4, -2.4, 0.0], atol=1e-13)
    assert internal.largest.moment[0] == approx(8.0 * 0.075 * 0.175 / 0.25)
    assert internal.uniform
    assert internal.largest.x[0] == approx(0.075)


@pytest.mark.parametrize(
    "bar, load, foot",
    [
        (4, {}, 0.0),
        (3, {}, 0.125),
        (4, {"from_pin": (0.22, 0.0)}, 0.22),
        (3, {"from_pin": (0.25, 0.0)}, 0.25),
        (3, {"from_centre": (0.05, math.pi)}, 0.075),
        (4, {"point": "P"}, 0.05),
        (4, {"force": (0.0, 0.0), "from_pin": (0.05, 0.0)}, 0.05),
        (4, {"force": (0.0, 0.0)}, 0.11),
    ],
    ids=str,
)
def test_a_couple_bends_its_bar_from_its_place_on(bar, load, foot):
    """M(x) = T x/L before the place and T (x/L - 1) behind it, on two supports.

    Without a place the couple enters the output at O4 and the coupler at G.
    """
    couple = Load(bar, moment=3.0, **load)
    point = fourbar.Point("P", 4, from_pin=(0.05, 0.0))
    scene = Scene(BARE, AT, loads=(couple,), points=(point,))
    x = np.array([0.01, 0.06, 0.12, 0.2])
    internal = solved(scene, bar, x)
    length = BARE.bar(bar).length
    M = 3.0 * (x / length - (x > foot))
    assert_allclose(internal.M[0], M, atol=3.0 * ROUNDED)
    largest = 3.0 * max(foot, length - foot) / length
    assert abs(internal.largest.moment[0]) == approx(largest, rel=ROUNDED)
    assert internal.largest.x[0] == approx(foot, abs=ROUNDED)
    elsewhere = replace(scene, loads=(Load(bar, moment=3.0),))
    assert solve(elsewhere).torque[0] == solve(scene).torque[0]


def test_a_bar_that_hangs_in_its_pins_bends_by_its_own_weight():
    """w L^2/8 in the middle of a uniform bar on two pins.

    w is its weight per metre across the bar.
    """
    linkage = replace(BARE, coupler=Bar(0.25, 2.0))
    scene = Scene(linkage, AT, effects=(Gravity(9.81),))
    internal, theta = solved(scene, 3), solve(scene).theta_3[0]
    w = 2.0 / 0.25 * 9.81 * math.cos(theta)
    assert internal.uniform and internal.x[20] == approx(0.125)
    assert (
        internal.M[0, 20]
        == approx(w * 0.25**2 / 8.0)
        == approx(internal.largest.moment[0])
    )
    assert internal.largest.x[0] == approx(0.125)
    at_G = replace(linkage, coupler=Bar(0.25, 2.0, centre=(0.125, 0.0)))
    concentrated = solved(replace(scene, linkage=at_G), 3)
    assert not concentrated.uniform
    assert concentrated.M[0, 20] == approx(w * 0.25**2 / 4.0)


def test_a_crank_that_turns_is_pulled_by_its_own_mass():
    """N = m omega^2 (L^2 - x^2)/(2 L), and nothing bends it where nothing else acts."""
    scene = Scene(replace(BARE, input=Bar(0.1, 3.0)), Motion(1.0, 20.0))
    internal = solved(scene, 2, np.linspace(0.0, 0.099, 5))
    expected = 3.0 * 20.0**2 * (0.1**2 - internal.x**2) / (2.0 * 0.1)
    assert_allclose(internal.N[0], expected, rtol=ROUNDED)
    assert np.abs(internal.M).max() < 1e-13


def test_a_bar_that_speeds_up_bends_by_its_inertia():
    """The torque of the drive at O2 is the moment there.

    M L^2 alpha/3, and V falls to nothing at A.
    """
    scene = Scene(replace(BARE, input=Bar(0.1, 3.0)), Motion(1.0, 0.0, 50.0))
    internal = solved(scene, 2, [0.0, 0.05, 0.1])
    torque = solve(scene).torque[0]
    assert torque == approx(3.0 * 0.1**2 * 50.0 / 3.0)
    assert internal.M[0, 0] == approx(-torque)
    m, x = 3.0 * 50.0 / 0.1, 0.05
    assert internal.V[0, 1] == approx(m * (0.1**2 - x**2) / 2.0)
    assert internal.M[0, 1] == approx(
        -m * (0.1**3 / 3.0 - 0.1**2 * x / 2.0 + x**3 / 6.0)
    )


EVERYTHING = (
    Gravity(),
    fourbar.Viscous.at(O2=0.01, A=0.02, B=0.01, O4=0.03),
    fourbar.PinFriction.at(A=(0.2, 0.01)),
    fourbar.Torsion.at(B=(0.3, 0.2, 0.1)),
    fourbar.Flywheel(0.02, 2),
    fourbar.Springs((
        Spring(Place(1, (0.1, -0.5)), Place(4, (0.3, 0.2)), 20.0, 0.1),
        Spring(Place(2, (0.05, 0.3)), Place(3, (0.1, 0.1)), 30.0, 0.05),
    )),
)  # fmt: skip


@pytest.mark.parametrize(
    "drive",
    [{"drive_bar": 2}, {"drive_bar": 3}, {"drive_bar": 4}, {"drive": ON_COUPLER}],
    ids=str,
)
def test_each_part_of_a_bar_up_to_a_cut_is_in_balance_under_all_that_acts(drive):
    """As a run judges it, which asks free bodies for the forces.

    Where friction jams there are none.
    """
    motion = Motion(Sweep(0.1, 6.0, 60), 8.0, 5.0)
    couples = (
        Load(2, moment=0.4),
        Load(3, moment=-0.7, from_pin=(0.12, 0.6)),
        Load(4, moment=0.5, from_centre=(0.03, 2.0)),
    )
    scene = crank_rocker(motion=motion, loads=couples, effects=EVERYTHING, **drive)
    rows = judge_by(scene, "internal_forces")
    assert {row.quantity for row in rows} == {
        f"{part}{bar}" for part in "NVM" for bar in (2, 3, 4)
    }
    assert all(row.compared and not row.failed and row.error <= ROUNDED for row in rows)


def test_what_cannot_be_is_refused_and_what_has_no_forces_is_nan():
    scene = crank_rocker(motion=Motion(np.radians([30.0, 60.0])))
    with raises(InputError, match="solve up to the stage 'force'"):
        internal_forces(scene, solve(scene), 2)
    moving = crank_rocker()
    for bar in (1, 5, "3"):
        with raises(InputError, match="bar"):
            internal_forces(moving, solve(moving), bar)
    with raises(InputError, match="stations"):
        internal_forces(moving, solve(moving), 2, [math.inf])
    open_ = crank_rocker(motion=Motion(theta_4=np.array([0.2, 2.0]), omega_4=1.0))
    internal = internal_forces(open_, solve(open_), 3)
    assert np.isnan(internal.M[0]).all() and np.isfinite(internal.M[1]).all()
    assert np.isnan(internal.largest.moment[0])
    assert np.isfinite(internal.largest.moment[1])


def test_feet_that_differ_by_rounding_are_one():
    """A load and the inertia act at G, each by its own roundings.

    Between them no part of both bends the bar.
    """
    bar = Bar(0.25, 0.7, 1e-4, (0.13, 0.3))
    linkage = replace(crank_rocker().linkage, coupler=bar)
    load = Load(3, (3.0, 0.7), moment=20.0)
    sweep = Motion(Sweep(0.0, math.tau, 200), 10.0)
    scene = replace(
        crank_rocker(motion=sweep, effects=()), linkage=linkage, loads=(load,)
    )
    s = solve(scene)
    largest = internal_forces(scene, s, 3).largest
    G, far = bar.to_centre.real, 1e-6 * bar.length
    beside = np.abs(
        internal_forces(scene, s, 3, np.array([0.0, G - far, G + far, bar.length])).M
    ).max(axis=1)
    assert np.abs(largest.moment) == approx(beside, rel=1e-4)


def test_beyond_its_second_pin_a_uniform_bar_bends_as_a_cantilever():
    """The mass of a uniform bar ends at its pin.

    Beyond, P (a - x) of the load alone, and nothing beyond the load.
    """
    linkage = replace(BARE, output=Bar(0.22, 0.4))
    load = Load(4, (8.0, math.radians(-90.0)), from_pin=(0.3, 0.0), frame="bar")
    scene = Scene(
        linkage,
        Motion(1.1, 12.0, 30.0),
        loads=(load,),
        effects=(Gravity(9.81),),
    )
    x = np.array([0.2200001, 0.25, 0.29, 0.31, 0.4])
    internal = solved(scene, 4, x)
    assert internal.uniform
    arms = np.maximum(0.3 - x, 0.0)
    assert_allclose(np.abs(internal.M[0]), 8.0 * arms, atol=1e-13)
    assert_allclose(np.abs(internal.V[0]), 8.0 * (arms > 0.0), atol=1e-12)
    assert_allclose(internal.N[0], 0.0, atol=1e-12)
