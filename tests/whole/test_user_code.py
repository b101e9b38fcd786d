"""A user's code passes pyright without assertions of its own, and runs.

`make check` has mypy read it with the packages.
"""

import importlib.util
import runpy
import sys

from pytest import mark

from tests.support.checkout import ROOT, run_python

PAGE = "tests/support/user_code.py"


@mark.slow
@mark.skipif(
    importlib.util.find_spec("pyright") is None,
    reason="not run: pyright is not installed: pip install 'pyright[nodejs]'",
)
def test_pyright_passes_the_page():
    done = run_python("-m", "pyright", "--pythonpath", sys.executable, PAGE)
    assert done.returncode == 0, done.stdout


def test_the_page_runs(monkeypatch):
    monkeypatch.chdir(ROOT)
    assert len(runpy.run_path(PAGE)["peaks"]) == 5
