"""Differences as text, Markdown, HTML and JUnit XML."""

from collections.abc import Iterator

from validation.regression.changes import OTHER_QUESTION, Change, Differences, Kind
from validation.report.junit import Case, document
from validation.report.markdown import cell
from validation.report.templating import environment, number

SHOWN = tuple(kind for kind in Kind if kind not in (Kind.SAME, Kind.ROUND_OFF, Kind.NOT_RUN, *OTHER_QUESTION))
"""Listed row by row; what was not run, or is another question, is named as a whole."""
AT_MOST = 50
"""Rows of one kind listed in text and Markdown."""


def verdict(found: Differences) -> str:
    """One line: how many regressions among how many rows, what else moved, and the counts of the new run."""
    counts = [f"{len(found.of(kind))} {kind.value}" for kind in Kind if found.of(kind)]
    many = len(found.regressions)
    head = f"{many} regression{'s' if many > 1 else ''}" if many else "No regression"
    if found.nothing and not many:
        head = "Nothing was compared with the old run"
    moved = f" in {len(found.changes)} rows: {', '.join(counts)}" if counts else ""
    return f"{head}{moved}. New run: {found.counts.sentence()}"


def line(change: Change) -> str:
    """One change in one line of text."""
    name = " / ".join(part for part in change.key if part)
    if change.old is None:
        assert change.new is not None
        return f"{name}: {change.new.verdict}, error {number(change.new.error)}"
    if change.new is None:
        return f"{name}: was {change.old.verdict}, error {number(change.old.error)}"
    old, new = change.old, change.new
    words = f"{name}: error {number(old.error)} -> {number(new.error)}"
    if old.verdict != new.verdict:
        words += f", {old.verdict} -> {new.verdict} ({new.reason})"
    return words + f"; round-off moves it by {number(change.round_off)}"


def text(found: Differences) -> str:
    """For a terminal: what is another question first, then what it was made with, then the rows."""
    lines = [*map(str, found.scenes), *found.notes]
    lines += [f"{what}: {old} -> {new}" for what, old, new in found.surroundings]
    lines += [f"not compared: {name}" for name in found.not_compared]
    lines += [f"not run: {name}" for name in found.not_run]
    lines += [f"time: {change}" for change in found.slower]
    for kind in SHOWN:
        changes = found.of(kind)
        lines += [f"{kind.value}: {line(change)}" for change in changes[:AT_MOST]]
        if len(changes) > AT_MOST:
            lines.append(f"{kind.value}: and {len(changes) - AT_MOST} more")
    return "\n".join([*lines, verdict(found)]) + "\n"


def other_questions(found: Differences) -> list[tuple[str, list[str]]]:
    """What is another question, was not run, or took longer, under its headings."""
    parts = {
        "The scenes changed": [*map(str, found.scenes), *found.notes],
        "Not compared": found.not_compared,
        "Not run": found.not_run,
        "Times": [*map(str, found.slower)],
    }
    return [(heading, texts) for heading, texts in parts.items() if texts]


def markdown(found: Differences) -> str:
    """For a comment on a pull request."""
    lines = [f"# {verdict(found)}", ""]
    for heading, texts in other_questions(found):
        lines += [f"## {heading}", "", *(f"- {cell(text)}" for text in texts), ""]
    if found.surroundings:
        lines += ["| made with | old | new |", "|---|---|---|"]
        lines += [f"| {cell(what)} | {cell(old)} | {cell(new)} |" for what, old, new in found.surroundings]
        lines.append("")
    for kind in SHOWN:
        if changes := found.of(kind):
            lines += [f"## {kind.value}: {len(changes)}", ""]
            lines += [f"- {cell(line(change))}" for change in changes[:AT_MOST]]
            if len(changes) > AT_MOST:
                lines.append(f"- and {len(changes) - AT_MOST} more")
            lines.append("")
    return "\n".join(lines)


def html(found: Differences) -> str:
    """A page of its own."""
    kinds = [(kind, found.of(kind)) for kind in SHOWN if found.of(kind)]
    template = environment("validation.regression", escape=True).get_template("changes.html.j2")
    return template.render(found=found, verdict=verdict(found), kinds=kinds, questions=other_questions(found))


def junit(found: Differences) -> str:
    """For the test page of a continuous-integration system: one case per row.

    A regression is a failure, and so is a row that fails as it did before; what was not compared is skipped.
    """
    return document(verdict(found), _cases(found))


def _cases(found: Differences) -> Iterator[Case]:
    for change in found.changes:
        scene, engine, setting, quantity = change.key
        name, kind = (scene, f"{scene}.{engine} {setting}", quantity), change.kind.value
        if change.regression or (change.new is not None and change.new.failed):
            yield Case(*name, "failure", kind, line(change))
        elif change.new is None:
            yield Case(*name, "skipped", kind, line(change))
        elif not change.new.compared:
            yield Case(*name, "skipped", kind, f"{change.new.verdict}: {change.new.reason}")
        else:
            yield Case(*name, "passed")
    if found.nothing:
        yield Case("all scenes", "all scenes", "anything is compared", "failure", "nothing compared", verdict(found))
