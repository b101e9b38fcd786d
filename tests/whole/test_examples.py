"""Examples in docstrings print what they say."""

import doctest
from importlib import import_module

import pytest

from tests.whole.test_imports import PACKAGES, ROOT

MET_FIRST = {
    "fourbar.formulas": ("position", "motion", "pin_forces", "torque", "path"),
    "fourbar.effects": ("effect",),
    "fourbar.evaluation": ("case",),
    "fourbar_validation.compare": ("rows",),
    "fourbar_validation.run": ("judge", "question"),
}
"""Modules that have examples: those that one meets first."""


def find_modules():
    """Return the names of the modules whose docstrings have an example."""
    names = []
    for folder in PACKAGES.values():
        for path in sorted(folder.rglob("*.py")):
            if ">>> " in path.read_text("utf-8"):
                module = path.relative_to(folder.parent).with_suffix("")
                names.append(".".join(module.parts).removesuffix(".__init__"))
    return names


MODULES = find_modules()


@pytest.mark.parametrize("name", MODULES)
def test_examples_print_what_they_say(name, monkeypatch):
    monkeypatch.chdir(ROOT)  # some load a scene of `models`
    failed, attempted = doctest.testmod(import_module(name))
    assert failed == 0
    assert attempted > 0


def test_what_one_meets_first_has_an_example():
    first = {
        f"{package}.{name}" for package, names in MET_FIRST.items() for name in names
    }
    assert first <= set(MODULES)
