"""Differences as text, Markdown, HTML and JUnit XML."""

from validation.regression.changes import Change, Differences, Kind
from validation.report.markdown import cell
from validation.report.templating import environment, number

SHOWN = tuple(kind for kind in Kind if kind not in (Kind.SAME, Kind.ROUND_OFF))
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
    """For a terminal."""
    lines = [f"{what}: {old} -> {new}" for what, old, new in found.surroundings]
    for kind in SHOWN:
        changes = found.of(kind)
        lines += [f"{kind.value}: {line(change)}" for change in changes[:AT_MOST]]
        if len(changes) > AT_MOST:
            lines.append(f"{kind.value}: and {len(changes) - AT_MOST} more")
    return "\n".join([*lines, verdict(found)]) + "\n"


def markdown(found: Differences) -> str:
    """For a comment on a pull request."""
    lines = [f"# {verdict(found)}", ""]
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
    return template.render(found=found, verdict=verdict(found), kinds=kinds)


def junit(found: Differences) -> str:
    """For the test page of a continuous-integration system: one case per row.

    A regression is a failure, and so is a row that fails as it did before; what was not compared is skipped.
    """
    from junitparser import Failure, JUnitXml, Skipped, TestCase, TestSuite

    report = JUnitXml(verdict(found))
    suites: dict[str, TestSuite] = {}
    for change in found.changes:
        scene, engine, setting, quantity = change.key
        suite = suites.setdefault(scene, TestSuite(scene))
        case = TestCase(quantity, classname=f"{scene}.{engine} {setting}", time=0.0)
        if change.regression or (change.new is not None and change.new.failed):
            case.result = [Failure(line(change), change.kind.value)]
        elif change.new is None:
            case.result = [Skipped(line(change), change.kind.value)]
        elif not change.new.compared:
            case.result = [Skipped(f"{change.new.verdict}: {change.new.reason}", change.kind.value)]
        suite.add_testcase(case)
    if found.nothing:
        suites[""] = TestSuite("all scenes")
        case = TestCase("anything is compared", classname="all scenes", time=0.0)
        case.result = [Failure(verdict(found), "nothing compared")]
        suites[""].add_testcase(case)
    for suite in suites.values():
        report.add_testsuite(suite)
    report.update_statistics()  # type: ignore[no-untyped-call]
    xml: str | bytes = report.tostring()  # type: ignore[no-untyped-call]
    return xml if isinstance(xml, str) else xml.decode("utf-8")
