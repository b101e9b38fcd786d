"""Forces of MuJoCo's arrays where bodies are held against gravity."""

import contextlib
import io
import math
import re
from itertools import combinations

import mujoco
import numpy as np
import pytest

from fourbar.files import load
from fourbar.mjcf import write_mjcf
from fourbar_validation.engines.mujoco.robots.ancestry import list_lifted_masses
from fourbar_validation.engines.mujoco.robots.forces import (
    BearerForces,
    read_equality_force,
)
from fourbar_validation.robots.judge_loop import FILE_AT_ONE_STATE
from tests.support.robots import answer_of, examine_text, measure
from tests.whole.test_docs import blocks, read
from tests.whole.test_imports import ROOT

FLAGS = ("gravity", "spring", "damper", "constraint", "actuation")
CRANK_ROCKER = ROOT / "models" / "crank_rocker.toml"
F14_AT_90_DEG = {'spring="disable" damper="disable"': 4.469, "": -1.333}
"""N upwards at theta_2 = 90 deg and 10 rad/s, of a free body of bar 4. The keys are
flags: without passive forces gravity is not compensated.
"""


@pytest.mark.parametrize("off", [c for n in range(4) for c in combinations(FLAGS, n)])
def test_gravity_is_compensated_where_mujoco_does(off):
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
def scene():
    return load(CRANK_ROCKER)


@pytest.mark.parametrize(
    "flags",
    [
        pytest.param(flags, marks=[pytest.mark.slow] * bool(flags))
        for flags in F14_AT_90_DEG
    ],
)
def test_pin_forces_are_those_of_the_free_body(scene, flags):
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
    loop = measure(text, scene, loop="B")
    rows = {round(math.degrees(row.angle)) % 360: row for row in loop.states.rows}
    assert rows[90].soft.forces["F14"][1] == right
    assert rows[90].rigid.forces["F14"][1] == right


SOLVED = 1e-6
"""Parts of the weight: MuJoCo's solver stops at a tolerance of 1e-8."""


def test_the_listing_of_the_guide_reads_what_the_harness_reads(monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(blocks("python", read("docs/guide-roboticist.md"))[0], names)
    model, data = names["model"], names["data"]
    number = model.body("right_follower").id
    np.testing.assert_array_equal(names["force"], read_equality_force(data, 0))
    np.testing.assert_array_equal(names["pin"], BearerForces(model).read(data, number))
    # Newton's law of the follower, which the pin bears and the connect pulls
    acceleration = np.zeros(6)
    body = mujoco.mjtObj.mjOBJ_BODY
    mujoco.mj_objectAcceleration(model, data, body, number, acceleration, 0)
    inertia = model.body_mass[number] * acceleration[3:]  # less gravity
    np.testing.assert_allclose(
        names["pin"] - names["force"], inertia, atol=SOLVED * np.abs(inertia).max()
    )
