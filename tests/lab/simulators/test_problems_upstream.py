"""Test files for other projects state the answers of models/problems and import no
module of this project.
"""

import ast
import json

import numpy as np
import pytest

from fourbar_lab.simulators.problems import PROBLEMS
from tests.whole.test_imports import ROOT, imported

UPSTREAM = ROOT / "docs/upstream"
FILES = sorted(UPSTREAM.glob("*/*four_bar*.py"))
NEWTON = UPSTREAM / "newton" / "test_fourbar_forces.py"
DIGITS = 1e-8
"""Of the ten digits that the files state."""


def literals(path):
    """What the file states as plain values."""
    outcomes = {}
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                outcomes[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                continue
    return outcomes


@pytest.mark.parametrize("quantity", ["torque", "F14"])
def test_newton_s_free_bodies_find_our_answers(quantity):
    numbers = [
        node
        for node in ast.parse(NEWTON.read_text()).body
        if isinstance(node, ast.Assign)
        or (isinstance(node, ast.FunctionDef) and node.name.startswith("solve"))
    ]
    names = {"np": np}
    exec(compile(ast.Module(numbers, []), str(NEWTON), "exec"), names)
    problem = json.loads((PROBLEMS / "newton_128.json").read_text())
    command, answers = problem["command"], np.array(problem["answers"][quantity])
    solved = [
        names["solve_free_bodies"](theta, command["omega_2"], 0.0)
        for theta in command["theta_2"]
    ]
    theirs = np.array(
        [torque if quantity == "torque" else force for torque, force in solved]
    )
    assert (
        len(theirs) == 37
        and np.abs(theirs - answers).max() <= DIGITS * np.abs(answers).max()
    )


@pytest.mark.parametrize(
    "path",
    [path for path in UPSTREAM.glob("*/*.py") if path.name != "conftest.py"],
    ids=str,
)
def test_every_test_for_another_project_says_what_it_compares(path):
    tree = ast.parse(path.read_text())
    tests = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]
    assert (
        tests
        and all(ast.get_docstring(node) for node in tests)
        and ast.get_docstring(tree)
    )
    assert "expectedFailure" not in path.read_text()
    assert not any(name.startswith("fourbar") for name in imported(path))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.parent.name)
def test_a_file_for_another_project_states_our_answers(path):
    text, stated = path.read_text(), literals(path)
    problems = [file.stem for file in PROBLEMS.glob("*.json") if file.stem in text]
    tables = (
        stated["EXPECTED"]
        if isinstance(next(iter(stated["EXPECTED"])), str)
        else {problems[0]: stated["EXPECTED"]}
    )
    assert set(tables) <= set(problems)
    compared = 0
    for name, table in tables.items():
        problem = json.loads((PROBLEMS / f"{name}.json").read_text())
        angles = np.rad2deg(problem["command"]["theta_2"])
        for degrees, row in table.items():
            index = int(np.argmin(np.abs(angles - degrees)))
            assert abs(angles[index] - degrees) < 1e-9
            for column, value in zip(stated["COLUMNS"], row, strict=True):
                ours = np.asarray(problem["answers"][column])
                assert (
                    np.abs(ours[index] - value).max() <= DIGITS * np.abs(ours).max()
                ), (name, degrees, column)
                compared += 1
    assert compared >= 16


def test_each_project_has_its_file():
    projects = {path.parent.name for path in UPSTREAM.glob("*/*.py")}
    assert projects == {"drake", "genesis", "mujoco_warp", "newton", "pinocchio"}
    page = (ROOT / "docs/findings.md").read_text()
    assert all(
        f"(upstream/{path.relative_to(UPSTREAM).as_posix()})" in page
        for path in [*FILES, NEWTON]
    )
