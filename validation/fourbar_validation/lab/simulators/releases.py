"""Released versions of an engine, each in an environment of its own: listed, installed and loaded."""

import os
import re
import sys
import sysconfig
import venv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

from fourbar.errors import DependencyError, InputError
from fourbar_validation.engines.witnesses import EXTRA
from fourbar_validation.regression.history import HistoryRun
from fourbar_validation.report.machine import PACKAGES
from fourbar_validation.run.elsewhere import Ended, run_to_end

MODULES = {extra: module for module, extra in EXTRA.items() if extra != "exact"}
"""By engine: what must be importable, and which witnesses it is (`Witness.library`)."""
LISTED = "Available versions:"
"""What pip's list begins with; the newest comes first."""
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fourbar-versions"
LOOK = "import importlib.metadata, importlib.util as u, sys; u.find_spec({0!r}) or sys.exit(1)"
"""For an interpreter: fails where a module is not installed."""
DONE = "installed"
"""In the folder of a version that was installed wholly."""


@dataclass(frozen=True, slots=True)
class Release:
    """The run of the suite under one version, or why there is none."""

    version: str
    run: HistoryRun | None
    why: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """By witness: of the processor's clock for one position."""


def find_distribution(engine: str) -> str:
    """Return the name that an engine has for pip."""
    return PACKAGES.get(engine, engine)


def find_module(engine: str) -> str:
    """Return the module of an engine; InputError where it has no adapter."""
    if engine not in MODULES:
        close = get_close_matches(engine, MODULES, n=1) or [
            name for name in MODULES if find_distribution(name) == engine
        ]
        hint = f'; did you mean "{close[0]}"?' if close else ""
        raise InputError("ENGINE", engine, f"must be one of {', '.join(MODULES)}{hint}")
    return MODULES[engine]


def run_pip(python: Path, *arguments: str) -> Ended:
    """Run pip, with the index that the user has set up for it."""
    return run_to_end([sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check", *arguments])


def list_released(engine: str, first: str | None, last: str | None) -> list[str]:
    """List the versions of pip's index from `first` to `last`, the oldest first."""
    done = run_pip(Path(sys.executable), "index", "versions", find_distribution(engine))
    listed = [line.removeprefix(LISTED) for line in done.out.splitlines() if line.startswith(LISTED)]
    if done.why or not listed:
        raise DependencyError(f"pip lists no versions of {find_distribution(engine)}: {_find_reason(done)}")
    found = [version.strip() for version in listed[0].split(",")][::-1]
    for option, version in (("--from", first), ("--to", last)):
        if version is not None and version not in found:
            close = get_close_matches(version, found, n=1)
            hint = f'; did you mean "{close[0]}"?' if close else ""
            raise InputError(option, version, f"is no released version; there are {found[0]} to {found[-1]}{hint}")
    chosen = found[found.index(first) if first else 0 : found.index(last) + 1 if last else None]
    if len(chosen) < 2:
        raise InputError("--from", first, f"must come before --to ({last or found[-1]}): two versions make a history")
    return chosen


def install_version(
    engine: str, version: str, cache: Path, more: Sequence[str] = (), module: str | None = None
) -> tuple[Path | None, str]:
    """Install a version: the interpreter that loads it and no other, or None, and why it does not install or load.

    The environment has the engine and what it requires, and `more` where that does not contradict it; all else it takes
    from the one that runs here. `module` is what is imported of an engine that has no adapter.
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
    done = run_to_end([python, "-c", f"import {module or MODULES[engine]} as engine; print(engine.__file__)"])
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
