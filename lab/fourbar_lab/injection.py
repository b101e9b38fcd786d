"""Inject faults, one after another.

A module is loaded with another text, then the harness checks the test scenes. Run by
its path, with the packages on PYTHONPATH: `python -P injection.py NUMBER...` prints
what failed as JSON, a line for each fault; without a number nothing is injected and
every test scene must hold. The number of an entry that a test catches, alone, runs its
tests and prints how they ended. As a module it would import the project before the
fault stands.
"""

import json
import sys
import time
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.machinery import PathFinder, SourceFileLoader
from itertools import chain
from pathlib import Path
from types import CodeType
from typing import Any
from unittest.mock import patch

FAULTS = Path(__file__).parent / "faults.toml"
CHANGEABLE_PACKAGES = ("fourbar", "fourbar_validation", "tests")
"""Packages that an entry may change, in the checkout or as they are installed."""


def read_faults() -> list[dict[str, Any]]:
    """Read the list.

    The keys of an entry are fault, file, old and new; scenes, caught_by and perhaps
    harmless where a run catches it, tests where a test does.
    """
    document = tomllib.loads(FAULTS.read_text(encoding="utf-8"))
    entries: list[dict[str, Any]] = document["injected"]
    return entries


def inject_fault(entry: dict[str, Any]) -> dict[str, str]:
    """Change the text of modules, by their names.

    Raises ValueError if the entry no longer fits one.
    """
    texts = {}
    for change in (entry, entry.get("also")):
        if change is None:
            continue
        file, old = change["file"], change["old"]
        text = _find_module_file(file).read_text(encoding="utf-8")
        if (count := text.count(old)) != 1:
            raise ValueError(f"{entry['fault']}: {count} places in {file} read {old!r}")
        name = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        texts[name] = text.replace(old, change["new"])
    return texts


def _find_module_file(name: str) -> Path:
    """Find a file of a package that is not imported."""
    package, _, rest = name.partition("/")
    spec = PathFinder.find_spec(package)
    assert (
        package in CHANGEABLE_PACKAGES and spec is not None and spec.origin is not None
    ), name
    return Path(spec.origin).parent / rest


@contextmanager
def _inject(entry: dict[str, Any]) -> Iterator[None]:
    """Load the modules that an entry changes with its text.

    Raises RuntimeError if one of them is not loaded.
    """
    texts = inject_fault(entry)
    left = set(texts)
    load = SourceFileLoader.get_code

    def get_code(loader: Any, fullname: str) -> CodeType | None:
        if fullname not in texts:
            return load(loader, fullname)
        left.discard(fullname)
        # the cache is of the file
        code: CodeType = loader.source_to_code(texts[fullname].encode(), loader.path)
        return code

    with patch.object(SourceFileLoader, "get_code", get_code):
        yield
    if left:
        raise RuntimeError(f"nothing uses {', '.join(left)}")


def _list_failing(names: Iterable[str]) -> dict[str, list[str]]:
    """Check test scenes, and list the rows that fail by their names.

    A row is "engine quantity: reason".
    """
    from fourbar_lab.fault_scenes import FAULT_SCENES
    from fourbar_validation.engines.registry import ENGINES, HARD_ENGINES
    from fourbar_validation.run.judge import judge

    failing = {}
    for name in names:
        how, _, scene = name.rpartition(", ")
        offered = HARD_ENGINES if how == "to full accuracy" else ENGINES
        simulated = how == "simulated"
        engines = [engine for engine in offered if simulated or not engine.through_time]
        rows = judge(name, FAULT_SCENES[scene], engines).rows
        failing[name] = [
            f"{row.engine} {row.quantity}: {row.reason}" for row in rows if row.failed
        ]
    return failing


def _run_tests(entry: dict[str, Any]) -> dict[str, float]:
    """Run the quick tests that an entry names, with its fault.

    Return pytest's exit status and the processor time, s.
    """
    import pytest

    quick = ["-x", "-n", "0", "-p", "no:cacheprovider", "-m", "not slow"]
    with _inject(entry):
        status = pytest.main([*quick, entry["tests"]])
    return {"status": int(status), "seconds": time.process_time()}


def inject_and_judge() -> None:
    """Inject the fault of each number, check its test scenes, print what fails."""
    numbers = [int(number) for number in sys.argv[1:]]
    if not numbers:
        listed = [entry.get("scenes", ()) for entry in read_faults()]
        print(json.dumps(_list_failing(sorted({*chain.from_iterable(listed)}))))
    if len(numbers) == 1 and "tests" in (entry := read_faults()[numbers[0]]):
        print(json.dumps(_run_tests(entry)))
        return
    for number in numbers:
        # modules of the previous fault; the engines' libraries stay
        for name in list(sys.modules):
            if name.partition(".")[0] in (*CHANGEABLE_PACKAGES, "fourbar_lab"):
                del sys.modules[name]
        entry = read_faults()[number]
        with _inject(entry):
            failing = _list_failing(entry["scenes"])
        print(json.dumps(failing))


if __name__ == "__main__":
    inject_and_judge()
