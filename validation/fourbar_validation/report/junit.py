"""JUnit XML, for the test page of a continuous-integration system."""

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple

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
    listed = failures = others = 0
    for row in rows:
        name = (row.scene, f"{row.scene}.{row.engine} {row.setting}", row.quantity)
        if row.failed and failures < MOST_PASSING_CASES:
            failures += 1
            yield JunitCase(
                *name,
                "failure",
                row.verdict,
                f"error {row.error!r}, allowed {row.allowed!r}: {row.reason}",
            )
        elif not row.failed and listed < MOST_PASSING_CASES:
            listed += 1
            yield (
                JunitCase(*name, "passed")
                if row.compared
                else JunitCase(
                    *name,
                    "skipped",
                    row.verdict,
                    row.reason,
                )
            )
        else:
            others += 1
    yield from count_beyond(others)


def count_beyond(rows: int) -> Iterator[JunitCase]:
    """Count what is not listed, as one case."""
    if rows > 0:
        yield JunitCase(
            "all scenes",
            "all scenes",
            f"{rows} rows more: see results.parquet",
            "skipped",
            "not listed",
        )


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
        for attribute, outcome in (
            ("tests", "tests"),
            ("failures", "failure"),
            ("skipped", "skipped"),
        ):
            element.set(attribute, str(counts[name, outcome]))
        element.set("errors", "0")
    return ET.tostring(report, encoding="unicode", xml_declaration=True) + "\n"
