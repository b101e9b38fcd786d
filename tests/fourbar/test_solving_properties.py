"""Invariants of the mechanics: balances, and how forces scale, over whole scenes.

Scenes that are mirrored, turned or read from the other end are judged with the check of
a run that states them so.
"""

import numpy as np
import pytest

import fourbar
from fourbar import Gravity, Load, solve
from fourbar_validation.run.identities import check_identities
from fourbar_validation.run.judge import make_question
from fourbar_validation.scenes.random import DrawnType, draw_random_scene
from tests.support.scenes import CYLINDER, ON_COUPLER, crank_rocker

LEAST_CONDITION = 0.2
"""Positions nearer to a dead centre of the drive lose digits, and are left out."""
ROUND_OFF = 100.0 * 2.0**-52 / LEAST_CONDITION**3
"""Two evaluations of fifty roundings each, divided by the motion condition squared and
the drive condition: 2.8e-12.
"""
FORCES = ("F12", "F32", "F43", "F14")
LOADS = (
    Load(2, (1.0, 2.0), from_pin=(0.04, -0.6)),
    Load(3, (2.0, -1.4), from_centre=(0.1, 0.3), frame="bar", moment=-0.2),
    Load(4, (3.0, 0.7), arm=(0.05, 1.0)),
)
DAMPED = (Gravity(9.81, -1.2), fourbar.Viscous.at(O2=0.1, A=0.2, B=0.3))
SCENES = {
    **{
        f"drive on bar {bar}": crank_rocker(loads=LOADS, effects=DAMPED, drive_bar=bar)
        for bar in (2, 3, 4)
    },
    "cylinder on the input": crank_rocker(loads=LOADS, drive=CYLINDER),
    "cylinder on the coupler": crank_rocker(loads=LOADS, drive=ON_COUPLER),
    "cylinder against friction": crank_rocker(
        drive=ON_COUPLER, effects=(fourbar.PinFriction.at(A=(0.15, 5e-3)),)
    ),
    **{
        f"random {number}": draw_random_scene(68, number, tuple(DrawnType))
        for number in range(8)
    },
}


@pytest.mark.parametrize("name", SCENES)
def test_loop_forces_moments_and_power_balance(name):
    rows = [*check_identities(make_question(name, SCENES[name], ()))]
    assert {"closure", "power"} <= {row.quantity for row in rows}
    assert not [row for row in rows if row.failed]


def in_units(
    length=1.0,
    mass=1.0,
    time=1.0,
    *,
    speed=9.0,
    acceleration=30.0,
    branch=1,
    bare=False,
):
    """Make a linkage with loads, its numbers in units of so many metres, kg and s."""
    force = mass * length / time**2
    couple = force * length
    bars = (
        fourbar.Bar(x * length, m * mass, J * mass * length**2, (s * length, phi))
        for x, m, J, s, phi in (
            (0.1, 0.2, 1e-3, 0.04, 0.3),
            (0.25, 0.5, 4e-3, 0.13, -0.2),
            (0.22, 0.4, 2e-3, 0.1, 0.0),
        )
    )
    loads = (
        Load(3, (2.0 * force, -1.4), from_pin=(0.1 * length, 0.3), frame="bar"),
        Load(4, (3.0 * force, 0.7), arm=(0.05 * length, 1.0)),
        Load(2, moment=-0.2 * couple),
    )
    weight = Gravity(9.81 * length / time**2, -1.2)
    motion = fourbar.Motion(
        np.linspace(0.1, 6.0, 24), speed / time, acceleration / time**2, branch=branch
    )
    linkage = fourbar.FourBar(0.3 * length, *bars, 0.2)
    acts = {} if bare else {"loads": loads, "effects": (weight,)}
    return fourbar.Scene(linkage, motion, 3, **acts)


L, M, T = 2.0**-7, 2.0**9, 2.0**4
"""Powers of two, which round nothing."""
SCALED = {
    "length": ({}, {"length": L}, L),
    "mass": ({}, {"mass": M}, M),
    "time": ({}, {"time": T}, T**-2),
    "time reversed": ({}, {"speed": -9.0}, 1.0),
    "three times the speed of bars alone": (
        {"bare": True, "acceleration": 0.0},
        {"speed": 27.0, "acceleration": 0.0, "bare": True},
        9.0,
    ),
}
"""Changes of two scenes, and the ratio of their forces."""


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("name", SCALED)
def test_forces_scale_with_the_units(name, branch):
    first, second, ratio = SCALED[name]
    ours = solve(in_units(branch=branch, **first))
    theirs = solve(in_units(branch=branch, **second))
    good = ours.drive_condition > LEAST_CONDITION
    assert good.sum() > 10
    lever = ratio * second.get("length", 1.0)
    for quantity, factor in (*zip(FORCES, [ratio] * 4, strict=True), ("torque", lever)):
        mine, other = (getattr(s, quantity)[good] for s in (ours, theirs))
        size = ROUND_OFF * np.abs(mine).max()
        assert np.abs(mine - other / factor).max() <= size, quantity
