"""What each effect costs in each engine, in instructions: valgrind, of the work alone.

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
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click

from fourbar.errors import DependencyError, FourBarError, InputError
from fourbar.writing import write_text
from validation.effect_work import DEFAULT_FLAGS, EFFECTS, ENGINES, POSITIONS, flags

AMOUNTS = {"formulas": (1, 5), "mujoco-simulated": (10, 210), "mujoco-inverse": (5, 45), "pinocchio-inverse": (5, 45)}
"""Two amounts of work, in steps or positions, of the formulas in thousands of positions: their difference counts."""
BRACKET = "ffi_call"
"""The function of libffi within which a workload runs."""
NO_COUNTERPART = {("mujoco-simulated", "pin_friction"), ("mujoco-simulated", "load over theta_2")}
REPEATS = 1e-3
"""Counts of the same work differ by less than this part."""


def available() -> bool:
    """Whether instructions can be counted here."""
    return shutil.which("valgrind") is not None and shutil.which("setarch") is not None


def counts(engine: str, effects: Sequence[str], root: Path | None = None) -> dict[str, float]:
    """Instructions of each effect per step or position, from another checkout where one is given."""
    if not available():
        raise DependencyError("valgrind and setarch are needed to count instructions")
    here = Path(__file__).parent.parent if root is None else root
    few, many = AMOUNTS[engine]
    threads = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    with tempfile.TemporaryDirectory() as folder:  # MuJoCo writes its log where it runs
        told = {**os.environ, **threads, "PYTHONHASHSEED": "0", "PYTHONPATH": str(here), "PYTHONDONTWRITEBYTECODE": "1"}
        command = ["setarch", platform.machine(), "-R", "valgrind", "--tool=callgrind", "--callgrind-out-file=counted"]
        command += ["--collect-atstart=no", f"--toggle-collect={BRACKET}", f"--dump-after={BRACKET}"]
        command += [sys.executable, "-m", "validation.effect_work", engine, str(few), str(many), *effects]
        done = subprocess.run(command, env=told, cwd=folder, capture_output=True, text=True, check=False)
        dumps = sorted(Path(folder).glob("counted.*"), key=lambda path: int(path.suffix[1:]))
        totals = [re.findall(r"^totals: (\d+)", dump.read_text(), re.MULTILINE) for dump in dumps[-2 * len(effects) :]]
    if done.returncode or len(totals) < 2 * len(effects) or not all(totals):
        raise FourBarError(
            f"{engine} with {', '.join(effects)} did not run under valgrind: {done.stderr.strip()[-300:]}"
        )
    each = iter(int(total[-1]) for total in totals)
    units = (many - few) * (POSITIONS if engine == "formulas" else 1)
    return {effect: (more - less) / units for effect, less, more in zip(effects, each, each, strict=False)}


def pairs(engines: tuple[str, ...], effects: tuple[str, ...]) -> list[tuple[str, str]]:
    """Every engine with every effect that it has; of the simulation each flag that the bare scene switches off too."""
    found = [(engine, effect) for engine in engines for effect in effects if (engine, effect) not in NO_COUNTERPART]
    if "mujoco-simulated" in engines:
        found += [("mujoco-simulated", name) for name in (DEFAULT_FLAGS, *flags())]
    return found


def costs(asked: list[tuple[str, str]], workers: int) -> dict[tuple[str, str], float]:
    """Instructions of each; one process for each engine."""
    engines = list(dict.fromkeys(engine for engine, _ in asked))
    effects = [[effect for engine, effect in asked if engine == each] for each in engines]
    with ThreadPoolExecutor(workers) as pool:
        found = pool.map(counts, engines, effects)
    return {(engine, name): n for engine, of in zip(engines, found, strict=True) for name, n in of.items()}


@click.command(name="effects-cost")
@click.option("--engines", metavar="NAMES", default=",".join(AMOUNTS), show_default=True, help="Comma-separated.")
@click.option("--effects", metavar="NAMES", help="Comma-separated; left out: all.")
@click.option("--workers", type=click.IntRange(min=1), default=2, show_default=True, help="Counts at the same time.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the table as Markdown too.")
@click.option("--absent", is_flag=True, help="Look instead for any trace of an effect in a build without it: none.")
def command(engines: str, effects: str | None, workers: int, out: Path | None, absent: bool) -> int:
    """Count the instructions that each effect costs in each engine (valgrind; some minutes)."""
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
    counted = costs(work, workers)
    clocked = [ratio(*pair) for pair in track(work, description="wall clock", transient=True)]  # by itself, undisturbed
    entries = [Entry(*pair, counted[pair], times) for pair, times in zip(work, clocked, strict=True)]
    show(entries)
    if out is not None:
        write_text(out, markdown(entries))
        click.echo(f"written to {out}")
    return 0


def check_absent() -> int:
    """Print what a build without each effect makes otherwise of a bare scene; 1 where it is anything."""
    from validation.effect_absent import ABSENT, compared, holds

    failed, uncounted = False, False
    for effect, differs, more in compared(ABSENT):
        failed |= not holds(differs, more)
        uncounted |= more is None
        same = "differs in " + ", ".join(differs) if differs else "bits, MJCF, compiled model and terms are equal"
        counted = "instructions not counted: no valgrind" if more is None else f"instructions {100.0 * more:+.3f} %"
        click.echo(f"without {effect}: {same}; {counted}")
    asked = "no difference is" if uncounted else f"less than {100.0 * REPEATS:g} % and no difference are"
    click.echo(f"{'FAILS' if failed else 'holds'}: {asked} asked for")
    return int(failed)
