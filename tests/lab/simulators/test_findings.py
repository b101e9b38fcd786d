"""The findings.

What each says of itself, its script where the engine is, and the list of them.
"""

import re
import sys
from pathlib import Path

import pytest

from fourbar_lab.simulators import findings as module
from fourbar_lab.simulators.findings import (
    FIELDS,
    FINDINGS,
    FIXED,
    find_interpreter,
    read_docstring,
    read_findings,
)

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
