"""Fixtures of the tests of robots."""

from contextlib import contextmanager
from pkgutil import resolve_name

import pytest

from fourbar_validation.robots import judge_loop, judge_mimic, loop_errors, loops


@pytest.fixture
def in_this_process(monkeypatch):
    """Let MuJoCo look at files in this process: to start one takes a second."""

    @contextmanager
    def examine(file, seconds=None):
        yield lambda adapter, *arguments: resolve_name(adapter)(*arguments)

    for module in (loops, judge_loop, loop_errors, judge_mimic):
        monkeypatch.setattr(module, "examine_guarded", examine)
