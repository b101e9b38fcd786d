"""The test files for other projects state the answers of models/problems, and no module of this project."""

import ast
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fourbar_lab.simulators.problems import PROBLEMS
from tests.whole.test_imports import ROOT, imported

FILES = sorted((ROOT / "docs/upstream").glob("*/*four_bar*.py")) + sorted((ROOT / "docs/upstream").glob("*/*fourbar*"))
DIGITS = 1e-8
"""Of the ten digits that the files state."""


def literals(path: Path) -> dict[str, Any]:
    """What the file states as plain values."""
    found = {}
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                found[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                continue
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.parent.name)
def test_a_file_for_another_project_states_our_answers(path: Path) -> None:
    text, stated = path.read_text(), literals(path)
    assert not any(name.startswith("fourbar") for name in imported(path))
    named = [file.stem for file in PROBLEMS.glob("*.json") if file.stem in text]
    tables = stated["EXPECTED"] if isinstance(next(iter(stated["EXPECTED"])), str) else {named[0]: stated["EXPECTED"]}
    assert set(tables) <= set(named)
    compared = 0
    for name, table in tables.items():
        problem = json.loads((PROBLEMS / f"{name}.json").read_text())
        angles = np.rad2deg(problem["command"]["theta_2"])
        for degrees, row in table.items():
            index = int(np.argmin(np.abs(angles - degrees)))
            assert abs(angles[index] - degrees) < 1e-9
            for column, value in zip(stated["COLUMNS"], row, strict=True):
                ours = np.asarray(problem["answers"][column])
                assert np.abs(ours[index] - value).max() <= DIGITS * np.abs(ours).max(), (name, degrees, column)
                compared += 1
    assert compared >= 16


def test_each_project_has_its_file() -> None:
    assert {path.parent.name for path in FILES} == {"drake", "genesis", "mujoco_warp", "newton", "pinocchio"}
    assert all(path.parent.name in (ROOT / "docs/findings.md").read_text() for path in FILES)
