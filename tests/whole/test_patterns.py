"""Regular expressions against hostile repeats.

No text that somebody hands in may hang the program.
"""

import ast
import re
import time

from pytest import mark

from tests.whole.test_imports import PACKAGES, ROOT, parse

FUNCTIONS = {
    "compile",
    "match",
    "search",
    "fullmatch",
    "sub",
    "split",
    "findall",
    "finditer",
}
REPEATED = (
    "a",
    "0",
    " ",
    ".",
    "-",
    "^",
    "_",
    "/",
    "(",
    "[",
    "<",
    '"',
    "'",
    "=",
    ",",
    ":",
    "a0",
    "a.",
    "1.",
    "a ",
    "m^2 ",
    "m_",
    "N m",
    "1 ",
    "a-",
    '="',
    "[a",
    "{ a",
    "²",
)
"""Pieces of the texts; a pattern that can read one of them in two ways takes 2^n steps
to refuse n of them.
"""
ENDS = ("", "!", "^", "\n", "0^", ")")
LENGTHS = (8, 12, 16, 20, 24, 28, 32, 60, 600)
"""Characters. The short texts come first and grow by four, by which an exponential
pattern takes 16 times as long, so that a bad one is named on any machine within the
time of the test.
"""
SECONDS = 0.25
"""Processor time of one search. The slowest takes 0.02 s; a quadratic one passes, an
exponential one cannot.
"""


def list_patterns():
    """List the literal patterns of the three packages, each with its place."""
    for folder in PACKAGES.values():
        for path in sorted(folder.rglob("*.py")):
            for node in ast.walk(parse(path)):
                match node:
                    case ast.Call(
                        ast.Attribute(ast.Name("re"), name), [ast.Constant(pattern), *_]
                    ) if name in FUNCTIONS:
                        place = f"{path.relative_to(ROOT)}:{node.lineno}"
                        yield place, re.compile(str(pattern))


def measure_slowest(pattern):
    """Return the longest processor time of a search in hostile texts, s, up to the
    first that is too long.
    """
    slowest = 0.0
    for length in LENGTHS:
        for piece in REPEATED:
            for end in ENDS:
                text = (length * piece)[:length] + end
                started = time.process_time()
                pattern.fullmatch(text)
                pattern.search(text)
                slowest = max(slowest, time.process_time() - started)
                if slowest > SECONDS:
                    return slowest
    return slowest


@mark.slow
@mark.timeout(300)
def test_a_hostile_repeat_is_refused_at_once():
    patterns = dict(list_patterns())
    assert len(patterns) > 30
    assert any(place.startswith("fourbar/quantities/units.py") for place in patterns)
    slow = [
        place
        for place, pattern in patterns.items()
        if measure_slowest(pattern) > SECONDS
    ]
    assert not slow


@mark.slow
def test_a_pattern_with_two_readings_is_caught():
    assert measure_slowest(re.compile("(?:[a-z]+)+")) > SECONDS
