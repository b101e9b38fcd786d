"""Derivatives against 50-digit differences of another evaluation.

They are held against differences of the formulas too.
"""

import json
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.cli import status
from fourbar.effects import Friction, Gravity, Load, PinFriction, Table, Viscous
from fourbar.linkage import FourBar
from fourbar.scene import Scene
from fourbar.scene.motion import Free, FromLimit, Motion
from fourbar.solution import find_values
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.keys import list_entries, read_place
from fourbar_lab.slopes import judge_slopes
from fourbar_lab.tally import Tally
from tests.fourbar.studies.test_study import ANGLES, DRIVEN, LINK, LOADS, RUBBING, scene

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
OF_DIFFERENCES = 3e-9
"""Central differences of fourth order in doubles: rounding, 1e-15, over a step of 1e-5,
with what conditioning adds.
"""
LEFT_OUT = (
    "bars.coupler.inertia",
    "bars.output.inertia",
    "bars.coupler.centre.0",
    "bars.coupler.centre.1",
)
"""Of the studies' linkage: stated, they would not follow the length."""


@pytest.mark.slow
@pytest.mark.parametrize("drive", [2, 3, 4])
def test_derivatives_are_those_of_a_50_digit_reference(drive: int) -> None:
    """By what a scene leaves out too, which the reference does not move.

    As where it is stated.
    """
    effects = (Gravity(), Viscous.at(O2=0.01, A=0.02), Friction.at(B=0.05))
    for theta_2 in ANGLES[1:3]:
        case = scene(effects, drive, theta_2=float(theta_2))
        judge_slopes(case, tally := Tally(), "")
        assert len(tally.worst) > 40 and max(tally.worst.values())[0] < 1.0
        slopes = sensitivity(case)
        assert slopes.status == ["ok"] and set(slopes.keys) == {
            "motion.theta_2",
            *list_entries(case),
        }
        bars = [
            replace(bar, inertia=bar.moment_of_inertia, centre=bar.mass_centre)
            for bar in LINK.moving
        ]
        stated = sensitivity(
            replace(case, linkage=FourBar(LINK.ground, *bars, LINK.ground_angle))
        )
        for name, key in product(slopes.by, LEFT_OUT):
            np.testing.assert_array_equal(slopes.of(name, key), stated.of(name, key))
    judge_slopes(stated.scene, tally := Tally(), "")
    assert max(tally.worst.values())[0] < 1.0


@pytest.mark.parametrize(("effects", "drive"), [(DRIVEN, 4), (RUBBING, 2)])
def test_effects_that_the_reference_lacks_by_differences(
    effects: tuple[Any, ...],
    drive: int,
) -> None:
    case, points = scene(effects, drive), (fourbar.Point("P", 3, (0.1, 0.4)),)
    case = Scene(
        case.linkage,
        case.motion,
        drive,
        (*LOADS, TABLED),
        effects,
        points=points,
    )
    slopes = sensitivity(case)
    assert slopes.status == ["ok"] * len(ANGLES) and {"P", "v_P", "a_P"} <= set(
        slopes.by
    )
    start = {
        key: ANGLES if key == "motion.theta_2" else x
        for key, x in zip(slopes.keys, slopes.numbers, strict=True)
    }
    steps = {key: 1e-5 * (np.max(np.abs(x)) or 1.0) for key, x in start.items()}
    study = {}
    for row, (key, x) in enumerate(
        start.items()
    ):  # each key moves in its own four members
        moves = np.zeros(4 * len(start))
        moves[4 * row : 4 * row + 4] = steps[key] * np.array([-2, -1, 1, 2])
        study[key] = x + moves[:, None] if key == "motion.theta_2" else x + moves
    solution = fourbar.solve(
        fourbar.vary(case, {k: v for k, v in study.items() if k not in LEFT_OUT})
    )
    for name in slopes.by:
        of_all = find_values(solution, name)
        for row, key in enumerate(start):
            if key in LEFT_OUT:
                continue
            low, less, more, high = of_all[4 * row : 4 * row + 4]
            difference = (low - 8 * less + 8 * more - high) / (12 * steps[key])
            scale = (
                np.abs(slopes.value(name)).max() * 1e-5 / steps[key]
                + np.abs(difference).max()
            )
            np.testing.assert_allclose(
                slopes.of(name, key),
                difference,
                rtol=0,
                atol=OF_DIFFERENCES * scale,
                err_msg=f"{name} by {key}",
            )


def test_where_there_is_no_derivative_a_status_says_why() -> None:
    rest = sensitivity(scene((Friction.at(B=0.05),), 2, omega_2=0.0))
    assert rest.status == ["at_rest"] * len(ANGLES)
    assert np.isnan(rest.by["torque"]).all() and np.isfinite(rest.by["a_G3"]).all()
    jammed = sensitivity(scene((PinFriction.at(A=(9.0, 2.0)),), 2))
    assert (
        set(jammed.status) <= {"jammed", "several"} and np.isnan(jammed.by["F12"]).all()
    )
    apart = fourbar.Scene(
        fourbar.uniform(0.2, 0.48, 0.55, 0.2),
        fourbar.Motion(np.array([0.0, 1.2, np.pi]), 1.0),
    )
    slopes = sensitivity(apart)
    assert slopes.status == fourbar.solve(apart).status
    lost = np.array(slopes.status) != "ok"
    assert lost.any() and not lost.all()
    for name, rows in slopes.by.items():
        assert np.isnan(rows[:, lost]).all() and np.isfinite(rows[:, ~lost]).all(), name


def test_positions_alone_and_through_a_change_point() -> None:
    plain = sensitivity(
        Scene(fourbar.uniform(0.3, 0.1, 0.3, 0.1), fourbar.Motion(np.array([1.0, 2.0])))
    )
    assert "torque" not in plain.by and "bars.input.mass" not in plain.keys
    # a parallelogram: the output follows the input, and its angle feels each length by
    # itself
    np.testing.assert_allclose(plain.of("theta_4", "motion.theta_2"), 1.0, rtol=EXACT)
    np.testing.assert_allclose(
        plain.of("theta_4", "lengths.input"),
        -1 / (0.1 * np.tan([1.0, 2.0])),
        rtol=EXACT,
    )


def test_past_a_change_point_derivatives_are_of_the_same_assembly() -> None:
    """Those of the first half of the turn, of a parallelogram on the other half too."""
    theta_2 = np.array([1.0, 4.0, 5.5, 8.0])
    parallelogram = Scene(fourbar.uniform(0.3, 0.1, 0.3, 0.1), Motion(theta_2, 1.0))
    slopes = sensitivity(parallelogram)
    # with b = d, c = a: dB = da e^{i theta_2}, which turns the output alone
    np.testing.assert_allclose(
        slopes.of("theta_4", "lengths.input"),
        -1.0 / (0.1 * np.tan(theta_2)),
        rtol=EXACT,
    )
    np.testing.assert_allclose(slopes.of("theta_4", "motion.theta_2"), 1.0, rtol=EXACT)


def differ_by_a_study(nominal: Scene, key: str) -> Any:
    """Difference theta_3 of the members of a study on both sides of a number."""
    step = 1e-6
    number = read_place(nominal, list_entries(nominal)[key].place)
    beside = {key: np.array([number - step, number + step])}
    below, above = fourbar.solve(fourbar.vary(nominal, beside), "position").theta_3
    return np.angle(np.exp(1j * (above - below))) / (2.0 * step)


PARALLELOGRAM = (0.3, 0.1, 0.3, 0.1)
KITE = (0.3, 0.1, 0.1, 0.3)


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize(
    ("lengths", "command"),
    [(PARALLELOGRAM, "theta_2"), (PARALLELOGRAM, "theta_4"), (KITE, "theta_2")],
)
def test_derivatives_are_the_differences_of_a_study_at_change_points(
    lengths: tuple[float, ...],
    branch: int,
    command: str,
) -> None:
    angles = np.array([0.7, 2.4, 4.0, 5.5])
    motion = Motion(**{command: angles}, branch=branch)
    nominal = Scene(fourbar.uniform(*lengths), motion)
    of = sensitivity(nominal).of
    for key in ("lengths.ground", "lengths.input", "lengths.coupler"):
        np.testing.assert_allclose(
            of("theta_3", key),
            differ_by_a_study(nominal, key),
            rtol=1e-6,
            atol=1e-6,
        )


@pytest.mark.parametrize(
    ("motion", "word"),
    [
        ({"theta_2": FromLimit(1, 0.1)}, "limit moves"),
        ({"theta_2": 1.0, "free": Free(1.0, 2)}, "free motion"),
    ],
)
def test_what_has_no_sensitivities(motion: dict[str, Any], word: str) -> None:
    with pytest.raises(fourbar.InputError, match=word):
        sensitivity(Scene(LINK, fourbar.Motion(**motion, omega_2=1.0)))


def test_an_unknown_name_is_refused() -> None:
    slopes = sensitivity(scene())
    for quantity, key in (("torque", "lengths.inptu"), ("torqe", "lengths.input")):
        with pytest.raises(fourbar.InputError, match="is not known here"):
            slopes.of(quantity, key)


@pytest.mark.slow
def test_the_command_ranks_the_numbers_and_writes_them_all(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
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
    assert (
        document["schema"] == "fourbar-sensitivity/1"
        and document["keys"]["lengths.input"]["unit"] == "m"
    )
    slopes = sensitivity(fourbar.load(models / "crank_rocker.toml"))
    np.testing.assert_array_equal(
        document["by"]["F12"]["lengths.input"], slopes.of("F12", "lengths.input")
    )
    assert (
        status(["analyze", str(models / "crank_rocker.toml"), "--sensitivity", "--csv"])
        == 2
    )


@pytest.mark.parametrize(
    ("ground_angle", "theta_2"),
    [(0.0, np.pi), (-0.4, np.pi - 0.4), (0.3, np.pi), (0.0, -np.pi)],
)
def test_half_a_turn_from_the_ground_the_first_derivative_is_the_ratio_of_the_speeds(
    ground_angle: float,
    theta_2: float,
) -> None:
    """There the tangent of the half angle is 1e16, of whose slope no digit is left."""
    link = replace(LINK, ground_angle=ground_angle)
    slopes = sensitivity(Scene(link, Motion(theta_2, 10.0, 3.0), effects=(Gravity(),)))
    solution = slopes.solution
    np.testing.assert_allclose(
        slopes.of("theta_3", "motion.theta_2"),
        solution.omega_3 / 10.0,
        rtol=1e-13,
    )
    turned = (
        slopes.of("omega_3", "motion.theta_2") * 10.0
        + slopes.of("omega_3", "motion.omega_2") * 3.0
    )
    np.testing.assert_allclose(turned, solution.alpha_3, rtol=1e-12)
    with_ground = slopes.of("theta_3", "motion.theta_2") + slopes.of(
        "theta_3", "lengths.ground_angle"
    )
    np.testing.assert_allclose(
        with_ground,
        1.0,
        rtol=1e-13,
    )  # a linkage turned as a whole


def test_a_kite_whose_halves_meet_has_derivatives() -> None:
    """With a = d and b = c the product in Heron's factor has no slope either.

    It is a constant.
    """
    slopes = sensitivity(Scene(fourbar.uniform(0.3, 0.3, 0.2, 0.2), Motion(1.0, 10.0)))
    np.testing.assert_allclose(
        slopes.of("theta_3", "motion.theta_2"),
        slopes.solution.omega_3 / 10.0,
        rtol=1e-13,
    )


@pytest.mark.parametrize("branch", [1, -1])
def test_slopes_of_a_parallelogram_keep_its_assembly_past_the_change_points(
    branch: int,
) -> None:
    """Differences are those of a study, whose members keep it too."""
    linkage = fourbar.uniform(0.3, 0.1, 0.3, 0.1)
    motion = Motion(np.radians([40.0, 200.0, 269.0, 330.0]), 6.0, branch=branch)
    parallelogram = Scene(linkage, motion, effects=(Gravity(),))
    slopes = sensitivity(parallelogram)
    key, step = "bars.coupler.mass", 1e-3
    mass = linkage.coupler.mass
    study = fourbar.vary(parallelogram, {key: np.array([mass - step, mass + step])})
    torque = fourbar.solve(study).torque
    expected = (torque[1] - torque[0]) / (2.0 * step)
    column = list(slopes.keys).index(key)
    np.testing.assert_allclose(slopes.by["torque"][column], expected, rtol=1e-9)
