"""What is installed.

Every file goes along, every library is declared, and one that is missing is one line.

`PACKAGE=all` (of `make long-test`) builds the wheel and the source archive and installs
them afresh on each Python that the machine has, and once more with the lowest versions
that pyproject.toml allows.
"""

import fnmatch
import os
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from itertools import chain

from pytest import mark

from fourbar import Free, Motion
from fourbar.cli import status
from fourbar.errors import BAD_INPUT, BROKEN, HOLDS, say_install
from fourbar.files import save
from fourbar_lab.cli import status as lab
from fourbar_validation.cli import status as harness
from tests.support.checkout import ROOT, read, read_complaint, run_line
from tests.support.scenes import crank_rocker
from tests.whole.test_imports import imported

PROJECT = tomllib.loads(read("pyproject.toml"))
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
MODELS = "fourbar_validation.models"
MOST_OF_THE_ACCEPTED = 200_000
"""Bytes of the accepted run, which an installation needs for `--against accepted`."""
MODULE_OF = {
    "python-flint": "flint",
    "pillow": "PIL",
    "pin": "pinocchio",
    "imageio-ffmpeg": "imageio_ffmpeg",
    "lazy-loader": "lazy_loader",
}
"""Libraries that are imported under another name than they are installed by."""


def libraries(requirements):
    names = {re.split(r"[<>=\[]", requirement)[0] for requirement in requirements}
    return {MODULE_OF.get(name, name) for name in names}


@mark.parametrize(
    "package, folder",
    [
        ("fourbar", "fourbar"),
        ("fourbar_validation", "validation/fourbar_validation"),
        (MODELS, "models"),
    ],
)
def test_every_file_of_the_package_is_shipped(package, folder):
    patterns = PROJECT["tool"]["setuptools"]["package-data"][package]
    for path in (ROOT / folder).rglob("*"):
        if path.suffix == ".py":
            assert (path.parent / "__init__.py").is_file(), path
        elif path.is_file() and path.parent.name != "__pycache__":
            name = path.relative_to(ROOT / folder).as_posix()
            assert any(
                fnmatch.fnmatch(name, pattern.removeprefix("**/"))
                for pattern in patterns
            ), name


def test_the_source_archive_has_the_package_that_lies_elsewhere():
    """The wheel is built from the archive.

    The archive has no module of a package that is mapped to another folder.
    """
    for package in PROJECT["tool"]["setuptools"]["package-dir"]:
        module = f"validation/{package.replace('.', '/')}/__init__.py"
        assert (ROOT / module).is_file()
        assert f"include {module}\n" in read("MANIFEST.in")


@mark.parametrize("line", ["write", "problems"])
def test_what_needs_a_checkout_says_so_in_one_line(line, monkeypatch, capsys):
    monkeypatch.setattr("fourbar_validation.places.CHECKOUT", None)
    assert lab([line]) == BAD_INPUT
    assert "needs a checkout" in read_complaint(capsys)


def test_the_harness_lists_a_command_whose_library_is_missing(monkeypatch, capsys):
    def without_flint(_):
        raise ModuleNotFoundError("No module named 'flint'", name="flint")

    with monkeypatch.context() as context:
        context.setattr("fourbar_validation.cli.find_spec", lambda _: None)
        assert harness(["--help"]) == HOLDS
    assert "mujoco is not installed" in capsys.readouterr().out
    monkeypatch.setattr("fourbar_validation.cli.resolve_name", without_flint)
    assert harness(["run", "scene.toml", "--out", "results"]) == BROKEN
    assert "flint is not installed: pip install" in read_complaint(capsys)


def test_extras_of_extras_are_named_one_by_one(monkeypatch):
    """No index of packages has `fourbar[plot]`."""
    monkeypatch.setattr("fourbar.errors.__file__", "/nowhere/fourbar/errors.py")
    for extra in ("validation", "all"):
        line = say_install(extra)
        assert "fourbar" not in line and all(
            name in line for name in ("mujoco>=", "pin>=", "python-flint>=")
        )


def test_a_wheel_in_a_folder_of_another_project_takes_that_for_no_checkout(tmp_path):
    """`pip install --target vendor` at the top of a project."""
    package = tmp_path / "vendor" / "fourbar_validation"
    shutil.copytree(ROOT / "models", package / "models")
    shutil.copy(ROOT / "validation" / "fourbar_validation" / "places.py", package)
    (tmp_path / "pyproject.toml").touch()
    places = runpy.run_path(package / "places.py")
    assert places["CHECKOUT"] is None and (places["MODELS"] / "thesis.toml").is_file()


def test_every_library_that_fourbar_imports_is_declared():
    project = PROJECT["project"]
    extras = chain(*project["optional-dependencies"].values())
    declared = libraries([*project["dependencies"], *extras])
    for path in (ROOT / "fourbar").rglob("*.py"):
        roots = {name.partition(".")[0] for name in imported(path, types=True)}
        assert roots <= {"fourbar", *sys.stdlib_module_names, *declared}, path


@mark.parametrize(
    "library, extra, command",
    [
        ("matplotlib", "plot", "plot scene.toml -o a.svg"),
        ("matplotlib", "plot", "animate scene.toml -o a.gif"),
        ("scipy", "studies", "analyze free.toml"),
        ("scipy", "studies", "animate free.toml -o a.html"),
    ],
)
def test_an_extra_that_is_missing_is_one_line(
    library, extra, command, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    save(crank_rocker(), "scene.toml")
    save(crank_rocker(Motion(0.5, 0.0, free=Free(0.5, 4))), "free.toml")
    for name in [name for name in sys.modules if name.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, library, None)
    before = sorted(tmp_path.iterdir())
    assert status(command.split()) == BROKEN
    assert f'pip install ".[{extra}]" in the checkout' in read_complaint(capsys)
    assert sorted(tmp_path.iterdir()) == before


def built(folder):
    """Wheel and source archive of the tree, made from a copy."""
    tree, dist = folder / "tree", folder / "dist"
    keep = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "results")
    shutil.copytree(ROOT, tree, ignore=keep)
    subprocess.run([sys.executable, "-m", "venv", folder / "builder"], check=True)
    python = folder / "builder" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "build"], check=True)
    subprocess.run(
        [python, "-m", "build", "-o", dist, tree],
        check=True,
        capture_output=True,
    )
    return next(dist.glob("*.whl")), next(dist.glob("*.tar.gz"))


def installed_works(python, package, folder, constraints):
    """Install afresh, outside the tree.

    Then version, numbers, a page, and the one line of a missing extra.
    """
    subprocess.run([python, "-m", "venv", folder], check=True)
    its_python = folder / "bin" / "python"
    (folder / "constraints.txt").write_text("\n".join(constraints))
    install = [its_python, "-m", "pip", "install", "-q", package]
    subprocess.run([*install, "-c", folder / "constraints.txt"], check=True)
    environment = {**os.environ, "PYTHONPATH": ""}

    def run(line, program="fourbar", status=HOLDS):
        words = [folder / "bin" / program, *line.split()]
        done = run_line(words, folder, env=environment)
        assert done.returncode == status, done.stderr
        return done.stdout + done.stderr

    assert run("--version") == f"fourbar, version {PROJECT['project']['version']}\n"
    run("new a.toml --lengths 300mm 10cm 0.25m 22cm")
    block = run("analyze a.toml --units imperial")
    assert "input turns fully" in block and "lbf in" in block
    assert run("analyze a.toml --table").count("\n") > 20
    run("animate a.toml -o a.html")
    assert (folder / "a.html").stat().st_size > 50_000
    assert "published" in run("--help", program="fourbar-validation")
    missing = run("plot a.toml -o a.svg", status=BROKEN)
    assert missing.count("\n") == 1 and 'pip install "matplotlib>=' in missing


@mark.skipif(
    os.environ.get("PACKAGE") != "all",
    reason="PACKAGE=all builds and installs wheel and archive",
)
@mark.timeout(1800)
def test_wheel_and_archive_install_on_every_python(tmp_path):
    wheel, archive = built(tmp_path)
    sizes = {one.filename: one.file_size for one in zipfile.ZipFile(wheel).infolist()}
    assert {name.partition("/")[0] for name in sizes} == {
        "fourbar",
        "fourbar_validation",
        f"{wheel.name.split('-py3')[0]}.dist-info",
    }
    accepted = "fourbar_validation/regression/accepted"
    assert {
        "fourbar/show/page/page.js",
        "fourbar_validation/models/thesis.toml",
        f"{accepted}/results.parquet",
        f"{accepted}/record.json",
    } <= sizes.keys()
    of_accepted = [size for name, size in sizes.items() if name.startswith(accepted)]
    assert sum(of_accepted) < MOST_OF_THE_ACCEPTED
    with tarfile.open(archive) as packed:
        inner = {name.partition("/")[2] for name in packed.getnames()}
    assert {
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
        "docs/index.md",
        "tests/conftest.py",
        "models/thesis.toml",
    } <= inner
    pythons = {version: shutil.which(f"python{version}") for version in PYTHONS} | {
        f"{sys.version_info.major}.{sys.version_info.minor}": sys.executable
    }
    for version, python in pythons.items():
        if python and run_line([python, "--version"]).returncode == 0:
            installed_works(python, wheel, tmp_path / version, [])
    lowest = [
        re.sub(r">=([0-9.]+).*", r"==\1.*", requirement)
        for requirement in PROJECT["project"]["dependencies"]
    ]
    installed_works(sys.executable, archive, tmp_path / "lowest", lowest)
