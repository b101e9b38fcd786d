"""JUnit XML, for the test page of a continuous-integration system."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from fourbar_validation.compare.rows import Row

LISTED = 10_000
"""Comparisons with a case of their own, besides as many that fail; the others are counted."""


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
    """List the rows of a run: what fails is a failure, and what was not compared is skipped."""
    listed = failures = others = 0
    for row in rows:
        name = (row.scene, f"{row.scene}.{row.engine} {row.setting}", row.quantity)
        if row.failed and failures < LISTED:
            failures += 1
            yield JunitCase(
                *name, "failure", row.verdict, f"error {row.error!r}, allowed {row.allowed!r}: {row.reason}"
            )
        elif not row.failed and listed < LISTED:
            listed += 1
            yield JunitCase(*name, "passed") if row.compared else JunitCase(*name, "skipped", row.verdict, row.reason)
        else:
            others += 1
    yield from count_beyond(others)


def count_beyond(rows: int) -> Iterator[JunitCase]:
    """Count what is not listed, as one case."""
    if rows > 0:
        yield JunitCase("all scenes", "all scenes", f"{rows} rows more: see results.parquet", "skipped", "not listed")


def write_document(title: str, cases: Iterable[JunitCase]) -> str:
    """Write the cases as JUnit XML, suite by suite."""
    from junitparser import Failure, JUnitXml, Skipped, TestCase, TestSuite

    report = JUnitXml(title)
    suites: dict[str, TestSuite] = {}
    results = {"failure": Failure, "skipped": Skipped}
    for each in cases:
        case = TestCase(each.name, classname=each.classname, time=0.0)
        if each.outcome in results:
            case.result = [results[each.outcome](each.message, each.kind)]
        suites.setdefault(each.suite, TestSuite(each.suite)).add_testcase(case)
    for suite in suites.values():
        report.add_testsuite(suite)
    report.update_statistics()  # type: ignore[no-untyped-call]
    xml: str | bytes = report.tostring()  # type: ignore[no-untyped-call]
    return xml if isinstance(xml, str) else xml.decode("utf-8")
