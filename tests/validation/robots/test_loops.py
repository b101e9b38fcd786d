"""The command `loops` as it is called."""

import math

import numpy as np
import pytest
from click.testing import CliRunner

import fourbar
from fourbar_validation.places import MODELS
from fourbar_validation.robots.loops import loops_command
from fourbar_validation.robots.options import read_pose

ROBOTS = MODELS / "robots"


def call(*arguments):
    line = [*map(str, arguments)]
    return CliRunner().invoke(loops_command, line, standalone_mode=False)


def unfold(printed):
    """Return the lines of a text whose folds are indented by four blanks."""
    return printed.replace("\n    ", " ").splitlines()


@pytest.mark.slow
def test_a_line_for_each_closure():
    result = call(ROBOTS / "gripper.xml")
    assert result.exception is None
    assert max(map(len, result.output.splitlines())) <= 80
    right, left = unfold(result.output)
    assert right == (
        "right_finger-right_follower: connect; ground palm; hinges right_finger, "
        "right_driver, right_follower; ground 20.00, input 60.00, coupler 20.00, "
        "output 60.00 mm; axes 0 deg apart; gap 0 mm; solref 0.02 1; "
        "solimp 0.9 0.95 0.001 0.5 2"
    )
    assert left.startswith("left_finger-left_follower: connect; ground palm;")


@pytest.mark.slow
def test_the_gap_is_that_of_the_stated_pose():
    result = call(ROBOTS / "biped_foot.xml", "--pose", "crank=20deg,knee=30deg")
    line, note = unfold(result.output)
    assert line.startswith("rod: connect; ground ankle_frame; hinges rod, crank, ankle")
    # the crank turned by 20 deg carries the rod's end along: 2 . 0.31905 m sin(10 deg)
    assert "gap 110.8 mm" in line
    assert note.startswith("note: the loops are closed again by least squares")


def test_a_pose_is_read_from_pairs():
    pose = ("knee=20deg, hip=1rad", "slide=3mm")
    stated = {"pose": pose, "key": "home", "hold": ("a,b",), "drive": "c"}
    options = read_pose(stated)
    assert options.joints == {"knee": "20deg", "hip": "1rad", "slide": "3mm"}
    assert options.held == ("a", "b")
    assert (options.key, options.drive) == ("home", "c")
    with pytest.raises(fourbar.InputError, match="must be like JOINT=20deg"):
        read_pose({**stated, "pose": ("knee",)})


@pytest.mark.slow
def test_a_scene_is_written_that_the_formulas_solve(tmp_path):
    out = tmp_path / "finger.toml"
    loop = "--loop", "right_finger-right_follower"
    result = call(ROBOTS / "gripper.xml", *loop, "-o", out, "--speed", "60 rpm")
    assert result.exception is None
    assert result.output.splitlines()[-1] == f"written to {out}"
    text = out.read_text()
    assert text.startswith("# Pins: O2 right_driver, A right_finger, B ")
    assert "# Bars: ground palm, " in text  # as the list of closures names it
    assert "# not in the scene: contacts" in text
    scene = fourbar.load(out)
    assert scene.motion.omega_2 == pytest.approx(2.0 * math.pi)
    assert np.isfinite(fourbar.solve(scene).torque).all()


def test_meshes_that_are_missing_are_counted_in_the_scene(tmp_path):
    geoms = "".join(f'<geom type="mesh" mesh="m{i}"/>' for i in range(150))
    meshes = "".join(f'<mesh name="m{i}" file="m{i}.stl"/>' for i in range(150))
    text = (ROBOTS / "biped_foot.xml").read_text("utf-8")
    text = text.replace("<worldbody>", f"<asset>{meshes}</asset><worldbody>{geoms}", 1)
    robot = tmp_path / "foot.xml"
    robot.write_text(text, "utf-8")
    out = tmp_path / "foot.toml"
    result = call(robot, "-o", out)
    assert result.exception is None, result.output
    said = out.read_text("utf-8").replace("\n# ", " ")
    assert "are left out: 150, the first of them m0.stl" in said
    assert fourbar.load(out).linkage.ground > 0.0


def test_a_speed_without_a_scene_is_refused():
    refused = call(ROBOTS / "gripper.xml", "--speed", "1")
    assert "--speed goes with -o" in str(refused.exception)
