"""A user's code passes type checkers without assertions of its own."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = "tests/support/user_code.py"


def run_checker(*line):
    done = subprocess.run(
        [sys.executable, "-m", *line, PAGE],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    return "" if done.returncode == 0 else done.stdout


@pytest.mark.slow
@pytest.mark.timeout(600)  # without a cache mypy reads numpy's types first
def test_mypy_passes_the_page():
    assert not run_checker("mypy", "--strict")


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("pyright") is None,
    reason="not run: pyright is not installed: pip install 'pyright[nodejs]'",
)
def test_pyright_passes_the_page():
    assert not run_checker("pyright")


@pytest.mark.slow
def test_the_page_runs():
    done = subprocess.run(
        [sys.executable, PAGE],
        cwd=ROOT,
        check=False,
    )
    assert done.returncode == 0
