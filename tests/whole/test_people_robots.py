"""What a roboticist asks of inverse dynamics, whose loop force is missing.

The right values were derived apart from this program, by virtual work on free bodies.
"""

import csv
import re

import pytest

from fourbar.cli import status
from fourbar.errors import FAILED, HOLDS
from fourbar_validation.cli import status as harness

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


@pytest.mark.parametrize("columns", [2, 3])
def test_torques_of_the_open_tree_are_named(columns, tmp_path, capsys):
    """As `mj_inverse` and `rnea` give them for a loop: the loop force is missing."""
    scene, theirs, right = (
        tmp_path / name for name in ("statics.toml", "inv.csv", "right.csv")
    )
    scene.write_text(STATICS)
    rows = [row.split(",")[:columns] for row in INVERSE_DYNAMICS.splitlines()]
    theirs.write_text("\n".join(",".join(row) for row in rows))
    assert harness(["check", str(scene), str(theirs)]) == FAILED
    told = " ".join(capsys.readouterr().out.split())
    first, *_ = re.findall("looks like: (.*?)\\)", told)
    assert "torque of the open tree" in first and "mj_inverse" in first
    assert "explains everything that differs: torque" in first
    line = ["analyze", str(scene), "--csv", "--units", "SI", "-o", str(right)]
    assert status(line) == HOLDS
    with right.open(encoding="utf-8", newline="") as table:
        torques = [float(row["torque"]) for row in csv.DictReader(table)]
    assert torques == pytest.approx([0.3933019, 0.1897882, -0.0532205], abs=5e-8)
