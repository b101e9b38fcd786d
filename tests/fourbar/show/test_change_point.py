"""Pin forces on a change point: balances of the whole linkage, and both sides."""

from dataclasses import replace

import numpy as np
import pytest
from pytest import approx

import fourbar
from fourbar import Bar, Free, Gravity, Motion, Scene, solve
from fourbar.effects import Place
from fourbar.scene import command_at
from fourbar.show.position import PositionSheet
from fourbar.show.units import units
from fourbar.studies.passing import find_positions
from tests.fourbar.show.test_position import SIX_DIGITS, numbers

PARALLELOGRAM = fourbar.FourBar(
    0.3,
    Bar(0.1, mass=0.1),
    Bar(0.3, mass=0.3),
    Bar(0.1, mass=0.1),
)


@pytest.mark.parametrize("theta_2, sense", ((0.0, 1.0), (np.pi, -1.0)))
def test_pin_forces_that_are_bounded_on_a_change_point_have_their_limit(theta_2, sense):
    """Weights along the line of all bars ask for no moment there.

    On the frame the bars then act with their weights less m a, and each side has the
    limit.
    """
    scene = Scene(
        PARALLELOGRAM,
        Motion(theta_2, 6.0),
        effects=(Gravity(9.81, 0.0),),
    )
    rows = PositionSheet(scene, solve(scene), units("N m")).write_pin_forces()
    assert rows[-1] == "on the change point: the limits from both sides"
    # of G2 and G4 half of the acceleration of the coupler
    mass_times_acceleration = -sense * 0.1 * 36.0 * (0.1 * 0.5 + 0.3 + 0.1 * 0.5)
    along = 0.5 * 9.81 - mass_times_acceleration
    assert numbers(rows[5]) == approx([along, 0.0, along], rel=SIX_DIGITS)
    assert numbers(rows[6]) == [0.0]
    beside = Motion(theta_2 + np.array([-1e-5, 1e-5]), 6.0)
    two = solve(replace(scene, motion=beside))
    for row, name in zip(rows[1:5], ("F12", "F32", "F43", "F14"), strict=True):
        mean = getattr(two, name).mean(axis=0)
        assert numbers(row)[:2] == approx(mean, rel=SIX_DIGITS, abs=1e-8)


def test_pin_forces_that_have_no_bound_on_a_change_point_have_no_value():
    scene = Scene(
        PARALLELOGRAM,
        Motion(0.0, 6.0),
        effects=(Gravity(9.81, -0.5 * np.pi),),
    )
    rows = PositionSheet(scene, solve(scene), units("N m")).write_pin_forces()
    assert [row.split()[-4:-1] for row in rows[1:6]] == [["-", "-", "-"]] * 5
    assert rows[-1] == "on the change point no pin force has a limit"


def ask_forces(scene, name, value):
    """Return the rows of pin forces where a named quantity has a value."""
    solution = solve(scene, at=find_positions(scene, [(name, value)]))
    assert solution.status == ["change_point"]
    return PositionSheet(scene, solution, units("N m")).write_pin_forces()


def test_a_commanded_stroke_has_the_limits_of_the_angle_that_it_commands():
    """At rest, along a cylinder at right angles to the line of all bars.

    Weights along the line ask for no force of the cylinder.
    """
    ends = Place(1, (0.2, -0.5 * np.pi)), Place(2, (0.06, 0.0))
    along = Gravity(9.81, 0.0)
    swept = fourbar.Sweep(0.19, 0.22, 6)
    motion = Motion(stroke=swept, side="right", stroke_speed=0.0)
    scene = Scene(
        PARALLELOGRAM, motion, drive=fourbar.LinearDrive(*ends), effects=(along,)
    )
    rows = ask_forces(scene, "stroke", float(np.hypot(0.2, 0.06)))
    assert rows[-1] == "on the change point: the limits from both sides"
    by_angle = Scene(PARALLELOGRAM, Motion(0.0, 0.0), effects=(along,))
    assert rows == ask_forces(by_angle, "theta_2", 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("direction", [0.0, -0.5 * np.pi])
def test_a_release_has_the_limits_of_its_own_motion(direction):
    """No torque acts: forces are bounded under any weight.

    On the frame the bars act with their weights less m a. Each arm turns about the
    same angle, so that half of it all is at each pin.
    """
    scene = Scene(
        PARALLELOGRAM,
        Motion(0.5, 6.0, free=Free(2.0, 100)),
        effects=(Gravity(9.81, direction),),
    )
    at = find_positions(scene, [("theta_2", 0.0)])
    solution = solve(scene, at=at)
    rows = ask_forces(scene, "theta_2", 0.0)
    assert rows[-1] == "on the change point: the limits from both sides"
    of_the_arms = np.array([0.1, 0.3, 0.1])
    accelerations = [getattr(solution, f"a_G{bar}")[0] for bar in (2, 3, 4)]
    lost = of_the_arms @ np.array(accelerations)
    weight = 9.81 * 0.5 * np.array([np.cos(direction), np.sin(direction)])
    shaking = numbers(rows[5])[:2]
    assert shaking == approx(weight - lost, rel=SIX_DIGITS, abs=1e-6)
    assert numbers(rows[1])[:2] == approx(
        [-0.5 * x for x in shaking], rel=SIX_DIGITS, abs=1e-6
    )


def test_the_reason_is_said_where_a_law_begins():
    law = fourbar.Rise("cycloidal", (1.0, 1.0), theta_2=0.0)
    scene = Scene(PARALLELOGRAM, Motion(law=law), effects=(Gravity(9.81, 0.0),))
    start = solve(scene, at=command_at(scene, np.array([0.0])))
    assert start.status == ["change_point"]
    rows = PositionSheet(scene, start, units("N m")).write_pin_forces()
    assert rows[-1] == (
        "on the change point pin forces have no value: the law stands still there"
    )
    assert numbers(rows[1]) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "omega, why",
    [
        (6.0, "the release begins or ends there, and has one side alone"),
        (0.0, "the release stands still there"),
    ],
)
def test_the_reason_is_said_where_a_release_begins(omega, why):
    scene = Scene(
        PARALLELOGRAM,
        Motion(0.0, omega, free=Free(1.0, 10)),
        effects=(Gravity(9.81, 0.0),),
    )
    rows = ask_forces(scene, "time", 0.0)
    assert rows[-1].endswith(f"pin forces have no value: {why}")
