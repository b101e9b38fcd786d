"""What people ask, from what they have to their answer in three steps at most.

The right values were derived apart from this program (circle intersection, 2x2 systems of
velocities and accelerations, a 9x9 system of free bodies, virtual work), or are printed in the
source of the task.
"""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar.cli import status
from fourbar.errors import HOLDS

WIDTH = 80
PRINTED = 1e-5
"""Relative: a value of six or seven digits against one that is printed with six."""
Steps = Callable[..., str]


@pytest.fixture
def ask(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Steps:
    """Run one command line of `fourbar` in an empty folder, and return what it prints."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> str:
        code = status(list(words))
        printed = capsys.readouterr()
        assert (code, printed.err) == (HOLDS, ""), printed.err
        assert max(map(len, printed.out.splitlines())) <= WIDTH, printed.out
        return printed.out

    return run


def row_of(text: str, label: str, after: str = "") -> list[float]:
    """Return the numbers of the first row with a label, below one that begins with `after`."""
    start = text.index(f"\n{after}") if after else 0
    row = re.search(rf"^ *{re.escape(label)}  +(.*)$", text[start:], re.MULTILINE)
    assert row is not None, (label, text)
    return [float(x) for x in re.findall(r"(?<!\S)-?\d[\d.e+-]*(?!\S)", row[1])]


HOMEWORK = """\
title = "Homework linkage with a coupler point"
[lengths]
ground = "5 cm"
input = "2 cm"
coupler = "3 cm"
output = "4.5 cm"
ground_angle = "15 deg"
[motion]
theta_2 = "45 deg"
omega_2 = "15 rad/s"
[points]
P = { bar = 3, from_pin = ["2.5 cm", "30 deg"] }
"""
OPEN = {
    "bar 3": (86.7856, -13.1675, 76.8866),
    "bar 4": (136.1867, -5.8506, 221.0994),
    "P": (0.29, 3.65),
    "v": (8.17, 36.05),
    "a": (-294.45, -791.77),
}
CROSSED = {
    "bar 3": (-90.8141, 1.1971, 269.4943),
    "bar 4": (-140.2152, -6.1197, 125.2815),
    "v": (-18.60, 22.67),
    "a": (268.25, 13.47),
}


@pytest.mark.parametrize(("branch", "right"), [("open", OPEN), ("crossed", CROSSED)])
def test_everything_about_one_position_of_a_homework_linkage(
    branch: str, right: dict[str, tuple[float, ...]], ask: Steps, tmp_path: Path
) -> None:
    """A file, an edit of its branch, a command."""
    stated = HOMEWORK.replace("[points]", f'branch = "{branch}"\n[points]')
    (tmp_path / "homework.toml").write_text(stated)
    text = ask("analyze", "homework.toml")
    for label, numbers in right.items():
        after = "P" if label in ("v", "a") else ""
        shown = row_of(text, label, after)[: len(numbers)]
        assert shown == pytest.approx(numbers, abs=6e-3), label
    assert len(text.splitlines()) < 40


def test_another_position_is_asked_for_on_the_command_line(
    ask: Steps, tmp_path: Path
) -> None:
    (tmp_path / "homework.toml").write_text(HOMEWORK.replace('"45 deg"', '"10 deg"'))
    text = ask("analyze", "homework.toml", "--at", "45 deg")
    assert row_of(text, "bar 3") == pytest.approx(OPEN["bar 3"], rel=PRINTED)


MIDTERM = """\
title = "Midterm: output angle known"
[lengths]
ground = "5 in"
input = "7 in"
coupler = "3.5 in"
output = "5 in"
[motion]
theta_4 = "30 deg"
[points]
P = { bar = 3, from_pin = ["6 in", "45 deg"] }
"""


def test_the_output_angle_is_known(ask: Steps, tmp_path: Path) -> None:
    """A file, a command; an edit of the branch gives the other assembly."""
    answers = {
        "open": (-0.015833, (6.659926, 5.879577)),
        "crossed": (0.539432, (11.363445, 6.296990)),
    }
    for branch, (theta_2, place) in answers.items():
        stated = MIDTERM.replace("[points]", f'branch = "{branch}"\n[points]')
        (tmp_path / "midterm.toml").write_text(stated)
        text = ask("analyze", "midterm.toml", "--units", "in rad")
        assert row_of(text, "bar 2") == pytest.approx([theta_2], abs=5e-5)
        assert row_of(text, "P") == pytest.approx(place, rel=PRINTED)


PLIERS = """\
title = "Pliers: effort at the handle, force at the jaw"
[lengths]
ground = "2.4 in"
input = "0.8 in"
coupler = "1.23 in"
output = "1.55 in"
[motion]
theta_2 = "49 deg"
[points]
handle = { bar = 2, from_pin = ["4.26 in", "0 deg"] }
jaw = { bar = 4, from_pin = ["1 in", "0 deg"] }
"""


def test_pliers_have_their_advantage_without_a_speed(
    ask: Steps, tmp_path: Path
) -> None:
    (tmp_path / "pliers.toml").write_text(PLIERS)
    text = ask("analyze", "pliers.toml")
    assert row_of(text, "omega_4/omega_2")[0] == pytest.approx(0.1332544, rel=PRINTED)
    assert row_of(text, "mechanical advantage")[0] == pytest.approx(
        1.0 / 0.1332544, rel=PRINTED
    )
    assert row_of(text, "F_jaw/F_handle")[0] == pytest.approx(31.969, rel=PRINTED)


def test_four_pins_and_the_speed_of_the_output_as_they_are_drawn(
    ask: Steps, tmp_path: Path
) -> None:
    """A command, an edit of two lines, a command."""
    ask("new", "pins.toml", "--pins", "0,0 0,100 175,50 250,50", "--unit", "mm")
    text = (tmp_path / "pins.toml").read_text()
    assert 'omega_2 = "60 rpm"' in text
    stated = 'theta_4 = "drawn"\nomega_4 = "2 rad/s"'
    (tmp_path / "pins.toml").write_text(text.replace('omega_2 = "60 rpm"', stated))
    text = ask("analyze", "pins.toml")
    assert row_of(text, "bar 2")[1:] == pytest.approx(
        [-0.4285714, -4.338192], rel=PRINTED
    )
    assert row_of(text, "bar 3")[1:] == pytest.approx(
        [-0.8571429, -0.104956], rel=PRINTED
    )


COORDINATES = """\
title = "Four-bar from joint coordinates"
[pins]
O2 = ["4.1 cm", "3.75 cm"]
A = ["1.244 cm", "0.196 cm"]
B = ["-2.32 cm", "-2.293 cm"]
O4 = ["0.165 cm", "1.322 cm"]
[motion]
omega_2 = "10 rpm"
[points]
E = { bar = 3, from_pin = { drawn = ["-2.591 cm", "1.657 cm"] } }
"""


def test_a_linkage_by_the_coordinates_of_its_joints(ask: Steps, tmp_path: Path) -> None:
    """E stands where it is drawn, in the coordinates of the drawing, and its path goes through it."""
    (tmp_path / "joints.toml").write_text(COORDINATES)
    text = ask("analyze", "joints.toml", "--at", "drawn")
    for name, place in {
        "A": (1.244, 0.196),
        "B": (-2.32, -2.293),
        "E": (-2.591, 1.657),
    }.items():
        assert row_of(text, name) == pytest.approx(place, rel=PRINTED)
    scene = fourbar.load(tmp_path / "joints.toml")
    curve = fourbar.coupler_curve(scene, "E", steps=4000)
    x, y = (np.asarray(z) + o for z, o in zip(curve[2:], scene.origin, strict=True))
    assert np.hypot(x + 0.02591, y - 0.01657).min() < 1e-4
