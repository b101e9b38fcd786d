"""Differences as text, Markdown, HTML and JUnit XML: what fails comes first."""

from collections.abc import Iterator
from typing import Any

from fourbar.errors import write_count
from fourbar_validation.compare.rows import HOLDING_VERDICTS
from fourbar_validation.regression.changes import REGRESSIONS, WHOLE, Differences, Kind
from fourbar_validation.report.junit import (
    MOST_PASSING_CASES,
    JunitCase,
    count_beyond,
    make_case,
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
CHANGE_HEADINGS = (
    "scene",
    "engine",
    "quantity",
    "old error",
    "new error",
    "round-off",
    "old verdict",
    "new verdict",
    "since when",
)
MOST_ROWS_ON_THE_PAGE = 1000
"""Rows of one kind on the page."""
MOST_ROWS_IN_TEXT = 5
"""Rows of one kind listed there, the worst of them."""


def write_verdict(diff: Differences) -> str:
    """Write one line on how many rows regressed.

    What else moved, and the counts of the new run, follow.
    """
    counts = [f"{count} {kind}" for kind, count in diff.kinds.items() if count]
    many = diff.regressed
    if diff.weakened:
        counts.insert(0, f"{write_count(len(diff.weakened), 'rule')} weaker")
    head = write_count(many, "regression") if many else "No regression"
    if diff.nothing and not many:
        head = "Nothing was compared"
    elif diff.strange:
        head = f"Runs of two suites: {head[:1].lower()}{head[1:]}"
    compared = diff.counterparts.total
    rows = f"{compared} of " * (compared < diff.rows) + f"{diff.rows}"
    if diff.baseline:
        head += f" against {diff.baseline}"
    moved = f" in {rows} rows: {', '.join(counts)}" if counts else ""
    return f"{head}{moved}. New run: {diff.counts.sentence()}"


def write_change_line(row: Any) -> str:
    """Write one line of the table of differences in one line of text."""
    name = " / ".join(filter(None, (row.scene, row.engine, row.setting, row.quantity)))
    old, new = write_error(row.error_old), write_error(row.error_new)
    if not row.verdict_old:
        words = f"{name}: {row.verdict_new}, error {new}"
        return f"{words}: {row.reason_new}" if row.fails else words
    if not row.verdict_new:
        return f"{name}: was {row.verdict_old}, error {old}"
    words = f"{name}: error {old} -> {new}"
    if row.verdict_old != row.verdict_new:
        words += f", {row.verdict_old} -> {row.verdict_new} ({row.reason_new})"
    elif row.fails:
        words += f", {row.verdict_new} ({row.reason_new})"
    if row.verdict_old == row.verdict_new and row.since:
        words += f"; it {row.since}"
    return f"{words}; round-off moves it by {write_error(row.round_off)}"


def write_differences(diff: Differences) -> str:
    """Write for a terminal: what regressed first, the verdict last."""
    lines = []
    for heading, texts in _list_regressions(diff).items():
        lines += [f"{heading}: {text}" for text in texts]
    for kind in KINDS_SHOWN:
        texts = [*_list_groups(diff, kind), *_list_worst(diff, kind)]
        lines += [f"{kind.capitalize()}: {text}" for text in texts]
    lines += [*map(str, diff.scenes), *diff.notes]
    lines += [f"{what}: {old} -> {new}" for what, old, new in diff.surroundings]
    for heading, texts in _list_other_questions(diff).items():
        lines += [f"{heading}: {text}" for text in texts]
    return "\n".join([*lines, f"{write_verdict(diff)}."]) + "\n"


def _list_groups(diff: Differences, kind: Kind) -> list[str]:
    """List the rows of a kind by engine and cause, the worst first."""
    groups = diff.list_groups(kind)
    more = len(groups) - MOST_GROUPS_LISTED
    beyond = [f"and {more} more engines and causes"] * (more > 0)
    return groups[:MOST_GROUPS_LISTED] + beyond


def _list_worst(diff: Differences, kind: Kind) -> list[str]:
    """List the worst rows of a kind; say how many more there are."""
    rows = diff.of(kind)
    more = len(rows) - MOST_ROWS_IN_TEXT
    lines = [*map(write_change_line, rows[:MOST_ROWS_IN_TEXT].itertuples())]
    return lines + [f"and {more} more"] * (more > 0)


def _list_regressions(diff: Differences) -> dict[str, list[str]]:
    """List what regressed and is no single row, under its headings."""
    return {
        "Gone": diff.gone,
        "Weaker rule": [*map(str, diff.weakened)],
        "Disagreement": diff.sentences,
    }


def _list_other_questions(diff: Differences) -> dict[str, list[str]]:
    """List what was not compared, under its headings."""
    return {
        "Not compared": diff.not_compared,
        "Not run": diff.not_run,
        "Allowed more": diff.grown,
    }


def write_pull_request_comment(diff: Differences) -> str:
    """Write for a comment on a pull request."""
    rows = {kind: _list_worst(diff, kind) for kind in KINDS_SHOWN}
    return _render_differences("changes.md.j2", diff, rows).rstrip("\n") + "\n"


def write_differences_page(diff: Differences) -> str:
    """Write a page of its own."""
    rows = {}
    for kind in KINDS_SHOWN:
        few = diff.of(kind)[:MOST_ROWS_ON_THE_PAGE]
        rows[kind] = [*map(_write_change_cells, few.itertuples())]
    return _render_differences("changes.html.j2", diff, rows)


def _write_change_cells(row: Any) -> tuple[str, ...]:
    """Write a line of the table of differences as the cells under CHANGE_HEADINGS."""
    return (
        row.scene,
        f"{row.engine} {row.setting}",
        row.quantity,
        write_error(row.error_old) if row.verdict_old else "",
        write_error(row.error_new) if row.verdict_new else "",
        write_error(row.round_off),
        row.verdict_old,
        row.verdict_new + f": {row.reason_new}" * row.fails,
        row.since,
    )


def _render_differences(name: str, diff: Differences, rows: dict[Kind, Any]) -> str:
    regressions = _list_regressions(diff).items()
    return render(
        "fourbar_validation.regression",
        name,
        diff=diff,
        verdict=write_verdict(diff),
        regressions=[(heading, texts) for heading, texts in regressions if texts],
        kinds=[
            (
                f"{kind.capitalize()}: {len(diff.of(kind))}",
                _list_groups(diff, kind),
                cells,
            )
            for kind, cells in rows.items()
            if cells
        ],
        questions=[
            ("Scenes", [*map(str, diff.scenes), *diff.notes]),
            *_list_other_questions(diff).items(),
        ],
        headings=CHANGE_HEADINGS,
    )


def write_junit_of_changes(diff: Differences) -> str:
    """Write for the test page of a continuous-integration system: one case per row.

    A regression is a failure, and so is a row that fails as it did before; what was not
    compared is skipped.
    """
    return write_document(write_verdict(diff), _list_cases_of_changes(diff))


def _list_cases_of_changes(diff: Differences) -> Iterator[JunitCase]:
    bad = (*REGRESSIONS, Kind.STILL_FAILS)
    failures = diff.of(*bad)[:MOST_PASSING_CASES]
    others = diff.of(*(kind for kind in Kind if kind not in bad))[:MOST_PASSING_CASES]
    for row in failures.itertuples():
        yield make_case(row, "failure", row.kind, write_change_line(row))
    for row in others.itertuples():
        if row.verdict_new in HOLDING_VERDICTS:
            yield make_case(row)
        elif row.verdict_new:
            why = f"{row.verdict_new}: {row.reason_new}"
            yield make_case(row, "skipped", row.kind, why)
        else:
            yield make_case(row, "skipped", row.kind, write_change_line(row))
    for one in diff.weakened:
        told = ("failure", "weaker rule", str(one))
        yield JunitCase(one.name, one.name, f"rule: {one.what}", *told)
    yield from count_beyond(diff.rows - len(failures) - len(others))
    if diff.nothing:
        told = ("failure", "nothing compared", write_verdict(diff))
        yield JunitCase("all scenes", "all scenes", "anything is compared", *told)
