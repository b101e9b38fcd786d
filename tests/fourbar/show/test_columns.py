"""Columns by name: sizes, components and ratios; derived quantities by geometry and by momentum."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.errors import InputError
from fourbar.formulas.path import compute_state
from fourbar.formulas.transmission import mechanical_advantage, transmission_angle
from fourbar.quantities import DERIVED
from fourbar.show.columns import read_columns
from fourbar.show.derived import derive
from fourbar.show.tables import print_positions
from fourbar.solution import DEGREES
from tests.support.scenes import crank_rocker

MODELS = Path(__file__).parents[3] / "models"
ROUND_OFF = 1e-13
"""Relative: two formulas of a few operations each, at transmission angles above 20 deg."""
TURN = crank_rocker(
    motion=fourbar.Motion(fourbar.Sweep(0.1, 0.1 + math.tau, 24), 10.0),
    points=(fourbar.Point("P", 3, (0.1, 0.7)), fourbar.Point("J", 4, (0.05, 0.2))),
)


def columns(scene: fourbar.Scene, names: str) -> dict[str, np.ndarray]:
    read = read_columns(scene, fourbar.solve(scene), names)
    return {column.name: column.values for column in read}


def test_a_vector_is_its_size_and_a_place_two_coordinates() -> None:
    s = fourbar.solve(TURN)
    read = columns(TURN, "theta_2, torque,F12,F12_x,P,v_P,a_P_y,I13")
    assert list(read) == [
        *("theta_2", "torque", "F12", "F12_x", "P_x", "P_y"),
        *("v_P", "a_P_y", "I13_x", "I13_y"),
    ]
    assert np.array_equal(read["F12"], np.hypot(*s.F12.T))
    assert np.array_equal(read["F12_x"], s.F12[:, 0])
    assert np.array_equal(read["P_y"], s.points["P"][:, 1])
    assert np.array_equal(read["v_P"], np.hypot(*s.velocity["P"].T))
    assert np.array_equal(read["a_P_y"], s.acceleration["P"][:, 1])


def test_a_ratio_of_speeds_does_not_ask_for_a_speed() -> None:
    """At rest, with the positions alone, and at any speed it is the same."""
    moving = columns(TURN, "omega_4/omega_2,v_P/v_J,v_B_x/omega_2")
    for speed in (None, 0.0, -3.0):
        still = replace(TURN, motion=TURN.motion.replace(speed=speed))
        for name, values in columns(still, ",".join(moving)).items():
            assert values == pytest.approx(moving[name], rel=1e-12, abs=1e-13), name


def test_a_ratio_of_forces_has_a_unit_where_the_two_differ() -> None:
    torque, ratio = read_columns(TURN, fourbar.solve(TURN), "torque/F12,F12/F14")
    assert torque.label({}) == "N m/N" and ratio.label({}) == ""
    shown = torque.shown({"N m": ("N mm", 1e3)})
    assert shown == pytest.approx(1e3 * torque.values)


def test_ratios_and_centres_are_those_of_the_formulas() -> None:
    """From the pins and from the half-angle formulas."""
    for motion in (TURN.motion, TURN.motion.replace(speed=None)):
        scene = replace(TURN, motion=motion)
        s = fourbar.solve(scene)
        state = compute_state(scene.linkage, s.theta_2, s.branch)
        expected = {
            "mechanical_advantage": mechanical_advantage(state),
            "omega_4/omega_2": state.k.h4,
            "omega_3/omega_2": state.k.h3,
            "transmission": transmission_angle(state),
        }
        for name, values in expected.items():
            assert derive(s, name) == pytest.approx(values, rel=ROUND_OFF), name
        by_formula = fourbar.instant_centres(scene.linkage, s.theta_2, s.branch)
        for bars, name in {(1, 3): "I13", (2, 4): "I24"}.items():
            centre = np.stack(by_formula[bars].point, axis=-1)
            assert derive(s, name) == pytest.approx(centre, rel=1e-11), name


def test_centres_of_a_scene_and_of_its_solution_are_those_of_its_linkage() -> None:
    of_scene, of_solution = (
        fourbar.instant_centres(of) for of in (TURN, fourbar.solve(TURN))
    )
    assert np.array_equal(of_scene[1, 3].x, of_solution[1, 3].x)
    with pytest.raises(InputError, match="must be left out"):
        fourbar.instant_centres(TURN, np.array([1.0]), 1)
    with pytest.raises(InputError, match="needs theta_2 and branch"):
        fourbar.instant_centres(TURN.linkage)


def test_a_coupler_curve_of_a_scene_passes_through_its_point() -> None:
    curve = fourbar.coupler_curve(TURN, "P", steps=4000)
    path = fourbar.solve(TURN).points["P"]
    away = np.hypot(curve.x[:, None] - path[:, 0], curve.y[:, None] - path[:, 1])
    assert away.min(axis=0).max() < 1e-4
    crossed = replace(TURN, motion=TURN.motion.replace(branch=-1))
    other = fourbar.coupler_curve(fourbar.solve(crossed), "P", steps=400)
    assert set(other.branch) == {-1} and set(curve.branch) == {1}
    with pytest.raises(InputError, match="must be a point of the coupler: P"):
        fourbar.coupler_curve(TURN, "J")


def test_what_has_no_value_is_a_dash_and_no_number() -> None:
    """Bars 2 and 4 parallel: I13 at infinity; bar 4 at a dead centre: no bounded advantage."""
    half_turn = fourbar.Scene(
        fourbar.uniform(3.0, 1.0, 3.0, 1.0), fourbar.Motion(np.array([1.0, 2.0]))
    )
    assert np.isnan(derive(fourbar.solve(half_turn), "I13")).all()
    assert derive(fourbar.solve(half_turn), "omega_4/omega_2") == pytest.approx(1.0)
    assert " - " in print_positions(fourbar.solve(half_turn), None, DEGREES)


def test_shaking_follows_the_frame_of_a_table_and_csv() -> None:
    s = fourbar.solve(TURN)
    text = s.to_csv()
    assert text is not None
    header, first = (line.split(",") for line in text.splitlines()[:2])
    row = dict(zip(header, first, strict=True))
    assert float(row["shaking_force_x"]) == -(s.F12[0, 0] + s.F14[0, 0])
    assert float(row["omega_4/omega_2"]) == s.omega_4[0] / s.omega_2[0]
    assert float(row["time"]) == 0.0
    for quantity in DERIVED:
        suffix = "" if quantity.kind == "scalar" else "_x"
        assert f"{quantity.name}{suffix}" in row


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("tork", 'did you mean "torque"'),
        ("F12_z", "F12_x is a component"),
        ("torque_x", "unknown"),
        ("P/F12", "is a place: P_x or P_y"),
        ("drive_force", "unknown"),
    ],
)
def test_an_unknown_column_is_refused_with_those_there_are(
    name: str, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        columns(TURN, name)


def test_a_column_that_needs_a_speed_says_so() -> None:
    still = replace(TURN, motion=TURN.motion.replace(speed=None))
    for name in ("shaking_moment", "time"):
        with pytest.raises(InputError, match=r"no speed|no one speed"):
            columns(still, name)


def test_a_steady_command_of_another_bar_or_a_stroke_has_a_time() -> None:
    rocker = replace(
        TURN, motion=fourbar.Motion(theta_4=fourbar.Sweep(2.0, 1.7, 3), omega_4=-2.0)
    )
    assert columns(rocker, "time")["time"] == pytest.approx([0.0, 0.05, 0.1, 0.15])
    growing = fourbar.Motion(fourbar.Sweep(0.0, 1.0, 3), 1.0, 0.5)
    with pytest.raises(InputError, match="no one speed"):
        columns(replace(TURN, motion=growing), "time")
    cylinder = fourbar.load(MODELS / "capabilities" / "stroke_input.toml")
    steady = replace(cylinder, motion=cylinder.motion.replace(acceleration=0.0))
    with pytest.raises(InputError, match="no one speed"):
        columns(cylinder, "time")
    time = columns(steady, "time")["time"]
    stroke = fourbar.solve(cylinder).stroke
    passed = np.abs(stroke - stroke[0]) / abs(cylinder.motion.speed)
    assert time == pytest.approx(passed, rel=1e-9, abs=1e-9)
