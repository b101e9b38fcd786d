"""What a scene does not name does not exist: nothing of it in the formulas, in the MJCF or in the compiled model."""

import ast
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import fourbar
from fourbar import effects
from fourbar.effects import FILE_OF, Friction, Viscous
from fourbar.mjcf import write_mjcf
from fourbar_validation.engines.mujoco.closed_loop import open_model
from fourbar_validation.report.record import Record
from fourbar_validation.run.judge import judge
from tests.support.scenes import crank_rocker
from tests.validation.engines.test_effects import ACTING

ROOT = Path(fourbar.__file__).parent.parent
KINDS = {getattr(effects, name).key: getattr(effects, name) for name in (*FILE_OF, "Load")}
"""Everything that can act, by key."""
TABLES = ("files/effects.py", "mjcf/effects.py")
"""Of the package, where an effect has a row."""
PROBE = """
import hashlib, json, sys
sys.path.insert(0, sys.argv[1])
import fourbar
from fourbar.mjcf import write_mjcf
link = fourbar.FourBar(0.3, fourbar.Bar(0.1, 0.2), fourbar.Bar(0.25, 0.5, 0.004, (0.13, 0.3)), fourbar.Bar(0.22, 0.4))
scene = fourbar.Scene(link, fourbar.Motion(fourbar.Sweep(0.1, 6.3, 60), 10.0, 5.0))
fourbar.solve(scene)
calls = []
def note(frame, event, argument):
    if event == "call" and "fourbar" in frame.f_code.co_filename:
        calls.append(frame.f_code.co_qualname)
sys.setprofile(note)
solution = fourbar.solve(scene)
sys.setprofile(None)
numbers = {name: hashlib.sha256(getattr(solution, name).tobytes()).hexdigest() for name in solution.evaluated()}
print(json.dumps({"file": fourbar.__file__, "numbers": numbers, "calls": calls, "mjcf": write_mjcf(scene)}))
"""
"""What a checkout makes of a scene without effects: digests of every array, the calls made, the MJCF."""


def build(folder: Path, without: str | None = None) -> Path:
    """Copy the package; without the file, the registration, the rows and the names of an effect where one is named."""
    copy = folder / "fourbar"
    shutil.copytree(ROOT / "fourbar", copy, ignore=shutil.ignore_patterns("__pycache__", "page", "plot"))
    if without is None:
        return folder
    effect = KINDS[without]
    name, module = effect.__name__, effect.__module__.rpartition(".")[2]
    (copy / "effects" / f"{module}.py").unlink()
    gone = (f"import {name} as {name}", f'"{name}": "{module}",', f'), "{module}"),')
    for path in (copy / "__init__.py", copy / "effects" / "__init__.py"):
        lines = [line for line in path.read_text().splitlines() if f".{module} import" not in line]
        lines = [line for line in lines if not line.endswith(gone)]
        path.write_text(re.sub(rf'"{name}", |\b{name}, |, {name}(?=\))', "", "\n".join(lines)) + "\n")
    for table in TABLES:
        path = copy / table
        path.write_text(without_row(path.read_text(), without))
    return folder


def without_row(text: str, key: str) -> str:
    """A module without the rows that its tables have under a key."""
    lines = text.splitlines(keepends=True)
    for table in ast.walk(ast.parse(text)):
        if isinstance(table, ast.Dict):
            for name, row in zip(table.keys, table.values, strict=True):
                if isinstance(name, ast.Constant) and name.value == key:
                    lines[name.lineno - 1 : row.end_lineno] = [""] * (row.end_lineno - name.lineno + 1)  # type: ignore[operator]
    return "".join(lines)


def made(root: Path) -> dict[str, object]:
    """What a checkout makes of the bare scene: bits, calls, MJCF."""
    line = [sys.executable, "-c", PROBE, str(root)]
    done = subprocess.run(line, cwd=root, check=True, capture_output=True, text=True)
    answer: dict[str, object] = json.loads(done.stdout)
    assert Path(str(answer.pop("file"))).is_relative_to(root)
    return answer


def differences(whole: dict[str, object], other: dict[str, object]) -> list[str]:
    """What a build makes otherwise than the whole one, in words."""
    texts = {"numbers": "bits of the results", "mjcf": "bytes of the MJCF", "calls": "list of the terms that run"}
    found = [text for key, text in texts.items() if whole[key] != other[key]]
    one, two = (contents(str(answer["mjcf"])) for answer in (whole, other))
    return found + [f"{key} of the compiled model" for key in one if one[key] != two[key]]


def contents(text: str) -> dict[str, object]:
    """The compiled model: sizes, rows of its constraints at the keyframe, flags, and the whole of it as bytes."""
    model, data = open_model(text)
    whole = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
    mujoco.mj_saveModel(model, None, whole)
    sizes = {name: int(getattr(model, name)) for name in ("nv", "neq", "nu", "ntendon", "nsensor", "njnt")}
    flags = {"disabled": int(model.opt.disableflags), "enabled": int(model.opt.enableflags)}
    return {**sizes, "nefc": int(data.nefc), **flags, "bytes": whole.tobytes()}


@pytest.fixture(scope="module")
def whole() -> dict[str, object]:
    return made(ROOT)


@pytest.mark.slow
@pytest.mark.parametrize("key", KINDS)
def test_a_build_that_never_heard_of_an_effect_gives_the_same_bits(
    key: str, whole: dict[str, object], tmp_path: Path
) -> None:
    other = build(tmp_path, key)
    assert not any(f'"{key}": ' in (other / "fourbar" / table).read_text() for table in TABLES)
    assert differences(whole, made(other)) == []


def test_a_build_that_pays_for_an_absent_effect_is_noticed(whole: dict[str, object], tmp_path: Path) -> None:
    """One that runs a term of size zero, and one whose MJCF leaves a flag on."""
    other = build(tmp_path)
    solver, model = other / "fourbar" / "evaluation" / "case.py", other / "fourbar" / "mjcf" / "model.py"
    text = solver.read_text()
    changed = text.replace("(*scene.loads, *scene.effects)", "(Viscous.at(O2=0.0), *scene.loads, *scene.effects)")
    assert changed != text
    solver.write_text(changed + "\n\nfrom fourbar.effects import Viscous\n")
    text = model.read_text()
    assert '"island", ' in text
    model.write_text(text.replace('"island", ', ""))
    found = differences(whole, made(other))
    assert "list of the terms that run" in found and "bytes of the MJCF" in found
    assert "disabled of the compiled model" in found


def test_no_term_of_an_effect_runs_in_a_scene_without_effects(whole: dict[str, object]) -> None:
    calls = whole["calls"]
    assert isinstance(calls, list) and "inertia_wrenches" in calls
    names = {*FILE_OF, "Load", "torque_interval", "solve_sliding"}
    assert not [call for call in calls if names & set(call.split("."))]


def test_an_effect_that_is_named_runs() -> None:
    """The check above could fail: the same profile sees the term where the scene has it."""
    calls = []

    def note(frame, event, argument):  # type: ignore[no-untyped-def]
        if event == "call":
            calls.append(frame.f_code.co_qualname)

    sys.setprofile(note)
    fourbar.solve(crank_rocker(loads=(), effects=(Viscous.at(O2=0.1),)))
    sys.setprofile(None)
    assert "Viscous.act" in calls and "Gravity.act" not in calls


def compiled(*names: str) -> mujoco.MjModel:
    effects = tuple(ACTING[name] for name in names)
    return mujoco.MjModel.from_xml_string(write_mjcf(crank_rocker(loads=(), effects=effects)))


def rows(model: mujoco.MjModel) -> int:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return int(data.nefc)


def disabled(model: mujoco.MjModel) -> set[str]:
    flags = mujoco.mjtDisableBit
    return {
        name.removeprefix("mjDSBL_").lower()
        for name in flags.__members__
        if name != "mjNDISABLE" and model.opt.disableflags & int(flags.__members__[name])
    }


BARE = {"contact", "limit", "island", "sensor", "spring", "damper", "frictionloss"}


def test_the_bare_model_has_the_closed_loop_and_nothing_else() -> None:
    model = compiled()
    assert (model.nv, model.neq, model.nu, model.ntendon, model.nsensor, model.njnt) == (3, 1, 1, 0, 0, 3)
    assert rows(model) == 3  # connect has three, the third of them empty in the plane
    assert disabled(model) == BARE
    assert not model.opt.gravity.any() and not model.dof_damping.any() and not model.dof_frictionloss.any()
    assert not (model.opt.enableflags or model.geom_contype.any() or model.jnt_limited.any())


@pytest.mark.parametrize(
    ("name", "enabled", "more_rows", "tendons", "actuators"),
    [
        ("gravity", set(), 0, 0, 1),
        ("viscous", {"damper"}, 0, 1, 1),
        ("friction", {"frictionloss"}, 4, 1, 1),
        ("torsion", {"spring"}, 0, 1, 1),
        ("springs", {"spring"}, 0, 5, 3),  # a constant force, and one that pulls at every length, is an actuator
        ("flywheel", set(), 0, 0, 1),
    ],
)
def test_each_effect_adds_what_it_needs_and_no_more(
    name: str, enabled: set[str], more_rows: int, tendons: int, actuators: int
) -> None:
    model = compiled(name)
    assert (model.nv, model.neq, model.nu, model.nsensor) == (3, 1, actuators, 0)
    assert disabled(model) == BARE - enabled
    assert rows(model) == 3 + more_rows
    assert model.ntendon == tendons  # one at the cut pin B, one for each linear spring


def test_an_effect_of_zero_size_is_still_named() -> None:
    """A torque of 0 that the scene writes down is the scene's; what it leaves out is not there at all."""
    named = write_mjcf(crank_rocker(loads=(), effects=(Friction.at(A=0.0),)))
    assert "frictionloss=" in named and 'frictionloss="0.0"' not in write_mjcf(crank_rocker(loads=(), effects=()))


POSITIONS_ONLY = """
import sys
import fourbar
from fourbar_validation.run.judge import judge
link = fourbar.uniform(0.3, 0.1, 0.25, 0.22)
record = judge("scene", fourbar.Scene(link, fourbar.Motion(fourbar.Sweep(0.0, 6.0, 20))))
print(sorted(name for name in ("mujoco", "pinocchio") if name in sys.modules))
print(*record.left_out, sep="\\n")
print(*sorted({row.engine for row in record.rows}))
"""


@pytest.mark.slow
def test_positions_alone_start_no_force_engine() -> None:
    done = subprocess.run([sys.executable, "-c", POSITIONS_ONLY], capture_output=True, text=True, check=True, cwd=ROOT)
    engines, *left_out, answered = done.stdout.splitlines()
    assert engines == "[]" and answered == "formulas free-body"
    assert {line.split(":")[0] for line in left_out} == {"pinocchio-inverse", "mujoco-inverse", "mujoco-simulated"}
    assert all("the scene states positions only" in line for line in left_out)


def moved(*motion: Any) -> Record:
    return judge("scene", fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.25, 0.22), fourbar.Motion(*motion)))


@pytest.mark.parametrize(
    ("motion", "reason"),
    [
        ((fourbar.Sweep(0.0, 6.0, 20), 0.0), "omega_2 is 0: nothing moves through time"),
        ((1.0, 2.0), "one position is no motion through time"),
    ],
)
def test_what_does_not_move_through_time_is_not_simulated(motion: tuple[Any, float], reason: str) -> None:
    record = moved(*motion)
    assert record.left_out == [f"mujoco-simulated: {reason}"]
    assert {row.engine for row in record.rows} == {"formulas", "free-body", "mujoco-inverse", "pinocchio-inverse"}


def test_equal_positions_are_evaluated_once() -> None:
    assert "positions: all are the same, one is evaluated" in moved([1.0, 1.0, 1.0], 2.0).left_out
