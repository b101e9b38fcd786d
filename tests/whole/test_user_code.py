"""A user's code passes pyright without assertions of its own, and runs.

`make check` has mypy read it with the packages.
"""

import importlib.util
import runpy
import subprocess
import sys

import pytest

from tests.whole.test_imports import ROOT

PAGE = "tests/support/user_code.py"


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("pyright") is None,
    reason="not run: pyright is not installed: pip install 'pyright[nodejs]'",
)
def test_pyright_passes_the_page():
    line = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, PAGE]
    done = subprocess.run(line, cwd=ROOT, stdout=subprocess.PIPE, check=False)
    assert done.returncode == 0, done.stdout.decode()


def test_the_page_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert len(runpy.run_path(PAGE)["peaks"]) == 5
