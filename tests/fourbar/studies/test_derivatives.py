"""Derivatives against the oracle, differences of studies, and cases known by hand."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pytest import raises

import fourbar
from fourbar import InputError, load, solve, uniform
from fourbar.cli import status
from fourbar.effects import Friction, Gravity, Load, PinFriction, Table
from fourbar.scene import Scene
from fourbar.scene.motion import Free, FromLimit, Motion
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.keys import list_entries, read_place
from tests.fourbar.studies.test_study import ANGLES, DRIVEN, LINK, LOADS, RUBBING, scene
from tests.oracle.oracles import judge_by
from tests.oracle.test_derived import failing

MODELS = Path(__file__).parents[3] / "models"
TABLED = Load(
    4,
    (2.0, 0.1),
    moment=0.3,
    frame="world",
    table=Table((0.0, 2.0, 6.0), (0.0, 1.0, 2.0)),
)
EXACT = 1e-10
"""Of the derivative, or of what the quantity would change by if it were proportional to
the number.
"""


@pytest.mark.parametrize("effects, drive", [(DRIVEN, 4), (RUBBING, 2)])
def test_every_effect_has_the_slopes_of_files_with_a_number_moved(effects, drive):
    case = scene(effects, drive)
    points = (fourbar.Point("P", 3, (0.1, 0.4)),)
    case = replace(case, loads=(*LOADS, TABLED), points=points)
    rows = judge_by(case, "sensitivity")
    assert {"points", "torque", "F14"} <= {row.quantity for row in rows if row.compared}
    assert not failing(rows)


def test_a_drawn_coordinate_counts_by_a_hundredth_of_the_longest_bar():
    """Others count by a hundredth of themselves, angles by a degree."""
    slopes = sensitivity(load(MODELS / "capabilities" / "drawn.toml"))
    longest = max(slopes.solution.scene.linkage.lengths)
    numbers = dict(zip(slopes.keys, slopes.numbers, strict=True))
    steps = {"pins.B.0": 0.01 * longest, "points.P.drawn.1": 0.01 * longest}
    steps |= {key: 0.01 * numbers[key] for key in ("bars.input.mass", "motion.omega_2")}
    for key, step in steps.items():
        name = "P" if key.startswith("points") else "|F12|"
        (change,) = (row.change for row in slopes.influences(name) if row.key == key)
        slope = slopes.of(name, key)
        size = np.abs(slope) if slope.ndim == 1 else np.hypot(*slope.T)
        assert abs(change) == pytest.approx(step * np.nanmax(size), rel=EXACT)


def test_where_there_is_no_derivative_a_status_says_why():
    rest = sensitivity(scene((Friction.at(B=0.05),), 2, omega_2=0.0))
    assert rest.status == ["at_rest"] * len(ANGLES)
    assert np.isnan(rest.by["torque"]).all() and np.isfinite(rest.by["a_G3"]).all()
    jammed = sensitivity(scene((PinFriction.at(A=(9.0, 2.0)),), 2))
    assert set(jammed.status) <= {"jammed", "several"}
    assert np.isnan(jammed.by["F12"]).all()
    apart = Scene(
        uniform(0.2, 0.48, 0.55, 0.2),
        Motion(np.array([0.0, 1.2, np.pi]), 1.0),
    )
    slopes = sensitivity(apart)
    assert slopes.status == solve(apart).status
    lost = np.array(slopes.status) != "ok"
    assert lost.any() and not lost.all()
    for name, rows in slopes.by.items():
        assert np.isnan(rows[:, lost]).all() and np.isfinite(rows[:, ~lost]).all(), name


def test_past_a_change_point_derivatives_are_of_the_same_assembly():
    """Those of the first half of the turn, of a parallelogram on the other half too."""
    theta_2 = np.array([1.0, 4.0, 5.5, 8.0])
    parallelogram = Scene(uniform(0.3, 0.1, 0.3, 0.1), Motion(theta_2, 1.0))
    slopes = sensitivity(parallelogram)
    # with b = d, c = a: dB = da e^{i theta_2}, which turns the output alone
    assert_allclose(
        slopes.of("theta_4", "lengths.input"),
        -1.0 / (0.1 * np.tan(theta_2)),
        rtol=EXACT,
    )
    assert_allclose(slopes.of("theta_4", "motion.theta_2"), 1.0, rtol=EXACT)
    alone = sensitivity(replace(parallelogram, motion=Motion(theta_2)))
    assert "torque" not in alone.by and "bars.input.mass" not in alone.keys


def differ_by_a_study(nominal, key):
    """Difference theta_3 of the members of a study on both sides of a number."""
    step = 1e-6
    number = read_place(nominal, list_entries(nominal)[key].place)
    beside = {key: np.array([number - step, number + step])}
    below, above = solve(fourbar.vary(nominal, beside), "position").theta_3
    return np.angle(np.exp(1j * (above - below))) / (2.0 * step)


PARALLELOGRAM = (0.3, 0.1, 0.3, 0.1)
KITE = (0.3, 0.1, 0.1, 0.3)


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize(
    "lengths, command",
    [(PARALLELOGRAM, "theta_2"), (PARALLELOGRAM, "theta_4"), (KITE, "theta_2")],
)
def test_derivatives_are_the_differences_of_a_study_at_change_points(
    lengths, branch, command
):
    angles = np.array([0.7, 2.4, 4.0, 5.5])
    motion = Motion(**{command: angles}, branch=branch)
    nominal = Scene(uniform(*lengths), motion)
    of = sensitivity(nominal).of
    for key in ("lengths.ground", "lengths.input", "lengths.coupler"):
        assert_allclose(
            of("theta_3", key), differ_by_a_study(nominal, key), rtol=1e-6, atol=1e-6
        )


@pytest.mark.parametrize(
    "motion, word",
    [
        ({"theta_2": FromLimit(1, 0.1)}, "limit moves"),
        ({"theta_2": 1.0, "free": Free(1.0, 2)}, "free motion"),
    ],
)
def test_what_has_no_sensitivities(motion, word):
    with raises(InputError, match=word):
        sensitivity(Scene(LINK, Motion(**motion, omega_2=1.0)))


def test_an_unknown_name_is_refused():
    slopes = sensitivity(scene())
    for quantity, key in (("torque", "lengths.inptu"), ("torqe", "lengths.input")):
        with raises(InputError, match="is not known here"):
            slopes.of(quantity, key)


@pytest.mark.slow
def test_the_command_ranks_the_numbers_and_writes_them_all(capsys, tmp_path):
    models, out = Path(__file__).parents[3] / "models", tmp_path / "s.json"
    assert status(["analyze", str(models / "crank_rocker.toml"), "--sensitivity"]) == 0
    text = capsys.readouterr().out
    assert "torque depends most on lengths.ground (at theta_2 = " in text
    # the torque of inertia grows with the square of the speed, that of weight and loads
    # does not
    row = next(line for line in text.splitlines() if line.startswith("bars.input.mass"))
    assert row.split()[3:] == ["0", "0", "0"]
    assert (
        status(
            [
                "analyze",
                str(models / "crank_rocker.toml"),
                "--sensitivity",
                "--json",
                "-o",
                str(out),
            ]
        )
        == 0
    )
    document = json.loads(out.read_text())
    assert document["schema"] == "fourbar-sensitivity/1"
    assert document["keys"]["lengths.input"]["unit"] == "m"
    slopes = sensitivity(load(models / "crank_rocker.toml"))
    assert_array_equal(
        document["by"]["F12"]["lengths.input"], slopes.of("F12", "lengths.input")
    )
    assert (
        status(["analyze", str(models / "crank_rocker.toml"), "--sensitivity", "--csv"])
        == 2
    )


@pytest.mark.parametrize(
    "ground_angle, theta_2",
    [(0.0, np.pi), (-0.4, np.pi - 0.4), (0.3, np.pi), (0.0, -np.pi)],
)
def test_half_a_turn_from_the_ground_the_first_derivative_is_the_ratio_of_the_speeds(
    ground_angle, theta_2
):
    """There the tangent of the half angle is 1e16, of whose slope no digit is left."""
    link = replace(LINK, ground_angle=ground_angle)
    slopes = sensitivity(Scene(link, Motion(theta_2, 10.0, 3.0), effects=(Gravity(),)))
    solution = slopes.solution
    assert_allclose(
        slopes.of("theta_3", "motion.theta_2"), solution.omega_3 / 10.0, rtol=1e-13
    )
    turned = (
        slopes.of("omega_3", "motion.theta_2") * 10.0
        + slopes.of("omega_3", "motion.omega_2") * 3.0
    )
    assert_allclose(turned, solution.alpha_3, rtol=1e-12)
    with_ground = slopes.of("theta_3", "motion.theta_2") + slopes.of(
        "theta_3", "lengths.ground_angle"
    )
    assert_allclose(with_ground, 1.0, rtol=1e-13)  # a linkage turned as a whole


def test_a_kite_whose_halves_meet_has_derivatives():
    """With a = d and b = c the product in Heron's factor is a constant."""
    slopes = sensitivity(Scene(uniform(0.3, 0.3, 0.2, 0.2), Motion(1.0, 10.0)))
    assert_allclose(
        slopes.of("theta_3", "motion.theta_2"),
        slopes.solution.omega_3 / 10.0,
        rtol=1e-13,
    )
