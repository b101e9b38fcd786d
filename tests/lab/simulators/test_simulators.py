"""Simulators under test: what is checked, and the findings' scripts where their simulator is installed."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import fourbar
from fourbar.effects import Friction, Viscous
from fourbar.errors import LimitError
from fourbar.mjcf import write_mjcf
from fourbar.mjcf.assembly import write_sdf
from fourbar.quantities import PIN_FORCES
from fourbar.scene import command
from fourbar_lab.simulators import examine, motion, standing
from fourbar_lab.simulators.findings import read_findings
from fourbar_lab.simulators.standing import PROBLEM
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.processes import Ended
from tests.whole.test_imports import ROOT, imported

EXACT = 1e-10
"""Of single states of MuJoCo with the generated file; measured 2e-12."""
THROUGH = 1e-5
"""Of a turn in 157 steps with the generated file; measured 4e-7."""

DIFFERENCES = 1e-5
"""Of MuJoCo's torques (1e-12) over 2e-6; measured 5e-7."""

IN_EXUDYN = 1e-3
"""Of a turn in 314 steps of its trapezoidal rule; measured 1.2e-4."""

IN_PINOCCHIO = {True: 1e-6, False: 5e-3}
"""Of a turn in 314 steps, by RK4 (measured 2e-7) and by the semi-implicit Euler method (3.3e-3)."""

JUDGES = {"examine.py", "problems.py"}
"""The modules that state or judge by the formulas; every other hands things to a simulator."""


@pytest.fixture
def sealed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The writers of model files have no formulas: what a simulator receives is the simulator's own assembly."""

    def refused(*_: Any, **__: Any) -> None:
        raise AssertionError("a simulator would receive what the formulas computed")

    monkeypatch.setattr("fourbar.mjcf.document.solve", refused)


@pytest.mark.usefixtures("sealed")
def test_a_subject_starts_from_its_own_assembly_without_the_formulas() -> None:
    for path in (path for path in (ROOT / "validation/fourbar_lab/simulators").glob("*.py") if path.name not in JUDGES):
        assert not {name for name in imported(path) if name.startswith(("fourbar.solve", "fourbar.formulas"))}, path
        assert not {name for name in imported(path) if name.endswith(("at_start", "mjcf_for"))}, path
        assert "fourbar.solve" not in path.read_text(), path
    for branch in (1, -1):
        scene = fourbar.load(PROBLEM)
        scene = replace(scene, motion=scene.motion.replace(branch=branch, speed=-10.0 * branch))
        begin = motion.start(scene)
        assert write_mjcf(scene, start=begin).count("<key ") == 1 and "coupler" in write_sdf(scene, "drake", begin)
        theta = (begin.qpos[0], begin.qpos[0] + begin.qpos[1], begin.qpos[2])
        assert motion.compute_gap(scene, theta) < 1e-15 and np.sin(theta[2] - theta[1]) * branch > 0.0
        assert begin.qpos[0] == (math.tau if branch > 0 else 0.0) and begin.qvel[0] == -10.0 * branch


def test_a_subject_is_judged_on_the_branch_of_its_scene() -> None:
    scene = fourbar.load(PROBLEM)
    scene = replace(scene, motion=scene.motion.replace(branch=-1))
    found = FreeBody().answer(scene, command(scene)).quantities
    reading = {"theta": np.column_stack([command(scene).theta_2, found["theta_3"], found["theta_4"]]).tolist()}
    reading |= {"omega_2": [10.0] * 25, "alpha_2": [0.0] * 25, "torque": found["torque"].tolist()}
    errors = examine.compute_errors(scene, {**reading, "forces": {"F43": found["F43"].tolist()}})
    assert max(errors.values()) < EXACT


@pytest.mark.usefixtures("sealed")
def test_mujoco_answers_at_states_and_through_a_turn() -> None:
    mujoco_c = pytest.importorskip("fourbar_lab.simulators.mujoco_c", exc_type=ImportError)
    scene = fourbar.load(PROBLEM)
    setting = "generated file"
    readings = [mujoco_c.states(scene, setting), mujoco_c.through(scene, 157, setting)]
    answer = {"version": "", "readings": [each.plain() for each in readings]}
    at_states, through = examine.compare_lines(scene, "MuJoCo", json.loads(json.dumps(answer)))
    assert set(at_states.errors) == {"torque", *PIN_FORCES} == set(through.errors)
    assert max(at_states.errors.values()) < EXACT < max(through.errors.values()) < THROUGH
    assert at_states.cost is None and through.cost is not None and through.gap < THROUGH


@pytest.mark.usefixtures("sealed")
def test_each_solver_of_pinocchio_carries_the_loop() -> None:
    simulated = pytest.importorskip("fourbar_lab.simulators.pinocchio_simulated", exc_type=ImportError)
    scene = fourbar.load(PROBLEM)
    for setting in simulated.SETTINGS:
        found = examine.compute_errors(scene, simulated.through(scene, 314, setting).plain())
        assert set(found) == {"torque", *PIN_FORCES} and max(found.values()) < IN_PINOCCHIO["RK4" in setting], setting
        if "RK4" in setting:
            found = examine.compute_errors(scene, simulated.states(scene, setting).plain())
            assert max(found.values()) < IN_PINOCCHIO[True], setting
        else:
            assert simulated.states(scene, setting) is None


def test_derivatives_of_the_torque_are_compared_at_the_simulators_own_state() -> None:
    """By differences of what MuJoCo itself answers along the changes that a differentiable simulator is given."""
    mujoco_c = pytest.importorskip("fourbar_lab.simulators.mujoco_c", exc_type=ImportError)
    from fourbar_lab.simulators import gradients

    scene = fourbar.load(PROBLEM)
    _, theta_2 = gradients.choose_quarter(scene)

    def answered(at: gradients.ClosedState) -> motion.Instant:
        at.data.qpos[:], at.data.qvel[:] = at.qpos, at.qvel
        found: motion.Instant = mujoco_c._evaluated(at.model, at.data)
        return found

    now, by = answered(gradients.assemble(scene, theta_2, "mujoco")), {}
    for key in gradients.list_keys(scene):
        more, less = (answered(at).torque for at in gradients.assemble_either_side(scene, theta_2, key, "mujoco"))
        by[key] = gradients.change(more, less)
    state = (theta_2, now.omega_2, now.alpha_2, now.torque)
    given = gradients.collect_answer(scene, "differences", state, by)
    zero = {**given, "how": "tape", "by": dict.fromkeys(by, 0.0)}
    answer = json.loads(json.dumps({"version": "4", "slopes": [given, zero, {"how": "refused"}]}))
    found = examine.slopes(scene, "MuJoCo", answer)
    assert set(found[0].errors) == {"torque", "lengths.coupler", "bars.coupler.mass", "motion.theta_2"}
    assert all(error is not None and error < DIFFERENCES for error in found[0].errors.values())
    table = standing.lay_out_derivatives(examine.Examination(slopes=found))
    assert table is not None and table["rows"][1][3:] == ["zero"] * 3 and table["rows"][2][1:] == ["refused"] + [""] * 4
    wrong = {**given, "by": {key: 1.1 * value for key, value in by.items()}}
    (line,) = examine.slopes(scene, "MuJoCo", {"version": "4", "slopes": [wrong]})
    assert all(line.errors[key] == pytest.approx(0.1, abs=DIFFERENCES) for key in by)


def test_a_wrong_a_missing_and_a_nan_reading_show() -> None:
    mujoco_c = pytest.importorskip("fourbar_lab.simulators.mujoco_c", exc_type=ImportError)
    scene = fourbar.load(PROBLEM)
    reading = json.loads(json.dumps(mujoco_c.states(scene, "generated file").plain()))
    reading["forces"]["F43"] = [[-x, -y] for x, y in reading["forces"]["F43"]]
    reading["forces"]["F12"][3][0] = math.nan
    reading["torque"] = reading["torque"][:-1]
    del reading["forces"]["F14"]
    found = examine.compute_errors(scene, reading)
    assert found["F43"] > 0.5 and np.isnan(found["F12"]) and np.isnan(found["torque"]) and "F14" not in found
    assert found["F32"] < EXACT


@pytest.mark.nightly
def test_exudyn_refuses_what_it_has_no_element_for() -> None:
    exudyn = pytest.importorskip("fourbar_lab.simulators.exudyn_simulated", exc_type=ImportError)
    scene, (_, setting) = fourbar.load(PROBLEM), exudyn.SETTINGS
    damped = replace(scene, effects=(*scene.effects, Viscous.at(B=0.01)))
    assert max(examine.compute_errors(damped, exudyn.through(damped, 314, setting).plain()).values()) < IN_EXUDYN
    with pytest.raises(LimitError, match="alone"):
        exudyn.through(replace(scene, effects=(Friction.at(B=0.01),)), 314, setting)


def test_a_simulator_that_diverges_has_its_lines_without_an_order() -> None:
    scene, n = fourbar.load(PROBLEM), 3
    readings = []
    for steps, torque in ((100, 1.0), (200, math.inf), (400, math.nan), (800, 1.0)):
        found = motion.Readings("its defaults", steps)
        for _ in range(n):
            found.read(scene, motion.Instant((1.0, math.nan, 2.0), 10.0, 0.0, torque, {}))
        readings.append(found.plain())
    lines = examine.compare_lines(scene, "subject", {"version": "", "readings": readings})
    assert lines[1].errors["torque"] == math.inf and math.isnan(lines[2].errors["torque"])
    assert all(math.isnan(line.gap) for line in lines) and not any(line.order for line in lines)


def of_a_turn(**changes: Any) -> str:
    """What a simulator says that stood still and forgot to read its torque, but for some changes."""
    n = motion.SAMPLES
    reading = {"setting": "s", "steps": 100, "theta": [[1.0, 2.0, 3.0]] * n, "omega_2": [10.0] * n}
    reading |= {"alpha_2": [0.0] * n, "torque": [1.0] * n, "forces": {}, "gap": 0.0, "seconds": 1.0}
    answer = {"version": "1", "changed": "-", "device": "CPU", "python": "3", "not_run": {"a batch": "no GPU here"}}
    return json.dumps({**answer, "apart": {"s": "not meant for it"}, "readings": [reading | changes]})


@pytest.mark.parametrize(
    ("stated", "why"),
    [
        ("", "JSONDecodeError"),  # it left early, as if all were well
        ("Simulation finished\x1b[2J", "JSONDecodeError"),
        ("[]", "TypeError"),
        ('{"readings": []}', "KeyError"),
        (of_a_turn(theta=[[1.0, 2.0]]), "ValueError"),
        (of_a_turn(theta=[], omega_2=[], alpha_2=[]), "ValueError"),
        (of_a_turn(omega_2=[10.0]), "ValueError"),
        (of_a_turn(torque=["much"]), "ValueError"),
        (of_a_turn(gap="none"), "TypeError"),
        (of_a_turn(forces=None), "AttributeError"),
    ],
)
def test_an_answer_that_cannot_be_read_is_left_out_and_the_page_goes_on(
    stated: str, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(examine, "SIMULATORS", {"one": ("One", "json"), "other": ("Other", "json")})
    monkeypatch.setattr(examine, "_has", lambda *_: True)
    answers = {"one": stated, "other": of_a_turn(torque=[math.nan] * motion.SAMPLES)}
    monkeypatch.setattr(examine, "start_harness", lambda line, **_: Ended(answers[line[3]], "", False, ""))
    found = examine.examine(fourbar.load(PROBLEM), PROBLEM, [Path(sys.executable)], 1.0)
    assert why in found.left_out["One"] and "\x1b" not in found.left_out["One"]
    (line,) = found.lines
    assert line.simulator == "Other" and math.isnan(line.errors["torque"]) and line.apart == "not meant for it"
    assert found.devices["Other"] == "CPU, Python 3" and found.left_out["Other, a batch"] == "no GPU here"


@pytest.mark.parametrize("name", ["theta", "omega_2", "alpha_2"])
def test_a_state_that_is_no_number_has_no_error_that_is_one(name: str) -> None:
    n = motion.SAMPLES
    answer = json.loads(of_a_turn(**{name: [[math.nan, 2.0, 3.0]] * n if name == "theta" else [math.nan] * n}))
    assert math.isnan(examine.compute_errors(fourbar.load(PROBLEM), answer["readings"][0])["torque"])


@pytest.mark.slow
def test_what_a_simulator_prints_is_no_part_of_its_answer(tmp_path: Path) -> None:
    (tmp_path / "loud.py").write_text(
        "import atexit, os\nfrom fourbar_lab.simulators.motion import Readings\nVERSION = CHANGED = '-'\n"
        "SETTINGS, STEPS = ['s'], [1]\natexit.register(print, 'bye')\n"
        "def through(scene, steps, setting):\n    print('hello'); os.write(1, b'there')\n    return Readings(setting)\n"
    )
    code = "import runpy, sys; from fourbar_lab import simulators as s; s.__path__.append(sys.argv.pop(1)); "
    code += "runpy.run_module('fourbar_lab.simulators.work', run_name='__main__', alter_sys=True)"
    line = [sys.executable, "-c", code, str(tmp_path), "loud", str(PROBLEM.absolute())]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["readings"][0]["setting"] == "s"
    assert "hello" in done.stderr and "bye" in done.stderr


LISTED = {"drake": ["1", "2", "3"], "exudyn": ["3", "4"]}


@pytest.mark.parametrize(
    ("error", "shown"),
    [(0.0573, "6 %"), (9.6e-4, "0.1 %"), (9.4e-4, "9e-4"), (4.26e-7, "4e-7"), (10.4, "1000 %"), (0.0, "0e+00")],
)
def test_an_error_has_one_digit(error: float, shown: str) -> None:
    assert standing.write_size(error) == shown and standing.write_size(math.nan) == "nan"


def test_the_page_is_written_and_names_what_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    line = examine.Line("MuJoCo", "4", "generated file", 157, {"torque": 1e-7, "F43": math.nan}, 1e-8, 0.01, 1.5)
    fine = replace(line, steps=314, errors={"torque": 4.4e-8, "F43": 0.012})
    aside = replace(fine, setting="slack", errors={"torque": 0.99}, apart="not meant for it")
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    given = examine.Examination([line, fine, aside], {"MuJoCo": "nothing"}, {"MuJoCo": "CPU, Python 3"})
    given.made_for["MuJoCo"] = "many worlds"
    given.left_out["PyBullet"] = "not installed under any --python"
    monkeypatch.setattr("fourbar_lab.simulators.standing.examine", lambda *_: given)
    stated = [(finding, f"mended in {number}") for number, finding in enumerate(read_findings())]
    monkeypatch.setattr("fourbar_lab.simulators.standing.run_findings", lambda *_: stated)
    done = CliRunner().invoke(standing.command, ["--out", str(tmp_path)], catch_exceptions=False)
    assert done.exit_code == 0 and "not examined: PyBullet" in done.output
    for name in ("standing.html", "standing.md"):
        text = (tmp_path / name).read_text()
        for each in ("1e-7", "nan", "PyBullet", "generated file: F43 alone and torque to 1 % in 314 steps.", "slack",
                     "CPU, Python 3; made for many worlds; here one world", "CPU, Python 3; not meant for it",
                     *(finding.script.name for finding, _ in stated), *(state for _, state in stated)):  # fmt: skip
            assert each in text, each
        assert text.index("in 314 steps.") < text.index("157 steps") < text.index("Apart") < text.rindex("slack")
    assert len(standing.HEAD) <= 12
    assert (tmp_path / "standing.csv").read_text().splitlines()[1].startswith("MuJoCo,4,generated file,157,1e-07,")


COARSE = 0.05
"""Of a turn in the fewest steps that each simulator is examined with; measured 2e-2 and less."""


COARSE_OF = {"newton_kamino": 0.2}
"""Single precision and of first order; measured 9.7e-2 in 157 steps."""


@pytest.mark.nightly
@pytest.mark.usefixtures("sealed")
@pytest.mark.parametrize("module", examine.SIMULATORS)
def test_each_simulator_that_is_installed_carries_the_loop(module: str) -> None:
    name, library = examine.SIMULATORS[module]
    try:
        found = find_spec(library)
    except ModuleNotFoundError:
        found = None
    if found is None:
        pytest.skip(f"not run: {name} is not installed")
    scene, simulator = fourbar.load(PROBLEM), import_module(f"fourbar_lab.simulators.{module}")
    reading = simulator.through(scene, simulator.STEPS[0], next(iter(simulator.SETTINGS))).plain()
    assert max(examine.compute_errors(scene, reading).values()) < COARSE_OF.get(module, COARSE)
