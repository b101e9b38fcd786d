"""The findings.

What each says of itself, its script where the engine is, and the list of them.
"""

import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from fourbar.errors import DependencyError
from fourbar_lab.cli import status
from fourbar_lab.simulators import findings as module
from fourbar_lab.simulators.findings import (
    FIELDS,
    FINDINGS,
    FIXED,
    find_interpreter,
    read_docstring,
    read_findings,
)
from fourbar_validation.engines.environments import Entry

ALL = read_findings()
SECONDS = 100.0


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("finding", ALL, ids=lambda finding: finding.script.stem)
def test_each_finding_holds_or_says_since_when_not(finding, monkeypatch):
    # no test makes an environment
    monkeypatch.setattr(module, "read_engines", lambda folders: {})
    if (place := find_interpreter(finding)) is None:
        pytest.skip(f"not run: {finding.engine[0]} is not installed")
    since_fixed = not finding.fields["Until"].startswith("still")
    assert finding.run(place[0], SECONDS) in ("holds", FIXED)[: 1 + since_fixed]


def test_each_finding_is_a_report_and_stands_in_the_list():
    assert FINDINGS is not None and len(ALL) >= 8
    listed = (FINDINGS.parent / "findings.md").read_text(encoding="utf-8")
    for finding in ALL:
        assert set(FIELDS) - {"With"} <= finding.fields.keys(), finding.script
        entry = (
            f"- **{finding.engine[0]}**: {finding.sentence}\n  -"
            f" {finding.fields['Found']}\n"
        )
        assert entry in listed, finding.script
    scripts = re.findall(r"\]\(findings/(\w+\.py)\)", listed)
    assert sorted(scripts) == sorted(finding.script.name for finding in ALL)


@pytest.mark.parametrize(
    ("code", "state"),
    [
        ("", "holds"),
        ("import sys; sys.exit('fixed')", FIXED),
        ("1 / 0", "not run: ZeroDivisionError: division by zero"),
        ("import time; time.sleep(60)", "not run: no answer within 1 s"),
    ],
)
def test_a_script_that_breaks_down_is_not_fixed(code, state, tmp_path):
    (tmp_path / "one.py").write_text(
        f'"""It is\nso.\n\nEngine: pip (pip)\nSince: 1.0 and\n  more\n"""\n{code}\n'
    )
    finding = read_docstring(tmp_path / "one.py")
    assert finding.sentence == "It is so." and finding.fields["Since"] == "1.0 and more"
    seconds = 1.0 if "sleep" in code else SECONDS
    assert finding.run(Path(sys.executable), seconds) == state


@pytest.mark.slow
@pytest.mark.parametrize(
    ("engine", "says", "ended"),
    [
        ("nothing-such (nothing_such)", "not run: nothing-such is not installed", 1),
        ("pytest (pytest)", f"holds in pytest {pytest.__version__}, Python", 0),
    ],
)
def test_the_command_says_what_could_not_run(
    engine, says, ended, monkeypatch, tmp_path
):
    script = tmp_path / "one.py"
    script.write_text(f'"""It is so.\n\nEngine: {engine}\nWith: also, more\n"""\n')
    monkeypatch.setattr(module, "FINDINGS", tmp_path)
    done = CliRunner().invoke(module.findings_command)
    assert f"one.py: {says}" in done.output and done.exit_code == ended


def test_a_simulator_is_sought_in_the_environments_of_engines(monkeypatch):
    packages = ("nothing", "nothing-such", "nothing-such")
    entries = {
        f"{n}": Entry(f"{n}", "a:B", requires=(f"{name}[sim]>=1",))
        for n, name in enumerate(packages)
    }

    def make(entry):
        if entry.name == "1":
            raise DependencyError("no network")
        return f"python of {entry.name}"

    monkeypatch.setattr(module, "read_engines", lambda _: entries)
    monkeypatch.setattr(module, "make_environment", make)
    pythons = list(module._list_interpreters("nothing-such"))
    assert pythons == [sys.executable, "python of 2"]


@pytest.mark.parametrize("arguments", [[__file__], ["no_such.py"]])
def test_bad_input_is_one_line(arguments, capsys):
    assert status(["findings", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1
