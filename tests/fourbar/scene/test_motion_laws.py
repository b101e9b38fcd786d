"""Laws against exact polynomials, differences, a sine's energy and the books."""

import json
from math import degrees, pi, sin, sqrt, tau

import numpy as np
from numpy.testing import assert_allclose
from pytest import approx, mark, raises

import fourbar
from fourbar import Gravity, InputError, Scene, solve, uniform
from fourbar.files import dump, loads
from fourbar.linkage import MOVING_BARS
from fourbar.scene.motion import COMMAND_NAMES, Law, Motion, Rise, Sine
from tests.support.block import read_block
from tests.support.rows import read_rows, refused
from tests.support.scenes import UNIFORM

EXACT = 1e-13
"""Relative to the largest term: some ten roundings of a polynomial of degree 5."""
SWING = """
[lengths]
ground = "139.7 mm"
input = "50.8 mm"
coupler = "152.4 mm"
output = "76.2 mm"
[bars]
input = { mass = "0.089408 kg" }
coupler = { mass = "0.268224 kg", inertia = "5.19142188e-4 kg m^2", centre = CENTRE }
output = { mass = "0.041148 kg" }
[motion]
law = LAW
"""
CENTRE = '{ x = "76.2 mm", y = "10.2362 mm" }'
SINE = (
    '{ kind = "sine", mean = "1 rad", amplitude = "1 rad", frequency = "0.5 rad/s",'
    ' duration = "10 s" }'
)


def make_swing(law):
    return loads(SWING.replace("CENTRE", CENTRE).replace("LAW", law))


def test_a_sine_is_followed_to_all_digits():
    """The torque at 10 s is that of the energy of the bars, by differences."""
    scene = make_swing(SINE)
    assert loads(dump(scene)) == scene
    s = solve(scene)
    assert s.torque[-1] == approx(7.6736e-5, rel=1e-5)
    assert s.theta_2[100] == approx(1.0 + sin(0.5 * s.time[100]))


@mark.parametrize(
    "law, at",
    [
        (Law((-0.1, 0.2, 0.5), (0.2, 0.9, 1.3), ends="rest"), (-0.1, 0.5)),
        (Law((0.0, 0.3, 0.7), (0.2, 0.9, 1.3), omega_2=(0.0, 2.0, 0.0)), (0.0, 0.7)),
        (Sine(1.0, 0.5, tau, 0.75, 0.5 * pi), (0.0, 0.5)),
    ],
)
def test_what_rests_or_turns_back_at_an_instant_has_no_speed_there(law, at):
    """Dry friction would take the sign of its rounding."""
    assert not law.at(np.array(at))[1].any()


@mark.parametrize("bar", MOVING_BARS)
@mark.parametrize("rates", [0, 1, 2])
def test_a_polynomial_comes_back_from_its_points_and_rates(rates, bar):
    """Speeds make each piece a cubic, accelerations beside them a quintic.

    Through four points alone goes one cubic.
    """
    coefficients = [1.0, 0.3, -0.2, 0.07, 0.02, -0.01][: 6 if rates == 2 else 4]
    wanted = np.polynomial.Polynomial(coefficients)
    t = np.array([0.0, 0.3, 1.1, 1.5])
    columns = {
        name: tuple(wanted.deriv(order)(t))
        for order, name in enumerate(COMMAND_NAMES[bar])
        if order <= rates
    }
    law = Law(tuple(t), **columns)
    between = np.linspace(0.0, 1.5, 50)
    for order, computed in enumerate(law.at(between)):
        assert_allclose(computed, wanted.deriv(order)(between), atol=100.0 * EXACT)
    scene = Scene(uniform(0.2, 0.3, 0.25, 0.28), Motion(law=law))
    text = dump(scene)
    assert loads(text).motion == scene.motion
    assert (f"omega_{bar} = [" in text) == (rates > 0)
    assert ("alpha" in text) == (rates > 1)


POINTS = (0.0, 0.2, 0.5, 1.0), (0.0, 1.0, 2.5, tau)
CAM = {"rise": (1.0, 0.5), "dwell": 0.2, "fall": 0.4, "rest": 0.1}
LATE = (10.0, 11.0, 12.5, 14.0), (0.3, 2.0, 4.0, 0.3 + tau)
LAWS = {
    "free": Law(*POINTS, 10, "free"),
    "rest": Law(*POINTS, 10, "rest"),
    "periodic": Law(*POINTS, 10, "periodic"),
    "periodic, from 10 s on": Law(*LATE, 8, "periodic"),
    "cycloidal": Rise("cycloidal", theta_2=-0.4, **CAM),
    "345": Rise("345", theta_4=-0.4, **CAM),
    "sine": Sine(1.0, 1.0, 0.5, 4.0 * pi, -0.5 * pi, 40),
    "345 that does not fall": Rise("345", (-1.0, 0.5), 2.0, dwell=0.3),
}


@mark.parametrize("name", LAWS)
def test_rates_are_the_slopes_of_a_law_that_passes_its_points(name):
    """Pieces join without a jump.

    Central differences miss the third derivative times step^2/6, and rounding over
    the step.
    """
    law, step = LAWS[name], 1e-5
    joints = np.array(law.time)
    inside = joints[:-1] + 0.37 * np.diff(joints)
    before, here, after = (law.at(inside + shift) for shift in (-step, 0.0, step))
    for order in (1, 2):
        slope = (after[order - 1] - before[order - 1]) / (2.0 * step)
        assert here[order] == approx(slope, rel=1e-7, abs=1e-6)
    theta, omega, alpha = law.at(joints)
    if isinstance(law, Law):
        assert theta == approx(law.angle, rel=EXACT, abs=EXACT)
    assert law.times()[[0, -1]] == approx(joints[[0, -1]], rel=EXACT)
    if name.startswith("periodic"):
        ends = [rate[[0, -1]] for rate in (omega, alpha)]
        assert np.ptp(ends, axis=1) == approx([0.0, 0.0], abs=1e-11)
    elif name != "free":
        assert omega[[0, -1]] == approx([0.0, 0.0], abs=EXACT)
    sides = np.array([law.at(joints[1:-1] + shift) for shift in (-1e-9, 1e-9)])
    assert abs(np.diff(sides, axis=0)).max(initial=0.0) < 1e-5


@mark.parametrize(
    "kind, speed, acceleration",
    [("cycloidal", 2.0, 2.0 * pi), ("345", 1.875, 10.0 / sqrt(3.0))],
)
def test_a_cam_has_the_factors_of_the_books(kind, speed, acceleration):
    """C_v = 2 and C_a = 2 pi of the cycloidal law, 1.875 and 5.7735 of 3-4-5."""
    law = LAWS[kind]
    assert law.time == approx((0.0, 0.5, 0.7, 1.1, 1.2))
    theta, _, _ = law.at(np.array(law.time))
    assert theta == approx([-0.4, 0.6, 0.6, -0.4, -0.4], abs=1e-15)
    _, omega, alpha = law.at(np.linspace(0.0, 0.5, 100_001))
    assert abs(omega).max() * 0.5 == approx(speed, rel=1e-8)
    assert abs(alpha).max() * 0.25 == approx(acceleration, rel=1e-8)


@mark.parametrize(
    "kind, stated, key",
    read_rows("""
Rise | {"kind": "harmonic", "rise": [1, 0.5], "theta_2": 0} | motion.law.kind
Rise | {"kind": "345", "rise": [1, 0], "theta_2": 0} | motion.law.rise
Rise | {"kind": "345", "rise": [1, 0.5]} | motion.law.theta_2
Rise | {"kind": "345", "rise": [1, 0.5], "theta_2": 0, "rest": 0.1} | motion.law.rest
Rise | {"kind": "345", "rise": [1, 0.5], "theta_2": 0, "dwell": -1} | motion.law.dwell
Law | {"time": [0, 1], "theta_2": [0, 1]} | motion.law
Law | {"time": [0, 1, 1, 2], "theta_2": [0, 1, 2, 3]} | motion.law.time
"""),
)
def test_a_law_that_cannot_be_names_its_key(kind, stated, key):
    with raises(InputError) as error:
        getattr(fourbar, kind)(**json.loads(stated))
    assert error.value.key.startswith(key)


TABLE = 'time = ["0 s", "1 s"], theta_2 = ["0 deg", "60 deg"], '


@mark.parametrize(
    "law, words",
    [
        *(
            (TABLE + more, words)
            for more, *words in read_rows("""
alpha_2 = ["0 rad/s^2", "1 rad/s^2"] | alpha_2 | omega_2
omega_2 = ["0 rad/s", "1 rad/s"], ends = "rest" | law.ends | left out
omega_3 = ["0 rad/s", "1 rad/s"] | omega_3 | left out beside theta_2
omega_2 = ["0 rad/s"] | omega_2 | needs 2
""")
        ),
        *(
            (SINE[2:-2].replace(old, new), words)
            for old, new, *words in read_rows("""
0.5 rad/s | 0.5 Hz | frequency | is not known
0.5 rad/s | 0 rad/s | frequency | > 0
mean = "1 rad", |  | law.mean | missing
sine | cosine | law.kind | "sine"
""")
        ),
    ],
)
def test_a_law_that_states_too_much_or_too_little_is_refused(law, words):
    with refused(*words):
        make_swing(f"{{ {law} }}")


@mark.parametrize("ends, other", [("free", "rest"), ("rest", "free")])
def test_a_table_of_angles_says_what_its_ends_assume(ends, other):
    """The change is that of the two laws on a dense grid of the end intervals."""
    times, angles = (0.0, 0.2, 0.5, 0.7, 1.0), (0.0, 0.5, 1.5, 1.9, 2.0)
    law, changed = (Law(times, angles, ends=name) for name in (ends, other))
    at_ends = np.array([*np.linspace(0.0, 0.2, 2001), *np.linspace(0.7, 1.0, 2001)])
    scene = Scene(UNIFORM, Motion(law=law), effects=(Gravity(),))
    printed = read_block(solve(scene, "error"))
    assert f'ends = "{ends}"' in printed and f'"{other}" changes' in printed
    rates = (one.at(at_ends) for one in (law, changed))
    changes = [abs(a - b).max() for a, b in zip(*rates, strict=True)]
    said = printed.partition("by up to ")[2].split()
    assert float(said[0]) == approx(degrees(changes[0]), rel=2e-3)
    assert float(said[3]) == approx(changes[2], rel=2e-3)


def test_a_table_that_leaves_no_choice_says_nothing_of_its_ends():
    times, angles = (0.0, 0.3, 0.7, 1.0), (0.0, 2.0, 4.0, 2.0 * pi)
    rates = Law((0.0, 1.0), (0.0, 1.0), omega_2=(0.0, 0.0))
    for law in (Law(times, angles, ends="periodic"), rates):
        assert "ends" not in read_block(solve(Scene(UNIFORM, Motion(law=law))))
