"""Speed of this tree against that of another revision: the same timings of both, in turns, within one command."""

import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

from fourbar.errors import DependencyError, FourBarError, InputError
from fourbar.quantities import ANGLES, UNKNOWNS
from fourbar_validation.lab.stress.timed import time_in_turns
from fourbar_validation.places import find_checkout
from fourbar_validation.run.elsewhere import run_to_end

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Ratio(NamedTuple):
    """CPU seconds of a call, medians, and ours over theirs: median, least and greatest of the pairs."""

    ours: float
    theirs: float
    ratio: float
    least: float
    most: float


def time_against(revision: str, positions: int, rounds: int, tree: Path | None = None) -> dict[str, Ratio]:
    """Divide each timing of a tree by that of a revision of its repository.

    Raises InputError where the revision does not exist or is none of this package's, FourBarError where it has not
    what is timed, DependencyError where git is not installed.
    """
    tree = find_checkout("bench --against") if tree is None else tree
    with tempfile.TemporaryDirectory(prefix="fourbar-") as folder:
        unpack(revision, tree, Path(folder))
        trees = {"this tree": tree, revision: Path(folder)}
        clocks = {name: partial(time_actions, where, name, positions) for name, where in trees.items()}
        both = time_in_turns(clocks, rounds).values()
    rows = {}
    for name in next(iter(both))[0]:
        ours, theirs = ([times[name] for times in side] for side in both)
        ratios = [a / b for a, b in zip(ours, theirs, strict=True)]
        rows[name] = Ratio(median(ours), median(theirs), median(ratios), min(ratios), max(ratios))
    return rows


def unpack(revision: str, tree: Path, folder: Path) -> None:
    """Unpack the package as it stood at a revision into a folder."""
    if shutil.which("git") is None:
        raise DependencyError("bench --against needs git, which is not installed")
    arguments_of_git = ["rev-parse", "--verify", "--quiet", "--end-of-options", f"{revision}^{{commit}}"]
    commit = _run_git(tree, arguments_of_git).decode().strip()
    archive = _run_git(tree, ["archive", "--format=tar", commit, "fourbar"]) if commit else b""
    if not archive:
        raise InputError("--against", revision, f"must be a revision of the git repository of {tree} that has fourbar")
    with tarfile.open(fileobj=io.BytesIO(archive)) as packed:
        packed.extractall(folder, filter="data")


def _run_git(tree: Path, arguments: list[str]) -> bytes:
    """Return what git prints; nothing where it fails."""
    done = subprocess.run(["git", "-C", str(tree), *arguments], capture_output=True, check=False)
    return done.stdout if done.returncode == 0 else b""


def time_actions(tree: Path, name: str, positions: int) -> dict[str, float]:
    """Time each action, in CPU seconds, in a fresh interpreter that imports the package from a tree."""
    script = str(Path(__file__).with_name("timed.py"))
    line = [sys.executable, "-P", script, str(positions), *(" ".join(names) for names in (UNKNOWNS, ANGLES))]
    path = os.pathsep.join(filter(None, (str(tree), os.environ.get("PYTHONPATH"))))
    done = run_to_end(line, variables=dict.fromkeys(ONE_THREAD, "1") | {"PYTHONPATH": path})
    if done.why:
        raise FourBarError(f"{name} cannot be timed: {done.why}")
    result = json.loads(done.out)
    if not Path(result["from"]).resolve().is_relative_to(tree.resolve()):
        raise FourBarError(f"{name} cannot be timed: {result['from']} was imported instead")
    times: dict[str, float] = result["times"]
    return times
