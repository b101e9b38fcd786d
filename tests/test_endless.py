"""Input that never ends, and work that would not: refused in one line with exit status 2, or bounded and stopped."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import fourbar.cli
import validation.cli
from fourbar.exits import BAD_INPUT

ROOT = Path(__file__).parents[1]
SCENE = str(ROOT / "models" / "crank_rocker.toml")
READING = [
    # what reads a file of somebody's; ENDLESS stands for the file
    ["fourbar", "analyze", "ENDLESS"],
    ["fourbar", "mjcf", "ENDLESS", "-o", "OUT"],
    ["fourbar", "plot", "ENDLESS", "-o", "OUT.svg"],
    ["fourbar", "animate", "ENDLESS", "-o", "OUT.html"],
    ["fourbar", "animate", SCENE, "--picture", "coupler=ENDLESS", "-o", "OUT.html"],
    ["validation", "check", "ENDLESS", "ENDLESS"],
    ["validation", "check", SCENE, "ENDLESS"],
    ["validation", "run", "ENDLESS", "--out", "OUT"],
    ["validation", "run", SCENE, "--mjcf", "ENDLESS", "--out", "OUT"],
    ["validation", "run", SCENE, "--against", "ENDLESS", "--out", "OUT"],
    ["validation", "run", SCENE, "--python", "ENDLESS", "--out", "OUT"],
    ["validation", "run", "--suite", "ENDLESS", "--out", "OUT"],
    ["validation", "compare", "ENDLESS", "ENDLESS"],
    ["validation", "accept", "ENDLESS"],
    ["validation", "advise", "ENDLESS", "--error", "1e-3"],
    ["validation", "cost", "ENDLESS", "--out", "OUT"],
]


@pytest.mark.timeout(30)
@pytest.mark.parametrize("what", ["pipe", "device", "directory"])
@pytest.mark.parametrize("asked", READING, ids=lambda asked: " ".join(asked[:2]))
def test_what_may_never_end_is_not_waited_for(
    asked: list[str], what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    endless = {"pipe": tmp_path / "pipe", "device": Path("/dev/zero"), "directory": tmp_path / "folder"}[what]
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    before = sorted(tmp_path.rglob("*"))
    out = str(tmp_path / "out")
    program, *arguments = (part.replace("ENDLESS", str(endless)).replace("OUT", out) for part in asked)
    status = fourbar.cli.status if program == "fourbar" else validation.cli.status
    assert status(arguments) == BAD_INPUT
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and endless.name in told.err
    assert sorted(tmp_path.rglob("*")) == before


def test_a_file_on_standard_input_is_read_and_a_pipe_is_not() -> None:
    """`< scene.toml` is an ordinary file with a size, `cat scene.toml |` is a pipe."""
    command = [sys.executable, "-m", "fourbar", "analyze", "/dev/stdin"]
    with Path(SCENE).open("rb") as scene:
        assert subprocess.run(command, stdin=scene, stdout=subprocess.DEVNULL, check=False).returncode == 0
    piped = subprocess.run(command, input=Path(SCENE).read_bytes(), capture_output=True, check=False)
    assert piped.returncode == BAD_INPUT and b"must be an ordinary file" in piped.stderr
