"""Imports run downwards from layer to layer, and solving loads numpy alone."""

import ast
import runpy
from collections import Counter
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module

from pytest import mark

from tests.support.checkout import ROOT, read, run_python

HEAVY = (
    "pint",
    "click",
    "rich",
    "jinja2",
    "matplotlib",
    "scipy",
    "mujoco",
    "pinocchio",
    "flint",
    "mpmath",
    "tornado",
)
ENGINES = {
    name: name.removeprefix("py")
    for name in ("mujoco", "pinocchio", "exudyn", "opensim", "pydrake")
}
PACKAGES = {
    "fourbar": ROOT / "fourbar",
    "fourbar_validation": ROOT / "validation" / "fourbar_validation",
    "fourbar_lab": ROOT / "lab" / "fourbar_lab",
}
LAYERS = {
    "fourbar": (
        "errors",
        "quantities",
        "linkage writing",
        "formulas",
        "effects",
        "scene",
        "solution",
        "evaluation",
        "solving",
        "files mjcf studies",
        "show",
        "edit",
        "cli",
    ),
    "fourbar_validation": (
        "models places",
        "compare scenes",
        "engines",
        "report",
        "engine regression robots",
        "advise check published run",
        "cost",
        "cli",
    ),
}
"""From the ground up: no layer imports one above it or on its own floor, not even
inside a function.
"""
ON_ONE_FLOOR = {("files", "studies"), ("scenes", "compare"), ("run", "check")}
"""Of two layers on one floor the first may use the second."""
MOST = {"fourbar": 16, "fourbar_validation": 15}
"""Entries at a package's own level, dunder files not counted: what a stranger can take
in at a glance.
"""


@cache
def parse(path):
    return ast.parse(read(path))


@cache
def imported(path, *, types=False):
    """Full names of all modules that a file imports when it runs, at any depth.

    With those of its types if wanted.
    """
    names = set()
    nodes = {*ast.walk(parse(path))}
    for node in [*nodes]:
        match node:
            case ast.If(ast.Name("TYPE_CHECKING")) if not types:
                nodes -= {*ast.walk(node)}
    for node in nodes:
        match node:
            case ast.Import(aliases):
                names |= {alias.name for alias in aliases}
            case ast.ImportFrom(str(module), aliases):
                names |= {module, *(f"{module}.{alias.name}" for alias in aliases)}
    return names


def test_solving_loads_numpy_alone():
    """With the names that a first program uses.

    The others are imported on their first use.
    """
    code = (
        "import sys; from fourbar import FourBar, Motion, Scene, solve, uniform;"
        " print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    )
    out = run_python("-c", code).stdout.split()
    assert "numpy" in out
    assert not set(HEAVY) & set(out)


def test_the_product_knows_neither_harness_nor_engines():
    for path in PACKAGES["fourbar"].rglob("*.py"):
        roots = {name.partition(".")[0] for name in imported(path)}
        assert not roots & {"fourbar_validation", "tests", *ENGINES}, path


def test_each_engine_is_imported_under_its_own_name_alone():
    for package in ("fourbar_validation", "fourbar_lab"):
        for path in PACKAGES[package].rglob("*.py"):
            roots = {name.partition(".")[0] for name in imported(path)}
            assert "tests" not in roots, path
            for engine in roots & ENGINES.keys():
                assert {"engines", "simulators"} & {*path.relative_to(ROOT).parts}
                assert ENGINES[engine] in path.relative_to(ROOT).as_posix()


def layer(name):
    """The layer of a module: the second part of its name."""
    return name.split(".")[1]


def modules(package):
    """Every module of a package, but for its dunder files at the top."""
    top = PACKAGES[package]
    names = {
        path.relative_to(top.parent).with_suffix("").as_posix().replace("/", "."): path
        for path in top.rglob("*.py")
    }
    return {
        name: path
        for name, path in names.items()
        if not name.split(".")[1].startswith("__")
    }


@mark.slow
@mark.parametrize("package", LAYERS)
def test_layers_stand_on_floors(package):
    floors = [floor.split() for floor in LAYERS[package]]
    height = {name: number for number, floor in enumerate(floors) for name in floor}
    assert height.keys() == {*map(layer, modules(package))}
    shown = {path.name for path in PACKAGES[package].glob("[!_]*")}
    assert len(shown - {"py.typed"}) <= MOST[package]
    for name, path in modules(package).items():
        using = layer(name)
        for used_module in imported(path):
            top, used, *_ = f"{used_module}.".split(".")
            if top == package and used in height and used != using:
                assert height[used] < height[using] or (using, used) in ON_ONE_FLOOR, (
                    f"{name} imports {used_module}"
                )


@mark.slow
@mark.parametrize("package", PACKAGES)
def test_no_modules_import_each_other_in_a_circle_types_included(package):
    names = modules(package)
    uses = {
        name: {used for used in imported(path, types=True) if used in names} - {name}
        for name, path in names.items()
    }
    TopologicalSorter(uses).prepare()  # raises where there is one


@mark.slow
def test_no_class_name_stands_for_two_things():
    names = Counter(
        node.name
        for package in PACKAGES
        for path in modules(package).values()
        for node in ast.walk(parse(path))
        if isinstance(node, ast.ClassDef)
    )
    assert not [name for name, count in names.items() if count > 1]


@mark.slow
def test_the_picture_of_the_layers_is_what_the_imports_make():
    drawn = runpy.run_path(ROOT / "docs/architecture.py")["text"]()
    assert read("docs/architecture.svg") == drawn, "python docs/architecture.py"


def test_the_formulas_know_numpy_and_the_linkage_alone():
    for path in (ROOT / "fourbar" / "formulas").glob("*.py"):
        used = {name for name in imported(path) if name.startswith("fourbar.")}
        assert {layer(name) for name in used} <= {"formulas", "linkage", "errors"}, path


def test_nothing_that_is_shipped_knows_the_lab():
    """Not even as a text such as "module:Class", which no import shows."""
    shipped = [
        path
        for package in ("fourbar", "fourbar_validation")
        for path in PACKAGES[package].rglob("*.py")
    ]
    assert len(shipped) > 200
    assert not [path for path in shipped if "fourbar_lab" in read(path)]


@mark.parametrize(
    "script",
    [path for name in ("docs", "benchmarks") for path in (ROOT / name).rglob("*.py")],
    ids=lambda path: path.name,
)
def test_the_scripts_of_the_pages_import_what_there_is(script):
    for node in ast.walk(parse(script)):
        match node:
            case ast.ImportFrom(str(module), aliases):
                if module.partition(".")[0] in PACKAGES:
                    names = {alias.name for alias in aliases}
                    assert names <= {*dir(import_module(module))}, module
