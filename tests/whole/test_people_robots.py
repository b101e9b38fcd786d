"""What roboticists ask, from their files to the answer in three steps at most.

The right values were derived apart from this program: by virtual work on free bodies,
by MuJoCo asked by bisection on the couple, and from the loop's own angles.
"""

import csv
import math
import re
from pathlib import Path

import pytest

from fourbar.cli import status as ask_formulas
from fourbar_validation.cli import status as ask_harness

COMMANDS = {"fourbar": ask_formulas, "fourbar-validation": ask_harness}

ARM = """\
title = "Arm"
[lengths]
ground = "300 mm"
input = "100 mm"
coupler = "250 mm"
output = "220 mm"
[bars.input]
mass = "0.2 kg"
[bars.coupler]
mass = "0.3 kg"
[bars.output]
mass = "0.3 kg"
[motion]
"""
ROTOR = f"""{ARM}\
theta_2 = {{ from = "30 deg", to = "60 deg", steps = 30 }}
omega_2 = "10 rad/s"
alpha_2 = "20 rad/s^2"
[effects]
flywheel = {{ bar = 2, inertia = "0.02 kg m^2" }}
"""
STATICS = """\
title = "Holding torque, statics"
[lengths]
ground = "120 mm"
input = "80 mm"
coupler = "130 mm"
output = "90 mm"
[bars.input]
mass = "0.25 kg"
[bars.coupler]
mass = "0.35 kg"
[bars.output]
mass = "0.3 kg"
[motion]
theta_2 = ["40 deg", "70 deg", "100 deg"]
omega_2 = "0 rad/s"
[effects]
gravity = ["9.81 m/s^2", "-90 deg"]
"""
INVERSE_DYNAMICS = """\
theta_2 [deg],torque [N m],F43 [N]
40,0.508658747,0
70,0.350371690,0
100,0.157628523,0
"""
KNEE = """\
title = "Knee of a leg: thigh is ground, crank at the hip, rod, shank with foot force"
[lengths]
ground = "300 mm"
input = "40 mm"
coupler = "295 mm"
output = "45 mm"
ground_angle = "-90 deg"
[bars.output]
mass = "0.9 kg"
inertia = "0.012 kg m^2"
centre = ["0.13 m", "150 deg"]
[motion]
theta_2 = { from = "-40 deg", to = "40 deg", steps = 160 }
omega_2 = "5 rad/s"
[[loads]]
bar = 4
force = ["200 N", "90 deg"]
from_pin = ["0.17 m", "0 deg"]
"""
MIMIC = """\
<mujoco><option timestep="0.002"/><worldbody>
<body name="crank"><joint name="c" axis="0 0 1"/>
<inertial pos="0.02 0 0" mass="0.1" diaginertia="1e-5 1e-5 1e-5"/></body>
<body name="shank" pos="0 -0.3 0"><joint name="s" axis="0 0 1"/>
<inertial pos="0.1 0 0" mass="0.9" diaginertia="0.012 0.012 0.012"/></body>
</worldbody><equality>
<joint joint1="s" joint2="c" polycoef="0 0.8842 0 0 0"/>
</equality></mujoco>
"""


@pytest.fixture
def ask(tmp_path, capsys, monkeypatch):
    """Run one command line in an empty folder.

    Return what it prints in one line, which fits in a terminal of 80 columns.
    """
    monkeypatch.chdir(tmp_path)

    def run(line, code=0):
        command, *words = line.split()
        assert COMMANDS[command](words) == code, capsys.readouterr()
        printed = capsys.readouterr().out
        assert max(map(len, printed.splitlines()), default=0) <= 80
        return " ".join(printed.split())

    return run


def write(name, text):
    Path(name).write_text(text)


def spoil(name, old, new):
    """Change a written file in one place."""
    text = Path(name).read_text()
    changed, times = re.subn(old, new, text, count=1)
    assert times == 1
    write(name, changed)


@pytest.mark.slow
def test_a_rotor_may_stand_as_armature(ask):
    write("bare.toml", ROTOR.replace("flywheel", "# flywheel"))
    write("armature.toml", ROTOR)
    ask("fourbar mjcf bare.toml --drive none -o arm.xml")
    spoil("arm.xml", 'armature="0"', 'armature="0.02"')
    told = ask("fourbar-validation check-mjcf armature.toml arm.xml")
    assert "All 22 comparisons hold: 22 agree" in told
    position = ask("fourbar analyze armature.toml --at 30deg")
    assert "torque 362.425 mN m" in position  # 0.3624249 N m


@pytest.mark.parametrize("columns", [2, 3])
def test_torques_of_the_open_tree_are_named(ask, columns):
    """As `mj_inverse` and `rnea` give them for a loop: the loop force is missing."""
    write("statics.toml", STATICS)
    rows = [row.split(",")[:columns] for row in INVERSE_DYNAMICS.splitlines()]
    write("inv.csv", "\n".join(",".join(row) for row in rows))
    told = ask("fourbar-validation check statics.toml inv.csv", code=1)
    first, *_ = re.findall("looks like: (.*?)\\)", told)
    assert "torque of the open tree" in first and "mj_inverse" in first
    assert "explains everything that differs: torque" in first
    ask("fourbar analyze statics.toml --csv --units SI -o right.csv")
    with Path("right.csv").open(encoding="utf-8", newline="") as table:
        torques = [float(row["torque"]) for row in csv.DictReader(table)]
    assert torques == pytest.approx([0.3933019, 0.1897882, -0.0532205], abs=5e-8)


@pytest.mark.slow
def test_what_a_polynomial_in_place_of_the_loop_loses(ask):
    write("mimic.toml", KNEE)
    write("mimic.xml", MIMIC)
    told = ask("fourbar-validation check-mjcf mimic.toml mimic.xml --mimic s")
    assert "1.7507 deg through the zero of the file" in told
    assert "1.2722 deg with the constant of least squares" in told
    assert "1 least squares 1.2716 0.1267" in told
    errors = {
        (int(degree), fit): float(angle)
        for degree, fit, angle in re.findall(
            r"([1-4]) (least squares|smallest largest error) (\S+)", told
        )
    }
    right = {
        (1, "least squares"): 1.2716,
        (3, "least squares"): 0.0588,
        (1, "smallest largest error"): 0.783,
        (3, "smallest largest error"): 0.0285,
    }
    for key, angle in right.items():
        assert math.isclose(errors[key], angle, abs_tol=6e-5 if angle < 0.1 else 3e-4)
