"""The numbers hold on another machine.

Another BLAS kernel, other vectorised functions of NumPy, in a child process.

`MACHINES=all` (part of `make long-test`) tries every kernel that the CPU can run, on
every numerical test file, and the whole `validation run`.
"""

import os

from pytest import mark, skip

from tests.support.another_machine import BEFORE, CORES, environment, machine, why_not
from tests.support.checkout import ROOT, run_python

ALL = os.environ.get("MACHINES") == "all"
TESTS = ROOT / "tests"
SAMPLE = [
    TESTS / "fourbar/formulas/test_pin_forces.py",
    TESTS / "validation/regression/test_accepted.py",
]
"""Identities, and the accepted state of the exact engines."""
BUT = {*(TESTS / "whole").glob("*.py"), *TESTS.rglob("test_bench*.py")}
"""Of no number, or of the time that it takes."""
NUMERICAL = [
    file
    for file in sorted({*TESTS.rglob("test_*.py")} - BUT)
    if "numpy" in file.read_text("utf-8")
]


@mark.slow
@mark.timeout(3600 if ALL else 600)
@mark.parametrize("core", CORES if ALL else ["another"])
def test_the_numbers_hold_on_another_machine(core, tmp_path):
    reasons = {name: why_not(name) for name in ([core] if ALL else CORES)}
    possible = [name for name, reason in reasons.items() if reason is None]
    if not possible:
        skip(
            "not run: "
            + "; ".join(f"{name}: {reason}" for name, reason in reasons.items())
        )
    child = environment(possible[0]) | {BEFORE: machine()}
    files = [TESTS / "support/another_machine.py", *(NUMERICAL if ALL else SAMPLE)]
    workers = "-n 2" if ALL else "-p no:xdist"
    lines = [["pytest", "-p", "no:cacheprovider", *workers.split(), *files]]
    if ALL:
        lines.append(["validation", "run", "--against", "accepted", "-o", tmp_path])
    for line in lines:
        done = run_python("-m", *line, **child)
        assert done.returncode == 0, (
            f"{machine(possible[0])}\n{done.stdout}{done.stderr}"
        )
