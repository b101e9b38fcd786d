"""A command of the coupler or the output.

The same linkage in the same motion, whichever bar is told to make it.
"""

import json
from dataclasses import replace

import numpy as np
from pytest import approx, mark, raises

import fourbar
from fourbar import (
    Bar,
    FourBar,
    Free,
    FromLimit,
    Gravity,
    Law,
    Load,
    Motion,
    Scene,
    Sweep,
    Viscous,
    command,
    dump,
    solve,
    uniform,
)
from fourbar.errors import InputError, LimitError
from fourbar.formulas.mobility import find_limit_angles, limit_positions
from fourbar.linkage import MOVING_BARS
from fourbar.mjcf import write_mjcf
from fourbar.scene import command_at
from tests.support.rows import read_rows, refused, slow_but

U = 2.0**-53
BARS = [Bar(0.1, 0.2), Bar(0.25, 0.5, 0.01, (0.12, 0.2)), Bar(0.22, 0.4)]
LOADED = Scene(
    FourBar(0.3, *BARS, 0.4),
    loads=(Load(3, (10.0, 0.3), arm=(0.05, 0.1)),),
    effects=(Gravity(9.81, -1.5),),
)
OTHERS = {2: (3, 4), 3: (2, 4), 4: (2, 3)}


def sine(solution, bar):
    """Between the two moving bars besides it."""
    first, second = (solution[f"theta_{number}"] for number in OTHERS[bar])
    return np.asarray(np.sin(second - first))


@mark.parametrize("bar", MOVING_BARS)
def test_limits_of_a_bar_are_where_its_own_sine_is_zero(bar):
    rocker = FourBar(0.5, Bar(0.4), Bar(0.3), Bar(0.25), 0.2)

    def solve_from(number, offset=0.0):
        limit = FromLimit(number, offset)
        motion = Motion(**{f"theta_{bar}": limit, f"omega_{bar}": 1.0})
        return solve(Scene(rocker, motion), "velocity")

    for number, angle in enumerate(find_limit_angles(rocker, bar), 1):
        away = [limit[bar - 2] - angle for limit in limit_positions(rocker, bar)]
        assert abs(np.sin(0.5 * np.array(away))).min() < 8 * U
        beside = [solve_from(number, offset) for offset in (1e-12, -1e-12)]
        assert sorted(s.status[0] for s in beside) == ["not_assembled", "ok"]
        (inside,) = (s for s in beside if s.status == ["ok"])
        assert 1e-8 < inside.condition[0] < 1e-4  # the root of the distance
        assert abs(sine(inside, bar)[0]) == approx(inside.condition[0], rel=1e-6)
    with raises(InputError, match=rf"motion.theta_{bar}.limit = 4"):
        solve_from(4)


def test_a_bar_without_limits_has_no_position_from_one():
    crank = Scene(uniform(0.1, 0.3, 0.25, 0.28), Motion(theta_4=FromLimit(1)))
    with refused("output of this linkage has no limit pos"):
        solve(crank)


@mark.parametrize("bar", [3, 4])
def test_a_sweep_a_law_and_what_is_left_out_follow_the_commanded_bar(bar):
    theta, omega, alpha = (f"{name}_{bar}" for name in ("theta", "omega", "alpha"))
    swept = solve(replace(LOADED, motion=Motion(**{omega: 2.0})))
    angle = swept[theta]
    assert len(swept) == 361 and np.isfinite(swept.torque).all()
    assert (swept[omega] == 2.0).all() and swept.commanded == theta
    assert (np.diff(angle) > 0.0).all()
    assert abs(np.diff(swept.theta_2)).max() < 1.0  # continuous
    table = tuple(np.linspace(angle[30], angle[200], 5).tolist())
    law = Law((0.0, 1.0, 2.0, 3.0, 4.0), steps=8, ends="rest", **{theta: table})
    assert law.bar == bar and law.angle == table
    moved = solve(replace(LOADED, motion=Motion(law=law)))
    assert np.isfinite(moved.torque).all()
    assert moved[theta][-1] == approx(table[-1], rel=4 * U)
    assert abs(moved.omega_2[0]) < 1e-12
    with refused(f"gives {theta}, {omega} and {alpha}"):
        Motion(law=law, theta_2=1.0)
    with refused("stands alone"):
        Motion(law=law, free=Free(1.0, 2))


@mark.parametrize("bar", slow_but({3}, [3, 4]))
def test_released_at_an_angle_of_another_bar_it_moves_as_at_its_own_theta_2(bar):
    free = Free(0.4, 8)
    scene = replace(LOADED, effects=(*LOADED.effects, Viscous.at(O2=0.01)), loads=())
    start = solve(replace(scene, motion=Motion(1.2, 3.0)), "velocity")
    names = f"theta_{bar}", f"omega_{bar}"
    commanded = {name: start[name][0] for name in names}
    branch = int(np.sign(sine(start, bar)[0]))
    moved = solve(replace(scene, motion=Motion(free=free, branch=branch, **commanded)))
    same = solve(replace(scene, motion=Motion(1.2, 3.0, free=free)))
    assert len(moved) == len(same) == 9
    assert moved.theta_2 == approx(same.theta_2, abs=1e-9)
    assert abs(moved.F12 - same.F12).max() < 1e-6


TWO = """
[lengths]
ground = "30 cm"
input = "10 cm"
coupler = "25 cm"
output = "22 cm"
[motion]
"""


RATES = {"stroke": 0.3, "stroke_speed": 0.1, "side": "left", "branch": -1}
STROKE = Motion(stroke_acceleration=0.2, **RATES)


@mark.parametrize(
    "motion, changes, same",
    [
        (
            Motion(1.0, 2.0, 3.0, -1),
            {"angle": 1.5, "branch": "open"},
            Motion(1.5, 2.0, 3.0, 1),
        ),
        (STROKE, {"acceleration": 0.0}, Motion(**RATES)),
        (
            Motion(law=Law((0.0, 1.0, 2.0, 3.0), theta_3=(0.0, 1.0, 1.5, 1.0))),
            {"law": None},
            Motion(theta_3=None),
        ),
        (Motion(1.0, free=Free(1.0, 2)), {"free": None}, Motion(1.0)),
    ],
    ids=str,
)
def test_a_motion_is_replaced_by_what_it_commands(motion, changes, same):
    assert motion.replace() == motion != same == motion.replace(**changes)
    with raises(TypeError, match="unexpected keyword argument 'speeds'"):
        motion.replace(speeds=1.0)


def test_a_motion_reads_by_the_name_of_what_it_commands():
    rates = STROKE.stroke, STROKE.stroke_speed, STROKE.stroke_acceleration
    assert (*rates, STROKE.theta_2) == (0.3, 0.1, 0.2, None)
    output = Motion(theta_4=1.0, omega_4=2.0, alpha_4=3.0)
    own = output.theta_4, output.omega_4, output.alpha_4, output.bar
    assert own == (1.0, 2.0, 3.0, 4)
    others = output.theta_2, output.omega_2, output.alpha_2, output.stroke
    assert others == (None, None, 0.0, None)


@mark.parametrize("bar", [2, 3, 4])
def test_angles_with_rates_of_their_own_are_the_positions_of_a_law(bar):
    five = replace(LOADED, motion=Motion(np.linspace(0.5, 1.5, 5)))
    angles = tuple(solve(five, "position")[f"theta_{bar}"])
    law = Law((0.0, 0.1, 0.3, 0.4, 0.5), **{f"theta_{bar}": angles}, steps=12)
    of_law = replace(LOADED, motion=Motion(law=law))
    names = (f"{name}_{bar}" for name in ("theta", "omega", "alpha"))
    each = dict(zip(names, law.at(law.times()), strict=True))
    of_each = replace(LOADED, motion=Motion(**each))
    expected = solve(of_law)
    assert np.array_equal(solve(of_each).torque, expected.torque)
    again = fourbar.files.loads(dump(of_each))
    assert again.motion == of_each.motion != of_law.motion
    assert hash(again.motion) == hash(of_each.motion)
    # positions keep their rates where some are asked for, and no other has any
    some = solve(of_each, at=command_at(of_each, of_each.motion.angle[8:2:-2]))
    assert np.array_equal(some.torque, expected.torque[8:2:-2])
    with refused("no other has one"):
        command_at(of_each, np.array([0.123]))


@mark.parametrize(
    "motion, said",
    read_rows("""
{"theta_2": [1, 2], "omega_2": [1]} | one for each listed position: 2
{"theta_2": [1, 2], "alpha_2": [1, 1, 1]} | one for each listed position: 2
{"theta_2": 1, "omega_2": []} | one for each listed position: 0
{"theta_2": 1, "omega_2": [1]} | one for each listed position: 0
{"theta_2": [1, 2], "omega_2": [1, 1e200]} | must be below
{"theta_2": [1, 2], "omega_2": [1, NaN]} | must be finite
{"stroke": [1, 2], "stroke_speed": [1, 1, 1], "side": "left"} | position: 2
{"stroke": 1, "stroke_speed": [1, 1], "side": "left"} | must be one number
{"side": "left"} | are of a stroke
{"stroke_speed": 1} | are of a stroke
{"stroke_acceleration": 1} | are of a stroke
{"theta_2": 1, "stroke_acceleration": 1} | beside theta_2, omega_2, alpha_2: one bar
"""),
)
def test_rates_that_belong_to_no_angle_are_refused(motion, said):
    with refused(said):
        Motion(**json.loads(motion))


@mark.parametrize(
    "lines, said",
    read_rows(r"""
theta_2 = "1 rad"\ntheta_4 = "1 rad" | motion.theta_4 = 1.0: must be left out
theta_4 = "1 rad"\nomega_2 = "1 rad/s" | motion.theta_4
theta_3 = "1 m" | motion.theta_3
theta_4 = "1 rad"\nlaw = { time = ["0 s"], theta_4 = ["0 rad"] } | motion.law
law = { time = ["0 s"], theta_2 = ["0 rad"], theta_3 = ["0 rad"] } | motion.law
"""),
)
def test_two_commands_of_motion_are_one_line(lines, said):
    with refused(said):
        fourbar.files.loads(TWO + lines.replace(r"\n", "\n"))


def test_what_takes_theta_2_alone_refuses_in_one_line():
    of_output = Motion(theta_4=Sweep(3.8, 4.2, 7), omega_4=1.0)
    scene = replace(LOADED, motion=of_output, loads=())
    words = r"^motion.theta_4: .* takes a command of theta_2 alone$"
    with raises(LimitError, match=words):
        write_mjcf(scene)
    with raises(InputError, match=r"theta_4'?: is commanded, and theta_2 is"):
        _ = command(scene).theta_2
    listed = replace(scene, motion=Motion([1.0, 2.0], [1.0, 2.0]))
    with raises(LimitError, match=r"takes one speed and acceleration$"):
        write_mjcf(listed)
