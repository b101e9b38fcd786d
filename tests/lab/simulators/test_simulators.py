"""Simulators as engines of the protocol.

What each is given, how a run is laid out, what is judged of its answer.
"""

import json
import math
from dataclasses import replace
from importlib.util import find_spec
from io import BytesIO
from typing import Any, ClassVar

import numpy as np
import pytest

import fourbar
from fourbar.effects import Friction, Viscous
from fourbar.errors import LimitError, NotAssembledError
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.assembly import write_sdf
from fourbar.quantities import PIN_FORCES
from fourbar.scene import Command
from fourbar_lab import benchmark
from fourbar_lab.simulators import gradients, motion, mujoco_c
from fourbar_lab.simulators.motion import Instant, Simulator
from fourbar_lab.simulators.problems import PROBLEMS
from fourbar_validation.check.problem import judge_answers, read_problem
from fourbar_validation.engine import open_engine, serve
from fourbar_validation.engines import protocol
from fourbar_validation.engines.environments import read_engines_of
from fourbar_validation.engines.free_body import FreeBody
from tests.support.scenes import low_parallelogram
from tests.whole.test_imports import ROOT, imported

EXACT = 1e-10
"""Of single states of MuJoCo with the generated file; measured 2e-12."""
THROUGH = 1e-5
"""Of a turn in 157 steps with the generated file; measured 4e-7."""
DIFFERENCES = 1e-5
"""Of MuJoCo's torques (1e-12) over 2e-6; measured 5e-7."""
IN_EXUDYN = 1e-3
"""Of a turn in 314 steps of its trapezoidal rule; measured 1.6e-4."""
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


ALL = {"theta_3", "theta_4", "torque", *PIN_FORCES}


def ask_position(problem=PROBLEM, **changes):
    """Read scene and command of a problem, some entries of which are changed."""
    scene = protocol.scene_from_json(problem["scene"])
    return protocol.command_from_json(scene, problem["command"] | changes)


def find_errors(simulator, **setting):
    """Errors of a simulator's answer, each read back from the protocol's JSON."""
    scene, command = ask_position()
    answer = simulator().at_setting(**setting).answer(scene, command)
    assert answer.refusal is None, answer.refusal
    data = json.loads(json.dumps(protocol.answer_to_json(scene, command, answer)))
    return {row.quantity: row.error for row in judge_answers(PROBLEM, data)}


@pytest.fixture
def sealed(monkeypatch):
    """The writers of model files have no formulas.

    What a simulator receives is the simulator's own assembly.
    """

    def refused(*_, **__):
        raise AssertionError("a simulator would receive what the formulas computed")

    monkeypatch.setattr("fourbar.mjcf.document.solve", refused)


@pytest.mark.usefixtures("sealed")
def test_a_simulator_starts_from_its_own_assembly_without_the_formulas():
    paths = {*(ROOT / "lab/fourbar_lab/simulators").glob("*.py")}
    handing = [path for path in paths if path.name not in JUDGES]
    assert len(handing) > 10
    for path in handing:
        formulas = ("fourbar.solving", "fourbar.formulas")
        assert not [name for name in imported(path) if name.startswith(formulas)], path
        assert "fourbar.solving" not in path.read_text(), path
    for branch in (1, -1):
        scene = fourbar.load(PROBLEMS / "crank_rocker.toml")
        scene = replace(
            scene,
            motion=scene.motion.replace(branch=branch, speed=-10.0 * branch),
        )
        begin = motion.start(scene)
        assert write_mjcf(scene, start=begin).count("<key ") == 1
        assert "coupler" in write_sdf(scene, "drake", begin)
        theta = (begin.qpos[0], begin.qpos[0] + begin.qpos[1], begin.qpos[2])
        assert motion.compute_gap_at_B(scene, theta) < 1e-15
        assert np.sin(theta[2] - theta[1]) * branch > 0.0
        assert begin.qpos[0] == (math.tau if branch > 0 else 0.0)
        assert begin.qvel[0] == -10.0 * branch


def test_beyond_a_change_point_a_simulator_starts_in_the_assembly_that_is_stated():
    """Of a parallelogram bars 2 and 4 stay parallel there, and the coupler level."""
    scene = low_parallelogram()
    for qpos in (
        motion.start(scene).qpos,
        *(q for q, _ in mujoco_c.states_of(write_mjcf(scene), scene)),
        gradients.compile_and_assemble(scene, 4.0, "mujoco").qpos,
    ):
        theta_2, of_3_to_2, theta_4 = qpos
        level = theta_2 + of_3_to_2 - scene.linkage.ground_angle
        assert abs(math.remainder(theta_4 - theta_2, math.tau)) < 1e-12
        assert abs(math.remainder(level, math.tau)) < 1e-12


class Rigid(Simulator):
    """A simulator that is the free bodies at the end of each step.

    A test changes it.
    """

    name, version, device = "rigid", "1", "abacus"
    made_for, changed = "tests", "nothing"
    settings: ClassVar[dict[str, Any]] = {"plain": 1.0, "wrong": 1.1}
    left_out = ""
    diverges_at = math.inf

    def through(self, scene, course):
        begin, speed, done = motion.start(scene), scene.motion.omega_2 or 0.0, 0

        def advance(steps):
            nonlocal done
            done += steps
            return begin.qpos[0] + speed * done * course.timestep

        def read(theta):
            branch = np.array([scene.motion.branch], dtype=np.int8)
            command = Command(np.array([theta]), branch, speed, 0.0)
            exact = FreeBody().answer(scene, command).quantities
            angles = [float(exact[name][0]) for name in ("theta_3", "theta_4")]
            if done > self.diverges_at:
                angles[0] = math.nan
            read = [name for name in PIN_FORCES if name != self.left_out]
            forces = {name: exact[name][0] for name in read}
            torque = self.settings[self.setting] * float(exact["torque"][0])
            return Instant((theta, *angles), speed, 0.0, torque, forces)

        return motion.run_through(scene, course, advance, read)


def test_a_run_is_judged_at_the_motion_that_it_made():
    errors = find_errors(Rigid, steps_per_turn=50)
    assert max(errors.values()) < EXACT and {*errors} == ALL
    assert find_errors(Rigid, name="wrong")["torque"] == pytest.approx(0.1, abs=1e-9)


def test_a_run_begins_before_its_first_position_where_the_linkage_closes():
    scene, command = ask_position()
    for sense, begin, rows in ((1, -0.5, range(25)), (-1, 2.5, range(24, -1, -1))):
        motion_back = scene.motion.replace(speed=10.0 * sense)
        led, course = motion.lay_out(
            replace(scene, motion=motion_back),
            command._replace(speed=10.0 * sense),
            100,
        )
        assert motion.start(led).qpos[0] == pytest.approx(begin * math.pi)
        assert course.stops[-1] == 125 and course.rows.tolist() == [*rows]
        assert course.timestep == pytest.approx(math.tau / 10.0 / 100)
    # 30 degrees from a change point
    scene, command = ask_position(read_problem(PROBLEMS / "pinocchio_2729.json"))
    led, course = motion.lay_out(scene, command, 628)
    assert 0.1 < motion.start(led).qpos[0] < command.theta_2[0] - 0.1
    assert course.stops[0] > 1


@pytest.mark.parametrize(
    "changes",
    [
        {"alpha_2": 1.0},
        {"branch": [1, -1] * 12 + [1]},
        {"omega_2": 0.0},
        {"theta_2": [1.0, 1.0001] * 12},
    ],
)
def test_a_motion_that_no_simulator_makes_is_a_refusal(changes):
    answer = Rigid().answer(*ask_position(**changes))
    assert answer.refusal is not None and answer.setting == "plain, 628/rev"


def test_a_run_that_diverges_or_stops_is_no_answer(monkeypatch):
    monkeypatch.setattr(Rigid, "diverges_at", 100)
    with pytest.raises(ArithmeticError, match="diverged"):
        Rigid().answer(*ask_position())
    monkeypatch.setattr(motion.Readings, "read", lambda *_: None)
    with pytest.raises(NotAssembledError, match="0 of 25 positions were read"):
        Rigid().answer(*ask_position())


def test_a_force_that_is_not_read_is_missing_and_the_others_count(monkeypatch):
    monkeypatch.setattr(Rigid, "left_out", "F43")
    errors = find_errors(Rigid)
    assert np.isnan(errors.pop("F43")) and max(errors.values()) < EXACT


@pytest.mark.slow
def test_the_host_serves_a_simulator_its_settings_and_derivatives(monkeypatch):
    told = {key: PROBLEM[key] for key in ("scene", "command")}

    def tell(ask, **more):
        replies = BytesIO()
        question = {"id": 1, "ask": ask, **told, **more}
        serve(f"{__name__}:Rigid", BytesIO(json.dumps(question).encode()), replies)
        return json.loads(replies.getvalue())

    hello = open_engine(f"{__name__}:Rigid")[1]
    assert hello["settings"] == ["plain", "wrong"]
    assert (hello["device"], hello["made_for"]) == ("abacus", "tests")
    for setting, key, made in (
        (None, "setting", "plain, 628/rev"),
        ({"name": "wrong"}, "setting", "wrong, 628/rev"),
        ({"name": "wrong", "steps_per_turn": 50}, "setting", "wrong, 50/rev"),
        ({"name": "no"}, "refusal", "it has no setting 'no'; it has"),
        ({"error": 0.1}, "refusal", "it knows no law of its error"),
        ({"steps": 3}, "error", "setting = {'steps': 3}"),
    ):
        assert made in tell("answer", setting=setting)[key]
    assert tell("slopes") == {"id": 1, "refusal": "it has no derivatives"}
    by_hand = [{"how": "by hand"}]
    monkeypatch.setattr(Rigid, "slopes", lambda *_: by_hand, raising=False)
    assert tell("slopes") == {"id": 1, "slopes": by_hand}


def load_adapter(name):
    module, _, cls = name.partition(":")
    assert find_spec(module) is not None
    return getattr(pytest.importorskip(module, exc_type=ImportError), cls)


@pytest.mark.usefixtures("sealed")
def test_mujoco_answers_at_states_and_through_a_turn():
    simulator = load_adapter("fourbar_lab.simulators.mujoco_c:MujocoFile")
    at_states, through = (
        find_errors(simulator, steps_per_turn=steps) for steps in (None, 157)
    )
    assert {*at_states} == {*through} == ALL
    assert max(at_states.values()) < EXACT < max(through.values()) < THROUGH
    assert find_errors(simulator, name="its defaults")["torque"] > THROUGH


@pytest.mark.usefixtures("sealed")
def test_each_solver_of_pinocchio_carries_the_loop():
    name = "fourbar_lab.simulators.pinocchio_simulated:PinocchioSolvers"
    simulator = load_adapter(name)
    for setting in simulator.settings:
        accurate = setting in ("constraintDynamics", "lcaba")
        errors = find_errors(simulator, name=setting, steps_per_turn=314)
        assert max(errors.values()) < IN_PINOCCHIO[accurate], setting
        if accurate:
            at_states = find_errors(simulator, name=setting)
            assert max(at_states.values()) < IN_PINOCCHIO[True], setting
        else:
            answer = simulator().at_setting(name=setting).answer(*ask_position())
            assert answer.refusal == "an impulse solver has no single states"


def test_derivatives_of_the_torque_are_compared_at_the_simulators_own_state():
    """By differences of what MuJoCo itself answers along the changes.

    A differentiable simulator is given these changes.
    """
    scene = fourbar.load(PROBLEMS / "crank_rocker.toml")
    _, theta_2 = gradients.choose_quarter(scene)

    def answered(state):
        state.data.qpos[:], state.data.qvel[:] = state.qpos, state.qvel
        return mujoco_c._evaluate_mujoco(state.model, state.data)

    now, by = answered(gradients.compile_and_assemble(scene, theta_2, "mujoco")), {}
    for key in gradients.list_keys(scene):
        more, less = (
            answered(state).torque
            for state in gradients.assemble_either_side(scene, theta_2, key, "mujoco")
        )
        by[key] = gradients.change(more, less)
    state = (theta_2, now.omega_2, now.alpha_2, now.torque)
    right = gradients.collect_answer(scene, "differences", state, by)
    wrong = {**right, "by": {key: 1.1 * value for key, value in by.items()}}
    zero = {**right, "by": dict.fromkeys(by, 0.0)}
    slopes = json.loads(json.dumps([right, wrong, zero, {"how": "refused"}, {}]))
    compared = benchmark.compare_slopes(PROBLEM, slopes)
    (_, found), (_, tenth), (_, zeros), refused, unread = compared
    assert {*found} == {"torque", *by} and "motion.theta_2" in by
    assert all(float(error) < DIFFERENCES for error in found.values())
    assert all(float(tenth[key]) == pytest.approx(0.1, abs=1e-3) for key in by)
    assert {zeros[key] for key in by} == {"zero"} and refused == ("refused", {})
    assert unread == ("no derivatives that can be read: KeyError: 'how'", {})


@pytest.mark.nightly
def test_exudyn_refuses_what_it_has_no_element_for():
    cls = load_adapter("fourbar_lab.simulators.exudyn_simulated:ExudynIntegrators")
    scene, command = ask_position()
    _, setting = cls.settings
    steps = {"name": setting, "steps_per_turn": 314}
    assert max(find_errors(cls, **steps).values()) < IN_EXUDYN
    simulator = cls().at_setting(**steps)
    damped = replace(scene, effects=(*scene.effects, Viscous.at(B=0.01)))
    answer = simulator.answer(damped, command)
    ours = fourbar.solve(damped, "force", at=answer.at).torque
    apart = np.abs(answer.quantities["torque"] - ours).max()
    assert apart < IN_EXUDYN * np.abs(ours).max()
    dry = replace(scene, effects=(Friction.at(B=0.01),))
    with pytest.raises(LimitError, match="alone"):
        simulator.through(*motion.lay_out(dry, command, 314))


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.usefixtures("sealed")
@pytest.mark.parametrize(
    "name", [name for name, entry in ENTRIES.items() if entry.steps]
)
def test_each_simulator_that_is_installed_carries_the_loop(name):
    entry = ENTRIES[name]
    simulator = load_adapter(entry.adapter)
    setting = entry.setting or None
    errors = find_errors(simulator, name=setting, steps_per_turn=entry.steps[1])
    bound = simulator.tolerance[0] if "tolerance" in vars(simulator) else COARSE
    assert errors["torque"] < bound
    not_read = np.nan
    assert not errors.get("F43", not_read) > bound
