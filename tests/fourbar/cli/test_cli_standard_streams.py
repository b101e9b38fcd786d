"""`-` is standard input where a scene is read, standard output where a file is written.

Pipes are read to their end.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from fourbar.errors import BAD_INPUT

ROOT = Path(__file__).parents[3]
SCENE = ROOT / "models" / "crank_rocker.toml"
TEXT = SCENE.read_bytes()


def call_fourbar(
    folder,
    *arguments,
    scene=TEXT,
):
    """Run the command line in a folder, with a scene on a pipe.

    The pipe is its standard input.
    """
    line = [sys.executable, "-m", "fourbar", *arguments]
    return subprocess.run(
        line,
        input=scene,
        capture_output=True,
        check=False,
        cwd=folder,
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["-", "/dev/stdin"])
@pytest.mark.posix
def test_a_scene_is_read_from_standard_input(name, tmp_path):
    for form in ("--json", "--degrees"):  # the block has the units of the file
        of_file = call_fourbar(tmp_path, "analyze", str(SCENE), form)
        of_pipe = call_fourbar(tmp_path, "analyze", name, form)
        assert of_pipe.returncode == 0 and not of_pipe.stderr
        assert of_pipe.stdout == of_file.stdout


@pytest.mark.slow
@pytest.mark.posix
def test_a_scene_is_read_from_a_pipe_of_the_shell(tmp_path):
    line = f"{sys.executable} -m fourbar analyze <(cat '{SCENE}') --json"
    piped = subprocess.run(["bash", "-c", line], capture_output=True, check=True)
    assert json.loads(piped.stdout)["title"]


@pytest.mark.slow
@pytest.mark.posix
def test_a_mistake_on_standard_input_is_one_line(tmp_path):
    wrong = call_fourbar(tmp_path, "analyze", "-", scene=b"[lengths]\nground = 3\n")
    assert wrong.returncode == BAD_INPUT
    assert wrong.stderr.count(b"\n") == 1 and b"lengths.ground" in wrong.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments, start",
    [
        (("analyze", "-", "--csv", "-o", "-"), b"status,"),
        (("analyze", "-", "--json", "-o", "-"), b"{"),
        (("mjcf", "-", "-o", "-"), b"<"),
        (("sdf", "-", "--without-loads", "-o", "-"), b"<"),
        (("usd", "-", "--without-loads", "-o", "-"), b"#usda"),
        (("plot", "-", "-o", "-"), b"<?xml"),
        (("animate", "-", "-o", "-"), b"<!doctype html>"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_a_file_is_written_to_standard_output(arguments, start, tmp_path):
    written = call_fourbar(tmp_path, *arguments)
    assert written.returncode == 0, written.stderr
    assert written.stdout.lower().startswith(start.lower())
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_defaults_of_lengths_do_not_enter_the_file(tmp_path):
    import xml.etree.ElementTree as ET

    lengths = ("0.3", "0.1", "0.25", "0.22")
    written = call_fourbar(tmp_path, "mjcf", "--lengths", *lengths, "-o", "-")
    assert ET.fromstring(written.stdout).tag == "mujoco"
    assert b"kg/m" in written.stderr
