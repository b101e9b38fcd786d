"""Bending of bars that the drive does not act on is bounded beside a pole of the
drive. The second derivation is the motion in 320-bit balls, and the moments of one bar
about its ground pin.
"""

from dataclasses import replace
from math import cos, inf, sin

import numpy as np
from pytest import approx, mark

from fourbar import internal_forces, load, solve
from fourbar.show.summary import Facts
from fourbar_validation.places import MODELS
from tests.support.balls import answer_in_balls

SCENE = load(
    MODELS.parent / "tests/counterexamples/bar_without_drive_beside_a_pole.toml"
)
"""A force on bar 3 drives it. It has no lever at two places of the turn."""
ROUNDED = 1e-13
"""Relative: some tens of roundings, and the sine of the transmission angle is above
0.3.
"""
LOCATED = 1e-9
"""Relative error of a maximum that is located to some 1e-5 of a step."""


def move(places):
    return replace(SCENE, motion=SCENE.motion.replace(angle=places))


def bend(bar, omega, alpha):
    """Largest |M| of a bar about a ground pin that its inertia alone bends.

    The force across it at its second pin gives it its whole moment,
    (I + m r^2) alpha; M is largest on one side of the foot of G.
    """
    r, phi = bar.centre
    foot = r * cos(phi)
    second = (bar.moment_of_inertia + bar.mass * r**2) * alpha / bar.length
    first = bar.mass * (alpha * foot - omega**2 * r * sin(phi)) - second
    return np.maximum(abs(first * foot), abs(second * (bar.length - foot)))


def bend_output(places):
    exact = answer_in_balls(move(places))
    return bend(SCENE.linkage.output, exact["omega_4"], exact["alpha_4"])


BENT_INPUT = bend(SCENE.linkage.input, SCENE.motion.omega_2, SCENE.motion.alpha_2)


def find_pole(low, high):
    """Place at which the force of the drive changes its sign."""
    for _ in range(6):
        places = np.linspace(low, high, 101)
        force = solve(move(places)).drive_force
        step = int(np.flatnonzero(force[:-1] * force[1:] < 0.0)[0])
        low, high = places[step : step + 2]
    return 0.5 * (low + high)


@mark.parametrize("low, high", [(1.0, 1.1), (3.7, 3.8)])
def test_the_rounding_of_a_pole_bends_no_bar_without_drive(low, high):
    distances = np.logspace(-2, -12, 11)
    places = find_pole(low, high) + np.concatenate([-distances, distances])
    solution = solve(move(places))
    assert np.hypot(*solution.F12.T).max() > 1e9 and solution.assembled.all()
    input_bar, output_bar = (
        abs(internal_forces(SCENE, solution, bar).largest.moment) for bar in (2, 4)
    )
    assert input_bar == approx(BENT_INPUT, rel=ROUNDED, abs=0.0)
    assert output_bar == approx(bend_output(places), rel=ROUNDED, abs=0.0)


@mark.slow
def test_the_largest_moments_are_those_of_balls():
    """That of the input is the same everywhere, that of the output has a maximum."""
    facts = Facts(solve(SCENE))
    assert "drive_force" in facts.motion.panels.growing
    assert facts.bending[3].peak.value == inf
    assert facts.bending[2].peak.value == approx(BENT_INPUT, rel=ROUNDED, abs=0.0)
    low, high = 0.0, 2.0 * np.pi
    for _ in range(4):
        places = np.linspace(low, high, 181)
        moments = bend_output(places)
        best = int(np.argmax(moments))
        low, high = places[best - 1], places[best + 1]
    output = facts.bending[4]
    assert output.peak.value == approx(moments[best], rel=LOCATED, abs=0.0)
    assert output.peak.place == approx(places[best], abs=1e-5)
