"""Forces of MuJoCo's arrays where bodies are held against gravity."""

import contextlib
import io
import math
import re
from itertools import combinations

import mujoco
import numpy as np
import pytest

import fourbar
from fourbar.errors import HOLDS
from fourbar.files import load
from fourbar.mjcf import write_mjcf
from fourbar_validation.cli import status
from fourbar_validation.engines.mujoco.robots.ancestry import list_lifted_masses
from fourbar_validation.engines.mujoco.robots.planes import (
    find_bearer_forces,
    read_equality_force,
)
from fourbar_validation.robots.judge_loop import FILE_AT_ONE_STATE
from tests.support.robots import answer_of, examine_text, forward, measure
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
    model, data = forward(
        f"<mujoco><option><flag {flags}/></option><worldbody>"
        '<body gravcomp="0.7"><joint axis="0 1 0"/><geom pos=".1 0 0" size=".1"/>'
        "</body></worldbody></mujoco>"
    )
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
    answer = answer_of(examine_text(scene, text), FILE_AT_ONE_STATE)
    theta_2 = np.asarray(answer.at.theta_2) % math.tau
    at = int(np.argmin(np.abs(theta_2 - math.pi / 2.0)))
    assert answer.quantities["F14"][at, 1] == right
    loop = measure(text, scene, loop="B")
    rows = {round(math.degrees(row.angle)) % 360: row for row in loop.states.rows}
    assert rows[90].soft["F14"][1] == right
    assert rows[90].rigid["F14"][1] == right


SOLVED = 1e-6
"""Parts of the weight: MuJoCo's solver stops at a tolerance of 1e-8."""


def test_the_torque_by_mj_inverse_is_that_of_rigid_pins(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    names = {}
    page = read("docs/inverse-dynamics.md")
    with contextlib.redirect_stdout(io.StringIO()):
        exec(blocks("python", page)[0], names)
    line, _ = re.findall(r"`fourbar-validation (loops .*) -o", page)
    scene = tmp_path / "gripper.toml"
    assert status([*line.split(), "-o", str(scene)]) == HOLDS
    stated = load(scene)
    at = fourbar.command(stated).part(slice(1))
    at = at._replace(angle=at.angle * 0.0 + math.pi / 2.0 + 0.3, speed=2.0)
    right = fourbar.solve(stated, at=at._replace(acceleration=5.0))
    assert names["torque"] == pytest.approx(right.torque[0], rel=1e-7)
    x, _, z = names["force"]  # the scene's x is -x of the world
    np.testing.assert_allclose((-x, z), right.F43[0], rtol=1e-7)


def test_the_listing_of_the_guide_reads_what_the_harness_reads(monkeypatch):
    monkeypatch.chdir(ROOT)
    names = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(blocks("python", read("docs/guide-roboticist.md"))[0], names)
    model, data = names["model"], names["data"]
    number = model.body("right_follower").id
    np.testing.assert_array_equal(names["force"], read_equality_force(data, 0))
    bearing = find_bearer_forces(model, data)
    np.testing.assert_allclose(names["pin"], bearing[number], rtol=1e-13)
    # Newton's law of the follower, which the pin bears and the connect pulls
    acceleration = np.zeros(6)
    body = mujoco.mjtObj.mjOBJ_BODY
    mujoco.mj_objectAcceleration(model, data, body, number, acceleration, 0)
    inertia = model.body_mass[number] * acceleration[3:]  # less gravity
    np.testing.assert_allclose(
        names["pin"] - names["force"], inertia, atol=SOLVED * np.abs(inertia).max()
    )


@pytest.mark.parametrize("scale", [1.0, 0.3])
def test_a_weld_exerts_force_and_moment_as_the_guide_has_them(scale):
    model, data = forward(
        f"""<mujoco><option gravity="0 0 0" tolerance="0"/><worldbody>
        <body name="one" pos=".1 0 0"><freejoint/><geom size=".1"/></body>
        <body name="two" pos=".3 .2 .1" euler="20 40 60"><geom size=".1"/></body>
        </worldbody><equality><weld body1="one" body2="two" torquescale="{scale}"
        solimp="0.9999 0.9999 .001 .5 2" solref=".01 1"/></equality></mujoco>"""
    )
    force, moment = np.array([1.0, 2.0, 3.0]), np.array([0.3, -0.5, 0.2])
    data.xfrc_applied[1] = [*force, *moment]
    mujoco.mj_forward(model, data)
    turned = data.xmat[2].reshape(3, 3)
    exerted = 0.5 * scale * turned @ data.efc_force[3:6]
    about = np.cross(data.xpos[2] - data.xpos[1], data.efc_force[:3])
    # Newton and Euler for a ball at rest: what its acceleration does not take
    left = model.body_mass[1] * data.qacc[:3] - force
    left_moment = model.body_inertia[1] * data.qacc[3:] - moment
    np.testing.assert_allclose(data.efc_force[:3], left, atol=SOLVED)
    np.testing.assert_allclose(exerted + about, left_moment, atol=SOLVED)
    assert np.abs(exerted).max() > 0.05
