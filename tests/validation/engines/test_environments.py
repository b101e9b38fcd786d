"""Engines in environments of their own.

Read from engines.toml, installed once, and judged side by side.
"""

import re
import shutil
import sys
import zipfile
from pathlib import Path

from pytest import MonkeyPatch, fixture, mark, raises

import fourbar
from fourbar.errors import LONGEST_MESSAGE, DependencyError, InputError
from fourbar_validation.compare.rows import AGREES
from fourbar_validation.engines import environments
from fourbar_validation.engines.environments import (
    EngineEntry,
    choose_engines,
    fill_table,
    make_environment,
    read_engines,
)
from fourbar_validation.engines.programs import Ended
from fourbar_validation.regression.record import describe_run
from fourbar_validation.run.judge import judge
from tests.support.guests import end_guests
from tests.support.rows import read_rows, refused
from tests.support.scenes import crank_rocker

SCENE = crank_rocker(fourbar.Motion(fourbar.Sweep(0.1, 6.38, 8), 10.0), loads=())
CLASS = """
from fourbar_validation.engines.free_body import FreeBody

class Toy:
    name, version = "toy", "VERSION"

    def answer(self, scene, at):
        answer = FreeBody().answer(scene, at)
        answer.quantities["torque"] = FACTOR * answer.quantities["torque"]
        return answer
"""


@fixture(autouse=True)
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
    record = f"{info}/RECORD"
    files[record] = "".join(f"{name},,\n" for name in (*files, record))
    path = folder / f"toy_engine-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return f"toy-engine @ {path.as_uri()}"


@fixture(scope="module")
def made_once():
    """Environments are made once and copied, without an index of packages."""
    ran, made = environments.run_to_end, []

    def run(line):
        folder = Path(line[-1])
        if "venv" not in line:
            return ran(line)
        if made:
            shutil.copytree(made[0], folder, symlinks=True)
            return Ended(
                "",
                "",
                failed=False,
                last="",
            )
        made.append(folder.parent / "kept")
        ended = ran(line)
        shutil.copytree(folder, made[0], symlinks=True)
        return ended

    with MonkeyPatch.context() as patch:
        patch.setenv("PIP_NO_INDEX", "1")
        patch.setattr(environments, "run_to_end", run)
        yield


@mark.slow
@mark.usefixtures("made_once")
def test_two_versions_are_judged_side_by_side(tmp_path, monkeypatch):
    monkeypatch.setattr(
        environments,
        "make_environment",
        lambda entry: make_environment(entry, tmp_path / "cache"),
    )
    tables = [
        f'[[engine]]\nname = "toy {version}"\nadapter = "toy_engine:Toy"\n'
        f'requires = ["{write_wheel(tmp_path, version, factor)}"]\n'
        for version, factor in (("1.0", "1.0"), ("1.1", "1.001"))
    ]
    (tmp_path / "engines.toml").write_text("\n".join(tables))
    engines = choose_engines("free-body, toy 1.0, toy 1.1", fill_table([tmp_path]))
    assert [engine.name for engine in engines] == ["free-body", "toy 1.0", "toy 1.1"]
    versions = describe_run(engines, "").versions
    assert versions["toy 1.0"] == "1.0" and versions["toy 1.1"] == "1.1"
    rows = judge("scene", SCENE, engines).rows
    failed = {(row.engine, row.quantity) for row in rows if row.verdict != AGREES}
    assert failed == {("toy 1.1", "torque")}
    # an environment that is there is not made again
    monkeypatch.setattr(environments, "run_to_end", None)
    entry = read_engines([tmp_path])["toy 1.0"]
    python = make_environment(entry, tmp_path / "cache")
    assert Path(python).is_relative_to(tmp_path / "cache")


@mark.slow
@mark.usefixtures("made_once")
@mark.parametrize(
    "stated, words",
    [
        (
            {"requires": ("no-such-thing==1",)},
            "^none: its environment cannot be made: .*no-such-thing",
        ),
        ({"python": "no-such-python"}, "no no-such-python is found"),
    ],
)
def test_an_environment_that_cannot_be_made_is_one_line(stated, words, tmp_path):
    with raises(DependencyError, match=words):
        make_environment(EngineEntry("none", adapter="a:B", **stated), tmp_path)


def test_an_engine_without_packages_of_its_own_runs_here(tmp_path):
    entry = EngineEntry("here", adapter="free-body")
    assert make_environment(entry, tmp_path) == sys.executable


def test_an_environment_is_filled_by_its_own_pip(tmp_path, monkeypatch):
    """The environment that runs may have been made by uv, and have none."""
    lines = []

    def fails_at_pip(line):
        lines.append([*map(str, line)])
        return Ended(
            "",
            "",
            failed="pip" in lines[-1],
            last="stop",
        )

    monkeypatch.setattr(environments, "run_to_end", fails_at_pip)
    with raises(DependencyError, match="none: its environment cannot be made"):
        make_environment(EngineEntry("none", adapter="a:B", requires=("x",)), tmp_path)
    (made, filled) = lines
    assert made[:3] == [sys.executable, "-m", "venv"]
    assert "--without-pip" not in made
    assert Path(filled[0]).is_relative_to(tmp_path)
    assert filled[-2:] == ["install", "x"]


@mark.parametrize(
    "text, words",
    read_rows("""
[[engine] | is no TOML
engine = [1] | must be a table
[[engine]]\\nadapter = "free-body" | with a name
[[engine]]\\nname = "a" | must have an adapter or a command
[[engine]]\\nname = "a"\\nadapter = "b"\\ncommand = ["c"] | must have an adapter or a \
command
[[engine]]\\nname = "a"\\ncommand = "c" | engine.command = 'c': allowed: name
[[engine]]\\nname = "a"\\nsteps = [1.5] | engine.steps = [1.5]: allowed: name
[[engine]]\\nname = "a"\\nadaptor = "c" | engine.adaptor = 'c': allowed: name
"""),
)
def test_what_is_no_entry_is_named_with_its_file(text, words, tmp_path):
    file = tmp_path / "engines.toml"
    file.write_text(text.replace(r"\n", "\n"))
    with refused(words, start=str(file)):
        read_engines([tmp_path])


def test_a_name_that_is_nobody_s_is_refused_with_those_that_are_known():
    """The list of known engines has whole names."""
    with refused("among Newton: MuJoCo solver, Newton: Kam"):
        choose_engines("newton")
    known = r"must be among pinocchio-inverse, .*mujoco 3\.3\.7"
    with raises(InputError, match=known) as error:
        choose_engines("nobody")
    names, count = re.search(r"among (.*) and (\d+) more$", str(error.value)).groups()
    table = fill_table()
    assert set(names.split(", ")) < {*table}
    assert len(names.split(", ")) + int(count) == len(table)
    assert len(str(error.value)) < LONGEST_MESSAGE
