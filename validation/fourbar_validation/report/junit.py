"""JUnit XML, for the test page of a continuous-integration system."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from fourbar_validation.compare.rows import Row

MOST_PASSING_CASES = 10_000
"""Comparisons with a case of their own, besides as many that fail. The others are
counted.
"""


class JunitCase(NamedTuple):
    """One comparison."""

    suite: str
    classname: str
    name: str
    outcome: str
    """passed, failure or skipped."""
    kind: str = ""
    message: str = ""


def list_cases(rows: Iterable[Row]) -> Iterator[JunitCase]:
    """List the rows of a run as cases.

    What fails is a failure, and what was not compared is skipped.
    """
    counts = Counter[bool]()
    for row in rows:
        counts[row.failed] += 1
        if counts[row.failed] > MOST_PASSING_CASES:
            continue
        if row.compared and not row.failed:
            yield make_case(row)
        elif row.failed:
            why = f"error {row.error!r}, allowed {row.allowed!r}: {row.reason}"
            yield make_case(row, "failure", row.verdict, why)
        else:
            yield make_case(row, "skipped", row.verdict, row.reason)
    others = [count - MOST_PASSING_CASES for count in counts.values()]
    yield from count_beyond(sum(max(0, count) for count in others))


def make_case(row: Any, *told: str) -> JunitCase:
    """Make the case of a row.

    `told`: its outcome, kind and message; left out: it passed.
    """
    name = f"{row.scene}.{row.engine} {row.setting}"
    return JunitCase(row.scene, name, row.quantity, *(told or ("passed",)))


def count_beyond(rows: int) -> Iterator[JunitCase]:
    """Count what is not listed, as one case."""
    if rows > 0:
        name = f"{rows} rows more: see results.parquet"
        yield JunitCase("all scenes", "all scenes", name, "skipped", "not listed")


def write_document(title: str, cases: Iterable[JunitCase]) -> str:
    """Write the cases as JUnit XML, suite by suite."""
    import xml.etree.ElementTree as ET

    report = ET.Element("testsuites", name=title)
    suites: dict[str, ET.Element] = {}
    counts: Counter[tuple[str, str]] = Counter()
    for case in cases:
        if case.suite not in suites:
            suites[case.suite] = ET.SubElement(report, "testsuite", name=case.suite)
        element = ET.SubElement(
            suites[case.suite],
            "testcase",
            name=case.name,
            classname=case.classname,
            time="0.0",
        )
        if case.outcome != "passed":
            ET.SubElement(element, case.outcome, message=case.message, type=case.kind)
        for name in (case.suite, ""):
            counts.update(((name, "tests"), (name, case.outcome)))
    for name, element in {**suites, "": report}.items():
        element.set("tests", str(counts[name, "tests"]))
        element.set("failures", str(counts[name, "failure"]))
        element.set("skipped", str(counts[name, "skipped"]))
        element.set("errors", "0")
    return ET.tostring(report, encoding="unicode", xml_declaration=True) + "\n"
