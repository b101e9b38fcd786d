"""Released versions of an engine, each installed by itself."""

import os
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from fourbar_validation.lab.simulators import releases
from fourbar_validation.run.elsewhere import Ended


def wheel(folder: Path, version: str, code: str) -> None:
    """A release of the engine "toy", of one module."""
    info = f"toy-{version}.dist-info"
    files = {
        "toy.py": code,
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: toy\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    files[f"{info}/RECORD"] = "".join(f"{name},,\n" for name in (*files, f"{info}/RECORD"))
    with zipfile.ZipFile(folder / f"toy-{version}-py3-none-any.whl", "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)


def unpacking(folder: Path) -> Callable[..., Ended]:
    """What pip does with wheels that require nothing."""

    def pip(python: Path, *arguments: str) -> Ended:
        file = folder / f"{arguments[3].replace('==', '-')}-py3-none-any.whl"
        if len(arguments) > 4 or not file.is_file():
            missing = f"Could not find a version that satisfies the requirement {arguments[-1]}"
            return Ended("", f"ERROR: {missing} (from versions: none)\nERROR: No match\n", True, "ERROR: No match")
        with zipfile.ZipFile(file) as archive:
            archive.extractall(next(python.parents[1].rglob("site-packages")))
        return Ended("", "", False, "")

    return pip


def test_each_release_loads_by_itself_or_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two local wheels; RELEASES=pip lets pip itself install them."""
    wheel(tmp_path, "1.0", "import numpy")
    wheel(tmp_path, "1.1", "raise ImportError('libtoy.so.7 is not there')")
    if os.environ.get("RELEASES") == "pip":
        for name, value in {"CONFIG_FILE": "/dev/null", "NO_INDEX": "1", "FIND_LINKS": str(tmp_path)}.items():
            monkeypatch.setenv(f"PIP_{name}", value)
    else:
        monkeypatch.setattr(releases, "run_pip", unpacking(tmp_path))
    python, why = releases.install_version("toy", "toy", "1.0", tmp_path / "cache")
    assert python is not None and python.is_file() and python != Path(sys.executable) and not why
    python, why = releases.install_version("toy", "toy", "1.1", tmp_path / "cache")
    assert python is None and why == "does not load: ImportError: libtoy.so.7 is not there"
    assert releases.install_version("toy", "toy", "1.0", tmp_path / "cache", ["nothing-such"])[1] == "", (
        "it is installed alone"
    )
    missing = "Could not find a version that satisfies the requirement toy==0.9"
    assert releases.install_version("toy", "toy", "0.9", tmp_path / "cache") == (None, f"does not install: {missing}")
    stead = releases.install_version("toy", "numpy", "1.0", tmp_path / "cache")  # which the harness has
    assert stead == (None, "does not load: another toy is found in its stead") and "toy" not in sys.modules
