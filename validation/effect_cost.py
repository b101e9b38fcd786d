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

from fourbar.errors import DependencyError, FourBarError, InputError
from fourbar.writing import write_text
from validation.effect_work import DEFAULT_FLAGS, EFFECTS, ENGINES, POSITIONS, flags

AMOUNTS = {
    "formulas": (4, 24),
    "mujoco-simulated": (100, 1100),
    "mujoco-inverse": (20, 120),
    "pinocchio-inverse": (20, 120),
}
"""Two amounts of work for each engine; the difference leaves out start-up, import and compilation."""
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


def pairs(engines: tuple[str, ...], effects: tuple[str, ...]) -> list[tuple[str, str]]:
    """Every engine with every effect that it has; of the simulation each flag that the bare scene switches off too."""
    found = [(engine, effect) for engine in engines for effect in effects if (engine, effect) not in NO_COUNTERPART]
    if "mujoco-simulated" in engines:
        found += [("mujoco-simulated", name) for name in (DEFAULT_FLAGS, *flags())]
    return found


def costs(asked: list[tuple[str, str]], workers: int) -> Iterator[Cost]:
    """Instructions of each, as they come."""
    with ThreadPoolExecutor(workers) as pool:
        yield from pool.map(lambda pair: cost(*pair), asked)


@click.command(name="effects-cost")
@click.option("--engines", metavar="NAMES", default=",".join(AMOUNTS), show_default=True, help="Comma-separated.")
@click.option("--effects", metavar="NAMES", help="Comma-separated; left out: all.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Counts at the same time.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the table as Markdown too.")
@click.option("--absent", is_flag=True, help="Look instead for any trace of an effect in a build without it: none.")
def command(engines: str, effects: str | None, workers: int, out: Path | None, absent: bool) -> int:
    """Count the instructions that each effect costs in each engine (valgrind; half an hour for all)."""
    if absent:
        return check_absent()
    asked = tuple(name.strip() for name in engines.split(","))
    for name in asked:
        if name not in ENGINES:
            raise InputError("--engines", name, "must be among " + ", ".join(ENGINES))
    chosen = tuple(EFFECTS) if effects is None else tuple(dict.fromkeys(["none", *effects.split(",")]))
    for name in chosen:
        if name not in EFFECTS:
            raise InputError("--effects", name, "must be among " + ", ".join(EFFECTS))
    if not available():
        raise DependencyError("valgrind and setarch are needed to count instructions")
    from rich.progress import track

    from validation.effect_clock import ratio
    from validation.effect_table import Entry, markdown, show

    work = pairs(asked, chosen)
    counted = list(track(costs(work, workers), total=len(work), description="instructions", transient=True))
    clocked = [ratio(*pair) for pair in track(work, description="wall clock", transient=True)]  # by itself, undisturbed
    entries = [
        Entry(one.engine, one.effect, one.instructions, times) for one, times in zip(counted, clocked, strict=True)
    ]
    show(entries)
    if out is not None:
        write_text(out, markdown(entries))
        click.echo(f"written to {out}")
    return 0


def check_absent() -> int:
    """Print what a build without each effect makes otherwise of a bare scene; 1 where it is anything."""
    from validation.effect_absent import ABSENT, compared, holds

    failed = False
    for effect, differs, more in compared(ABSENT):
        failed |= not holds(differs, more)
        same = "differs in " + ", ".join(differs) if differs else "bits, MJCF, compiled model and terms are equal"
        counted = "instructions not counted: no valgrind" if more is None else f"instructions {100.0 * more:+.3f} %"
        click.echo(f"without {effect}: {same}; {counted}")
    click.echo(f"{'FAILS' if failed else 'holds'}: less than {100.0 * REPEATS:g} % and no difference are asked for")
    return int(failed)
