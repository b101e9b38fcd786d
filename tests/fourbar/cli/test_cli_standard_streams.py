"""`-` is standard input where a scene is read, standard output where a file is written.

Pipes are read to their end.
"""

import subprocess
import sys

from pytest import fixture, mark

from fourbar.cli import status
from fourbar_validation.places import MODELS
from tests.support.rows import read_rows, slow_but

SCENE = MODELS / "crank_rocker.toml"


@fixture
def call(monkeypatch, capfdbinary, tmp_path):
    """Runs the command line with a scene on its standard input."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with SCENE.open(encoding="utf-8") as stream:
            monkeypatch.setattr(sys, "stdin", stream)
            return status([*arguments]), *capfdbinary.readouterr()

    return run


@mark.slow
@mark.posix
@mark.parametrize("name", ["-", "/dev/stdin", f"<(cat '{SCENE}')"])
def test_a_scene_is_read_from_standard_input_and_from_a_pipe_of_the_shell(name, call):
    """The block would have the units of the file."""
    line = f"{sys.executable} -m fourbar analyze {name} --json < '{SCENE}'"
    piped = subprocess.run(["bash", "-c", line], capture_output=True, check=True)
    assert (0, piped.stdout, piped.stderr) == call("analyze", str(SCENE), "--json")


STARTS = read_rows("""
analyze - --csv | status,
analyze - --json | {
mjcf - | <
sdf - --without-loads | <
usd - --without-loads | #usda
plot - | <?xml
animate - | <!doctype html>
""")


@mark.parametrize(
    "arguments, start",
    slow_but(STARTS[:5], STARTS),
)
def test_a_file_is_written_to_standard_output(arguments, start, call, tmp_path):
    code, out, err = call(*arguments.split(), "-o", "-")
    assert code == 0, err
    assert out.lower().startswith(start.encode())
    assert not list(tmp_path.iterdir())
