"""Files of the set of problems are up to date, and its answers are those of derivations
that share no code with them.
"""

import json
import math
import os
import re
import runpy
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fourbar
from fourbar_lab.cli import status as lab_status
from fourbar_lab.simulators.problems import PROBLEMS, collect_problem, list_problems
from fourbar_validation.check.problem import (
    LEVELS,
    PROBLEM_SCHEMA,
    RESULT,
    find_levels,
    judge_answers,
    read_problem,
)
from fourbar_validation.cli import status
from fourbar_validation.compare.tolerance import EPS, K, magnitude
from fourbar_validation.engines import protocol
from fourbar_validation.engines.free_body import FreeBody
from tests.whole.test_imports import ROOT

NAMES = list_problems()
APART = 2.0
"""Error bars between the answers of two CPUs."""
LONG = () if os.environ.get("PROBLEMS") == "all" else ("iftomm_a02",)
"""Motions that take seconds to compute again; their values are held in any case."""
RELEASED = ("gz_physics_987", "iftomm_a02")
SLIDING = ("slider_crank", "slider_crank_offset")
PRESCRIBED = [name for name in NAMES if name not in (*RELEASED, *SLIDING)]
IN_MANY_DIGITS = [
    name for name in PRESCRIBED if name not in ("cylinder", "pin_friction")
]


@cache
def read_stored(name):
    """Read a problem as it stands in the tree."""
    return read_problem(PROBLEMS / f"{name}.json")


def find_distance(first, second):
    """Return the distance between two answers at each position."""
    return magnitude(
        np.atleast_1d(np.asarray(first, dtype=float) - np.asarray(second, dtype=float))
    )


def assert_agreement(name, answers, share=0.0):
    """Assert that each answer lies within its error bar.

    The bar is widened by a share of the largest value for its derivation.
    """
    problem, compared = read_stored(name), 0
    for quantity, values in problem["answers"].items():
        if quantity not in answers:
            continue
        apart = find_distance(values, answers[quantity])
        if quantity.startswith("theta"):
            apart = np.minimum(apart, np.abs(apart - 2.0 * np.pi))
        size = (
            1.0
            if quantity.startswith("theta")
            else magnitude(np.atleast_1d(np.asarray(values))).max()
        )
        assert (
            apart <= np.asarray(problem["errors"][quantity]) + share * size
        ).all(), quantity
        compared += 1
    assert compared >= 4


def test_there_are_fifteen_and_their_files_agree():
    assert len(NAMES) == 15 and {file.stem for file in PROBLEMS.glob("*.json")} == set(
        NAMES
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if name not in LONG])
def test_the_files_are_those_of_today(name):
    old, new = read_stored(name), json.loads(json.dumps(collect_problem(name)))
    assert (
        old["schema"] == PROBLEM_SCHEMA
        and old["answers"].keys() == new["answers"].keys() == old["errors"].keys()
    )
    for key in ("title", "source", "conventions", "mechanism", "ask", "units"):
        assert old[key] == new[key]
    numbers = [
        re.findall(
            r"-?\d[\d.e+-]*", json.dumps([problem[key] for key in ("scene", "command")])
        )
        for problem in (old, new)
    ]
    assert np.allclose(
        *(np.array(texts, dtype=float) for texts in numbers),
        rtol=K * EPS,
        atol=1e-9,
    )
    for quantity, values in old["answers"].items():
        bar = np.asarray(old["errors"][quantity])
        assert (bar > 0.0).all() and (
            find_distance(values, new["answers"][quantity]) <= APART * bar
        ).all(), quantity


@pytest.mark.parametrize("name", NAMES)
def test_a_problem_is_what_the_schema_says(name):
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(
        (ROOT / "docs" / "protocol.schema.json").read_text(encoding="utf-8")
    )
    check = jsonschema.Draft202012Validator(
        {"$ref": "#/$defs/problem", "$defs": schema["$defs"]}
    )
    problem = json.loads((PROBLEMS / f"{name}.json").read_text(encoding="utf-8"))
    check.validate(problem)
    assert not check.is_valid({**problem, "given": {}}) and not check.is_valid(
        {**problem, "scene": {}}
    )


def read_question(name):
    """Read scene and command as an engine does."""
    problem = read_stored(name)
    return protocol.command_from_json(
        protocol.scene_from_json(problem["scene"]), problem["command"]
    )


@pytest.mark.parametrize("name", PRESCRIBED)
def test_the_free_bodies_answer_the_same(name):
    scene, command = read_question(name)
    answers = FreeBody().answer(scene, command).quantities
    assert_agreement(
        name, answers, K * EPS / float(np.abs(answers["sin_mu"]).min()) ** 2
    )


@pytest.mark.parametrize("name", IN_MANY_DIGITS)
def test_ninety_digits_answer_the_same(name):
    exact = pytest.importorskip("fourbar_validation.engines.exact")
    pytest.importorskip("flint")
    assert_agreement(
        name, exact.BallArithmetic().answer(*read_question(name)).quantities
    )


def slide(mp, scene, place, omega, alpha):
    """Answer a slider-crank by virtual work.

    The motion as functions of time, which are differentiated in many digits. Each
    displacement tells one unknown: the crank's turn the torque, the rod's turn about A
    and the slider's along its guide the force at B, the slider's across it the guide's,
    and those of a bar as a whole the forces at its first pin.
    """
    a, b, e = (mp.mpf(scene["lengths"][name]) for name in ("crank", "rod", "offset"))
    weight = mp.mpc(0, -mp.mpf(scene["effects"]["gravity"][0]))

    def theta(t):
        return place + omega * t + alpha * t * t / 2

    def psi(angle):
        return mp.asin((e - a * mp.sin(angle)) / b)

    def slope(point, angle, order=1):
        return mp.mpc(
            *(
                mp.diff(lambda x, part=part: part(point(x)), angle, order)
                for part in (mp.re, mp.im)
            )
        )

    def work(force, displaced):
        return mp.re(force * mp.conj(displaced))

    bodies = []
    for name, length in (("crank", a), ("rod", b)):
        stated = scene["bars"][name]
        r, phi = stated.get("centre", (length / 2, 0.0))
        bodies.append(
            (
                stated.get("inertia", mp.mpf(stated["mass"]) * length**2 / 12),
                mp.mpf(r) * mp.expj(phi),
            )
        )
    (i2, c2), (i3, c3) = bodies
    centres = (
        lambda angle: c2 * mp.expj(angle),
        lambda angle: a * mp.expj(angle) + c3 * mp.expj(psi(angle)),
        lambda angle: a * mp.cos(angle) + b * mp.cos(psi(angle)) + mp.mpc(0, e),
    )
    masses = (
        mp.mpf(scene["bars"][name]["mass"]) for name in ("crank", "rod", "slider")
    )
    p = [
        m * (slope(lambda t: centre(theta(t)), 0, 2) - weight)  # noqa: B023
        for m, centre in zip(masses, centres, strict=True)
    ]
    for load in scene.get("loads", ()):
        p[2] -= mp.mpf(load["force"][0]) * mp.expj(load["force"][1])
    t2, t3 = i2 * alpha, i3 * slope(lambda t: psi(theta(t)), 0, 2).real
    torque = sum(
        work(force, slope(centre, place))
        for force, centre in zip(p, centres, strict=True)
    )
    torque += t2 + t3 * slope(psi, place).real
    arm = mp.expj(psi(place))
    F43 = mp.mpc(
        -p[2].real,
        (work(p[1], 1j * c3 * arm) + t3 - p[2].real * b * arm.imag) / (b * arm.real),
    )
    F32 = F43 - p[1]
    F12 = p[0] - F32
    numbers = {
        "theta_3": psi(place),
        "stroke": centres[2](place).real,
        "torque": torque,
        "guide_force": p[2].imag + F43.imag,
    }
    forces = {"F12": F12, "F32": F32, "F43": F43}
    return {name: float(x) for name, x in numbers.items()} | {
        name: [float(x.real), float(x.imag)] for name, x in forces.items()
    }


@pytest.mark.parametrize("name", SLIDING)
def test_virtual_work_answers_the_slider_cranks_the_same(name):
    mp = pytest.importorskip("mpmath").mp
    command = read_stored(name)["command"]
    with mp.workdps(60):
        rates = mp.mpf(command["omega_2"]), mp.mpf(command["alpha_2"])
        rows = [
            slide(mp, read_stored(name)["scene"], mp.mpf(place), *rates)
            for place in command["theta_2"]
        ]
    assert rows[0].keys() == read_stored(name)["answers"].keys()
    assert_agreement(
        name, {quantity: [row[quantity] for row in rows] for quantity in rows[0]}
    )


def pendulum(problem):
    """Return k in theta'' = -k cos theta, and the energy.

    The energy of a released parallelogram is theta'^2/2 + k sin theta.
    """
    scene, start = problem["scene"], problem["command"]
    bars, length = scene["bars"], scene["lengths"]["input"]
    swinging, coupler = [bars["input"], bars["output"]], bars["coupler"]["mass"]
    arms = [bar.get("centre", [0.5 * length, 0.0])[0] for bar in swinging]
    inertias = [bar.get("inertia", bar["mass"] * length**2 / 12.0) for bar in swinging]
    inertia = sum(
        i + bar["mass"] * arm**2
        for i, bar, arm in zip(inertias, swinging, arms, strict=True)
    )
    inertia += coupler * length**2
    moment = (
        sum(bar["mass"] * arm for bar, arm in zip(swinging, arms, strict=True))
        + coupler * length
    )
    k = scene["effects"]["gravity"][0] * moment / inertia
    return k, start["omega_2"] ** 2 / 2.0 + k * math.sin(start["theta_2"])


def test_gazebos_four_bar_swings_as_a_pendulum():
    special = pytest.importorskip("scipy.special")
    problem = read_stored("gz_physics_987")
    answers, errors = problem["answers"], problem["errors"]
    k, modulus = (
        pendulum(problem)[0],
        math.sin(0.5 * (problem["command"]["theta_2"] + 0.5 * math.pi)),
    )
    quarter = special.ellipk(modulus**2)
    assert (
        abs(answers["frequency"] - math.sqrt(k) / (4.0 * quarter))
        <= errors["frequency"]
        < 1e-9
    )
    assert f"{answers['frequency']:.10f}" == "0.7504113317"
    sn, cn, _, _ = special.ellipj(
        quarter - math.sqrt(k) * np.asarray(problem["times"]), modulus**2
    )
    theta = 2.0 * np.arcsin(modulus * sn) - 0.5 * math.pi
    omega = -2.0 * modulus * math.sqrt(k) * cn
    assert_agreement(
        "gz_physics_987",
        {"theta_2": theta, "omega_2": omega, **solve_pin_forces(problem, theta, omega)},
    )


def test_a02_passes_every_angle_when_energy_says():
    integrate = pytest.importorskip("scipy.integrate")
    problem = read_stored("iftomm_a02")
    answers, errors = problem["answers"], problem["errors"]
    k, energy = pendulum(problem)
    theta, time = np.asarray(answers["theta_2"]), problem["times"]
    speed = -np.sqrt(2.0 * (energy - k * np.sin(theta)))
    assert_agreement(
        "iftomm_a02", {"omega_2": speed, **solve_pin_forces(problem, theta, speed)}
    )
    reached, passed = 0.0, 0
    for i in range(20, len(time), 20):
        reached += integrate.quad(
            lambda x: -1.0 / math.sqrt(2.0 * (energy - k * math.sin(x))),
            *theta[[i - 20, i]],
            epsabs=1e-12,
            epsrel=1e-12,
            limit=200,
        )[0]
        passed += 1
        assert abs(reached - time[i]) * abs(speed[i]) <= errors["theta_2"][i]
    assert passed == 20 and time[-1] == 20.0


def solve_pin_forces(problem, theta, omega):
    """Return the pin forces of a released parallelogram, N, from the balances of its
    coupler, which does not turn.

    Moments of the coupler about B give the part of F32 across it, moments of the input
    about O2 the part along it.
    """
    mp = pytest.importorskip("mpmath").mp
    scene, k = problem["scene"], pendulum(problem)[0]
    a, b, weight = (
        scene["lengths"]["input"],
        scene["lengths"]["coupler"],
        mp.mpc(0, -scene["effects"]["gravity"][0]),
    )
    forces: dict[str, list[list[float]]] = {"F12": [], "F32": [], "F43": [], "F14": []}

    def cross(arm, force):
        return (mp.conj(arm) * force).imag

    def centre(name, length):
        r, angle = scene["bars"][name].get("centre", (length / 2, 0.0))
        return r * mp.expj(angle)

    with mp.workdps(40):
        for angle, speed in zip(theta, omega, strict=True):
            crank = a * mp.expj(angle)
            growth = -k * mp.cos(angle)
            turning = (
                1j * growth - mp.mpf(speed) ** 2
            )  # acceleration of a point by its arm about O2 or O4
            swinging = {}
            for name in ("input", "output"):
                bar, arm = scene["bars"][name], centre(name, a) * crank / a
                swinging[name] = bar["mass"] * (turning * arm - weight)
            bar = scene["bars"]["input"]
            arm = centre("input", a) * crank / a
            turned = bar.get("inertia", bar["mass"] * a**2 / 12) * growth + cross(
                arm, swinging["input"]
            )
            carried = scene["bars"]["coupler"]["mass"] * (turning * crank - weight)
            across = -cross(b - centre("coupler", b), carried) / b
            F32 = mp.mpc((crank.real * across - turned) / crank.imag, across)
            pins = (
                swinging["input"] - F32,
                F32,
                F32 + carried,
                swinging["output"] + F32 + carried,
            )
            for rows, force in zip(forces.values(), pins, strict=True):
                rows.append([float(force.real), float(force.imag)])
    return forces


def test_the_page_s_example_reads_an_answer_without_this_project():
    page = (ROOT / "docs/benchmark.md").read_text()
    code = page[page.index("```python") + 9 :].partition("```")[0]
    names: dict[str, Any] = {}
    exec(code, names)
    assert "fourbar" not in code.replace("fourbar-problem/4", "")
    file, right = (
        PROBLEMS / "newton_128.json",
        read_stored("newton_128")["answers"]["F43"],
    )
    assert names["find_error"](file, "F43", right) <= 0.0
    wrong = [right[0], [1.01 * x for x in right[1]], *right[2:]]
    assert 1e-4 < names["find_error"](file, "F43", wrong) < 1e-2


def test_the_page_has_the_data_the_letters_and_a_figure_of_every_problem():
    written = runpy.run_path(str(ROOT / "docs/benchmark.py"))
    for name, words in {"benchmark.md": 2800, "findings.md": 1750}.items():
        page = (ROOT / "docs" / name).read_text(encoding="utf-8")
        assert page == written["text"](name), "python docs/benchmark.py"
        assert len(page.split()) <= words
    page = (ROOT / "docs/benchmark.md").read_text(encoding="utf-8")
    assert sorted(written["BLOCK"].findall(page)) == sorted([*NAMES, "matrix"])
    assert {file.stem for file in (ROOT / "docs/benchmark").glob("*.svg")} == set(NAMES)


def test_the_proposed_problem_rests_and_swings_as_its_page_says():
    mp = pytest.importorskip("mpmath").mp
    page = (
        (ROOT / "docs/benchmark.md")
        .read_text(encoding="utf-8")
        .partition("## Proposed")[2]
    )
    scene = fourbar.load(PROBLEMS.parent / "proposed" / "diagonal_spring.toml")
    (rest,) = [
        row
        for row in fourbar.equilibrium(scene).found
        if row.stability == "stable" and row.place.theta_2 < 3.0
    ]
    with mp.workdps(30):
        energy = lambda x: (  # noqa: E731
            2 * mp.mpf("9.81") * mp.sin(x)
            + 25 * (2 * mp.cos(x / 2) - mp.sqrt(2)) ** 2 / 2
        )
        angle = mp.findroot(lambda x: mp.diff(energy, x), mp.mpf("2.2"))
        stiffness, inertia, damping = (
            mp.diff(energy, angle, 2),
            mp.mpf(5) / 3,
            mp.sin(angle / 2) ** 2,
        )
        root = (-damping + mp.sqrt(damping**2 - 4 * inertia * stiffness)) / (
            2 * inertia
        )
        frequency = mp.sqrt(stiffness / inertia) / (2 * mp.pi)
    assert abs(rest.place.theta_2 - float(angle)) < 1e-12 and math.isclose(
        rest.frequency,
        frequency,
        rel_tol=1e-9,
    )
    assert abs(float(angle) - 2.23433101898) < 5e-11
    for text in (
        f"{float(angle):.12f}",
        f"{float(frequency):.6f}",
        f"{float(root.real):.9f} ± {float(root.imag):.9f}i",
        f"{float(stiffness):.9f}",
    ):
        assert text in page


def make_result(name, **answers):
    return {
        "schema": RESULT,
        "problem": name,
        "engine": "mine",
        "answers": {**read_stored(name)["answers"], **answers},
    }


@pytest.mark.parametrize(
    ("error", "level"),
    [(0.0, "A"), (5e-10, "A"), (5e-7, "B"), (5e-4, "C"), (5e-3, "D")],
)
def test_a_level_is_that_of_the_worst_position(error, level):
    torque = list(read_stored("newton_128")["answers"]["torque"])
    torque[7] += error * max(map(abs, torque))
    levels = find_levels(
        judge_answers(
            read_stored("newton_128"), make_result("newton_128", torque=torque)
        )
    )
    assert levels == {"motion": "A", "reactions": "A", "torque": level}


@pytest.mark.parametrize(
    "torque", [None, [], [1.0], "x", [[1.0, 2.0]] * 37, [math.nan] * 37]
)
def test_an_answer_that_is_none_has_no_level(torque):
    assert (
        find_levels(
            judge_answers(
                read_stored("newton_128"), make_result("newton_128", torque=torque)
            )
        )["torque"]
        == "-"
    )


def test_error_bars_are_allowed_where_they_are_larger():
    problem = read_stored("near_limit")
    torque, bars = (
        np.array(problem["answers"]["torque"]),
        np.array(problem["errors"]["torque"]),
    )
    assert (bars > LEVELS["A"] * np.abs(torque).max()).any()
    assert (
        find_levels(
            judge_answers(
                problem,
                make_result("near_limit", torque=(torque + 0.9 * bars).tolist()),
            )
        )["torque"]
        == "A"
    )


def test_an_answer_at_its_own_motion_is_judged_there():
    problem = read_stored("crank_rocker")
    scene, command = read_question("crank_rocker")
    moved = command._replace(
        angle=command.angle + 1e-3,
        speed=np.full(len(command.angle), 10.01),
    )
    theirs = fourbar.solve(scene, at=moved)
    answers = {name: getattr(theirs, name).tolist() for name in problem["answers"]}
    answer_file = {
        **make_result("crank_rocker", **answers),
        "at": protocol.command_to_json(scene, moved),
    }
    assert set(find_levels(judge_answers(problem, answer_file)).values()) == {"A"}
    del answer_file["at"]
    assert set(find_levels(judge_answers(problem, answer_file)).values()) != {"A"}


def test_the_command_judges_a_result_file(tmp_path, capsys):
    file, problem = tmp_path / "mine.json", str(PROBLEMS / "newton_128.json")
    file.write_text(json.dumps(make_result("newton_128")))
    assert status(["check", problem, str(file)]) == 0
    assert "levels: motion A, torque A, reactions A" in capsys.readouterr().out
    del (wrong := make_result("newton_128"))["answers"]["F43"]
    file.write_text(json.dumps(wrong))
    assert status(["check", problem, str(file)]) == 1
    assert "no answer" in capsys.readouterr().out
    for text in ("{", "[]", '{"schema": "fourbar-result/1", "answers": {}}'):
        file.write_text(text)
        assert status(["check", problem, str(file)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_the_archive_holds_the_set_and_is_the_same_bytes_each_time(tmp_path):
    for name in ("one.zip", "two.zip"):
        assert lab_status(["problems", "--archive", str(tmp_path / name)]) == 0
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "two.zip").read_bytes()
    names = {
        Path(name).name for name in zipfile.ZipFile(tmp_path / "one.zip").namelist()
    }
    assert {f"{name}.json" for name in NAMES} | {
        f"{name}.svg" for name in NAMES
    } <= names
    assert {"LICENSE", "CITATION.cff", "benchmark.md"} <= names
