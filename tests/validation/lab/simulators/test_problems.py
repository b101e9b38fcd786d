"""The set of problems: its files are those of today, its answers those of other methods within their error bars."""

import json
import math
import os
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar.quantities import PIN_FORCES
from fourbar.scene import command
from fourbar_validation.compare.tolerance import EPS, K, magnitude
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.lab.simulators.problems import PROBLEMS, SCHEMA, collect_problem
from fourbar_validation.lab.stress.forward_error.tally import TOO_SMALL
from tests.whole.test_imports import ROOT

FILES = sorted(PROBLEMS.glob("*.toml"))
APART = 2.0 * TOO_SMALL
"""Error bars between the answers of two CPUs, neither of which is off by more than TOO_SMALL of its own."""
LONG = () if os.environ.get("PROBLEMS") == "all" else ("iftomm_a02",)
"""Motions that take seconds to compute again; their values are held in any case."""
PUBLIC = {
    "crank_rocker",
    "drake_23842",
    "gz_physics_987",
    "iftomm_a02",
    "newton_128",
    "pinocchio_2729",
    "second_on_the_crank",
    "sprung",
}


@cache
def kept(name: str) -> Any:
    """The JSON that is in the tree."""
    return json.loads((PROBLEMS / f"{name}.json").read_text())


def off(one: Any, other: Any) -> Any:
    """How far two answers are apart, position by position."""
    return magnitude(np.atleast_1d(np.asarray(one, dtype=float) - np.asarray(other, dtype=float)))


@pytest.mark.parametrize("file", [file for file in FILES if file.stem not in LONG], ids=lambda file: file.stem)
def test_the_files_are_those_of_today(file: Path) -> None:
    assert {each.stem for each in FILES} == {each.stem for each in PROBLEMS.glob("*.json")} == PUBLIC
    old, new = kept(file.stem), json.loads(json.dumps(collect_problem(file)))
    assert old["schema"] == SCHEMA and old["answers"].keys() == new["answers"].keys()
    assert {key: old[key] for key in ("title", "source", "scene", "conventions")}.items() <= new.items()
    numbers = [re.findall(r"-?\d[\d.e+-]*", json.dumps(each["given"])) for each in (old, new)]
    assert np.allclose(*(np.array(each, dtype=float) for each in numbers), rtol=K * EPS, atol=1e-9)
    for name, answer in old["answers"].items():
        again, bar = new["answers"][name], np.asarray(answer["error"])
        assert (bar > 0.0).all() and (off(answer["value"], again["value"]) <= APART * bar).all(), name


@pytest.mark.parametrize("name", sorted(PUBLIC - {"gz_physics_987", "iftomm_a02"}))
def test_the_free_body_answers_the_same(name: str) -> None:
    scene, answers = fourbar.load(PROBLEMS / f"{name}.toml"), kept(name)["answers"]
    other = FreeBody().answer(scene, command(scene)).quantities
    for quantity in ("torque", *PIN_FORCES):
        value, bar = np.asarray(answers[quantity]["value"]), np.asarray(answers[quantity]["error"])
        both = bar + K * EPS / np.abs(other["sin_mu"]) * magnitude(value).max()
        assert (off(value, other[quantity]) <= both).all(), quantity


def pendulum(given: Any) -> tuple[float, float]:
    """Of a parallelogram whose input swings about O2 and whose coupler does not turn: k in theta'' = -k cos theta, and
    the energy theta'^2/2 + k sin theta."""
    bars, g = given["bars"], -given["gravity"][1]
    swinging = [bars["input"], bars["output"]]
    length, coupler = bars["input"]["length"], bars["coupler"]["mass"]
    inertia = sum(bar["inertia"] + bar["mass"] * bar["centre"][0] ** 2 for bar in swinging) + coupler * length**2
    k = g * (sum(bar["mass"] * bar["centre"][0] for bar in swinging) + coupler * length) / inertia
    return k, given["start"]["omega_2"] ** 2 / 2.0 + k * math.sin(given["start"]["theta_2"])


def test_gazebos_four_bar_swings_as_a_pendulum() -> None:
    special = pytest.importorskip("scipy.special")
    given, answers = kept("gz_physics_987")["given"], kept("gz_physics_987")["answers"]
    k, modulus = pendulum(given)[0], math.sin(0.5 * (given["start"]["theta_2"] + 0.5 * math.pi))
    quarter = special.ellipk(modulus**2)
    frequency = answers["frequency"]
    assert abs(frequency["value"] - math.sqrt(k) / (4.0 * quarter)) <= frequency["error"] < 1e-9
    assert f"{frequency['value']:.10f}" == "0.7504113317"
    sn, _, _, _ = special.ellipj(quarter - math.sqrt(k) * np.asarray(given["time"]), modulus**2)
    theta = 2.0 * np.arcsin(modulus * sn) - 0.5 * math.pi
    assert (off(answers["theta_2"]["value"], theta) <= answers["theta_2"]["error"]).all()


def test_a02_passes_every_angle_when_energy_says() -> None:
    integrate = pytest.importorskip("scipy.integrate")
    given, answers = kept("iftomm_a02")["given"], kept("iftomm_a02")["answers"]
    k, energy = pendulum(given)
    theta, time = np.asarray(answers["theta_2"]["value"]), given["time"]
    speed = -np.sqrt(2.0 * (energy - k * np.sin(theta)))
    assert (off(answers["omega_2"]["value"], speed) <= answers["omega_2"]["error"]).all()
    reached, passed = 0.0, 0
    for i in range(20, len(time), 20):
        reached += integrate.quad(lambda x: -1.0 / math.sqrt(2.0 * (energy - k * math.sin(x))), *theta[[i - 20, i]],
                                  epsabs=1e-12, epsrel=1e-12, limit=200)[0]  # fmt: skip
        passed += 1
        assert abs(reached - time[i]) * abs(speed[i]) <= answers["theta_2"]["error"][i]
    assert passed == 20 and time[-1] == 20.0


def test_the_page_s_example_reads_an_answer_without_this_project() -> None:
    page = (ROOT / "docs/problems.md").read_text()
    code = page[page.index("```python") + 9 :].partition("```")[0]
    names: dict[str, Any] = {}
    exec(code, names)
    assert "fourbar" not in code.replace("fourbar-problem/1", "")
    file, right = PROBLEMS / "newton_128.json", kept("newton_128")["answers"]["F43"]["value"]
    assert names["missed"](file, "F43", right) <= 0.0
    wrong = [right[0], [1.01 * x for x in right[1]], *right[2:]]
    assert 1e-4 < names["missed"](file, "F43", wrong) < 1e-2
    assert all(f"`{file.stem}`" in page for file in FILES)
