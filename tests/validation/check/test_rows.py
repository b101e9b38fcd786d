"""Tables whose rows are found by another angle than theta_2.

The second derivation of a position is the intersection of two circles.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

import fourbar
from fourbar.errors import BAD_INPUT, FAILED, HOLDS, InputError, LimitError
from fourbar.files import loads
from fourbar.scene import Command, Scene
from fourbar_validation.check.check import judge_table
from fourbar_validation.check.rows import find_row_commands
from fourbar_validation.check.theirs import read_table
from fourbar_validation.cli import status
from tests.support.scenes import crank_rocker

ROCKER = {4: "theta_4", 2: "theta_2", 3: "theta_3"}
SAME_PLACE = 1e-9
"""rad: a position by two circles and one by the formulas, 0.1 rad off a limit."""


def find_crank(scene, theta_4, side):
    """Return theta_2 at which the output has these angles, by two circles.

    A lies at the distances of input and coupler from O2 and B. `side`: +1 if A lies to
    the left of the line from O2 to B, -1 to the right.
    """
    d, a, b, c = scene.linkage.lengths
    B = d * np.exp(1j * scene.linkage.ground_angle) + c * np.exp(1j * theta_4)
    away = np.abs(B)
    along = (a * a - b * b + away * away) / (2.0 * away)
    across = side * np.sqrt(a * a - along * along)
    return np.angle((along + 1j * across) * B / away)


def write_table(path, angle, angles, torque, form="{:.12g}"):
    """Write angles in deg with torques in N m."""
    rows = [f"{angle} [deg],torque"]
    for place, number in zip(np.degrees(angles), torque, strict=True):
        rows.append(f"{form.format(place)},{float(number)!r}")
    path.write_text("\n".join(rows) + "\n")
    return path


def judged(scene, path):
    return judge_table(scene, read_table(path, scene.motion.commanded))


def commanding(bar, first, last, steps=8):
    """A crank-rocker whose bar `bar` is commanded and driven over a range in deg."""
    start, stop = math.radians(first), math.radians(last)
    motion = fourbar.Motion(
        **{
            f"theta_{bar}": fourbar.Sweep(start, stop, steps),
            f"omega_{bar}": 2.0,
            f"alpha_{bar}": -1.0,
        }
    )
    return replace(crank_rocker(motion=motion), drive_bar=bar)


@pytest.mark.parametrize(("bar", "ends"), [(4, (115.0, 155.0)), (3, (40.0, 75.0))])
@pytest.mark.parametrize("same", [True, False])
def test_a_table_of_the_commanded_bar_is_judged(bar, ends, same, tmp_path):
    scene = commanding(bar, *ends)
    angles = np.radians(np.linspace(*ends, 9 if same else 6))
    solution = fourbar.solve(replace(scene, motion=scene.motion.replace(angle=angles)))
    assert set(solution.status) == {"ok"}
    path = tmp_path / "theirs.csv"
    name = f"theta_{bar}"
    good = judged(scene, write_table(path, name, angles, solution.torque))
    assert good.status == HOLDS and good.compared == len(angles)
    bad = judged(scene, write_table(path, name, angles, -solution.torque))
    assert bad.status == FAILED
    assert bad.explanations[0].text.startswith("sign reversed")
    fast = scene.motion.replace(
        angle=angles, speed=2.0 * 30.0 / math.pi, acceleration=-1.0
    )
    torque = fourbar.solve(replace(scene, motion=fast)).torque
    slip = judged(scene, write_table(path, name, angles, torque))
    assert f"omega_{bar} in rev/min taken for rad/s" in [
        explanation.text for explanation in slip.explanations
    ]


def test_a_mistake_in_the_velocity_terms_of_a_driven_rocker_is_named(tmp_path):
    """The other bars' accelerations follow that of the output alone."""
    scene = commanding(4, 115.0, 155.0)
    right = fourbar.solve(scene)
    path = tmp_path / "theirs.csv"
    rows = ["theta_4,alpha_2,alpha_3"]
    for place, w2, w3 in zip(right.theta_4, right.omega_2, right.omega_3, strict=True):
        rows.append(f"{float(place)!r},{-float(w2) / 2.0!r},{-float(w3) / 2.0!r}")
    path.write_text("\n".join(rows) + "\n")
    (first, *_) = judged(scene, path).explanations
    assert first.complete and "(dJ/dt) v is missing" in first.text


def test_the_scenes_own_positions_may_be_listed_by_another_bar(tmp_path):
    """The angles of the output are printed to a hundredth of a degree, twice a turn."""
    scene = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.0, 6.0, 24), 10.0))
    right = fourbar.solve(scene)
    path = tmp_path / "theirs.csv"
    write_table(path, "theta_4", right.theta_4, right.torque, "{:.2f}")
    assert judged(scene, path).status == HOLDS
    wrong = np.array(right.torque)
    wrong[7] *= 1.0 + 1e-9
    write_table(path, "theta_4", right.theta_4, wrong, "{:.2f}")
    assert [finding.line for finding in judged(scene, path).differing] == [9]


@pytest.mark.parametrize(
    ("ends", "side"), [((60.0, 220.0), 1.0), ((245.0, 395.0), -1.0)]
)
def test_an_angle_of_the_output_is_a_position_of_a_crank(ends, side, tmp_path):
    """It is passed twice a turn, and once within the range of the scene."""
    scene = commanding(2, *ends)
    limits = np.sort(fourbar.solve(scene, "position").theta_4[[0, -1]])
    theta_4 = np.radians(np.arange(*np.ceil(np.degrees(limits)), 5.0))
    assert len(theta_4) > 3
    path = write_table(tmp_path / "theirs.csv", "theta_4", theta_4, theta_4, "{:.0f}")
    rows = find_row_commands(scene, read_table(path))
    by_circles = find_crank(scene, theta_4, side)
    apart = np.angle(np.exp(1j * (rows.at.angle - by_circles)))
    np.testing.assert_allclose(apart, 0.0, atol=SAME_PLACE)
    turned = math.radians(ends[0]) - 0.1, math.radians(ends[1]) + 0.1
    assert ((rows.at.angle > turned[0]) & (rows.at.angle < turned[1])).all()
    at = Command(
        rows.at.angle,
        np.ones(len(theta_4), np.int8),
        2.0,
        -1.0,
    )
    torque = fourbar.solve(scene, at=at).torque
    write_table(path, "theta_4", theta_4, torque, "{:.0f}")
    assert judged(scene, path).status == HOLDS


def test_the_rounding_of_another_bars_angle_is_allowed_for(tmp_path):
    """Six decimals are a rounded number; what half a unit changes is allowed."""
    scene = commanding(2, 60.0, 220.0)
    at = Command(
        np.array([1.2, 1.7, 2.4]),
        np.ones(3, np.int8),
        2.0,
        -1.0,
    )
    right = fourbar.solve(scene, at=at)
    path = tmp_path / "theirs.csv"
    write_table(path, "theta_4", right.theta_4, right.torque, "{:.6f}")
    assert judged(scene, path).status == HOLDS
    write_table(
        path,
        "theta_4",
        right.theta_4,
        right.torque * (1 + 1e-5),
        "{:.6f}",
    )
    assert judged(scene, path).status == FAILED


def test_an_angle_that_is_passed_twice_needs_the_commanded_one(tmp_path, capsys):
    scene = commanding(2, 0.0, 360.0)
    fourbar.save(scene, tmp_path / "scene.toml")
    theta_4 = np.radians([120.0, 140.0])
    theirs = tmp_path / "theirs.csv"
    write_table(theirs, "theta_4", theta_4, theta_4, "{:.0f}")
    assert status(["check", str(tmp_path / "scene.toml"), str(theirs)]) == BAD_INPUT
    error = capsys.readouterr().err
    both = np.degrees(find_crank(scene, theta_4[:1], 1.0)) % 360.0
    assert f"{both[0]:.6g}" in error and "add a column theta_2" in error
    assert "line 2, theta_4" in error and "120 deg" in error


def test_an_angle_of_the_crank_is_a_position_of_a_driven_rocker(tmp_path):
    scene = commanding(4, 115.0, 155.0)
    right = fourbar.solve(scene)
    middle = 0.5 * (right.theta_2[1:] + right.theta_2[:-1])
    path = write_table(tmp_path / "theirs.csv", "theta_2", middle, middle)
    rows = find_row_commands(scene, read_table(path, "theta_4"))
    there = fourbar.solve(scene, at=rows.at)
    apart = np.angle(np.exp(1j * (there.theta_2 - middle)))
    np.testing.assert_allclose(apart, 0.0, atol=SAME_PLACE)
    assert (np.diff(rows.at.angle) > 0.0).all()
    write_table(path, "theta_2", middle, there.torque)
    assert judged(scene, path).status == HOLDS


def test_a_parallelogram_is_found_on_both_halves_of_its_turn(tmp_path):
    linkage = fourbar.uniform(0.3, 0.1, 0.3, 0.1)
    motion = fourbar.Motion(fourbar.Sweep(0.1, 6.1, 20), 5.0)
    scene = Scene(linkage, motion, effects=(fourbar.Gravity(),))
    angles = np.radians([20.0, 100.0, 200.0, 250.0, 340.0])
    expected = (0.1 + 0.3) * 9.81 * 0.1 * np.cos(angles)
    path = write_table(tmp_path / "theirs.csv", "theta_4", angles, expected, "{:.0f}")
    assert judged(scene, path).status == HOLDS


def test_an_angle_that_is_never_reached_has_no_motion(tmp_path):
    scene = commanding(2, 60.0, 220.0)
    angles = np.radians([10.0, 130.0])
    path = write_table(tmp_path / "theirs.csv", "theta_4", angles, angles, "{:.0f}")
    assert judged(scene, path).not_assembled == [2]


def test_the_word_angle_means_what_the_scene_commands(tmp_path):
    path = tmp_path / "theirs.csv"
    path.write_text("Angle [deg],torque\n100,1.0\n")
    assert read_table(path, "theta_4").found_by == "theta_4"
    assert read_table(path).found_by == "theta_2"
    path.write_text("output angle [deg],torque\n100,1.0\n")
    assert read_table(path).found_by == "theta_4"


def test_a_command_of_a_stroke_is_refused(tmp_path):
    text = """\
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[drive]
from = { bar = 1, from_pin = ["100 mm", "-60 deg"] }
to = { bar = 4, from_pin = ["100 mm", "0 deg"] }
[motion]
stroke = "250 mm"
side = "left"
"""
    path = tmp_path / "theirs.csv"
    path.write_text("theta_2 [deg],theta_3\n100,1.0\n")
    with pytest.raises(LimitError, match="takes a command of an angle alone"):
        judged(loads(text), path)


def test_a_table_without_an_angle_names_the_commanded_one(tmp_path):
    path = tmp_path / "theirs.csv"
    path.write_text("torque\n1.0\n")
    with pytest.raises(InputError, match=r"needs a column theta_4 \(say theta_4 \[deg"):
        read_table(path, "theta_4")
