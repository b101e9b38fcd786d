"""A build that never heard of an effect: the same bits, MJCF, compiled model and calls, and as many instructions."""

import ast
import json
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import NamedTuple

from fourbar import effects
from fourbar.errors import FourBarError
from fourbar_validation.engines.witnesses import not_installed
from fourbar_validation.lab.effects.counted import REPEATS, available, counts
from fourbar_validation.places import FORMULAS, PACKAGE
from fourbar_validation.run.elsewhere import ended

WORKLOADS = (
    *("lab/__init__.py", "lab/effects/__init__.py", "lab/effects/work.py"),
    *("engines/__init__.py", "engines/mujoco/__init__.py", "engines/mujoco/stepping.py"),
)
"""Of the harness, what runs a workload; it names no effect but those that are requested."""
KINDS = {getattr(effects, name).key: getattr(effects, name) for name in (*effects.FILE_OF, "Load")}
"""Everything that can act, by key."""
ABSENT = tuple(KINDS)
WHOLE = 5
"""Copies of the whole build, each counted with other idle functions next to the effects: what they differ by is noise
of where things lie in memory, as a build without the file of an effect has it too."""
IDLE = 40
"""Functions by which one copy has more than the one before: an effect has some ten, with their classes and words."""
BEYOND_NOISE = 3.0
"""An effect's count is another one beyond so many times the largest deviation among those copies."""
TABLES = ("files/effects.py", "mjcf/effects.py")
"""Of the package, where an effect has a row."""
PROBE = """
import hashlib, json, sys
sys.path.insert(0, sys.argv[1])
import fourbar
from fourbar.mjcf import mjcf
link = fourbar.FourBar(0.3, fourbar.Bar(0.1, 0.2), fourbar.Bar(0.25, 0.5, 0.004, (0.13, 0.3)), fourbar.Bar(0.22, 0.4))
scene = fourbar.Scene(link, fourbar.Motion(fourbar.Sweep(0.1, 6.3, 60), 10.0, 5.0))
fourbar.solve(scene)
calls = []
def note(frame, event, argument):
    if event == "call" and "fourbar" in frame.f_code.co_filename:
        calls.append(frame.f_code.co_qualname)
sys.setprofile(note)
solution = fourbar.solve(scene)
sys.setprofile(None)
numbers = {name: hashlib.sha256(getattr(solution, name).tobytes()).hexdigest() for name in solution.evaluated()}
print(json.dumps({"file": fourbar.__file__, "numbers": numbers, "calls": calls, "mjcf": mjcf(scene)}))
"""
"""What a checkout makes of a scene without effects: digests of every array, the calls made, the MJCF."""


def build(folder: Path, without: str | None = None) -> Path:
    """A copy of the package and of the workloads; one that has never heard of an effect where one is named.

    Its file, its registration, its rows and its names are gone.
    """
    copy = folder / "fourbar"
    shutil.copytree(FORMULAS, copy, ignore=shutil.ignore_patterns("__pycache__", "page", "plot"))
    for file in WORKLOADS:
        target = folder / PACKAGE.name / file
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PACKAGE / file, target)
    (folder / PACKAGE.name / "__init__.py").touch()  # that of the harness imports what a workload has no use for
    if without is None:
        return folder
    effect = KINDS[without]
    name, module = effect.__name__, effect.__module__.rpartition(".")[2]
    (copy / "effects" / f"{module}.py").unlink()
    gone = (f"import {name} as {name}", f'"{name}": "{module}",', f'), "{module}"),')
    for path in (copy / "__init__.py", copy / "effects" / "__init__.py"):
        lines = [line for line in path.read_text().splitlines() if f".{module} import" not in line]
        lines = [line for line in lines if not line.endswith(gone)]
        path.write_text(re.sub(rf'"{name}", |\b{name}, |, {name}(?=\))', "", "\n".join(lines)) + "\n")
    for table in TABLES:
        path = copy / table
        path.write_text(without_row(path.read_text(), without))
    return folder


def without_row(text: str, key: str) -> str:
    """A module without the rows that its tables have under a key."""
    lines = text.splitlines(keepends=True)
    for table in ast.walk(ast.parse(text)):
        if isinstance(table, ast.Dict):
            for name, row in zip(table.keys, table.values, strict=True):
                if isinstance(name, ast.Constant) and name.value == key:
                    lines[name.lineno - 1 : row.end_lineno] = [""] * (row.end_lineno - name.lineno + 1)  # type: ignore[operator]
    return "".join(lines)


def made(root: Path) -> dict[str, object]:
    """What a checkout makes of the bare scene: bits, calls, MJCF."""
    done = ended([sys.executable, "-c", PROBE, root], folder=root)
    if done.why:
        raise FourBarError(f"the build in {root} does not run: {done.why}")
    answer: dict[str, object] = json.loads(done.out)
    if not Path(str(answer.pop("file"))).is_relative_to(root):
        raise FourBarError(f"not the build in {root} was run, but another")
    return answer


def differences(whole: dict[str, object], other: dict[str, object]) -> list[str]:
    """What a build makes otherwise than the whole one, in words."""
    texts = {"numbers": "bits of the results", "mjcf": "bytes of the MJCF", "calls": "list of the terms that run"}
    found = [text for key, text in texts.items() if whole[key] != other[key]]
    if not_installed("mujoco") is not None:
        return found
    compiled = import_module("fourbar_validation.engines.mujoco.stepping").compiled
    one, two = (compiled(answer["mjcf"]) for answer in (whole, other))
    return found + [f"{key} of the compiled model" for key in one if one[key] != two[key]]


class Trace(NamedTuple):
    """What a build without an effect makes otherwise of a bare scene."""

    effect: str
    differs: list[str]
    more: float | None
    """Its instructions relative to those of the whole build, less 1; None where they cannot be counted."""
    bound: float
    """What noise explains of that."""

    @property
    def holds(self) -> bool:
        """Whether the build is the same in everything that was looked at."""
        return not self.differs and (self.more is None or abs(self.more) <= self.bound)


def compared(effects: tuple[str, ...]) -> Iterator[Trace]:
    """Each effect in turn."""
    with tempfile.TemporaryDirectory() as folder:
        roots = []
        for number, effect in enumerate((*[None] * WHOLE, *effects)):
            # names of one length: paths are part of what is counted
            roots.append(Path(folder).resolve() / f"{number:03d}")
            roots[-1].mkdir()
            build(roots[-1], effect)
            if number < WHOLE:
                with (roots[-1] / "fourbar" / "effects" / "__init__.py").open("a") as file:
                    file.writelines(f"\n\ndef _idle_{k}() -> int:\n    return {k}\n" for k in range(IDLE * number))
        whole = made(roots[0])
        usual, bound = _noise([_counted(root) for root in roots[:WHOLE]] if available() else [])
        for effect, root in zip(effects, roots[WHOLE:], strict=True):
            more = _counted(root) / usual - 1.0 if available() else None
            yield Trace(effect, differences(whole, made(root)), more, bound)


def _counted(root: Path) -> float:
    return counts("formulas", ["none"], root)["none"]


def _noise(counted: list[float]) -> tuple[float, float]:
    """The usual count of the same work, and the part of it by which another count is beyond noise."""
    if not counted:
        return 1.0, REPEATS
    usual = median(counted)
    return usual, max(REPEATS, BEYOND_NOISE * max(abs(each / usual - 1.0) for each in counted))
