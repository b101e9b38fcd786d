"""An environment without one of the engines.

What is left is judged, and what is missing is named.
"""

import csv

from pytest import mark

from tests.support.checkout import join_paths, run_python

pytestmark = mark.slow
BLOCKER = """
import os
import sys


class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in os.environ["BLOCKED"].split():
            if "BROKEN" in os.environ:
                said = "libboost.so: cannot open shared object file"
                raise ImportError(said, name=name)
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, Blocker())
"""
"""As `sitecustomize` it is imported by every Python started with it on its path, the
workers too.
"""
ENGINES = {
    "mujoco": {"mujoco-inverse", "mujoco-simulated"},
    "pinocchio": {"pinocchio-inverse"},
}
ALL = {"free-body", *ENGINES["mujoco"], *ENGINES["pinocchio"]}
NEVER = "exudyn opensim pydrake"
"""Not here, installed or not: the same engines are left on every machine."""
SCENE = """
[lengths]
ground = "4 m"
input = "1 m"
coupler = "3 m"
output = "3 m"
[bars.coupler]
mass = "1 kg"
[motion]
theta_2 = { from = "10 deg", to = "50 deg", steps = 8 }
omega_2 = "1 rad/s"
"""


def without(library, folder, *arguments, **settings):
    """`python -m validation run` where a library cannot be imported."""
    (folder / "sitecustomize.py").write_text(BLOCKER)
    (folder / "scene.toml").write_text(SCENE)
    line = "-m validation run scene.toml --workers 1 --no-pictures --out out"
    settings |= {"BLOCKED": f"{library} {NEVER}", "PYTHONPATH": join_paths(folder)}
    return run_python(
        *line.split(), *arguments, folder=folder, COLUMNS="200", **settings
    )


@mark.parametrize("library", ENGINES)
def test_the_others_run_and_the_missing_named_with_the_reason(library, tmp_path):
    done = without(library, tmp_path)
    reason = f'{library} is not installed: pip install ".[validation]" in the checkout'
    with (tmp_path / "out" / "results.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert {row["engine"] for row in rows} == {"formulas", *(ALL - ENGINES[library])}
    assert "fails" not in {
        row["verdict"] for row in rows
    }  # MuJoCo refuses bars without mass
    for name in ENGINES[library]:
        assert f"Not run: {name}: {reason}" in done.stdout
        assert f"Not run: {name}: " in (tmp_path / "out" / "report.html").read_text()
        assert f"not run: {name}: " in (tmp_path / "out" / "report.md").read_text()
    printed = done.stderr.strip().splitlines()[-1]
    assert printed.startswith(f"error: {reason}, or say --engines ")
    assert done.returncode == 3  # the environment, not the formulas


def test_requested_by_name_nothing_is_run(tmp_path):
    done = without("mujoco", tmp_path, "--engines", "free-body,mujoco-inverse")
    reason = 'mujoco is not installed: pip install ".[validation]" in the checkout'
    assert done.stderr.strip() == f"error: mujoco-inverse: {reason}"
    assert done.returncode == 3 and not (tmp_path / "out").exists()


def test_an_engine_that_is_there_and_does_not_load_is_one_line(tmp_path):
    done = without("pinocchio", tmp_path, "--engines", "pinocchio-inverse", BROKEN="1")
    assert done.stderr == (
        "error: pinocchio-inverse: pinocchio is installed, but does not load:"
        " ImportError: libboost.so: cannot open shared object file\n"
    )
    assert done.returncode == 3 and not (tmp_path / "out").exists()
