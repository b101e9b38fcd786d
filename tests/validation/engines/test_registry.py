"""Engines of the lab join a run where it is installed.

No other distribution adds one.
"""

from importlib.metadata import Distribution, PackageNotFoundError

import pytest

from fourbar_validation.engines import registry
from fourbar_validation.engines.registry import Engine
from tests.whole.test_imports import ROOT


def installed(folder, name, entries):
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n"
    )
    (info / "entry_points.txt").write_text(entries)


@pytest.fixture
def only(tmp_path, monkeypatch):
    """A folder that has all distributions."""

    def find(name):
        for one in Distribution.discover(path=[str(tmp_path)]):
            if one.metadata["Name"] == name:
                return one
        raise PackageNotFoundError(name)

    monkeypatch.setattr(registry, "distribution", find)
    yield tmp_path
    registry.load_further.cache_clear()


def load():
    registry.load_further.cache_clear()
    return registry.load_further()


NAMES = ["exudyn-constraints", "opensim-constraints", "drake-inverse"]


def test_the_lab_alone_adds_engines(only, monkeypatch):
    assert [
        engine.name for engine in load()
    ] == NAMES  # of the checkout, where it lies on the path
    monkeypatch.setattr(registry, "CHECKOUT", None)
    assert load() == ()
    installed(only, "stranger", "[fourbar.engines]\nmine = os:abort\n")
    assert load() == ()
    project = (ROOT / "lab" / "pyproject.toml").read_text()
    lines = (
        project.partition('entry-points."fourbar.engines"]')[2]
        .partition("[")[0]
        .replace('"', "")
        .splitlines()[1:]
    )
    installed(
        only,
        "fourbar-lab",
        "[fourbar.engines]\n" + "\n".join(lines) + "\n[other]\nmine = os:abort\n",
    )
    engines = load()
    assert [engine.name for engine in engines] == NAMES
    assert all(
        isinstance(engine, Engine)
        and engine.code in engine.fingerprint()
        and engine.code
        for engine in engines
    )


def test_ctrl_c_while_a_compiled_module_starts_is_no_broken_library(
    tmp_path, monkeypatch
):
    """pybind11 raises an ImportError then, from what ended it."""
    module = "raise ImportError('initialization failed') from KeyboardInterrupt()\n"
    (tmp_path / "interrupted.py").write_text(module)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        registry.find_missing("interrupted")
