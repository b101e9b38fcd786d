"""Bending of bars that the drive does not act on is bounded beside a pole of the
drive. The second derivation is in 40 digits: circles that meet, their first and
second derivatives, and the moments of one bar about its ground pin.
"""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from pytest import approx

from fourbar import internal_forces, load, solve
from fourbar.show.summary import Facts
from fourbar_validation.places import MODELS

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


@pytest.fixture(autouse=True)
def many_digits():
    with mp.workdps(40):
        yield


def solve_at(places):
    return solve(replace(SCENE, motion=SCENE.motion.replace(angle=places)))


def move_output(theta_2):
    """Speed and acceleration of bar 4, where the circles about A and O4 meet."""
    d, a, b, c = (mp.mpf(length) for length in SCENE.linkage.lengths)
    omega_2 = mp.mpf(SCENE.motion.omega_2)
    alpha_2 = mp.mpf(SCENE.motion.alpha_2)
    A = a * mp.expj(theta_2)
    from_O4 = A - d * mp.expj(SCENE.linkage.ground_angle)
    diagonal = abs(from_O4)
    at_O4 = mp.acos((diagonal**2 + c**2 - b**2) / (2 * diagonal * c))
    theta_4 = mp.arg(from_O4) - at_O4
    theta_3 = mp.arg(c * mp.expj(theta_4) - from_O4)
    lever = c * mp.sin(theta_4 - theta_3)
    assert lever > 0  # the assembly is open
    omega_4 = a * omega_2 * mp.sin(theta_2 - theta_3) / lever
    omega_3 = a * omega_2 * mp.sin(theta_2 - theta_4) * c / (b * lever)
    along_bar_3 = (
        a * alpha_2 * mp.sin(theta_2 - theta_3)
        + a * omega_2**2 * mp.cos(theta_2 - theta_3)
        + b * omega_3**2
        - c * omega_4**2 * mp.cos(theta_4 - theta_3)
    )
    return omega_4, along_bar_3 / lever


def bend(bar, omega, alpha):
    """Largest |M| of a bar about a ground pin that its inertia alone bends.

    The force across it at its second pin gives it its whole moment,
    (I + m r^2) alpha; M is largest on one side of the foot of G.
    """
    m, inertia, length, r, phi = (
        mp.mpf(number)
        for number in (bar.mass, bar.moment_of_inertia, bar.length, *bar.centre)
    )
    foot = r * mp.cos(phi)
    second = (inertia + m * r**2) * alpha / length
    first = m * (alpha * foot - omega**2 * r * mp.sin(phi)) - second
    return max(abs(first * foot), abs(second * (length - foot)))


def bend_input():
    omega_2, alpha_2 = SCENE.motion.omega_2, SCENE.motion.alpha_2
    return float(bend(SCENE.linkage.input, omega_2, alpha_2))


def bend_output(theta_2):
    return float(bend(SCENE.linkage.output, *move_output(mp.mpf(theta_2))))


def find_pole(low, high):
    """Place at which the force of the drive changes its sign."""
    for _ in range(6):
        places = np.linspace(low, high, 101)
        force = solve_at(places).drive_force
        step = int(np.flatnonzero(force[:-1] * force[1:] < 0.0)[0])
        low, high = places[step : step + 2]
    return 0.5 * (low + high)


@pytest.mark.parametrize("low, high", [(1.0, 1.1), (3.7, 3.8)])
def test_the_rounding_of_a_pole_bends_no_bar_without_drive(low, high):
    distances = np.logspace(-2, -12, 11)
    places = find_pole(low, high) + np.concatenate([-distances, distances])
    solution = solve_at(places)
    assert np.hypot(*solution.F12.T).max() > 1e9 and solution.assembled.all()
    input_bar, output_bar = (
        np.abs(internal_forces(SCENE, solution, bar).largest.moment) for bar in (2, 4)
    )
    assert input_bar == approx(bend_input(), rel=ROUNDED, abs=0.0)
    expected = [bend_output(place) for place in places]
    assert output_bar == approx(expected, rel=ROUNDED, abs=0.0)


@pytest.mark.slow
def test_the_largest_moments_are_those_of_many_digits():
    """That of the input is the same everywhere, that of the output has a maximum."""
    facts = Facts(solve(SCENE))
    assert "drive_force" in facts.motion.panels.growing
    assert facts.bending[3].peak is None
    assert facts.bending[2].peak.value == approx(bend_input(), rel=ROUNDED, abs=0.0)
    low, high = 0.0, 2.0 * np.pi
    for _ in range(4):
        places = np.linspace(low, high, 181)
        moments = [bend_output(place) for place in places]
        best = int(np.argmax(moments))
        low, high = places[best - 1], places[best + 1]
    output = facts.bending[4]
    assert output.peak.value == approx(moments[best], rel=LOCATED, abs=0.0)
    assert output.peak.place == approx(places[best], abs=1e-5)
