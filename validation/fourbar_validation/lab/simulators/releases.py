"""Released versions of an engine, each installed and loaded in an environment of its own."""

import os
import re
import sys
import sysconfig
import venv
from collections.abc import Sequence
from pathlib import Path

from fourbar_validation.report.machine import PACKAGES
from fourbar_validation.run.elsewhere import Ended, run_to_end

CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fourbar-versions"
LOOK = "import importlib.metadata, importlib.util as u, sys; u.find_spec({0!r}) or sys.exit(1)"
"""For an interpreter: fails where a module is not installed."""
DONE = "installed"
"""In the folder of a version that was installed wholly."""


def find_distribution(engine: str) -> str:
    """Return the name that an engine has for pip."""
    return PACKAGES.get(engine, engine)


def run_pip(python: Path, *arguments: str) -> Ended:
    """Run pip, with the index that the user has set up for it."""
    return run_to_end([sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check", *arguments])


def install_version(
    engine: str, module: str, version: str, cache: Path, more: Sequence[str] = ()
) -> tuple[Path | None, str]:
    """Install a version: the interpreter that loads it and no other, or None, and why it does not install or load.

    The environment has the engine and what it requires, and `more` where that does not contradict it; all else it takes
    from the one that runs here. `module` is what is imported of the engine.
    """
    folder = (cache / re.sub(r"[^\w.+-]", "_", "-".join([engine, version, *more]))).absolute()
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not (folder / DONE).is_file():
        venv.EnvBuilder(symlinks=os.name != "nt", clear=True).create(folder)
        wanted = f"{find_distribution(engine)}=={version}"
        options = ("install", "--only-binary=:all:", "--no-compile", wanted)
        done = run_pip(python, *options, *more)
        if done.why and more:
            done = run_pip(python, *options)
        if done.why:
            return None, f"does not install: {_find_reason(done)}"
        site = Path(run_to_end([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]).out.strip())
        own = dict.fromkeys(sysconfig.get_path(name) for name in ("purelib", "platlib"))
        (site / "zz_of_the_harness.pth").write_text("\n".join(own) + "\n", encoding="utf-8")  # read after all others
        (folder / DONE).touch()
    done = run_to_end([python, "-c", f"import {module} as engine; print(engine.__file__)"])
    if done.why:
        return None, f"does not load: {done.why}"
    if not (printed := done.out.strip()):
        return None, "does not load: it ends the interpreter"
    if folder not in Path(printed.splitlines()[-1]).parents:
        return None, f"does not load: another {engine} is found in its stead"
    return python, ""


def _find_reason(done: Ended) -> str:
    """Find the line of pip's errors that says why."""
    stated = [line.removeprefix("ERROR:").strip() for line in done.errors.splitlines() if line.startswith("ERROR:")]
    return stated[0].partition(" (from versions")[0] if stated else done.why or "no word"
