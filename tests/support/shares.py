"""Shares of a table of cases that the quick tests take."""

import pytest


def slow_but(quick, cases):
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
