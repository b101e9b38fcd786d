"""Parts of the report besides the scenes: hard cases by family, limits and links."""

import re

import pytest
from markupsafe import escape

from fourbar_validation.compare.rows import (
    AGREES,
    FAILS,
    REFUSES,
    UNDECIDED,
)
from fourbar_validation.engines.limits import BOUNDARIES
from fourbar_validation.report.html import write_html
from fourbar_validation.report.sections import (
    collect_hard_cases,
    collect_sections,
)
from fourbar_validation.report.templating import count_or_size
from fourbar_validation.scenes.hard_families import HARD_FAMILIES, Hard
from tests.support.here import summary_of
from tests.support.rows import read_rows
from tests.support.runs import changed


def judged(scene, verdict):
    return changed(scene=scene, verdict=verdict)


def list_holding():
    """List a row that agrees of each hard scene."""
    hard = Hard()
    return [judged(hard.name(index), AGREES) for index in range(len(hard))]


def test_every_scene_is_counted_in_its_family_alone():
    table = {row[0]: row for row in collect_hard_cases(list_holding()).rows}
    for family in HARD_FAMILIES:
        count = str(sum(1 for _ in family.scenes()))
        row = table.pop(family.name)
        assert row[1:3] == (count, count) and row[7:] == ("holds", family.statement)
    assert not table


def test_a_failing_row_fails_its_family_in_the_report():
    rows = [
        judged("toggle-near-a", AGREES),
        judged("toggle-near-a", REFUSES),
        judged("toggle-b", FAILS),
    ]
    toggle, near = collect_hard_cases(rows).rows
    assert toggle[:8] == ("toggle", *"100001", "1 fail")
    assert near[:8] == ("toggle-near", *"110010", "holds")
    silent = [judged("toggle-near-a", verdict) for verdict in (REFUSES, UNDECIDED)]
    (refused,) = collect_hard_cases(silent).rows
    assert refused[:8] == ("toggle-near", *"100110", "nothing compared")


def test_the_report_of_the_hard_suite_has_every_statement_and_every_limit(tmp_path):
    parts = collect_sections(list_holding(), tmp_path)
    assert [part.key for part in parts] == ["hard", "engine-limits"]
    assert not list(tmp_path.iterdir())
    text = write_html(summary_of([]), {}, sections=parts)
    for shown in (
        'href="#hard"',
        'href="#engine-limits"',
        *(escape(family.statement) for family in HARD_FAMILIES),
        *(escape(limit.name) for limit in BOUNDARIES),
    ):
        assert shown in text


def test_hard_cases_and_studies_beside_the_report_are_linked(tmp_path):
    """An unfinished one has no page yet."""
    for name in ("hard", "cost/a", "cost/b", "cost/unfinished"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "hard" / "results.csv").touch()
    assert collect_sections(None, tmp_path) == []
    pages = ["hard/report.html", "cost/a/cost.md", "cost/b/cost.md"]
    for page in pages:
        (tmp_path / page).touch()
    text = write_html(summary_of([]), {}, sections=collect_sections(None, tmp_path))
    assert re.findall('href="((?:hard|cost)/[^"]+)"', text) == pages


@pytest.mark.parametrize(
    "value, text",
    read_rows("""
628 | 628
12345 | 12345
-999999 | -999999
1000000 | 1e+06
nan | -
inf | inf
0 | 0
0.125 | 0.125
3.1e-09 | 3.1e-09
1.5e7 | 1.5e+07
"""),
)
def test_what_is_counted_is_written_for_people(value, text):
    assert count_or_size(float(value)) == text
