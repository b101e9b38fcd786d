"""Simulators as engines of the protocol.

What each is given, how a run is laid out, what is judged of its answer.
"""

import json
import re
from importlib.util import find_spec
from math import remainder, tau

import numpy as np
from pytest import approx, fixture, importorskip, mark

from fourbar import load
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.assembly import write_sdf
from fourbar.quantities import PIN_FORCES
from fourbar_lab import benchmark
from fourbar_lab.simulators import (
    gradients,
    mujoco_c,
    pinocchio_simulated,
    protocol_engines,
)
from fourbar_lab.simulators.problems import PROBLEMS
from fourbar_validation.check.problem import judge_answers, read_problem
from fourbar_validation.engines import protocol
from fourbar_validation.engines.environments import read_engines_of
from tests.support.checkout import ROOT
from tests.support.scenes import low_parallelogram, recommand

EXACT = 1e-10
"""Of single states of MuJoCo with the generated file; measured 2e-12."""
THROUGH = 1e-5
"""Of a turn in 157 steps with the generated file; measured 4e-7."""
DIFFERENCES = 1e-5
"""Of MuJoCo's torques (1e-12) over 2e-6; measured 5e-7."""
IN_PINOCCHIO = {True: 1e-6, False: 5e-3}
"""Of a turn in 314 steps, by RK4 (measured 2e-7) and by the semi-implicit Euler method
(3.8e-3).
"""
COARSE = 0.05
"""Of torque and F43 in the middle number of steps of each simulator's entry; measured
3.8e-2 and less.
"""
JUDGES = {"problems.py"}
"""Modules that state the formulas' answers; every other hands things to a simulator."""
PROBLEM = read_problem(PROBLEMS / "crank_rocker.json")
ENTRIES = {
    name: entry
    for name, entry in read_engines_of(benchmark.BENCHMARKED_ENGINES).items()
    if "simulators" in entry.adapter
}


READ = {"theta_3", "theta_4", "torque", *PIN_FORCES}


def ask_position(problem="crank_rocker"):
    stated = read_problem(PROBLEMS / f"{problem}.json")
    scene = protocol.scene_from_json(stated["scene"])
    return protocol.command_from_json(scene, stated["command"])


def find_errors(simulator, **setting):
    """Errors of a simulator's answer, each read back from the protocol's JSON."""
    scene, command = ask_position()
    answer = simulator().at_setting(**setting).answer(scene, command)
    assert answer.refusal is None
    data = json.loads(json.dumps(protocol.answer_to_json(scene, command, answer)))
    return {row.quantity: row.error for row in judge_answers(PROBLEM, data)}


@fixture
def sealed(monkeypatch):
    """The writers of model files have no formulas.

    What a simulator receives is the simulator's own assembly.
    """
    monkeypatch.delattr("fourbar.mjcf.document.solve")


@mark.usefixtures("sealed")
def test_a_simulator_starts_from_its_own_assembly_without_the_formulas():
    paths = [
        path
        for path in (ROOT / "lab/fourbar_lab/simulators").glob("*.py")
        if path.name not in JUDGES
    ]
    assert len(paths) > 10
    for path in paths:
        formulas = r"fourbar(\.| import .*)(solving|formulas)"
        assert not re.search(formulas, path.read_text()), path
    scene = load(PROBLEMS / "crank_rocker.toml")
    for branch, first in ((1, tau), (-1, 0.0)):
        moved = recommand(scene, branch=branch, speed=-10.0 * branch)
        begin = protocol_engines.start(moved)
        assert write_mjcf(moved, start=begin).count("<key ") == 1
        assert "coupler" in write_sdf(moved, "drake", begin)
        theta = protocol_engines.bar_directions(begin.qpos)
        assert protocol_engines.compute_gap_at_B(moved, theta) < 1e-15
        assert np.sin(theta[2] - theta[1]) * branch > 0.0
        assert (begin.qpos[0], begin.qvel[0]) == (first, -10.0 * branch)


def test_beyond_a_change_point_a_simulator_starts_in_the_assembly_that_is_stated():
    """Of a parallelogram bars 2 and 4 stay parallel there, and the coupler level."""
    scene = low_parallelogram()
    for qpos in (
        protocol_engines.start(scene).qpos,
        *(q for q, _ in mujoco_c.states_of(write_mjcf(scene), scene)),
        gradients.compile_and_assemble(scene, 4.0, "mujoco").qpos,
    ):
        theta_2, of_3_to_2, theta_4 = qpos
        level = theta_2 + of_3_to_2 - scene.linkage.ground_angle
        assert abs(remainder(theta_4 - theta_2, tau)) < 1e-12
        assert abs(remainder(level, tau)) < 1e-12


@mark.usefixtures("sealed")
def test_mujoco_answers_at_states_and_through_a_turn():
    at_states = find_errors(mujoco_c.MujocoFile)
    through = find_errors(mujoco_c.MujocoFile, steps_per_turn=157)
    assert set(at_states) == READ == set(through)
    assert max(at_states.values()) < EXACT < max(through.values()) < THROUGH
    assert find_errors(mujoco_c.MujocoFile, name="its defaults")["torque"] > THROUGH


@mark.usefixtures("sealed")
@mark.parametrize("setting", ["constraintDynamics", "lcaba", "ADMM", "PGS"])
def test_each_solver_of_pinocchio_carries_the_loop(setting):
    solvers = pinocchio_simulated.PinocchioSolvers
    accurate = setting in ("constraintDynamics", "lcaba")
    errors = find_errors(solvers, name=setting, steps_per_turn=314)
    assert max(errors.values()) < IN_PINOCCHIO[accurate]
    if accurate:
        assert max(find_errors(solvers, name=setting).values()) < IN_PINOCCHIO[True]
    else:
        answer = solvers().at_setting(name=setting).answer(*ask_position())
        assert answer.refusal == "an impulse solver has no single states"


def test_derivatives_of_the_torque_are_compared_at_the_simulators_own_state():
    """By differences of what MuJoCo itself answers along the changes.

    A differentiable simulator is given these changes.
    """
    scene = load(PROBLEMS / "crank_rocker.toml")
    _, theta_2 = gradients.choose_quarter(scene)

    def answered(state):
        state.data.qpos[:], state.data.qvel[:] = state.qpos, state.qvel
        return mujoco_c.reading(state.model, mujoco_c.evaluate(state.model, state.data))

    now = answered(gradients.compile_and_assemble(scene, theta_2, "mujoco"))
    by = {}
    for key in gradients.list_keys(scene):
        sides = gradients.assemble_either_side(scene, theta_2, key, "mujoco")
        by[key] = gradients.change(*(answered(state).torque for state in sides))
    state = (theta_2, now.omega_2, now.alpha_2, now.torque)
    right = gradients.collect_answer(scene, "differences", state, by)
    wrong = {**right, "by": {key: 1.1 * value for key, value in by.items()}}
    zero = {**right, "by": dict.fromkeys(by, 0.0)}
    slopes = json.loads(json.dumps([right, wrong, zero, {"how": "refused"}, {}]))
    compared = benchmark.compare_slopes(PROBLEM, slopes)
    (_, of_right), (_, of_wrong), (_, of_zero), refused, unread = compared
    assert set(of_right) == {"torque", *by} and "motion.theta_2" in by
    assert all(float(error) < DIFFERENCES for error in of_right.values())
    assert all(float(of_wrong[key]) == approx(0.1, abs=1e-3) for key in by)
    assert {of_zero[key] for key in by} == {"zero"}
    assert refused == ("refused", {})
    assert unread == ("no derivatives that can be read: KeyError: 'how'", {})


@mark.slow
@mark.nightly
@mark.usefixtures("sealed")
@mark.parametrize("name", [name for name, entry in ENTRIES.items() if entry.steps])
def test_each_simulator_that_is_installed_carries_the_loop(name):
    entry = ENTRIES[name]
    module, _, cls = entry.adapter.partition(":")
    assert find_spec(module) is not None
    simulator = getattr(importorskip(module, exc_type=ImportError), cls)
    setting = {"name": entry.setting or None, "steps_per_turn": entry.steps[1]}
    allowed = COARSE
    if "tolerance" in vars(simulator):
        allowed, _ = simulator.tolerance
    errors = find_errors(simulator, **setting)
    assert errors["torque"] < allowed and not errors.get("F43", np.nan) > allowed
