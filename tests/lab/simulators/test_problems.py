"""Files of the set of problems are up to date, and its answers are those of derivations
that share no code with them.
"""

import json
import os
import re
import runpy
from dataclasses import replace
from functools import cache
from math import isclose, nan, pi, sin, sqrt

import numpy as np
from jsonschema import Draft202012Validator
from mpmath import mp
from pytest import mark
from scipy import integrate, special

import fourbar
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command
from fourbar_lab.simulators.problems import (
    PROBLEMS,
    _measure_period,
    collect_problem,
    list_problems,
)
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
from fourbar_validation.engines.balls import BallArithmetic
from fourbar_validation.engines.free_body import FreeBody
from tests.lab.simulators.test_simulators import ask_position
from tests.support.checkout import ROOT, read
from tests.support.rows import slow_but

PAGE = read("docs/benchmark.md")
NAMES = list_problems()
APART = 2.0
"""Error bars between the answers of two CPUs."""
LONG = () if os.environ.get("PROBLEMS") == "all" else ("iftomm_a02",)
"""Motions that take seconds to compute again; their values are held in any case."""
SLIDING = ("slider_crank", "slider_crank_offset")


@cache
def read_stored(name):
    """Read a problem as it stands in the tree."""
    return read_problem(PROBLEMS / f"{name}.json")


def find_distance(first, second):
    """Return the distance between two answers at each position."""
    apart = np.asarray(first, dtype=float) - np.asarray(second, dtype=float)
    return magnitude(np.atleast_1d(apart))


def assert_agreement(name, answers, share=0.0):
    """Assert that each answer lies within its error bar.

    The bar is widened by a share of the largest value for its derivation.
    """
    problem = read_stored(name)
    compared = problem["answers"].keys() & answers.keys()
    assert len(compared) >= 4
    for quantity in sorted(compared):
        values = problem["answers"][quantity]
        apart = find_distance(values, answers[quantity])
        size = find_distance(values, 0.0).max()
        if quantity.startswith("theta"):
            apart = np.minimum(apart, abs(apart - 2.0 * pi))
            size = 1.0
        allowed = np.asarray(problem["errors"][quantity]) + share * size
        assert (apart <= allowed).all(), quantity


def test_there_are_fifteen_and_their_files_agree():
    assert len(NAMES) == 15
    assert {file.stem for file in PROBLEMS.glob("*.json")} == {*NAMES}


@mark.slow
@mark.parametrize("name", [name for name in NAMES if name not in LONG])
def test_the_files_are_those_of_today(name):
    old, new = read_stored(name), json.loads(json.dumps(collect_problem(name)))
    assert old["schema"] == PROBLEM_SCHEMA
    assert old["answers"].keys() == new["answers"].keys() == old["errors"].keys()
    for key in ("title", "source", "conventions", "mechanism", "ask", "units"):
        assert old[key] == new[key]

    def find_numbers(problem):
        text = json.dumps([problem["scene"], problem["command"]])
        return np.array(re.findall(r"-?\d[\d.e+-]*", text), dtype=float)

    np.testing.assert_allclose(*map(find_numbers, (old, new)), rtol=K * EPS, atol=1e-9)
    for quantity, values in old["answers"].items():
        bar = np.asarray(old["errors"][quantity])
        apart = find_distance(values, new["answers"][quantity])
        assert (bar > 0.0).all() and (apart <= APART * bar).all(), quantity


@mark.parametrize("name", slow_but(set(NAMES) - {"iftomm_a02"}, NAMES))
def test_a_problem_is_what_the_schema_says(name):
    schema = json.loads(read("docs/protocol.schema.json"))
    check = Draft202012Validator({"$ref": "#/$defs/problem", "$defs": schema["$defs"]})
    problem = json.loads(read(PROBLEMS / f"{name}.json"))
    check.validate(problem)
    for wrong in ("given", "scene"):
        assert not check.is_valid({**problem, wrong: {}})


@mark.parametrize("name", sorted({*NAMES} - {"gz_physics_987", "iftomm_a02", *SLIDING}))
def test_ninety_digits_or_free_bodies_answer_the_same(name):
    by_bodies = name in ("cylinder", "pin_friction")
    engine = FreeBody if by_bodies else BallArithmetic
    answers = engine().answer(*ask_position(name)).quantities
    least = abs(answers["sin_mu"]).min()
    assert_agreement(name, answers, by_bodies * K * EPS / least**2)


def slide(scene, place, omega, alpha):
    """Answer a slider-crank by virtual work.

    The motion as functions of the crank's angle, which are differentiated in many
    digits. Each displacement tells one unknown: the crank's turn the torque, the rod's
    turn about A and the slider's along its guide the force at B, the slider's across it
    the guide's, and those of a bar as a whole the forces at its first pin.
    """
    a, b, e = (mp.mpf(scene["lengths"][name]) for name in ("crank", "rod", "offset"))
    weight = mp.mpc(0, -scene["effects"]["gravity"][0])
    inertias, arms = [], []
    for name, length in (("crank", a), ("rod", b)):
        stated = scene["bars"][name]
        r, phi = stated.get("centre", (length / 2, 0.0))
        inertias.append(stated.get("inertia", stated["mass"] * length**2 / 12))
        arms.append(r * mp.expj(phi))

    def psi(angle):
        return mp.asin((e - a * mp.sin(angle)) / b)

    def turn(angle):
        return mp.expj(angle), mp.expj(psi(angle))

    def find_rates(place_of):
        first, second = (mp.diff(place_of, place, order) for order in (1, 2))
        return first, alpha * first + omega**2 * second

    def work(force, displaced):
        return mp.re(force * mp.conj(displaced))

    u, v = turn(place)
    growth, alpha_3 = find_rates(psi)
    torque = inertias[0] * alpha + inertias[1] * alpha_3 * growth
    ends = {"crank": (arms[0], 0), "rod": (a, arms[1]), "slider": (a, b)}
    p = []
    for name, along in ends.items():
        moved, acceleration = find_rates(lambda x, c=along: mp.fdot(c, turn(x)))
        force = scene["bars"][name]["mass"] * (acceleration - weight)
        if name == "slider":
            loads = (load["force"] for load in scene.get("loads", ()))
            force -= sum(size * mp.expj(angle) for size, angle in loads)
        torque += work(force, moved)
        p.append(force)
    turned = work(p[1], 1j * arms[1] * v) + inertias[1] * alpha_3
    F43 = mp.mpc(-p[2].real, (turned - p[2].real * b * v.imag) / (b * v.real))
    F32 = F43 - p[1]
    F12 = p[0] - F32
    forces = {"F12": F12, "F32": F32, "F43": F43}
    return {name: [x.real, x.imag] for name, x in forces.items()} | {
        "theta_3": psi(place),
        "stroke": mp.re(a * u + b * v),
        "torque": torque,
        "guide_force": p[2].imag + F43.imag,
    }


@mark.parametrize("name", SLIDING)
def test_virtual_work_answers_the_slider_cranks_the_same(name):
    problem = read_stored(name)
    command = problem["command"]
    with mp.workdps(60):
        rates = mp.mpf(command["omega_2"]), mp.mpf(command["alpha_2"])
        places = map(mp.mpf, command["theta_2"])
        rows = [slide(problem["scene"], place, *rates) for place in places]
    assert rows[0].keys() == problem["answers"].keys()
    assert_agreement(name, {key: [row[key] for row in rows] for key in rows[0]})


def pendulum(problem):
    """Return k in theta'' = -k cos theta, and the energy.

    The energy of a released parallelogram is theta'^2/2 + k sin theta.
    """
    scene, start = problem["scene"], problem["command"]
    bars, length = scene["bars"], scene["lengths"]["input"]
    inertia = bars["coupler"]["mass"] * length**2
    moment = bars["coupler"]["mass"] * length
    for bar in (bars["input"], bars["output"]):
        mass, (arm, _) = bar["mass"], bar.get("centre", [0.5 * length, 0.0])
        inertia += bar.get("inertia", mass * length**2 / 12.0) + mass * arm**2
        moment += mass * arm
    k = scene["effects"]["gravity"][0] * moment / inertia
    return k, start["omega_2"] ** 2 / 2.0 + k * sin(start["theta_2"])


def test_gazebos_four_bar_swings_as_a_pendulum():
    problem = read_stored("gz_physics_987")
    answers, errors = problem["answers"], problem["errors"]
    rate = sqrt(pendulum(problem)[0])
    modulus = sin(0.5 * (problem["command"]["theta_2"] + 0.5 * pi))
    quarter = special.ellipk(modulus**2)
    apart = abs(answers["frequency"] - rate / (4.0 * quarter))
    assert apart <= errors["frequency"] < 1e-9
    assert f"{answers['frequency']:.10f}" == "0.7504113317"
    phase = quarter - rate * np.asarray(problem["times"])
    sn, cn, _, _ = special.ellipj(phase, modulus**2)
    theta = 2.0 * np.arcsin(modulus * sn) - 0.5 * pi
    omega = -2.0 * modulus * rate * cn
    forces = solve_pin_forces(problem, theta, omega)
    assert_agreement("gz_physics_987", {"theta_2": theta, "omega_2": omega} | forces)


@mark.parametrize("samples", [60, 61])
def test_a_period_lies_between_passages_at_samples_or_between_them(samples):
    time = np.linspace(-0.5, 2.5, samples + 1)
    turn = 2.0 * pi * time
    rates = 2.0 * pi * np.cos(turn), -4.0 * pi**2 * np.sin(turn)
    assert isclose(_measure_period(time, np.sin(turn), *rates), 1.0, rel_tol=1e-9)


def test_a02_passes_every_angle_when_energy_says():
    problem = read_stored("iftomm_a02")
    answers, errors = problem["answers"], problem["errors"]
    k, energy = pendulum(problem)
    theta, time = np.asarray(answers["theta_2"]), problem["times"]
    speed = -np.sqrt(2.0 * (energy - k * np.sin(theta)))
    forces = solve_pin_forces(problem, theta, speed)
    assert_agreement("iftomm_a02", {"omega_2": speed} | forces)
    assert len(time) == 401 and time[-1] == 20.0

    def seconds_per_radian(x):
        return -1.0 / sqrt(2.0 * (energy - k * sin(x)))

    accuracy = {"epsabs": 1e-12, "epsrel": 1e-12, "limit": 200}
    reached = 0.0
    for i in range(20, len(time), 20):
        part = theta[i - 20], theta[i]
        reached += integrate.quad(seconds_per_radian, *part, **accuracy)[0]
        assert abs(reached - time[i]) * abs(speed[i]) <= errors["theta_2"][i]


def solve_pin_forces(problem, theta, omega):
    """Solve the pin forces of a released parallelogram in many digits, N.

    Bars 2 and 4 are parallel, and no torque is needed at their own acceleration.
    """
    scene = protocol.scene_from_json(problem["scene"])
    branch = np.sign(np.sin(theta)).astype(np.int8)
    motion = Command(theta, branch, omega, -pendulum(problem)[0] * np.cos(theta))
    released = replace(scene, motion=fourbar.Motion(0.0, 0.0))
    answers = BallArithmetic().answer(released, motion).quantities
    forces = {name: answers[name] for name in PIN_FORCES}
    largest = max(abs(force).max() for force in forces.values())
    length = problem["scene"]["lengths"]["input"]
    assert abs(answers["torque"]).max() < K * EPS * largest * length
    return forces


def test_the_page_s_example_reads_an_answer_without_this_project():
    code = PAGE.partition("```python")[2].partition("```")[0]
    assert "fourbar" not in code.replace("fourbar-problem/4", "")
    names = {}
    exec(code, names)
    file = PROBLEMS / "newton_128.json"
    right = read_stored("newton_128")["answers"]["F43"]
    assert names["find_error"](file, "F43", right) <= 0.0
    wrong = [right[0], [1.01 * x for x in right[1]], *right[2:]]
    assert 1e-4 < names["find_error"](file, "F43", wrong) < 1e-2


def test_the_page_has_the_data_the_letters_and_a_figure_of_every_problem():
    written = runpy.run_path(ROOT / "docs/benchmark.py")
    for name, words in {"benchmark.md": 2800, "findings.md": 1750}.items():
        page = read(f"docs/{name}")
        assert page == written["text"](name), "python docs/benchmark.py"
        assert len(page.split()) <= words
    assert sorted(written["BLOCK"].findall(PAGE)) == sorted([*NAMES, "matrix"])
    assert {file.stem for file in (ROOT / "docs/benchmark").glob("*.svg")} == set(NAMES)


def test_the_proposed_problem_rests_and_swings_as_its_page_says():
    page = PAGE.partition("## Proposed")[2]
    scene = fourbar.load(PROBLEMS.parent / "proposed" / "diagonal_spring.toml")
    stable = (x for x in fourbar.equilibrium(scene).found if x.stability == "stable")
    (rest,) = (row for row in stable if row.place.theta_2 < 3.0)

    def energy(x):
        stretch = 2 * mp.cos(x / 2) - mp.sqrt(2)
        return 2 * mp.mpf("9.81") * mp.sin(x) + 25 * stretch**2 / 2

    with mp.workdps(30):
        angle = mp.findroot(lambda x: mp.diff(energy, x), mp.mpf("2.2"))
        stiffness, inertia = mp.diff(energy, angle, 2), mp.mpf(5) / 3
        decay = mp.sin(angle / 2) ** 2 / (2 * inertia)
        rate = mp.sqrt(stiffness / inertia - decay**2)
        frequency = mp.sqrt(stiffness / inertia) / (2 * mp.pi)
    assert abs(rest.place.theta_2 - float(angle)) < 1e-12
    assert isclose(rest.frequency, frequency, rel_tol=1e-9)
    for text in (
        f"{float(angle):.12f}",
        f"{float(frequency):.6f}",
        f"{float(-decay):.9f} ± {float(rate):.9f}i",
        f"{float(stiffness):.9f}",
    ):
        assert text in page


def make_result(name, **answers):
    answers = {**read_stored(name)["answers"], **answers}
    return {"schema": RESULT, "problem": name, "engine": "mine", "answers": answers}


def levels_of(name, **answers):
    """Return the levels of the right answers, some of which are others."""
    return find_levels(judge_answers(read_stored(name), make_result(name, **answers)))


def spoil(error):
    """Torques of newton_128, one off by a part of the largest."""
    torque = list(read_stored("newton_128")["answers"]["torque"])
    torque[7] += error * max(map(abs, torque))
    return torque


@mark.parametrize(
    "torque, level",
    [
        (spoil(0.0), "A"),
        (spoil(5e-10), "A"),
        (spoil(5e-7), "B"),
        (spoil(5e-4), "C"),
        (spoil(5e-3), "D"),
        (None, "-"),
        ([], "-"),
        ([1.0], "-"),
        ("x", "-"),
        ([[1.0, 2.0]] * 37, "-"),
        ([nan] * 37, "-"),
    ],
)
def test_a_level_is_that_of_the_worst_position(torque, level):
    levels = {"motion": "A", "reactions": "A", "torque": level}
    assert levels_of("newton_128", torque=torque) == levels


def test_error_bars_are_allowed_where_they_are_larger():
    problem = read_stored("near_limit")
    torque, bars = (np.array(problem[key]["torque"]) for key in ("answers", "errors"))
    assert (bars > LEVELS["A"] * abs(torque).max()).any()
    beside = (torque + 0.9 * bars).tolist()
    assert levels_of("near_limit", torque=beside)["torque"] == "A"


def test_an_answer_at_its_own_motion_is_judged_there():
    problem = read_stored("crank_rocker")
    scene, command = ask_position()
    speed = np.full(len(command.angle), 10.01)
    moved = command._replace(angle=command.angle + 1e-3, speed=speed)
    theirs = fourbar.solve(scene, at=moved)
    answers = {name: getattr(theirs, name).tolist() for name in problem["answers"]}
    answer_file = make_result("crank_rocker", **answers)
    answer_file["at"] = protocol.command_to_json(scene, moved)
    assert set(find_levels(judge_answers(problem, answer_file)).values()) == {"A"}
    del answer_file["at"]
    assert set(find_levels(judge_answers(problem, answer_file)).values()) != {"A"}


@mark.parametrize(
    "text, status_of_it, said",
    [
        (
            json.dumps(make_result("newton_128")),
            0,
            "levels: motion A, torque A, reactions A",
        ),
        (json.dumps(make_result("newton_128", F43=None)), 1, "no answer          0"),
        (
            json.dumps(make_result("newton_128", F43=[[1.0, 2.0]] * 5 + [None] * 32)),
            1,
            "no answer          5",
        ),
        (
            json.dumps(make_result("newton_128", torque=[1.0] * 38)),
            1,
            "no answer         37",
        ),
        ("{", 2, "error: "),
        ("[]", 2, "error: "),
        ('{"schema": "fourbar-result/1", "answers": {}}', 2, "error: "),
    ],
)
def test_the_command_judges_a_result_file(text, status_of_it, said, tmp_path, capsys):
    file = tmp_path / "mine.json"
    file.write_text(text)
    problem = str(PROBLEMS / "newton_128.json")
    assert status(["check", problem, str(file)]) == status_of_it
    printed = capsys.readouterr()
    assert said in printed.out + printed.err
    assert max(map(len, printed.out.splitlines()), default=0) <= 80
    assert printed.err.count("\n") == (status_of_it == 2)
