"""Fixtures of the tests of robots."""

from contextlib import contextmanager
from pkgutil import resolve_name

import pytest

from fourbar_validation.robots import command, judge, measure, mimic


@pytest.fixture
def in_this_process(monkeypatch):
    """Let MuJoCo look at files in this process: to start one takes a second."""

    @contextmanager
    def examine(file, seconds=None):
        yield lambda adapter, *arguments: resolve_name(adapter)(*arguments)

    for module in (command, judge, measure, mimic):
        monkeypatch.setattr(module, "examine_guarded", examine)
