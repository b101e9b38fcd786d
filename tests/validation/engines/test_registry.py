"""Engines of the lab join a run where it is there."""

import pytest

from fourbar_validation.engines import registry
from fourbar_validation.engines.environments import fill_table

NAMES = ["exudyn-constraints", "opensim-constraints", "drake-inverse"]


@pytest.fixture
def afresh():
    registry.load_further.cache_clear()
    yield
    registry.load_further.cache_clear()


def test_the_lab_alone_adds_engines(afresh, monkeypatch):
    ours = [engine.name for engine in registry.ENGINES]
    lab = registry.load_further()
    assert [engine.name for engine in lab] == NAMES
    assert all(engine.code and engine.code in engine.fingerprint() for engine in lab)
    assert [*fill_table()][: len(ours) + 3] == ours + NAMES
    monkeypatch.setattr(registry, "LAB", None)
    registry.load_further.cache_clear()
    assert registry.load_further() == ()
    assert not fill_table().keys() & {*NAMES}


def test_ctrl_c_while_a_compiled_module_starts_is_no_broken_library(
    tmp_path, monkeypatch
):
    """pybind11 raises an ImportError then, from what ended it."""
    module = "raise ImportError('initialization failed') from KeyboardInterrupt()\n"
    (tmp_path / "interrupted.py").write_text(module)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        registry.find_missing("interrupted")
