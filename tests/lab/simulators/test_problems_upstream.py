"""Test files for other projects state the answers of models/problems and import no
module of this project.
"""

import ast
from contextlib import suppress

import numpy as np
import pytest

from fourbar_lab.simulators.problems import PROBLEMS
from fourbar_validation.check.problem import read_problem
from tests.whole.test_imports import ROOT

UPSTREAM = ROOT / "docs/upstream"
FILES = sorted(UPSTREAM.glob("*/*four_bar*.py"))
NEWTON = UPSTREAM / "newton" / "test_fourbar_forces.py"
DIGITS = 1e-8
"""Of the ten digits that the files state."""


def run_statements(path, *kinds):
    """Run the statements of these kinds at the top of a file, and return its names."""
    body = ast.parse(path.read_text()).body
    found = {"np": np}
    for node in (node for node in body if isinstance(node, kinds)):
        with suppress(NameError):
            exec(compile(ast.Module([node], []), str(path), "exec"), found)
    return found


def test_newton_s_free_bodies_find_our_answers():
    problem = read_problem(PROBLEMS / "newton_128.json")
    command = problem["command"]
    solve = run_statements(NEWTON, ast.Assign, ast.FunctionDef)["solve_free_bodies"]
    solved = [solve(theta, command["omega_2"], 0.0) for theta in command["theta_2"]]
    assert len(solved) == 37
    for name, theirs in zip(("torque", "F14"), zip(*solved, strict=True), strict=True):
        ours = np.array(problem["answers"][name])
        assert abs(np.array(theirs) - ours).max() <= DIGITS * abs(ours).max()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.parent.name)
def test_a_file_for_another_project_states_our_answers(path):
    text, stated = path.read_text(), run_statements(path, ast.Assign)
    problems = [file.stem for file in PROBLEMS.glob("*.json") if file.stem in text]
    tables = stated["EXPECTED"]
    if not isinstance(next(iter(tables)), str):
        tables = {problems[0]: tables}
    assert tables.keys() <= set(problems)
    compared = 0
    for name, table in tables.items():
        problem = read_problem(PROBLEMS / f"{name}.json")
        angles = np.rad2deg(problem["command"]["theta_2"])
        for degrees, row in table.items():
            index = int(np.argmin(abs(angles - degrees)))
            assert abs(angles[index] - degrees) < 1e-9
            for column, value in zip(stated["COLUMNS"], row, strict=True):
                ours = np.asarray(problem["answers"][column])
                apart = abs(ours[index] - value).max()
                assert apart <= DIGITS * abs(ours).max(), (name, degrees, column)
                compared += 1
    assert compared >= 16
