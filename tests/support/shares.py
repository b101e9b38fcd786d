"""Shares of a table of cases that the quick tests take, and those of a day."""

import os
from collections.abc import Container, Iterable
from typing import Any

import pytest

ALL_CASES = os.environ.get("CASES") == "all"
"""Whether every case is tried, as `make long-cases` does."""


def take_share(count: int, cases: Iterable[Any], first: int = 0) -> list[Any]:
    """Return one case in so many from the first one on, and by night all of them."""
    return list(cases) if ALL_CASES else list(cases)[first::count]


def slow_but(quick: Container[Any], cases: Iterable[Any]) -> list[Any]:
    """Return the cases of a test, of which all but the quick ones are slow.

    A case of several arguments is a tuple.
    """
    return [
        pytest.param(
            *(case if isinstance(case, tuple) else (case,)),
            marks=[] if case in quick else pytest.mark.slow,
        )
        for case in cases
    ]
