"""Parts of the report from elsewhere: the hard cases, and what accuracy costs."""

import base64

import pytest
from markupsafe import escape

from fourbar_validation.compare.rows import (
    AGREES,
    FAILS,
    REFUSES,
    UNDECIDED,
    write_results,
)
from fourbar_validation.engines.limits import BOUNDARIES
from fourbar_validation.report.html import write_html
from fourbar_validation.report.sections import (
    LARGEST_INLINE_PICTURE,
    collect_hard_cases,
    collect_sections,
)
from fourbar_validation.report.templating import count_or_size
from fourbar_validation.scenes.hard_families import HARD_FAMILIES, Hard
from tests.support.here import summary_of
from tests.support.rows import read_rows
from tests.support.runs import changed
from tests.validation.report.test_report import demo, report


def judged(scene, verdict):
    return changed(scene=scene, verdict=verdict)


def list_holding():
    """List a row that agrees of each hard scene."""
    hard = Hard()
    return [judged(hard.name(index), AGREES) for index in range(len(hard))]


def test_every_scene_is_counted_in_its_family_alone():
    rows = list_holding()
    table = {row[0]: row for row in collect_hard_cases(rows).rows}
    for family in HARD_FAMILIES:
        count = str(sum(1 for _ in family.scenes()))
        row = table.pop(family.name)
        assert row[1:3] == (count, count) and row[7:] == ("holds", family.statement)
    assert not table


def test_a_failing_row_fails_its_family_in_the_report(tmp_path):
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
    assert collect_sections(None, tmp_path) == []
    (tmp_path / "hard").mkdir()
    write_results(rows, tmp_path / "hard" / "results.csv")
    assert (
        collect_sections(None, tmp_path) == []
    )  # unfinished: its page is not written yet
    (tmp_path / "hard" / "report.html").touch()
    (section,) = collect_sections(None, tmp_path)
    assert section.rows == collect_hard_cases(rows).rows
    assert [file for _, file in section.links] == ["hard/report.html"]


def test_the_report_of_the_hard_suite_has_every_statement_and_every_limit(tmp_path):
    rows = list_holding()
    parts = collect_sections(rows, tmp_path)
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


@pytest.mark.slow
def test_a_study_of_cost_next_to_the_report_is_part_of_it(tmp_path):
    assert collect_sections(None, tmp_path) == []
    folder = tmp_path / "cost" / "demo"
    folder.mkdir(parents=True)
    (folder / "cost.csv").touch()
    (folder / "work-precision-torque.svg").write_text("<svg onload='alert(1)'/>")
    (folder / "work-precision-force.svg").write_bytes(bytes(LARGEST_INLINE_PICTURE + 1))
    _, text = report([demo(draw=False)], sections=collect_sections(None, tmp_path))
    assert "The study of demo" in text and 'href="cost/demo/cost.md"' in text
    data = base64.b64encode(b"<svg onload='alert(1)'/>").decode()
    # an image runs no script; what is too large stays outside
    assert (
        text.count('<figure class="part">') == 1
        and f'src="data:image/svg+xml;base64,{data}"' in text
    )


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
