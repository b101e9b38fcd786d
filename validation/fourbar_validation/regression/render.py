"""Differences as text, Markdown, HTML and JUnit XML: what fails comes first."""

from collections import Counter
from collections.abc import Iterator
from typing import Any

from fourbar.errors import write_count
from fourbar_validation.compare.rows import HOLDING_VERDICTS
from fourbar_validation.regression.changes import REGRESSIONS, WHOLE, Differences, Kind
from fourbar_validation.report.junit import (
    JunitCase,
    make_cases,
    write_document,
)
from fourbar_validation.report.templating import render, write_error

KINDS_SHOWN: tuple[Kind, ...] = tuple(
    kind
    for kind in Kind
    if kind not in (*WHOLE, Kind.NOT_COMPARED, Kind.NOT_RUN, Kind.SAME)
)
"""Kinds shown by engine and cause. The others are named together, or counted."""
MOST_GROUPS_LISTED = 50
"""Engines and causes listed of one kind."""
MOST_ROWS_ON_THE_PAGE = 1000
"""Rows of one kind on the page."""
MOST_ROWS_IN_TEXT = 5
"""Rows of one kind in a text, the worst of them."""
_SCENES, _MADE_WITH = "Scenes", "Made with"
"""Headings whose lines say by themselves what they are about."""


def write_verdict(diff: Differences) -> str:
    """Write one line on how many rows regressed.

    What else moved, and the counts of the new run, follow.
    """
    counted = Counter(diff.table.kind)
    counts = [f"{counted[kind]} {kind}" for kind in Kind if counted[kind]]
    many = diff.regressed
    if diff.weakened:
        counts.insert(0, f"{write_count(len(diff.weakened), 'rule')} weaker")
    head = write_count(many, "regression") if many else "No regression"
    if diff.nothing and not many:
        head = "Nothing was compared"
    elif diff.strange:
        head = f"Runs of two suites: {head[:1].lower()}{head[1:]}"
    compared = diff.counterparts.total
    rows = f"{compared} of " * (compared < len(diff.table)) + f"{len(diff.table)}"
    if diff.baseline:
        head += f" against {diff.baseline}"
    moved = f" in {rows} rows: {', '.join(counts)}" if counts else ""
    return f"{head}{moved}. New run: {diff.counts.sentence()}"


def write_change_line(row: Any) -> str:
    """Write one line of the table of differences in one line of text."""
    name = " / ".join(filter(None, (row.scene, row.engine, row.setting, row.quantity)))
    old, new = write_error(row.error_old), write_error(row.error_new)
    if not row.verdict_new:
        return f"{name}: was {row.verdict_old}, error {old}"
    since = f"; it {row.since}" * bool(row.since)
    if not row.verdict_old:
        told = f"{name}: {row.verdict_new}, error {new}"
        return f"{told}: {row.reason_new}{since}" if row.fails else told
    words = f"{name}: error {old} -> {new}"
    if row.verdict_old != row.verdict_new:
        words += f", {row.verdict_old} -> {row.verdict_new} ({row.reason_new})"
    elif row.fails:
        words += f", {row.verdict_new} ({row.reason_new})"
    return f"{words}{since}; round-off moves it by {write_error(row.round_off)}"


def _list_sections(diff: Differences, most: int) -> list[tuple[str, list[str]]]:
    """List the lines under each heading, what regressed first; `most`: rows of a kind.

    The rows of a kind are listed by engine and cause, and then one by one.
    """
    sections = [
        ("Gone", diff.gone),
        ("Weaker rule", [*map(str, diff.weakened)]),
        ("Disagreement", diff.sentences),
    ]
    for kind in KINDS_SHOWN:
        rows = diff.of(kind)
        groups = diff.list_groups(kind)
        shown = groups[:MOST_GROUPS_LISTED]
        shown += _count_more(len(groups) - len(shown), " engines and causes")
        shown += map(write_change_line, rows[:most].itertuples())
        sections.append((kind.capitalize(), shown + _count_more(len(rows) - most)))
    made_with = [f"{what}: {old} -> {new}" for what, old, new in diff.surroundings]
    sections += [
        (_SCENES, [*map(str, diff.scenes), *diff.notes]),
        (_MADE_WITH, made_with),
        ("Not compared", diff.name_whole(Kind.NOT_COMPARED)),
        ("Not run", diff.name_whole(Kind.NOT_RUN)),
        ("Allowed more", diff.grown),
    ]
    return [(heading, lines) for heading, lines in sections if lines]


def _count_more(more: int, what: str = "") -> list[str]:
    return [f"and {more} more{what}"] * (more > 0)


def write_differences(diff: Differences) -> str:
    """Write for a terminal: what regressed first, the verdict last."""
    lines = []
    for heading, texts in _list_sections(diff, MOST_ROWS_IN_TEXT):
        begin = "" if heading in (_SCENES, _MADE_WITH) else f"{heading}: "
        lines += [begin + text for text in texts]
    return "\n".join([*lines, f"{write_verdict(diff)}."]) + "\n"


def _render_differences(name: str, diff: Differences, most: int) -> str:
    sections = _list_sections(diff, most)
    told = {"diff": diff, "verdict": write_verdict(diff), "sections": sections}
    return render("fourbar_validation.regression", name, **told)


def write_pull_request_comment(diff: Differences) -> str:
    """Write for a comment on a pull request."""
    return _render_differences("changes.md.j2", diff, MOST_ROWS_IN_TEXT)


def write_differences_page(diff: Differences) -> str:
    """Write a page of its own."""
    return _render_differences("changes.html.j2", diff, MOST_ROWS_ON_THE_PAGE)


def write_junit_of_changes(diff: Differences) -> str:
    """Write for the test page of a continuous-integration system: one case per row.

    A regression is a failure, and so is a row that fails as it did before; what was not
    compared is skipped.
    """
    return write_document(write_verdict(diff), _list_cases_of_changes(diff))


def _list_cases_of_changes(diff: Differences) -> Iterator[JunitCase]:
    yield from make_cases(diff.of(*Kind).itertuples(), _tell_change)
    for one in diff.weakened:
        told = ("failure", "weaker rule", str(one))
        yield JunitCase(one.name, one.name, f"rule: {one.what}", *told)
    if diff.nothing:
        told = ("failure", "nothing compared", write_verdict(diff))
        yield JunitCase("all scenes", "all scenes", "anything is compared", *told)


def _tell_change(row: Any) -> tuple[str, ...]:
    """Tell outcome, kind and message of a line; nothing where the row holds."""
    regressed = row.kind in (*REGRESSIONS, Kind.STILL_FAILS)
    if row.verdict_new in HOLDING_VERDICTS and not regressed:
        return ()
    return "failure" if regressed else "skipped", row.kind, write_change_line(row)
