"""`-` is standard input where a scene is read, standard output where a file is written.

Pipes are read to their end.
"""

import subprocess
import sys

import pytest

from fourbar.cli import status
from fourbar_validation.places import MODELS

SCENE = MODELS / "crank_rocker.toml"


@pytest.fixture
def call(monkeypatch, capfdbinary, tmp_path):
    """Runs the command line with a scene on its standard input."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with SCENE.open(encoding="utf-8") as stream:
            monkeypatch.setattr(sys, "stdin", stream)
            return status([*arguments]), *capfdbinary.readouterr()

    return run


@pytest.mark.slow
@pytest.mark.posix
@pytest.mark.parametrize("name", ["-", "/dev/stdin", f"<(cat '{SCENE}')"])
def test_a_scene_is_read_from_standard_input_and_from_a_pipe_of_the_shell(name, call):
    """The block would have the units of the file."""
    line = f"{sys.executable} -m fourbar analyze {name} --json < '{SCENE}'"
    piped = subprocess.run(["bash", "-c", line], capture_output=True, check=True)
    assert (0, piped.stdout, piped.stderr) == call("analyze", str(SCENE), "--json")


@pytest.mark.parametrize(
    "arguments, start",
    [
        ("analyze - --csv", b"status,"),
        ("analyze - --json", b"{"),
        ("mjcf -", b"<"),
        ("sdf - --without-loads", b"<"),
        ("usd - --without-loads", b"#usda"),
        pytest.param("plot -", b"<?xml", marks=pytest.mark.slow),
        pytest.param("animate -", b"<!doctype html>", marks=pytest.mark.slow),
    ],
)
def test_a_file_is_written_to_standard_output(arguments, start, call, tmp_path):
    code, out, err = call(*arguments.split(), "-o", "-")
    assert code == 0, err
    assert out.lower().startswith(start)
    assert not list(tmp_path.iterdir())
