"""Springs that act one way, by the energy of a linkage that circles close.

The torque is the slope of the energy over the angle, and a released motion conserves
it: nothing of the formulas is used.
"""

from dataclasses import replace
from math import degrees, isnan, radians, sin, sqrt

import numpy as np
from numpy.testing import assert_allclose
from pytest import approx, mark, raises
from scipy.integrate import quad

from fourbar import (
    InputError,
    Motion,
    Place,
    Spring,
    Springs,
    equilibrium,
    sensitivity,
    solve,
)
from fourbar.files import loads
from tests.support.rows import read_rows
from tests.support.scenes import cis, crank_rocker

SLOPES = 1e-7
"""Relative: a central difference over 1e-5 rad, of positions with 16 digits."""
DOOR = """
[lengths]
ground = "60 mm"
input = "25 mm"
coupler = "70 mm"
output = "55 mm"
[bars.input]
mass = "0.02 kg"
[bars.coupler]
mass = "0.06 kg"
inertia = "35 kg mm^2"
centre = { x = "40 mm", y = "5 mm" }
[bars.output]
mass = "0.04 kg"
[motion]
MOTION
[[loads]]
bar = 3
from_pin = ["70 mm", "0 deg"]
force = ["200 mN", "-90 deg"]
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
torsion = { O2 = { stiffness = "0.05 N m/rad", rest = "20 deg" } }
[[effects.springs]]
from = { bar = 1 }
to = { bar = 3, from_pin = ["50 mm", "0 deg"] }
stiffness = "0.5 N/mm"
length = "60 mm"
ACTS
"""


def make_door(motion, acts='acts = "push"'):
    return loads(DOOR.replace("MOTION", motion).replace("ACTS", acts))


def close(theta):
    """Return A and B of the door, m, by the intersection of two circles."""
    A = 0.025 * cis(theta)
    to_O4 = 0.06 - A
    d = abs(to_O4)
    along = (0.07**2 - 0.055**2 + d * d) / (2.0 * d)
    return A, A + (along + 1j * sqrt(0.07**2 - along**2)) * to_O4 / d


def energy_of_door(theta):
    """Return weights, load, torsion spring and the spring that only pushes, J."""
    A, B = close(theta)
    line = (B - A) / 0.07
    G3 = A + (0.04 + 0.005j) * line
    lifted = 0.02 * A.imag / 2.0 + 0.06 * G3.imag + 0.04 * B.imag / 2.0
    pushed = min(abs(A + 0.05 * line) - 0.06, 0.0)
    turned = theta - radians(20.0)
    return 9.81 * lifted + 0.2 * B.imag + 0.025 * turned**2 + 250.0 * pushed**2


def inertia_of_door(theta):
    """Return the equivalent inertia at bar 2, kg m^2, by differences of positions."""
    step = 1e-5
    A, B = np.transpose([close(theta - step), close(theta + step)])
    lines = (B - A) / 0.07
    G = A + (0.04 + 0.005j) * lines
    turn = np.angle(lines[1] / lines[0]) / (2.0 * step)
    swing = np.angle((B[1] - 0.06) / (B[0] - 0.06)) / (2.0 * step)
    speed = abs(G[1] - G[0]) / (2.0 * step)
    slender = 0.02 * 0.025**2 / 3.0 + 0.04 * 0.055**2 / 3.0 * swing**2
    return slender + 0.06 * speed**2 + 35e-6 * turn**2


def test_the_door_is_held_by_what_its_energy_asks():
    """At 40 deg the spring is longer than its free length, at 120 deg shorter."""
    scene = make_door('theta_2 = ["40 deg", "100 deg", "120 deg"]\nomega_2 = "0 rad/s"')
    s = solve(scene)
    step = 1e-5
    ahead, behind = ([*map(energy_of_door, s.theta_2 + h)] for h in (step, -step))
    assert_allclose(s.torque, np.subtract(ahead, behind) / (2.0 * step), rtol=SLOPES)
    fastened = solve(make_door('theta_2 = "40 deg"\nomega_2 = "0 rad/s"', ""))
    assert s.torque[0] - fastened.torque[0] == approx(0.0265373, abs=6e-8)


@mark.slow
def test_no_equilibrium_is_found_where_the_spring_would_have_to_pull():
    sweep = 'theta_2 = { from = "40 deg", to = "150 deg", steps = 11 }'
    found = equilibrium(make_door(sweep, "")).found
    assert [degrees(one.place.theta_2) for one in found] == approx([80.88], abs=5e-3)
    assert equilibrium(make_door(sweep)).found == ()


@mark.slow
def test_a_released_door_arrives_as_its_energy_says():
    """t = integral of d theta/omega, omega^2 = 2 (U(start) - U)/J."""
    motion = 'theta_2 = "150 deg"\nfree = { duration = "0.04 s", steps = 4000 }'
    s = solve(make_door(motion))
    row = int(np.argmax(s.theta_2 <= radians(40.0)))
    start = radians(150.0)

    def speed(theta):
        lost = energy_of_door(start) - energy_of_door(theta)
        return sqrt(2.0 * lost / inertia_of_door(theta))

    end = float(s.theta_2[row])
    # with theta = start - x^2 the integrand has a value where the door is let go
    time, _ = quad(lambda x: 2.0 * x / speed(start - x * x), 1e-6, sqrt(start - end))
    assert s.omega_2[row] == approx(-speed(end), rel=1e-6)
    assert s.time[row] == approx(time, rel=1e-4)
    assert (time, speed(end)) == approx((31.83e-3, 139.4), rel=1e-3)


ENDS = Place(1, (0.1, 0.5)), Place(2, (0.1, 0.0))
"""They meet at 0.7 rad: the ground lies at 0.2 rad."""


def test_where_its_ends_meet_a_spring_that_only_pulls_is_off():
    spring = Spring(*ENDS, 200.0, 0.05, acts="pull")
    scene = crank_rocker(Motion([0.7, 0.9], 8.0), effects=(Springs((spring,)),))
    s = solve(scene)
    assert s.status == ["ok", "ok"]
    assert s.torque[0] == solve(replace(scene, effects=())).torque[0]


def test_a_sensitivity_is_null_where_a_spring_comes_off_and_nowhere_else():
    """The distance of the ends is 2 r sin(half the angle between them)."""
    scene = crank_rocker(
        Motion([1.4, 1.7, 2.0], 0.0),
        effects=(Springs((Spring(*ENDS, 200.0, 0.2 * sin(0.5), acts="pull"),)),),
    )
    slopes = sensitivity(scene)
    assert slopes.status == ["ok", "at_free_length", "ok"]
    by_length = slopes.of("torque", "effects.springs.0.length")
    assert by_length[0] == 0.0 and isnan(by_length[1]) and by_length[2] != 0.0


@mark.parametrize(
    "numbers, acts, words",
    read_rows("""
200 0.05 0 | both | "push" or "pull"
0 0.05 -3 | push | constant
200 0.05 10 | push | 10 N
200 0 0 | pull | 0 N
"""),
)
def test_a_spring_that_never_comes_off_is_refused(numbers, acts, words):
    """Stiffness, length and preload."""
    with raises(InputError, match=rf"springs\.acts .*{words}"):
        Spring(*ENDS, *map(float, numbers.split()), acts=acts)
