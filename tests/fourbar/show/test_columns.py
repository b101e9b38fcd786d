"""Columns by name: sizes, components and ratios."""

from dataclasses import replace
from math import pi, remainder, tau

import numpy as np
from pytest import approx, mark

from fourbar import (
    Motion,
    Scene,
    Sine,
    Sweep,
    instant_centres,
    load,
    solve,
    uniform,
)
from fourbar.formulas.path import compute_state
from fourbar.quantities import DERIVED_QUANTITIES
from fourbar.scene import command_at
from fourbar.show.columns import choose_columns
from fourbar.show.derived import derive
from fourbar.show.tables import print_positions
from fourbar.solution import DEGREES
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, refused
from tests.support.scenes import TURN, WEIGHT, recommand


def columns(scene, names):
    read = choose_columns(solve(scene), names)
    return {column.name: column.values for column in read}


def test_a_vector_is_its_size_and_a_place_two_coordinates():
    s = solve(TURN)
    read = columns(TURN, "theta_2, torque,F12,F12_x,P,v_P,a_P_y,I13")
    names = "theta_2 torque F12 F12_x P_x P_y v_P a_P_y I13_x I13_y"
    assert list(read) == names.split()
    for name, expected in {
        "F12": np.hypot(*s.F12.T),
        "F12_x": s.F12[:, 0],
        "P_y": s.points["P"][:, 1],
        "v_P": np.hypot(*s.velocity["P"].T),
        "a_P_y": s.acceleration["P"][:, 1],
    }.items():
        assert np.array_equal(read[name], expected), name


def test_a_ratio_of_forces_has_a_unit_where_the_two_differ():
    s = solve(TURN)
    torque, ratio = choose_columns(s, "torque/F12,F12/F14")
    assert ratio.values == approx(np.hypot(*s.F12.T) / np.hypot(*s.F14.T))
    assert torque.convert({})[0] == "N m/N" and ratio.convert({})[0] == ""
    assert torque.convert({"N m": ("N mm", 1e3)})[1] == approx(1e3 * torque.values)
    at_A = TURN.linkage.input.length * np.abs(s.omega_2)
    (along,) = choose_columns(s, "F_A/F_P")
    assert along.values == approx(np.hypot(*s.velocity["P"].T) / at_A)


UNKNOWN = read_rows("""
tork | must be among torque, time, theta_2
F12_z | F12_x is a component
torque_x | must be among torque, time
P/F12 | is a place: P_x or P_y
drive_force | must be among time, theta_2
F_P/F_Q | columns = 'F_Q': must be among
F34_y | is the reaction of F43_y: minus it
""")


@mark.parametrize("name, says", UNKNOWN)
def test_an_unknown_column_is_refused_with_those_there_are(name, says):
    with refused(says):
        columns(TURN, name)


def test_a_column_that_needs_a_speed_says_so():
    still = recommand(TURN, speed=None)
    for name in ("shaking_moment", "torque", "omega_4", "a_P_y", "F12/F14"):
        with refused('"0 rad/s" gives the static torque'):
            columns(still, name)
    with refused("no one speed"):
        columns(still, "time")
    law = Motion(law=Sine(1.0, 0.5, 2.0, duration=3.0))
    for scene in (still, replace(TURN, motion=law)):
        with refused("must be among torque, time"):
            columns(scene, "tork")


def test_a_steady_command_of_another_bar_or_a_stroke_has_a_time():
    rocker = replace(TURN, motion=Motion(theta_4=Sweep(2.0, 1.7, 3), omega_4=-2.0))
    assert columns(rocker, "time")["time"] == approx([0.0, 0.05, 0.1, 0.15])
    alone = choose_columns(
        solve(rocker, at=command_at(rocker, np.array([1.9]))), "time"
    )
    assert alone[0].values == approx([0.05])
    with refused("no one speed"):
        columns(replace(TURN, motion=Motion(Sweep(0.0, 1.0, 3), 1.0, 0.5)), "time")
    cylinder = load(MODELS / "capabilities/stroke_input.toml")
    steady = recommand(cylinder, acceleration=0.0)
    with refused("no one speed"):
        columns(cylinder, "time")
    stroke = solve(cylinder).stroke
    passed = abs(stroke - stroke[0]) / abs(cylinder.motion.speed)
    assert columns(steady, "time")["time"] == approx(passed, rel=1e-9, abs=1e-9)
    pushed = load(MODELS / "capabilities/stroke_output.toml")
    assert columns(pushed, "v_B/stroke_speed")["v_B/stroke_speed"].min() > 0.0


def test_a_difference_of_angles_goes_on_from_its_first_position():
    """Over two turns bar 2 gains them on the rocker; the first is within half a turn.

    theta_4 - theta_2 is -1.4 turns of bar 2 at first where that is commanded so.
    """
    start = 2.0 * pi + 5.0
    scene = replace(TURN, motion=Motion(Sweep(start, start + 2.0 * tau, 100), 10.0))
    solution = solve(scene)
    (difference,) = columns(scene, "theta_2 - theta_4").values()
    assert -pi < difference[0] <= pi
    gained = solution.theta_2 - solution.theta_4
    assert np.ptp(difference - gained) < 1e-12
    assert abs(remainder(difference[0] - gained[0], tau)) < 1e-12
    names = ["F12-F14", "F12_x/F14-F12_y/F14"]
    assert [*columns(scene, ",".join(names))] == names


ROUND_OFF = 1e-13
"""Relative: two formulas of a few operations each, at transmission angles above 20 deg.
"""


@mark.parametrize("speed", [TURN.motion.speed, None])
def test_ratios_and_centres_are_those_of_the_formulas(speed):
    """From the pins and from the half-angle formulas."""
    scene = recommand(TURN, speed=speed)
    s = solve(scene)
    state = compute_state(scene.linkage, s.theta_2, s.branch)
    for name, values in {
        "mechanical_advantage": 1.0 / state.k.h4,
        "omega_4/omega_2": state.k.h4,
        "omega_3/omega_2": state.k.h3,
    }.items():
        assert derive(s, name) == approx(values, rel=ROUND_OFF), name
    by_formula = instant_centres(scene.linkage, s.theta_2, s.branch)
    for bars, name in {(1, 3): "I13", (2, 4): "I24"}.items():
        centre = np.stack(by_formula[bars].point, axis=-1)
        assert derive(s, name) == approx(centre, rel=1e-11), name


def test_what_has_no_value_is_a_dash_and_what_is_rounding_zero():
    """Bars 2 and 4 are parallel: I13 lies at infinity, and the weight pulls down."""
    motion = Motion(np.array([1.0, 2.0]), 0.0)
    s = solve(Scene(uniform(3.0, 1.0, 3.0, 1.0), motion, effects=WEIGHT))
    assert np.isnan(derive(s, "I13")).all()
    assert derive(s, "omega_4/omega_2") == approx(1.0)
    assert " - " in print_positions(s, None, DEGREES)
    columns = choose_columns(s, "shaking_force_x,omega_3/omega_2")
    *_, first, last = print_positions(s, None, columns=columns).splitlines()
    assert first.split() == last.split() == ["0", "0"]


def test_csv_has_every_derived_quantity():
    s = solve(TURN)
    header, first = (line.split(",") for line in s.to_csv().splitlines()[:2])
    row = dict(zip(header, first, strict=True))
    assert float(row["shaking_force_x"]) == approx(-(s.F12 + s.F14)[0, 0], rel=1e-12)
    assert float(row["omega_4/omega_2"]) == s.omega_4[0] / s.omega_2[0]
    assert float(row["time"]) == 0.0
    for quantity in DERIVED_QUANTITIES:
        suffix = "" if quantity.kind == "scalar" else "_x"
        assert f"{quantity.name}{suffix}" in row
