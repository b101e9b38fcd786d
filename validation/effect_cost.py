"""What each effect costs in each engine, in instructions: valgrind, two amounts of work, their difference.

Wall clock on a busy machine scatters by a third; instructions repeat to some 0.01 % where hashing
and addresses are fixed (PYTHONHASHSEED, setarch -R) and one thread runs.
"""

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import click

from fourbar.effects import REGISTRY
from fourbar.errors import DependencyError, FourBarError, InputError
from validation.effect_work import DEFAULT_FLAGS, EFFECTS, ENGINES, POSITIONS

AMOUNTS = {
    "formulas": (4, 24),
    "mujoco-simulated": (100, 1100),
    "mujoco-inverse": (20, 120),
    "pinocchio-inverse": (20, 120),
}
"""Two amounts of work for each engine; the difference leaves out start-up, import and compilation."""
UNIT = {"formulas": "position", "mujoco-simulated": "step"}
NO_COUNTERPART = {("mujoco-simulated", "pin_friction"), ("mujoco-simulated", "load over theta_2")}
REPEATS = 1e-3
"""Counts of the same work differ by less than this part."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Instructions of one engine with one effect."""

    engine: str
    effect: str
    instructions: float
    """Per step of the simulation, else per position."""


def available() -> bool:
    """Whether instructions can be counted here."""
    return shutil.which("valgrind") is not None and shutil.which("setarch") is not None


def count(engine: str, effect: str, amount: int, root: Path | None = None) -> int:
    """Instructions of a whole process that does an amount of work, from another checkout where one is given."""
    if not available():
        raise DependencyError("valgrind and setarch are needed to count instructions")
    here = Path(__file__).parent.parent if root is None else root
    threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo writes its log where it runs
        told = {**os.environ, **threads, "PYTHONHASHSEED": "0", "PYTHONPATH": str(here), "PYTHONDONTWRITEBYTECODE": "1"}
        command = ["setarch", platform.machine(), "-R", "valgrind", "--tool=cachegrind", "--cache-sim=no"]
        command += ["--cachegrind-out-file=/dev/null", sys.executable, "-m", "validation.effect_work"]
        done = subprocess.run(
            [*command, engine, effect, str(amount)], env=told, cwd=folder, capture_output=True, text=True, check=False
        )
    found = re.search(r"I\s+refs:\s+([\d,]+)", done.stderr)
    if done.returncode or found is None:
        raise FourBarError(f"{engine} with {effect} did not run under valgrind: {done.stderr.strip()[-300:]}")
    return int(found[1].replace(",", ""))


def cost(engine: str, effect: str, root: Path | None = None) -> Cost:
    """Instructions per step or position: the difference of two amounts of work."""
    few, many = AMOUNTS[engine]
    per_unit = (count(engine, effect, many, root) - count(engine, effect, few, root)) / (many - few)
    return Cost(engine, effect, per_unit / (POSITIONS if engine == "formulas" else 1))


def costs(engines: tuple[str, ...], effects: tuple[str, ...], workers: int) -> Iterator[Cost]:
    """Every engine with every effect that it has."""
    pairs = [(engine, effect) for engine in engines for effect in effects if (engine, effect) not in NO_COUNTERPART]
    if "mujoco-simulated" in engines:
        pairs.append(("mujoco-simulated", DEFAULT_FLAGS))
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(lambda pair: cost(*pair), pairs)


WORKLOADS = (
    *("__init__.py", "effect_work.py", "engines/__init__.py"),
    *("engines/mujoco/__init__.py", "engines/mujoco/stepping.py"),
)
"""Of the harness, what runs a workload; it names no effect but those it is asked for."""


def build(folder: Path, without: str | None = None) -> Path:
    """A copy of the package and of the workloads; one that has never heard of an effect where one is named.

    Its file, its registration and its name are gone.
    """
    root = Path(__file__).parent.parent
    copy = folder / "fourbar"
    shutil.copytree(root / "fourbar", copy, ignore=shutil.ignore_patterns("__pycache__", "page", "plot"))
    for file in WORKLOADS:
        target = folder / "validation" / file
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(root / "validation" / file, target)
    if without is None:
        return folder
    name, module = REGISTRY[without].__name__, REGISTRY[without].__module__.rpartition(".")[2]
    (copy / "effects" / f"{module}.py").unlink()
    for path in (copy / "__init__.py", copy / "effects" / "__init__.py"):
        lines = [line for line in path.read_text().splitlines() if f".{module} import" not in line]
        gone = (f"import {name} as {name}", f'"{name}": "{module}",')
        lines = [line for line in lines if not line.endswith(gone)]
        path.write_text(re.sub(rf'"{name}", |\b{name}, |, {name}(?=\))', "", "\n".join(lines)) + "\n")
    return folder


def absent(effects: tuple[str, ...]) -> Iterator[tuple[str, float]]:
    """For each effect the instructions of a bare scene in a build without it, relative to the whole build's, less 1."""
    with tempfile.TemporaryDirectory() as folder:
        roots = {}
        for number, effect in enumerate((None, *effects)):
            # names of one length: paths are part of what is counted
            roots[effect] = Path(folder) / f"{number:03d}"
            roots[effect].mkdir()
            build(roots[effect], effect)
        whole = cost("formulas", "none", roots[None]).instructions
        for effect in effects:
            yield effect, cost("formulas", "none", roots[effect]).instructions / whole - 1.0


@click.command(name="effects-cost")
@click.option("--engines", metavar="NAMES", default=",".join(AMOUNTS), show_default=True, help="Comma-separated.")
@click.option("--effects", metavar="NAMES", help="Comma-separated; left out: all.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Counts at the same time.")
@click.option("--absent", "check", is_flag=True, help="Count instead what effects cost that are not named: nothing.")
def command(engines: str, effects: str | None, workers: int, check: bool) -> int:
    """Count the instructions that each effect costs in each engine (valgrind; half an hour for all)."""
    if check:
        return check_absent(tuple(name for name in REGISTRY if name != "gravity"))
    asked = tuple(name.strip() for name in engines.split(","))
    for name in asked:
        if name not in ENGINES:
            raise InputError("--engines", name, "must be among " + ", ".join(ENGINES))
    chosen = tuple(EFFECTS) if effects is None else tuple(dict.fromkeys(["none", *effects.split(",")]))
    for name in chosen:
        if name not in EFFECTS:
            raise InputError("--effects", name, "must be among " + ", ".join(EFFECTS))
    table(costs(asked, chosen, workers), asked, chosen)
    return 0


def check_absent(effects: tuple[str, ...]) -> int:
    """Print by how much a bare scene differs in a build without each effect; 1 where it is more than repeats."""
    worst = 0.0
    for effect, difference in absent(effects):
        worst = max(worst, abs(difference))
        click.echo(f"{effect}: {100.0 * difference:+.3f} % in a build without it")
    click.echo(f"{'holds' if worst < REPEATS else 'FAILS'}: less than {100.0 * REPEATS:g} % is asked for")
    return 0 if worst < REPEATS else 1


def table(measured: Iterator[Cost], engines: tuple[str, ...], effects: tuple[str, ...]) -> None:
    """Print instructions and their ratio to the scene without effects."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    found = {(one.engine, one.effect): one.instructions for one in measured}
    shown = Table(title="instructions per position, per step of the simulation", box=SIMPLE_HEAD, pad_edge=False)
    shown.add_column("effect")
    for engine in engines:
        shown.add_column(engine, justify="right")
    rows = [*effects, DEFAULT_FLAGS] if "mujoco-simulated" in engines else [*effects]
    for effect in rows:
        cells = []
        for engine in engines:
            if (engine, effect) in found:
                ratio = found[engine, effect] / found[engine, "none"] - 1.0
                cells.append(f"{found[engine, effect]:,.0f} ({100.0 * ratio:+.2f} %)")
            else:
                cells.append("no counterpart" if effect in EFFECTS else "")
        shown.add_row(effect, *cells)
    Console().print(shown)
