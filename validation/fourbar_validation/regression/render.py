"""Differences as text, Markdown, HTML and JUnit XML."""

from collections.abc import Callable, Iterator, Sequence

from fourbar_validation.regression.change import OTHER_QUESTION, Change, Kind
from fourbar_validation.regression.changes import Differences
from fourbar_validation.regression.fault import Group
from fourbar_validation.report.junit import JunitCase, count_beyond, write_document
from fourbar_validation.report.templating import render, write_number

SHOWN = tuple(kind for kind in Kind if kind not in (Kind.SAME, Kind.ROUND_OFF, Kind.NOT_RUN, *OTHER_QUESTION))
"""Kinds shown by engine and cause; rows that were not run, or ask another question, are named together."""
AT_MOST = 50
"""Engines and causes listed in text and Markdown."""
HEADINGS = (
    "scene", "engine", "quantity", "old error", "new error", "round-off", "old verdict", "new verdict",
)  # fmt: skip
LISTED = 1000
"""Rows of one kind on the page."""
ROWS = 5
"""Rows of one kind listed there, the worst of them."""


def write_verdict(found: Differences) -> str:
    """Write one line: how many regressions among how many rows, what else moved, and the counts of the new run."""
    counts = [f"{found.kinds[kind]} {kind.value}" for kind in Kind if found.kinds[kind]]
    many = found.regressed
    head = f"{many} regression{'s' if many > 1 else ''}" if many else "No regression"
    if found.nothing and not many:
        head = "Nothing was compared with the old run"
    rows = f"{found.compared} of {found.rows}" if found.compared < found.rows else f"{found.rows}"
    moved = f" in {rows} rows: {', '.join(counts)}" if counts else ""
    return f"{head}{moved}. New run: {found.counts.sentence()}"


def write_line(change: Change) -> str:
    """Write one change in one line of text."""
    name = " / ".join(part for part in change.key if part)
    if change.old is None:
        assert change.new is not None
        return f"{name}: {change.new.verdict}, error {write_number(change.new.error)}"
    if change.new is None:
        return f"{name}: was {change.old.verdict}, error {write_number(change.old.error)}"
    old, new = change.old, change.new
    words = f"{name}: error {write_number(old.error)} -> {write_number(new.error)}"
    if old.verdict != new.verdict:
        words += f", {old.verdict} -> {new.verdict} ({new.reason})"
    return words + f"; round-off moves it by {write_number(change.round_off)}"


def write_text(found: Differences) -> str:
    """Write for a terminal: what is another question first, then what it was made with, then the rows."""
    lines = [*map(str, found.scenes), *found.notes]
    lines += [f"{what}: {old} -> {new}" for what, old, new in found.surroundings]
    lines += [f"not compared: {name}" for name in found.not_compared]
    lines += [f"not run: {name}" for name in found.not_run]
    lines += [f"disagree: {sentence}" for sentence in found.fault.sentences]
    groups, more = _group_rows(found)
    lines += [f"{group.kind.value}: {group}" for group in groups] + more
    for kind in SHOWN:
        lines += [f"{kind.value}: {each}" for each in _list_worst(found, kind)]
    return "\n".join([*lines, write_verdict(found)]) + "\n"


def _group_rows(found: Differences) -> tuple[list[Group], list[str]]:
    """Group the rows that changed by engine and cause, the worst first; say how many more there are."""
    groups = found.fault.groups(SHOWN)
    more = len(groups) - AT_MOST
    return groups[:AT_MOST], [f"and {more} more engines and causes"] if more > 0 else []


def _list_worst(found: Differences, kind: Kind) -> list[str]:
    """List the worst rows of a kind; say how many more there are."""
    more = found.kinds[kind] - ROWS
    return [write_line(each) for each in found.of(kind)[:ROWS]] + ([f"and {more} more"] if more > 0 else [])


def list_other_questions(found: Differences) -> list[tuple[str, list[str]]]:
    """List what is another question or was not run, under its headings."""
    parts = {
        "The scenes changed": [*map(str, found.scenes), *found.notes],
        "Not compared": found.not_compared,
        "Not run": found.not_run,
        "Who disagrees": found.fault.sentences,
    }
    return [(heading, texts) for heading, texts in parts.items() if texts]


def write_markdown(found: Differences) -> str:
    """Write for a comment on a pull request."""
    groups, more = _group_rows(found)
    return _render("changes.md.j2", found, groups, lambda kind: _list_worst(found, kind), more).rstrip("\n") + "\n"


def write_html(found: Differences) -> str:
    """Write a page of its own."""
    return _render("changes.html.j2", found, found.fault.groups(SHOWN), lambda kind: _write_cells(found.of(kind)), ())


def _write_cells(changes: Sequence[Change]) -> list[tuple[str, ...]]:
    """Write the changes as the cells under HEADINGS."""
    cells: list[tuple[str, ...]] = []
    for each in changes[:LISTED]:
        scene, engine, setting, quantity = each.key
        old, new = ((write_number(row.error), row.verdict) if row else ("", "") for row in (each.old, each.new))
        why = f": {each.new.reason}" if each.new and not each.new.passed else ""
        cells.append(
            (scene, f"{engine} {setting}", quantity, old[0], new[0], write_number(each.round_off), old[1], new[1] + why)
        )
    return cells


def _render(
    name: str, found: Differences, groups: list[Group], rows: Callable[[Kind], Sequence[object]], more: Sequence[str]
) -> str:
    kinds = [(kind, [each for each in groups if each.kind is kind], rows(kind)) for kind in SHOWN if found.kinds[kind]]
    what = {
        "verdict": write_verdict(found),
        "questions": list_other_questions(found),
        "more": more,
        "headings": HEADINGS,
    }
    return render("fourbar_validation.regression", name, found=found, kinds=kinds, **what)


def write_junit(found: Differences) -> str:
    """Write for the test page of a continuous-integration system: one case per row.

    A regression is a failure, and so is a row that fails as it did before; what was not compared is skipped.
    """
    return write_document(write_verdict(found), _list_cases(found))


def _list_cases(found: Differences) -> Iterator[JunitCase]:
    for change in found.changes:
        scene, engine, setting, quantity = change.key
        name, kind = (scene, f"{scene}.{engine} {setting}", quantity), change.kind.value
        if change.regression or (change.new is not None and change.new.failed):
            yield JunitCase(*name, "failure", kind, write_line(change))
        elif change.new is None:
            yield JunitCase(*name, "skipped", kind, write_line(change))
        elif not change.new.compared:
            yield JunitCase(*name, "skipped", kind, f"{change.new.verdict}: {change.new.reason}")
        else:
            yield JunitCase(*name, "passed")
    yield from count_beyond(found.rows - len(found.changes))
    if found.nothing:
        yield JunitCase(
            "all scenes", "all scenes", "anything is compared", "failure", "nothing compared", write_verdict(found)
        )
