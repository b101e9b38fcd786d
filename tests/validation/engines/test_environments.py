"""Engines in environments of their own.

Read from engines.toml, installed once, and judged side by side.
"""

import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

import fourbar
from fourbar.errors import DependencyError, InputError
from fourbar.scene import command as list_positions
from fourbar_validation.compare.rows import AGREES
from fourbar_validation.engines import environments
from fourbar_validation.engines.environments import (
    Entry,
    make_environment,
    read_engines,
    start_engine,
)
from fourbar_validation.engines.guests import adjust_engines
from fourbar_validation.engines.processes import Ended
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.engines.table import choose_engines, fill_table
from fourbar_validation.regression.record import describe_run
from fourbar_validation.run.judge import judge
from tests.support.guests import end_guests
from tests.support.scenes import crank_rocker

CLASS = """
from fourbar_validation.engines.free_body import FreeBody

class Toy:
    name, version = "toy", "VERSION"

    def answer(self, scene, at):
        answer = FreeBody().answer(scene, at)
        answer.quantities["torque"] = FACTOR * answer.quantities["torque"]
        return answer
"""


@pytest.fixture(autouse=True)
def _ended():
    yield
    end_guests()


def write_wheel(folder, version, factor):
    """A release of "toy-engine"; its address for pip."""
    info = f"toy_engine-{version}.dist-info"
    files = {
        "toy_engine.py": CLASS.replace("VERSION", version).replace("FACTOR", factor),
        f"{info}/METADATA": (
            f"Metadata-Version: 2.1\nName: toy-engine\nVersion: {version}\n"
        ),
        f"{info}/WHEEL": (
            "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag:"
            " py3-none-any\n"
        ),
    }
    files[f"{info}/RECORD"] = "".join(
        f"{name},,\n" for name in (*files, f"{info}/RECORD")
    )
    path = folder / f"toy_engine-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return f"toy-engine @ {path.as_uri()}"


@pytest.mark.slow
def test_two_versions_are_judged_side_by_side(tmp_path, monkeypatch):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    made = make_environment
    monkeypatch.setattr(
        environments, "make_environment", lambda entry: made(entry, tmp_path / "cache")
    )
    tables = [
        f'[[engine]]\nname = "toy {version}"\nadapter = "toy_engine:Toy"\n'
        f'requires = ["{write_wheel(tmp_path, version, factor)}"]\n'
        for version, factor in (("1.0", "1.0"), ("1.1", "1.001"))
    ]
    (tmp_path / "engines.toml").write_text("\n".join(tables))
    engines = choose_engines("free-body, toy 1.0, toy 1.1", fill_table([tmp_path]))
    assert [engine.name for engine in engines] == ["free-body", "toy 1.0", "toy 1.1"]
    assert describe_run(engines, "").versions.items() >= {
        ("toy 1.0", "1.0"),
        ("toy 1.1", "1.1"),
    }
    scene = crank_rocker(motion=fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0))
    failed = {
        (row.engine, row.quantity)
        for row in judge("scene", scene, engines).rows
        if row.verdict != AGREES
    }
    assert failed == {("toy 1.1", "torque")}
    # an environment that is there is not made again; one that pip cannot make is one
    # line
    monkeypatch.setattr(environments, "run_to_end", None)
    assert made(read_engines([tmp_path])["toy 1.0"], tmp_path / "cache").startswith(
        str(tmp_path / "cache")
    )


@pytest.mark.slow
def test_an_environment_that_cannot_be_made_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    with pytest.raises(
        DependencyError,
        match=r"^none: its environment cannot be made: .*no-such-thing",
    ):
        make_environment(
            Entry("none", adapter="a:B", requires=("no-such-thing==1",)), tmp_path
        )
    with pytest.raises(DependencyError, match="no no-such-python is found"):
        make_environment(
            Entry("none", adapter="a:B", python="no-such-python"), tmp_path
        )
    assert (
        make_environment(Entry("here", adapter="free-body"), tmp_path) == sys.executable
    )


def test_an_environment_is_filled_by_its_own_pip(tmp_path, monkeypatch):
    """The environment that runs may have been made by uv, and have none."""
    lines = []

    def fails_at_pip(line):
        lines.append(list(map(str, line)))
        return Ended("", "", failed="pip" in lines[-1], last="stop")

    monkeypatch.setattr(environments, "run_to_end", fails_at_pip)
    with pytest.raises(DependencyError, match="none: its environment cannot be made"):
        make_environment(Entry("none", adapter="a:B", requires=("x",)), tmp_path)
    (made, filled) = lines
    assert made[:3] == [sys.executable, "-m", "venv"]
    assert "--without-pip" not in made
    assert Path(filled[0]).is_relative_to(tmp_path)
    assert filled[-2:] == ["install", "x"]


def test_an_adapter_of_ours_is_held_to_what_it_is_held_to_here():
    (ours,) = [engine for engine in ENGINES if engine.name == "mujoco-simulated"]
    guest = start_engine(Entry("mine", adapter="mujoco-simulated"), like=ours)
    assert (guest.name, guest.tolerance, guest.through_time, guest.residuals) == (
        "mine",
        ours.tolerance,
        True,
        True,
    )
    assert guest.version and not guest.generated


@pytest.mark.slow
def test_an_engine_is_asked_for_its_steps_an_error_or_a_setting():
    pytest.importorskip("mujoco")
    entry = Entry("mine", adapter="mujoco-simulated", steps=(48, 96))
    scene = crank_rocker(
        motion=fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0),
        loads=(),
    )
    simulated, free_body = (
        next(engine for engine in ENGINES if engine.name == name)
        for name in ("mujoco-simulated", "free-body")
    )
    guest = start_engine(entry, like=simulated)
    (wanted,) = adjust_engines([guest], 1e-3)
    refused = start_engine(replace(entry, setting="fast"), like=simulated)
    exact = start_engine(Entry("free", adapter="free-body"), like=free_body)
    commanded = list_positions(scene)
    assert guest.start().answer(scene, commanded).setting == "RK4 96/rev"
    answer = wanted.start().answer(scene, commanded)
    assert answer.evidence["wanted_error"] == 1e-3 and answer.setting != "RK4 96/rev"
    assert (
        refused.start().answer(scene, commanded).refusal
        == "the engine's hello does not list 'fast' in settings"
    )
    assert (
        adjust_engines([exact], 1e-3)[0].start().answer(scene, commanded).setting
        == "exact"
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[[engine]", "is no TOML"),
        ("engine = [1]", "must be a table"),
        ('[[engine]]\nadapter = "free-body"', "with a name"),
        ('[[engine]]\nname = "a"', "must have an adapter or a command"),
        (
            '[[engine]]\nname = "a"\nadapter = "b"\ncommand = ["c"]',
            "must have an adapter or a command",
        ),
        (
            '[[engine]]\nname = "a"\ncommand = "c"',
            "engine.command = 'c': allowed: name",
        ),
        (
            '[[engine]]\nname = "a"\nsteps = [1.5]',
            "engine.steps = [1.5]: allowed: name",
        ),
        (
            '[[engine]]\nname = "a"\nadaptor = "c"',
            "engine.adaptor = 'c': allowed: name",
        ),
    ],
)
def test_what_is_no_entry_is_named_with_its_file(text, words, tmp_path):
    (tmp_path / "engines.toml").write_text(text)
    with pytest.raises(InputError) as error:
        read_engines([tmp_path])
    assert words in str(error.value) and str(error.value).startswith(
        str(tmp_path / "engines.toml")
    )


def test_a_name_that_is_nobody_s_is_refused_with_those_that_are_known():
    with pytest.raises(
        InputError,
        match=r"must be among pinocchio-inverse, .*mujoco 3\.3\.7",
    ):
        choose_engines("nobody")
