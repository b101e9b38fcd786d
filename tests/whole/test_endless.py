"""Input that never ends, and work that would not.

Refused in one line with exit status 2, or bounded and stopped.
"""

import os
import subprocess
from pathlib import Path

from pytest import mark, raises

import fourbar.cli
import fourbar_validation.cli
from fourbar.errors import BAD_INPUT, InputError
from fourbar_validation.scenes.suites import read_scene_files
from tests.support.checkout import ROOT, read_complaint

SCENE = ROOT / "models" / "crank_rocker.toml"
READING = [
    # what reads a file of somebody's; ENDLESS stands for the file
    "fourbar analyze ENDLESS",
    "fourbar mjcf ENDLESS -o OUT",
    "fourbar plot ENDLESS -o OUT.svg",
    "fourbar animate ENDLESS -o OUT.html",
    f"fourbar animate {SCENE} --picture coupler=ENDLESS -o OUT.html",
    "validation check ENDLESS ENDLESS",
    f"validation check {SCENE} ENDLESS",
    "validation run ENDLESS --out OUT",
    f"validation check-mjcf {SCENE} ENDLESS --out OUT",
    f"validation run {SCENE} --against ENDLESS --out OUT",
    "validation run --suite ENDLESS --out OUT",
    "validation compare ENDLESS ENDLESS",
    "validation accept ENDLESS",
    "validation advise ENDLESS --error 1e-3",
    "validation cost ENDLESS --out OUT",
]


@mark.posix
@mark.timeout(30)
@mark.parametrize("what", ["pipe", "device", "directory"])
@mark.parametrize("line", READING, ids=lambda line: line[:18])
def test_what_may_never_end_is_not_waited_for(line, what, tmp_path, capsys):
    endless = Path("/dev/zero") if what == "device" else tmp_path / what
    os.mkfifo(tmp_path / "pipe")
    writer = subprocess.Popen(f"exec cat /dev/zero >'{tmp_path / 'pipe'}'", shell=True)
    (tmp_path / "directory").mkdir()
    before = sorted(tmp_path.rglob("*"))
    line = line.replace("ENDLESS", str(endless)).replace("OUT", str(tmp_path / "out"))
    program, *arguments = line.split()
    status = {"fourbar": fourbar.cli, "validation": fourbar_validation.cli}[program]
    try:
        assert status.status(arguments) == BAD_INPUT
    finally:
        writer.kill()
        writer.wait()
    assert endless.name in read_complaint(capsys)
    assert sorted(tmp_path.rglob("*")) == before


RELEASED = """[lengths]
ground = "0.3 m"
input = "0.1 m"
coupler = "0.25 m"
output = "0.22 m"
[bars.input]
mass = "0.2 kg"
[motion]
theta_2 = "60 deg"
omega_2 = "1 rad/s"
free = { duration = "1e9 s", steps = 10 }
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""


@mark.slow
def test_a_free_motion_without_end_is_given_up_with_its_reason(
    tmp_path, monkeypatch, capsys
):
    file, out = tmp_path / "released.toml", tmp_path / "out.csv"
    file.write_text(RELEASED)
    monkeypatch.setattr("fourbar.evaluation.free_motion.MOST_INTEGRATION_STEPS", 500)
    assert fourbar.cli.status(["analyze", str(file), "-o", str(out)]) == BAD_INPUT
    complained = read_complaint(capsys)
    assert "released.toml: motion.free.duration = 1000000000.0" in complained
    assert "followed for 500 steps" in complained
    assert not out.exists()


def test_a_free_motion_too_long_for_the_engines_is_refused_before_a_run(tmp_path):
    file = tmp_path / "released.toml"
    file.write_text(RELEASED)
    words = r"motion\.free\.duration = .*must not exceed 100 s in a run"
    with raises(InputError, match=words):
        read_scene_files([file])
