"""The findings.

What each says of itself, its script where the engine is, and the list of them.
"""

import re

from pytest import mark, skip

from fourbar_lab.simulators.findings import (
    FIELDS,
    FINDINGS,
    FIXED,
    find_interpreter,
    read_findings,
)

ALL = read_findings()
SECONDS = 100.0


@mark.slow
@mark.nightly
@mark.parametrize("finding", ALL, ids=lambda finding: finding.script.stem)
def test_each_finding_holds_or_says_since_when_not(finding, monkeypatch):
    # no test makes an environment
    engines = "fourbar_lab.simulators.findings.read_engines"
    monkeypatch.setattr(engines, lambda folders: {})
    if (place := find_interpreter(finding)) is None:
        skip(f"not run: {finding.engine[0]} is not installed")
    since_fixed = not finding.fields["Until"].startswith("still")
    assert finding.run(place[0], SECONDS) in ("holds", FIXED)[: 1 + since_fixed]


def test_each_finding_is_a_report_and_stands_in_the_list():
    assert FINDINGS is not None and len(ALL) >= 8
    listed = (FINDINGS.parent / "findings.md").read_text("utf-8")
    for finding in ALL:
        assert set(FIELDS) - {"With"} <= finding.fields.keys(), finding.script
        entry = (
            f"- **{finding.engine[0]}**: {finding.sentence}\n  -"
            f" {finding.fields['Found']}\n"
        )
        assert entry in listed, finding.script
    scripts = re.findall(r"\]\(findings/(\w+\.py)\)", listed)
    assert sorted(scripts) == sorted(finding.script.name for finding in ALL)
