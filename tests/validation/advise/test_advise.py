"""Advice: the figures it reaches, the file it writes, and what it says where nothing
serves.
"""

import math
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from click.testing import CliRunner
from pytest import MonkeyPatch, approx, fixture, mark, raises

from fourbar import InputError, Motion, dump, load
from fourbar.scene import Command
from fourbar_lab.fault_scenes import FAULT_SCENES
from fourbar_validation.advise import advise, matters
from fourbar_validation.advise.matters import compute_errors
from fourbar_validation.compare.answer import Answer
from fourbar_validation.engines.guests import Guest, adjust_engines
from fourbar_validation.engines.mujoco.closed_loop import O2, ClosedLoop
from fourbar_validation.engines.mujoco.trial import JudgedSetup, compute_expected_error
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.run.judge import judge
from fourbar_validation.scenes.suites import MODELS
from tests.support.here import THROUGH_TIME
from tests.validation.cost.test_cost import turning
from tests.validation.engines.mujoco.test_simulate import hood


@fixture
def call(tmp_path):
    """Return a function that asks for advice on files of scenes, with options."""

    def run(scenes, *options):
        files = [str(tmp_path / f"{name}.toml") for name in scenes]
        for file, scene in zip(files, scenes.values(), strict=True):
            Path(file).write_text(dump(scene))
        line = [*files, "--error", *options]
        done = CliRunner().invoke(advise.advise_command, line, standalone_mode=False)
        return done.return_value, " ".join(done.output.split()), done

    return run


@mark.slow
@mark.parametrize(
    "omega, required, most",
    [(10.0, 1e-4, 75), (1000.0, 1e-6, 300), (100.0, 2e-9, 1000)],
)
def test_figures_of_the_crank_rocker(omega, required, most):
    advice = advise.advise(turning(omega, 72), required)
    assert advice.reached and advice.best.steps_per_revolution <= most, advice.reason
    assert advice.best.errors.worst <= required
    assert advice.best.settings.integrator == "RK4"
    serves = [
        attempt
        for attempt in advice.attempts
        if attempt.errors.worst <= advise.PART_OF_THE_ERROR * required
    ]
    assert advice.best in serves
    work = [attempt.steps * attempt.step_cost for attempt in serves]
    # readings count too, so that the fewest steps alone need not be the cheapest
    assert advice.best.steps * advice.best.step_cost <= 1.2 * min(work) < max(work)


@mark.slow
def test_the_solver_is_searched_too():
    """A solver that stops by itself takes a third of a step less, at the same error."""
    scene, required = turning(10.0, 72), 1e-4
    setup = JudgedSetup(scene)
    advice = advise.advise(scene, required, setup)
    settings = advice.best.settings
    assert settings != replace(settings, tolerance=0.0, iterations=10)
    assert advice.best.step_cost < 0.9
    # the speed ripples by about the inverse of the flywheel, and the advice says so
    assert advice.best.speed_error * settings.flywheel < 10.0
    assert f"vary by {advice.best.speed_error:.1e}" in advice.reason
    tight = replace(settings, tolerance=0.0, iterations=10, flywheel=1e5)
    error = matters.judge_trial(scene, setup.try_out(tight)).worst
    assert error == approx(advice.best.errors.worst, rel=0.5)


def test_a_drive_elsewhere_is_judged_between_the_steps_too():
    """Fourteen steps a turn hold the torque of bar 4 within 0.7 % at the steps, and
    miss 9 % between them.
    """
    scene = load(MODELS / "drag_link.toml")
    trial = JudgedSetup(scene).try_out(advise.make_settings(14.0, 3.0))
    assert compute_errors(scene, trial.at, trial.quantities).worst < 0.01
    assert matters.judge_trial(scene, trial).worst > 0.05


def test_no_curve_is_drawn_through_a_pole():
    """On the crank-rocker the torque of bar 4 has poles where the rocker reverses."""
    scene = replace(turning(), drive_bar=4)
    trial = JudgedSetup(scene).try_out(advise.make_settings(160.0, 20.0))
    assert len(matters.split_at_poles(scene, trial.at)) == 3
    assert matters.judge_trial(scene, trial).worst < 0.1


@mark.slow
@mark.parametrize(
    "name, most",
    # of the thesis errors between the steps decide
    [("double_rocker", 1000), ("triple_rocker", 1000), ("thesis", 1600)],
)
def test_figures_of_rockers_and_the_thesis(name, most):
    advice = advise.advise(load(MODELS / f"{name}.toml"), 1e-5)
    assert advice.reached, advice.reason
    assert max(advice.best.steps, advice.best.steps_per_revolution) <= most


@mark.slow
def test_the_file_alone_keeps_the_error(tmp_path, call):
    """What -o writes, loaded by nothing but its text.

    Reset to the keyframe and stepped for a revolution.
    """
    out = tmp_path / "out.xml"
    status, printed, _ = call({"scene": turning(positions=72)}, "1e-5", "-o", str(out))
    assert status == 0, printed
    loop = ClosedLoop(out.read_text())
    mujoco.mj_resetDataKeyframe(loop.model, loop.data, 0)
    steps = round(2.0 * math.pi / 10.0 / loop.model.opt.timestep)
    at, rows = [], []
    for _ in range(steps):
        mujoco.mj_step(loop.model, loop.data)
        loop.forward()
        at.append([loop.data.qpos[O2], loop.data.qvel[O2], loop.data.qacc[O2]])
        rows.append(loop.forces() | {"torque": loop.crank_torque()})
    columns = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    angle, *rates = np.transpose(at)
    commanded = Command(angle, np.ones(steps, dtype=np.int8), *rates)
    assert steps < 100 and compute_errors(turning(), commanded, columns).worst <= 1e-5


@mark.slow
def test_out_of_reach_is_reported_with_what_would_reach_it(tmp_path, monkeypatch, call):
    monkeypatch.setattr(advise, "MOST_STEPS_OF_A_RUN", 1500)
    still = replace(turning(), motion=Motion(1.0, 10.0))
    out = tmp_path / "none.xml"
    for scene, error, words in (
        (turning(positions=12), "1e-14", ("No setting of plain MJCF", "inverse dyn")),
        (still, "1e-3", ("nothing to run through",)),
        (FAULT_SCENES["law_periodic"], "1e-3", ("motion law",)),
    ):
        status, printed, _ = call({"scene": scene}, error, "-o", str(out))
        assert status == 1 and not out.exists()
        assert all(word in printed for word in words)


def test_a_predicted_error_that_is_no_number_is_no_small_one():
    values = {"torque": np.ones(2), "F12": np.ones((2, 2))}
    predicted = {"torque": np.full(2, 1e-9), "F12": np.array([1e-9, np.nan])}
    answer = Answer("", "", quantities=values, predicted=predicted)
    assert compute_expected_error(turning(), answer) == math.inf


@mark.parametrize("required", [0.0, 1.0, -1e-3, math.nan])
def test_an_error_is_between_0_and_1(required):
    for ask, asked in ((advise.advise, turning()), (adjust_engines, ENGINES)):
        with raises(InputError, match="above 0 and below 1"):
            ask(asked, required)


@mark.slow
@mark.parametrize("required", [1e-3, 1e-7])
def test_a_run_is_no_more_precise_than_required(required):
    record = judge("s", turning(positions=90), adjust_engines(THROUGH_TIME, required))
    assert not [row for row in record.rows if row.failed]
    (evidence,) = record.evidence.values()
    errors = [
        row.error
        for row in record.rows
        if row.engine == "mujoco-simulated" and row.quantity != "as shipped"
    ]
    assert evidence["wanted_error"] == required >= evidence["expected_error"]
    # the engine's own prediction is what the formulas find, though it never saw them
    assert max(errors) == approx(evidence["expected_error"], rel=0.5)
    assert evidence["steps"] < 628


def test_a_guest_is_asked_for_the_error_and_not_answered_for_by_the_harness():
    (simulated,) = THROUGH_TIME
    guest = Guest("mujoco 3.3.7", partial(dict), simulated.tolerance, through_time=True)
    ours, theirs, exact = adjust_engines(
        (simulated, guest, replace(guest, through_time=False)), 1e-3
    )
    assert ours.start != simulated.start
    assert theirs.start() == {"setting": {"error": 1e-3}} == exact.start()
    assert theirs.tolerance == ours.tolerance != exact.tolerance == guest.tolerance


def test_exact_engines_stay_exact():
    (changed,) = {*adjust_engines(ENGINES, 1e-3)} - {*ENGINES}
    assert changed.name == "mujoco-simulated"
    assert changed.tolerance.factor == 1e-3
    assert changed.answers == THROUGH_TIME[0].answers


@mark.slow
def test_what_matters_for_a_scene_is_measured_and_stated_with_its_reason():
    """Each scene is made so that one setting carries it."""
    for scene, setting, why in (
        (hood(0.01), "the stiffness by pads", "lighter of coupler and output"),
        (turning(10.0, 36), "the timestep", "the steps themselves"),
    ):
        first, *others = influences = matters.measure_influences(
            scene, JudgedSetup(scene), advise.make_settings(40.0, 12.0)
        )
        assert first.setting == setting and first.times > 10.0
        assert why in matters.write_sentence(influences)
        assert all(first.times >= influence.times for influence in others)
    quiet = [replace(influence, times=1.5) for influence in influences]
    assert matters.write_sentence(quiet).startswith("No setting matters by itself")


@mark.slow
def test_the_time_of_an_attempt_is_that_of_its_steps_and_readings():
    setup = JudgedSetup(turning(10.0, 36))
    attempt = advise.advise(turning(10.0, 36), 1e-2, setup).best
    clocks = (lambda count: 2e-6 * count), (lambda count: 3e-5 * count)
    with MonkeyPatch.context() as patch:
        patch.setattr(setup, "make_clocks", lambda *_: clocks)
        words = advise._describe_time(setup, attempt)
    revolution = 1e3 * (2e-6 * attempt.steps + 3e-5 * attempt.readings)
    second = revolution * 10.0 / math.tau  # at 10 rad/s
    assert f"{second:.2g} ms of processor time per simulated second" in words
    assert f"({revolution:.2g} ms per revolution): {attempt.steps} steps, and" in words


@mark.slow
def test_several_scenes_have_one_table(call):
    still = replace(turning(10.0, 36), motion=Motion(1.0, 1.0))
    scenes = {"one": turning(10.0, 36), "still": still}
    status, printed, done = call(scenes, "1e-4")
    assert status == 1  # one of them cannot be run through
    assert "timestep matters most here. If it is twice as long, the error is" in printed
    *_, first, second = map(str.split, done.output.replace("\n    ", " ").splitlines())
    assert first[0] == "one.toml" and second[:2] == ["still.toml", "-"]
    *_, done = call(scenes, "1e-4", "-o", "x.xml")
    assert "MJCF of one scene, not of 2" in str(done.exception)
