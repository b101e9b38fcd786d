"""Where gas springs are beyond their stroke, by the geometry of a parallelogram."""

import json
import math
import re
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

import fourbar
from fourbar import Motion, Place, Scene, Spring, Springs, solve
from fourbar.cli import status
from fourbar.files import loads
from fourbar.show.acting import list_drawn_notes, list_spring_notes
from fourbar.show.block import write_block
from fourbar.solution import DEGREES
from tests.support.scenes import bare
from tests.support.shares import slow_but

HATCH = """
[lengths]
ground = "100 mm"
input = "400 mm"
coupler = "100 mm"
output = "400 mm"
[bars.input]
mass = "10 kg"
[motion]
theta_2 = { from = "10 deg", to = "80 deg", steps = 7 }
omega_2 = "0 rad/s"
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
[[effects.springs]]
from = { bar = 1, from_pin = ["200 mm", "-90 deg"] }
to = { bar = 2, from_pin = ["300 mm", "0 deg"] }
gas = { extended = "EXTENDED", stroke = "STROKE", extended_force = "300 N" }
"""
"""The spring from 0.2 m below O2 to 0.3 m along the input: by the law of cosines
distance^2 = 0.2^2 + 0.3^2 + 2 0.2 0.3 sin(theta_2)."""


def reach(distance):
    """Return the angle at which the ends are so far apart, as it is printed."""
    sine = (distance**2 - 0.2**2 - 0.3**2) / (2.0 * 0.2 * 0.3)
    return f"{math.degrees(math.asin(sine)):.4g} deg"


def write(folder, extended, stroke):
    file = folder / "hatch.toml"
    text = HATCH.replace("EXTENDED", extended).replace("STROKE", stroke)
    file.write_text(text, encoding="utf-8")
    return str(file)


@pytest.mark.slow
def test_a_gas_spring_beyond_its_stroke_is_told(tmp_path, capsys):
    for extended, stroke, expected in (
        (
            "400 mm",
            "150 mm",
            f"extended length of 400 mm from theta_2 = {reach(0.4)} on",
        ),
        (
            "600 mm",
            "150 mm",
            f"compressed length of 450 mm up to theta_2 = {reach(0.45)}",
        ),
        ("300 mm", "150 mm", "extended length of 300 mm throughout"),
    ):
        file = write(tmp_path, extended, stroke)
        for command in ("analyze", "equilibrium"):
            assert status([command, file]) == 0
            printed = " ".join(capsys.readouterr().out.split())
            assert expected in printed, (command, printed)
            assert "has no stops" in printed
            assert status([command, file, "--json"]) == 0
            (note,) = json.loads(capsys.readouterr().out)["notes"]
            assert "has no stops" in note
    assert (
        status(["analyze", write(tmp_path, "400 mm", "150 mm"), "--at", "80deg"]) == 0
    )
    printed = " ".join(capsys.readouterr().out.split())
    assert "longer than its extended length of 400 mm here" in printed


@pytest.mark.slow
def test_a_gas_spring_within_its_stroke_is_not_told(tmp_path, capsys):
    file = write(tmp_path, "600 mm", "300 mm")
    for command in ("analyze", "equilibrium"):
        assert status([command, file]) == 0
        assert "gas spring" not in capsys.readouterr().out


@pytest.mark.slow
def test_a_spring_at_its_end_is_within_its_stroke(tmp_path, capsys):
    longest = sqrt(0.13 + 0.12 * math.sin(math.radians(80.0)))
    file = write(tmp_path, f"{1000.0 * longest!r} mm", "150 mm")
    assert np.isfinite(solve(fourbar.load(file), "force").torque).all()
    assert status(["analyze", file]) == 0
    assert "gas spring" not in capsys.readouterr().out


DRIVE = """
[drive]
from = { bar = 1, from_pin = ["200 mm", "-90 deg"] }
to = { bar = 2, from_pin = ["300 mm", "0 deg"] }
"""
SWEEP = """theta_2 = { from = "10 deg", to = "80 deg", steps = 7 }
omega_2 = "0 rad/s"
"""
MOTIONS = {
    "bar 4": 'theta_4 = { from = "10 deg", to = "80 deg", steps = 7 }\n',
    "a law": (
        'law = { time = ["0 s", "1 s", "3 s"], theta_2 = ["10 deg", "30 deg",'
        ' "80 deg"], ends = "rest", steps = 20 }\n'
    ),
    "a stroke": (
        'stroke = { from = "390 mm", to = "497 mm", steps = 7 }\nside = "left"\n'
    ),
}


@pytest.mark.parametrize("motion", slow_but({"a stroke"}, MOTIONS))
def test_ends_are_found_whatever_is_commanded(motion, tmp_path, capsys):
    file = Path(write(tmp_path, "400 mm", "150 mm"))
    text = file.read_text(encoding="utf-8").replace(SWEEP, MOTIONS[motion])
    if motion == "a stroke":
        text = text.replace("[motion]", f"{DRIVE}[motion]")
    file.write_text(text, encoding="utf-8")
    assert status(["equilibrium", str(file)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert f"extended length of 400 mm from theta_2 = {reach(0.4)} on" in printed
    assert status(["analyze", str(file)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    expected = {
        "bar 4": f"from theta_4 = {reach(0.4)} on",
        "a law": "from t = ",
        "a stroke": "from stroke = 400 mm on",
    }
    assert f"extended length of 400 mm {expected[motion]}" in printed


def test_between_the_positions_of_a_list_nothing_is_located(tmp_path, capsys):
    file = Path(write(tmp_path, "400 mm", "150 mm"))
    listed = 'theta_2 = ["10 deg", "80 deg", "12 deg", "50 deg"]\n'
    text = file.read_text(encoding="utf-8").replace(SWEEP, listed)
    file.write_text(text, encoding="utf-8")
    assert status(["analyze", str(file)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "at theta_2 = 80 deg and from theta_2 = 50 deg on" in printed


def told(text):
    """Return the block of a scene in one line."""
    scene = fourbar.files.loads(text)
    return " ".join(" ".join(write_block(scene, solve(scene))).split())


@pytest.mark.slow
@pytest.mark.parametrize("length", ["400 mm", "600 mm"])
def test_a_spring_that_changes_its_sense_is_told_where(length):
    """It pulls from where its ends are farther apart than its length."""
    spring = f'stiffness = "500 N/m"\nlength = "{length}"'
    text = re.sub(r"gas = .*", spring, HATCH)
    said = f"spring 1 pulls from theta_2 = {reach(0.4)} on and pushes elsewhere"
    assert (said in told(text)) == (length == "400 mm")
    assert "elsewhere" not in told(f'{text}acts = "push"\n')
    for angles, where in (("10 20 80", "from"), ("80 20 10", "up to")):
        listed = [f"{angle} deg" for angle in angles.split()]
        some = re.sub("theta_2 = .*", f"theta_2 = {json.dumps(listed)}", text)
        last = " on" if where == "from" else ""
        said = f"spring 1 pulls {where} theta_2 = 20 deg{last} and pushes elsewhere"
        assert (said in told(some)) == (length == "400 mm")


TAKEN = [
    ('bar = 4\nmoment = "1 N m"', "load 1 enters bar 4 at O4"),
    ('bar = 3\nmoment = "1 N m"', "load 1 enters bar 3 at G"),
    ('bar = 4\nmoment = "1 N m"\nfrom_pin = ["1 mm", "0 deg"]', ""),
    ('bar = 4\nmoment = "1 N m"\nforce = ["1 N", "0 deg"]', ""),
    (
        'bar = 4\nforce = ["1 N", "0 deg"]\narm = ["1 mm", "0 deg"]',
        "load 1: arm counts from G of bar 4, taken to be mid-bar",
    ),
    ('bar = 2\nforce = ["1 N", "0 deg"]\narm = ["1 mm", "0 deg"]', ""),
]


@pytest.mark.parametrize("load, said", slow_but(TAKEN[:2], TAKEN))
def test_a_place_that_is_taken_is_named(load, said):
    """Bar 2 has a mass, whose centre the arm counts from."""
    block = told(f"{HATCH.partition('[effects]')[0]}[[loads]]\n{load}\n")
    assert said in block
    if not said:
        assert "enters bar" not in block and "arm counts" not in block


def test_a_table_and_the_json_say_from_where_an_arm_counts(tmp_path, capsys):
    file = tmp_path / "hatch.toml"
    load = '[[loads]]\nbar = 4\nforce = ["1 N", "0 deg"]\narm = ["1 mm", "0 deg"]'
    file.write_text(f"{HATCH.partition('[effects]')[0]}{load}", encoding="utf-8")
    said = "arm counts from G of bar 4, taken to be mid-bar"
    for option in ("--columns=theta_2,torque", "--table", "--json"):
        assert status(["analyze", str(file), option]) == 0
        assert said in " ".join(capsys.readouterr().out.split())


DRAWN = """
[pins]
O2 = ["0 mm", "0 mm"]
A = ["-98 mm", "ACROSS mm"]
B = ["-450 mm", "200 mm"]
O4 = ["-300 mm", "0 mm"]
[motion]
theta_2 = { from = "FROM", to = "TO", steps = 4 }
omega_2 = "1 rad/s"
[bars.input]
mass = "1 kg"
"""


@pytest.mark.parametrize(
    "start, stop, told",
    [
        ("drawn", "-170 deg", 'to = "190 deg" is the same direction, 20 deg from'),
        ("-170 deg", "drawn", 'from = "190 deg" is the same direction, 20 deg from'),
        ("drawn", "190 deg", ""),
        ("drawn", "530 deg", ""),
        ("169.9 deg", "-170 deg", ""),
    ],
)
def test_a_sweep_from_a_drawing_that_goes_the_long_way_is_told(start, stop, told):
    """The input is drawn at 170 deg, or at -190 deg, to a ground at 180 deg."""
    text = DRAWN.replace("FROM", start).replace("TO", stop)
    across = 98.0 * math.tan(math.radians(10.0))
    scene = loads(text.replace("ACROSS", repr(across)))
    (note,) = list_drawn_notes(scene, DEGREES) or [""]
    assert told in note and bool(told) == note.startswith("theta_2 goes by 340 deg")


@pytest.mark.parametrize("start, stop", [(2.0, 2.0 + math.tau), (8.0, 2.0)])
def test_a_spring_pulls_between_the_positions_of_a_coarse_sweep(start, stop):
    """It is longest where the crank points away from its end, between two of three."""
    ends = Place(1, (0.3, 0.0)), Place(2, (0.1, 0.0))
    length = sqrt(0.1 - 0.06 * math.cos(math.pi - 0.2))
    springs = Springs((Spring(*ends, 1.0, length),))
    motion = Motion(fourbar.Sweep(start, stop, 1), 1.0)
    linkage = bare(0.3, 0.1, 0.25, 0.22)
    scene = Scene(linkage, motion, effects=(springs,))
    (note,) = list_spring_notes(scene, solve(scene), DEGREES)
    places = [f"theta_2 = {math.degrees(math.pi + x):.4g} deg" for x in (-0.2, 0.2)]
    if stop < start:
        places = places[::-1]
    assert f"pulls from {places[0]} to {places[1]} and" in note


@pytest.mark.slow
def test_a_spring_pulls_in_a_release_from_between_its_instants():
    """The crank swings about the rest of a spring at O2: theta = 1 - cos(w t)/2."""
    linkage = bare(0.3, 0.1, 0.25, 0.22)
    ends = Place(1, (0.3, 0.0)), Place(2, (0.1, 0.0))
    length = sqrt(0.1 - 0.06 * math.cos(1.1))  # at 1.1 rad
    effects = (
        fourbar.Flywheel(0.01, 2),
        fourbar.Torsion((("O2", 1.0, 1.0, 0.0),)),
        Springs((Spring(*ends, 1e-12, length),)),
    )
    motion = Motion(0.5, 0.0, free=fourbar.Free(0.3, 3))
    scene = Scene(linkage, motion, effects=effects)
    time = 1e3 * math.acos(-0.2) / 10.0
    (note,) = list_spring_notes(scene, solve(scene), DEGREES)
    assert f"pulls from t = {time:.4g} ms on" in note
