"""JUnit XML, for the test page of a continuous-integration system."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
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
    return make_cases(rows, _tell_row)


def _tell_row(row: Row) -> tuple[str, ...]:
    if row.compared and not row.failed:
        return ()
    if row.failed:
        why = f"error {row.error!r}, allowed {row.allowed!r}: {row.reason}"
        return "failure", row.verdict, why
    return "skipped", row.verdict, row.reason


def make_cases(
    rows: Iterable[Any],
    tell: Callable[[Any], tuple[str, ...]],
) -> Iterator[JunitCase]:
    """Make a case of each row; of many the first that fail and the first others.

    `tell`: tells outcome, kind and message of a row; nothing where it passed.
    """
    counts = Counter[bool]()
    for row in rows:
        told = tell(row) or ("passed",)
        failed = told[0] == "failure"
        counts[failed] += 1
        if counts[failed] <= MOST_PASSING_CASES:
            name = f"{row.scene}.{row.engine} {row.setting}"
            yield JunitCase(row.scene, name, row.quantity, *told)
    more = sum(max(0, count - MOST_PASSING_CASES) for count in counts.values())
    if more:
        name = f"{more} rows more: see results.parquet"
        yield JunitCase("all scenes", "all scenes", name, "skipped", "not listed")


def write_document(title: str, cases: Iterable[JunitCase]) -> str:
    """Write the cases as JUnit XML, suite by suite."""
    import xml.etree.ElementTree as ET

    suites: dict[str, list[JunitCase]] = {}
    for case in cases:
        suites.setdefault(case.suite, []).append(case)
    every = [*chain.from_iterable(suites.values())]
    report = ET.Element("testsuites", {"name": title} | _count(every))
    for name, of_suite in suites.items():
        suite = ET.SubElement(report, "testsuite", {"name": name} | _count(of_suite))
        for case in of_suite:
            named = {"name": case.name, "classname": case.classname, "time": "0.0"}
            element = ET.SubElement(suite, "testcase", named)
            if case.outcome != "passed":
                told = {"message": case.message, "type": case.kind}
                ET.SubElement(element, case.outcome, told)
    return ET.tostring(report, encoding="unicode", xml_declaration=True) + "\n"


def _count(cases: Sequence[JunitCase]) -> dict[str, str]:
    """Count cases by their outcome."""
    outcomes = Counter(case.outcome for case in cases)
    return {
        "tests": str(len(cases)),
        "failures": str(outcomes["failure"]),
        "skipped": str(outcomes["skipped"]),
        "errors": "0",
    }
