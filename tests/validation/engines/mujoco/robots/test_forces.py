"""Forces of MuJoCo's arrays where bodies are held against gravity."""

import math
import re
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np
import pytest

from fourbar.files import load
from fourbar.mjcf import write_mjcf
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.robots.ancestry import list_lifted_masses
from fourbar_validation.engines.mujoco.robots.answers import MeasureOptions
from fourbar_validation.engines.mujoco.robots.loop import PoseOptions, RobotFile
from fourbar_validation.engines.mujoco.robots.measure import measure_loops
from fourbar_validation.engines.mujoco.theirs import FILE_AT_ONE_STATE
from tests.support.robots import answer_of, examine_text
from tests.whole.test_imports import ROOT

FLAGS = ("gravity", "spring", "damper", "constraint", "actuation")
CRANK_ROCKER = ROOT / "models" / "crank_rocker.toml"
F14_AT_90_DEG = {'spring="disable" damper="disable"': 4.469, "": -1.333}
"""N upwards at theta_2 = 90 deg and 10 rad/s, of a free body of bar 4. The keys are
flags: without passive forces gravity is not compensated.
"""


@pytest.mark.parametrize("off", [c for n in range(4) for c in combinations(FLAGS, n)])
def test_gravity_is_compensated_where_mujoco_does(off: tuple[str, ...]) -> None:
    flags = " ".join(f'{flag}="disable"' for flag in off)
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><option><flag {flags}/></option><worldbody>"
        '<body gravcomp="0.7"><joint axis="0 1 0"/><geom pos=".1 0 0" size=".1"/>'
        "</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lifted = float(list_lifted_masses(model).sum())
    assert bool(lifted) == bool(data.qfrc_gravcomp.any())
    assert lifted in (0.0, pytest.approx(0.7 * model.body_mass.sum()))


@pytest.fixture
def scene() -> Scene:
    return load(CRANK_ROCKER)


@pytest.mark.parametrize("flags", F14_AT_90_DEG)
def test_pin_forces_are_those_of_the_free_body(scene: Scene, flags: str) -> None:
    text = write_mjcf(scene)
    text, bodies = re.subn(
        '<body name="(coupler|output)" ', r'\g<0>gravcomp="1" ', text
    )
    text, flagged = re.subn("<flag [^/]*", f'<flag contact="disable" {flags}', text)
    assert (bodies, flagged) == (2, 1)
    right = pytest.approx(F14_AT_90_DEG[flags], abs=5e-4)
    answer = answer_of(examine_text(scene, text, {}), FILE_AT_ONE_STATE)
    theta_2 = np.asarray(answer.at.theta_2) % math.tau
    at = int(np.argmin(np.abs(theta_2 - math.pi / 2.0)))
    assert answer.quantities["F14"][at, 1] == right
    file = RobotFile(Path("lifted.xml"), text)
    options = MeasureOptions(PoseOptions(), loop="B")
    (loop,) = measure_loops(file, options, scene).loops
    rows = {round(math.degrees(row.theta_2)) % 360: row for row in loop.states.rows}
    assert rows[90].soft.forces["F14"][1] == right
    assert rows[90].rigid.forces["F14"][1] == right
