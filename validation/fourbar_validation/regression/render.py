"""Differences as text, Markdown, HTML and JUnit XML."""

from collections.abc import Callable, Iterator, Sequence

from fourbar_validation.regression.change import OTHER_QUESTION, Change, KindOfChange
from fourbar_validation.regression.changes import Differences
from fourbar_validation.regression.fault import Group
from fourbar_validation.report.junit import JunitCase, count_beyond, write_document
from fourbar_validation.report.templating import render, write_error

KINDS_SHOWN = tuple(
    kind
    for kind in KindOfChange
    if kind
    not in (
        KindOfChange.SAME,
        KindOfChange.ROUND_OFF,
        KindOfChange.NOT_RUN,
        *OTHER_QUESTION,
    )
)
"""Kinds shown by engine and cause. Rows that were not run, or answer another question,
are named together.
"""
MOST_GROUPS_LISTED = 50
"""Engines and causes listed in text and Markdown."""
CHANGE_HEADINGS = (
    "scene",
    "engine",
    "quantity",
    "old error",
    "new error",
    "round-off",
    "old verdict",
    "new verdict",
)
MOST_ROWS_ON_THE_PAGE = 1000
"""Rows of one kind on the page."""
MOST_ROWS_IN_TEXT = 5
"""Rows of one kind listed there, the worst of them."""


def write_verdict(diff: Differences) -> str:
    """Write one line on how many rows regressed.

    What else moved, and the counts of the new run, follow.
    """
    counts = [
        f"{diff.kinds[kind]} {kind.value}" for kind in KindOfChange if diff.kinds[kind]
    ]
    many = diff.regressed
    if diff.weakened:
        rules = len(diff.weakened)
        counts.insert(0, f"{rules} rule{'s' if rules > 1 else ''} weaker")
    if many:
        head = f"{many} regression{'s' if many > 1 else ''}"
    else:
        head = "No regression"
    if diff.nothing and not many:
        head = "Nothing was compared"
    elif diff.strange:
        head = f"Runs of two suites: {head[:1].lower()}{head[1:]}"
    if diff.compared < diff.rows:
        rows = f"{diff.compared} of {diff.rows}"
    else:
        rows = f"{diff.rows}"
    if diff.baseline:
        head += f" against {diff.baseline}"
    if counts:
        moved = f" in {rows} rows: {', '.join(counts)}"
    else:
        moved = ""
    return f"{head}{moved}. New run: {diff.counts.sentence()}"


def _write_change_line(change: Change) -> str:
    """Write one change in one line of text."""
    name = " / ".join(part for part in change.key if part)
    if change.old is None:
        assert change.new is not None
        error = write_error(change.new.error)
        if not change.new.passed:
            why = f": {change.new.reason}"
        else:
            why = ""
        return f"{name}: {change.new.verdict}, error {error}{why}"
    if change.new is None:
        return (
            f"{name}: was {change.old.verdict}, error {write_error(change.old.error)}"
        )
    old = change.old
    new = change.new
    words = f"{name}: error {write_error(old.error)} -> {write_error(new.error)}"
    if old.verdict != new.verdict:
        words += f", {old.verdict} -> {new.verdict} ({new.reason})"
    elif new.failed:
        words += f", {new.verdict} ({new.reason})"
    return words + f"; round-off moves it by {write_error(change.round_off)}"


def write_differences(diff: Differences) -> str:
    """Write for a terminal: what is another question first.

    What the runs were made with follows, then the rows.
    """
    lines = [f"Weaker rule: {weakening}" for weakening in diff.weakened]
    lines += [*map(str, diff.scenes), *diff.notes]
    lines += [f"{what}: {old} -> {new}" for what, old, new in diff.surroundings]
    lines += [f"Not compared: {name}" for name in diff.not_compared]
    lines += [f"Not run: {name}" for name in diff.not_run]
    lines += [f"Allowed more: {name}" for name in diff.grown]
    lines += [f"Disagreement: {sentence}" for sentence in diff.fault.sentences]
    groups, more = _group_rows(diff)
    lines += [f"{_capitalise(group.kind.value)}: {group}" for group in groups] + more
    for kind in KINDS_SHOWN:
        lines += [
            f"{_capitalise(kind.value)}: {line}" for line in _list_worst(diff, kind)
        ]
    return "\n".join([*lines, f"{write_verdict(diff)}."]) + "\n"


def _capitalise(text: str) -> str:
    """Begin a line with a capital."""
    return text[:1].upper() + text[1:]


def _group_rows(diff: Differences) -> tuple[list[Group], list[str]]:
    """Group the rows that changed by engine and cause, the worst first.

    Say how many more there are.
    """
    groups = diff.fault.groups(KINDS_SHOWN)
    more = len(groups) - MOST_GROUPS_LISTED
    return groups[:MOST_GROUPS_LISTED], [
        f"and {more} more engines and causes"
    ] if more > 0 else []


def _list_worst(diff: Differences, kind: KindOfChange) -> list[str]:
    """List the worst rows of a kind; say how many more there are."""
    more = diff.kinds[kind] - MOST_ROWS_IN_TEXT
    return [
        _write_change_line(change) for change in diff.of(kind)[:MOST_ROWS_IN_TEXT]
    ] + ([f"and {more} more"] if more > 0 else [])


def _list_other_questions(diff: Differences) -> list[tuple[str, list[str]]]:
    """List what is another question or was not run, under its headings."""
    parts = {
        "Weaker rules": [str(weakening) for weakening in diff.weakened],
        "The scenes changed": [*map(str, diff.scenes), *diff.notes],
        "Not compared": diff.not_compared,
        "Not run": diff.not_run,
        "Allowed more than ten times as much": diff.grown,
        "Who disagrees": diff.fault.sentences,
    }
    return [(heading, texts) for heading, texts in parts.items() if texts]


def write_pull_request_comment(diff: Differences) -> str:
    """Write for a comment on a pull request."""
    groups, more = _group_rows(diff)
    return (
        _render_differences(
            "changes.md.j2",
            diff,
            groups,
            lambda kind: _list_worst(diff, kind),
            more,
        ).rstrip("\n")
        + "\n"
    )


def write_differences_page(diff: Differences) -> str:
    """Write a page of its own."""
    return _render_differences(
        "changes.html.j2",
        diff,
        diff.fault.groups(KINDS_SHOWN),
        lambda kind: _write_change_cells(diff.of(kind)),
        (),
    )


def _write_change_cells(changes: Sequence[Change]) -> list[tuple[str, ...]]:
    """Write the changes as the cells under CHANGE_HEADINGS."""
    cells: list[tuple[str, ...]] = []
    for change in changes[:MOST_ROWS_ON_THE_PAGE]:
        scene, engine, setting, quantity = change.key
        old, new = (
            (write_error(row.error), row.verdict) if row else ("", "")
            for row in (change.old, change.new)
        )
        if change.new and not change.new.passed:
            why = f": {change.new.reason}"
        else:
            why = ""
        cells.append(
            (
                scene,
                f"{engine} {setting}",
                quantity,
                old[0],
                new[0],
                write_error(change.round_off),
                old[1],
                new[1] + why,
            )
        )
    return cells


def _render_differences(
    name: str,
    diff: Differences,
    groups: list[Group],
    rows: Callable[[KindOfChange], Sequence[object]],
    more: Sequence[str],
) -> str:
    kinds = [
        (kind, [group for group in groups if group.kind is kind], rows(kind))
        for kind in KINDS_SHOWN
        if diff.kinds[kind]
    ]
    what = {
        "verdict": write_verdict(diff),
        "questions": _list_other_questions(diff),
        "more": more,
        "headings": CHANGE_HEADINGS,
    }
    return render(
        "fourbar_validation.regression",
        name,
        found=diff,
        kinds=kinds,
        **what,
    )


def write_junit_of_changes(diff: Differences) -> str:
    """Write for the test page of a continuous-integration system: one case per row.

    A regression is a failure, and so is a row that fails as it did before; what was not
    compared is skipped.
    """
    return write_document(write_verdict(diff), _list_cases_of_changes(diff))


def _list_cases_of_changes(diff: Differences) -> Iterator[JunitCase]:
    for change in diff.changes:
        scene, engine, setting, quantity = change.key
        name = (scene, f"{scene}.{engine} {setting}", quantity)
        kind = change.kind.value
        if change.regression or (change.new is not None and change.new.failed):
            yield JunitCase(
                *name,
                "failure",
                kind,
                _write_change_line(change),
            )
        elif change.new is None:
            yield JunitCase(
                *name,
                "skipped",
                kind,
                _write_change_line(change),
            )
        elif not change.new.compared:
            yield JunitCase(
                *name,
                "skipped",
                kind,
                f"{change.new.verdict}: {change.new.reason}",
            )
        else:
            yield JunitCase(*name, "passed")
    for weakening in diff.weakened:
        name = (weakening.name, weakening.name, f"rule: {weakening.what}")
        yield JunitCase(
            *name,
            "failure",
            "weaker rule",
            str(weakening),
        )
    yield from count_beyond(diff.rows - len(diff.changes))
    if diff.nothing:
        yield JunitCase(
            "all scenes",
            "all scenes",
            "anything is compared",
            "failure",
            "nothing compared",
            write_verdict(diff),
        )
