"""check-mjcf and advise on a robot's file: what is printed, and the exit status."""

import pytest
from click.testing import CliRunner

from fourbar_validation.advise.advise import advise_command as advise
from fourbar_validation.places import MODELS
from fourbar_validation.robots.check_mjcf import check_mjcf_command as check_mjcf
from fourbar_validation.robots.loops import loops_command as loops
from tests.support.robots import FOOT_PARALLELOGRAM

pytestmark = pytest.mark.usefixtures("in_this_process")
FOOT = str(MODELS / "robots" / "biped_foot.xml")


def call(command, *arguments):
    return CliRunner().invoke(command, arguments, standalone_mode=False)  # type: ignore[arg-type]


def join_lines(result):
    """Return what was printed without the breaks of its lines."""
    return " ".join(result.output.split())


@pytest.mark.slow
def test_a_loop_is_measured_in_its_robot_and_settings_are_advised(tmp_path):
    asked = ("--loop", "rod", "--speed", "2", "--torque", "5", "-o", str(tmp_path))
    checked = call(check_mjcf, FOOT, *asked)
    assert checked.return_value == 0, checked.output
    for words in ("through time", "F43", "gap through time", "under the torque"):
        assert words in join_lines(checked)
    advised = call(advise, FOOT, "--loop", "rod", "--speed", "2", "--error", "0.01")
    assert advised.return_value == 0, advised.output
    assert "Type this into the MJCF for an error within 0.01" in advised.output
    assert '<connect name="rod" site1="rod_end" site2="heel"' in advised.output
    assert "pad" not in advised.output and "flywheel" not in advised.output


@pytest.mark.slow
def test_a_scene_and_a_robot_need_no_name_of_a_loop(tmp_path):
    scene = str(tmp_path / "foot.toml")
    made = call(loops, FOOT, "-o", scene)
    assert made.exception is None, made.output
    checked = call(check_mjcf, scene, FOOT, "-o", str(tmp_path))
    assert checked.return_value == 1, checked.output
    assert "MuJoCo in the whole robot against the formulas" in join_lines(checked)
    assert "differs from the formulas by less than 1e-08" in join_lines(checked)


@pytest.mark.slow
def test_a_loop_too_slow_to_simulate_is_measured_at_single_states(tmp_path):
    asked = ("--loop", "rod", "--speed", "0.0001", "-o", str(tmp_path))
    checked = call(check_mjcf, FOOT, *asked)
    held = join_lines(checked)
    assert "not simulated: its timestep of" in held
    assert "by generalized forces; contacts, joint limits and motors are off" in held
    assert "nan" not in checked.output


def test_options_that_do_not_go_together_are_refused():
    for command, arguments in (
        (check_mjcf, ("a.toml", FOOT, "b.xml")),
        (check_mjcf, (FOOT, "--mimic", "crank")),
        (advise, ("a.toml", "--error", "0.1", "--loop", "rod")),
        (advise, (FOOT, "--error", "0.1", "-o", "new.xml")),
    ):
        result = call(command, *arguments)
        assert result.exception is not None, arguments


def test_what_the_digits_of_a_file_leave_open_is_said(tmp_path):
    file = tmp_path / "foot.xml"
    file.write_text(FOOT_PARALLELOGRAM, "utf-8")
    checked = call(check_mjcf, str(file), "-o", str(tmp_path))
    assert checked.return_value == 0, checked.output
    said = join_lines(checked)
    assert (
        "what the scene leaves out and the lengths that it reads as equal (the notes"
        " name what is known of it);" in said
    )
    assert "in line within the digits of the file (motor = 68.75 deg)" in said
    assert "note: lengths read as equal within the digits of the file: " in said
    assert "3.2 deg from a change point" in said
    assert "zero" not in said
