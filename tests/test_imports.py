"""Imports go one way, and `import fourbar` loads numpy alone."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HEAVY = ("pint", "click", "rich", "jinja2", "matplotlib", "scipy", "joblib", "mujoco", "pinocchio", "flint", "mpmath")
ENGINES = {"mujoco": "mujoco", "pinocchio": "pinocchio"}
LAYERS = [
    ("errors", "reading", "under_way", "writing", "double_double"),
    ("exits", "linkage", "units"),
    ("entries", "margins", "pictures", "sixty_digits"),
    ("new", "state", "mobility"),
    ("kinematics",),
    ("linkage_type", "circuits", "more_digits", "motion_law", "solution"),
    ("bearing", "motion", "transmission", "coefficients", "dynamics", "half_angles"),
    ("effects", "free_motion"),
    ("kinetostatics",),
    ("error_bars",),
    ("blocks",),
    ("scene",),
    ("scene_text", "mjcf", "plot", "drawing", "tables", "mobility_text"),
    ("files",),
    ("animate", "notebook"),
    ("cli",),
]
"""Inside `fourbar`: none of these imports one that stands later; at import time or inside a function."""
SHOWN = {("solution", "tables"), ("solution", "notebook"), ("scene", "notebook")}
"""A scene and a solution hand themselves over to what shows them, when they are asked to show themselves."""


def imported(path: Path) -> set[str]:
    """Full names of all modules that a file imports when it runs, at any depth."""
    names = set()
    tree = ast.parse(path.read_text())
    typing = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    for node in set(ast.walk(tree)) - typing:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def test_import_fourbar_loads_numpy_alone() -> None:
    code = "import sys, fourbar; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "numpy" in out
    assert not set(HEAVY) & set(out)


@pytest.mark.parametrize("path", sorted((ROOT / "fourbar").rglob("*.py")), ids=lambda path: path.stem)
def test_the_product_knows_neither_harness_nor_engines(path: Path) -> None:
    roots = {name.partition(".")[0] for name in imported(path)}
    assert not roots & {"validation", "tests", *ENGINES}


@pytest.mark.parametrize("path", sorted((ROOT / "validation").rglob("*.py")), ids=lambda path: path.stem)
def test_each_engine_is_imported_under_its_own_name_alone(path: Path) -> None:
    names = imported(path)
    assert not {name for name in names if name.partition(".")[0] == "tests"}
    for engine in ENGINES:
        if any(name.partition(".")[0] == engine for name in names):
            assert path.parent.name == "engines" or path.parent.parent.name == "engines"
            assert engine in path.relative_to(ROOT).as_posix()


def in_package(name: str) -> list[Path]:
    """`fourbar/name.py`, or the files of `fourbar/name/`."""
    return [*(ROOT / "fourbar").glob(f"{name}.py"), *(ROOT / "fourbar" / name).glob("*.py")]


def modules(layer: tuple[str, ...]) -> list[Path]:
    """The files of a layer."""
    return [path for name in layer for path in in_package(name)]


def test_layers_of_the_product() -> None:
    inside = {
        path.relative_to(ROOT / "fourbar").parts[0].removesuffix(".py") for path in (ROOT / "fourbar").rglob("*.py")
    }
    assert {name for layer in LAYERS for name in layer} == inside - {"__init__", "__main__"}
    for number, layer in enumerate(LAYERS):
        later = {name for above in LAYERS[number + 1 :] for name in above}
        for path in modules(layer):
            later_here = {name for name in later if (path.stem, name) not in SHOWN}
            known = {name.split(".")[1] for name in imported(path) if name.startswith("fourbar.")}
            assert not known & later_here, (path, known & later_here)


def test_the_two_derivations_share_no_equation_of_motion() -> None:
    """The energy method never imports Newton-Euler, nor the other way round."""
    for path, other in (
        (ROOT / "fourbar/dynamics.py", "kinetostatics"),
        (ROOT / "fourbar/kinetostatics.py", "dynamics"),
    ):
        assert f"fourbar.{other}" not in imported(path)


@pytest.mark.parametrize("name", ["compare", "tolerance", "report"])
def test_what_judges_knows_no_engine(name: str) -> None:
    paths = [*(ROOT / "validation").glob(f"{name}.py"), *(ROOT / "validation" / name).rglob("*.py")]
    assert paths
    for path in paths:
        names = imported(path)
        assert not {each for each in names if each.startswith("validation.engines")}, path
        assert not {each.partition(".")[0] for each in names} & set(ENGINES), path
