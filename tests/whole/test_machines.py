"""The numbers hold on another machine: another BLAS kernel, other vectorised functions of NumPy, in a child process.

`MACHINES=all` (part of `make long-test`) tries every kernel that the CPU can run, and the whole `validation run`.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.another_machine import BEFORE, CORES, ROOT, environment, machine, why_not

ALL = os.environ.get("MACHINES") == "all"
NUMERICAL = ["fourbar/formulas/test_pin_forces.py", "validation/regression/test_accepted.py"]
NUMERICAL += ["validation/published/test_published.py", "validation/engines/test_engines.py"] * ALL
"""Identities, the accepted state of the exact engines; with all kernels printed figures and each engine by itself."""


@pytest.mark.timeout(600)
@pytest.mark.parametrize("core", CORES if ALL else ["another"])
def test_the_numbers_hold_on_another_machine(core: str, tmp_path: Path) -> None:
    reasons = {name: why_not(name) for name in ([core] if ALL else CORES)}
    possible = [name for name, reason in reasons.items() if reason is None]
    if not possible:
        pytest.skip("not run: " + "; ".join(f"{name}: {reason}" for name, reason in reasons.items()))
    child = os.environ | environment(possible[0]) | {BEFORE: machine()}
    files = ("support/another_machine.py", *NUMERICAL)
    lines = [["pytest", "-p", "no:cacheprovider", "-p", "no:xdist", *(f"tests/{name}" for name in files)]]
    if ALL:
        lines.append(["validation", "run", "--against", "accepted", "--out", str(tmp_path)])
    for line in lines:
        done = subprocess.run(
            [sys.executable, "-m", *line], cwd=ROOT, env=child, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{machine(possible[0])}\n{done.stdout}{done.stderr}"
