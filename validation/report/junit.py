"""JUnit XML, for the test page of a continuous-integration system."""

from collections.abc import Iterable
from typing import NamedTuple


class Case(NamedTuple):
    """One comparison."""

    suite: str
    classname: str
    name: str
    outcome: str
    """passed, failure or skipped."""
    kind: str = ""
    message: str = ""


def document(title: str, cases: Iterable[Case]) -> str:
    """The cases as JUnit XML, suite by suite."""
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
