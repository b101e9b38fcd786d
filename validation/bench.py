"""Speed of the formulas, side by side in one process: against the 13x13 system, over sizes, over stages."""

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from statistics import median

import click
import numpy as np
from numpy.typing import NDArray

from fourbar.blocks import BLOCK
from fourbar.effects import Gravity
from fourbar.exits import BROKEN, FAILED, HOLDS
from fourbar.linkage import MOVING_BARS, Bar, FourBar
from fourbar.mobility import default_range
from fourbar.motion import Motion
from fourbar.scene import Command, Scene, solve
from fourbar.solution import VECTORS
from validation.thirteen import FreeBodies, solve_thirteen

Array = NDArray[np.float64]

LINKAGE = FourBar(0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4))
"""Crank-rocker a = 0.1, b = 0.25, c = 0.22, d = 0.3 m, uniform bars."""
ALL = ("theta_3", "theta_4", "omega_3", "omega_4", "alpha_3", "alpha_4", "F12", "F32", "F43", "F14", "torque")
"""From position to pin forces, one drive: every unknown of the mechanism, none of the points."""
POSITIONS = ("theta_3", "theta_4")
WITH_LIMITS = FourBar(0.3, Bar(0.25, 0.2), Bar(0.1, 0.5), Bar(0.22, 0.4))
"""Its input swings between limit positions: each of its positions has to be looked at."""
THIRTEEN_BATCH = 20_000
"""Positions per batch of the 13x13 system: larger batches are slower per position (27 MB of matrices each)."""
DEFAULT_SOLVED = 100_000
"""Positions of a plain `solve`, which evaluates the forces 17 times for the error bars."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
NEEDED = {"thirteen": 25.0, "growth": 1.3, "positions": 5.0, "import_ms": 30.0, "memory_MB": 50.0}


def example(linkage: FourBar = LINKAGE) -> Scene:
    """The scene that is timed: crank at 10 rad/s, gravity, drive on the input."""
    return Scene(linkage, Motion(0.0, 10.0), 2, (), (Gravity(),))


def preallocated(names: tuple[str, ...], n: int) -> dict[str, Array]:
    """Result arrays, already touched so that no page is faulted in while the clock runs."""
    return {name: np.zeros((2, n)).T if name in VECTORS else np.zeros(n) for name in names}


def command(n: int, start: float = 0.0, stop: float = 2.0 * np.pi) -> Command:
    """n positions, over a revolution unless told otherwise."""
    return Command(np.linspace(start, stop, n), np.broadcast_to(np.int8(1), (n,)), 10.0, 0.0)


def seconds(action: Callable[[], object]) -> float:
    """CPU seconds of one call on this thread."""
    start = time.process_time()
    action()
    return time.process_time() - start


def interleaved(actions: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Median time of each action, the actions taking turns so that a slow spell hits all of them."""
    times: dict[str, list[float]] = {name: [] for name in actions}
    for _ in range(rounds + 1):
        for name, action in actions.items():
            times[name].append(seconds(action))
    return {name: median(values[1:]) for name, values in times.items()}


def bodies_of(scene: Scene, at: Command) -> FreeBodies:
    """The right-hand sides of the 13x13 system, from the kinematics; not part of what is timed."""
    s = solve(scene, "acceleration", at=at)
    gravity = np.array(next((effect.vector for effect in scene.effects if isinstance(effect, Gravity)), (0.0, 0.0)))
    first = {2: np.zeros_like(s.A), 3: s.A, 4: s.B - s.B + [LINKAGE.ground, 0.0]}
    second = {2: s.A, 3: s.B, 4: s.B}
    bars = {k: scene.linkage.bar(k) for k in MOVING_BARS}
    centre = {k: getattr(s, f"G{k}") for k in MOVING_BARS}
    return FreeBodies(
        {k: np.ascontiguousarray(first[k] - centre[k]) for k in MOVING_BARS},
        {k: np.ascontiguousarray(second[k] - centre[k]) for k in MOVING_BARS},
        {k: np.ascontiguousarray(bars[k].mass * (getattr(s, f"a_G{k}") - gravity)) for k in MOVING_BARS},
        {k: bars[k].inertia * getattr(s, f"alpha_{k}") for k in MOVING_BARS},
    )


def import_cost() -> float:
    """CPU milliseconds that `import fourbar` adds to `import numpy`, median over fresh interpreters."""
    code = "import time, numpy; t = time.process_time(); import fourbar; print(time.process_time() - t)"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(7)]
    return 1e3 * median(float(run.stdout) for run in runs)


def memory(n: int) -> float:
    """MB allocated at the peak beyond arguments and results."""
    at, out = command(n), preallocated(ALL, n)
    tracemalloc.start()
    solve(example(), at=at, out=out)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def c_loop(n: int) -> Callable[[], object] | None:
    """The same equations as a plain C loop, compiled on the spot; None where there is no compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "loop.so"
        source = Path(__file__).with_name("bench_loop.c")
        made = subprocess.run(
            [compiler, "-O3", "-march=native", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"],
            capture_output=True,
            check=False,
        )
        if made.returncode != 0:
            return None
        loop = ctypes.CDLL(str(library)).loop
    theta_2, out = command(n).theta_2, np.zeros((15, n))
    pointer = ctypes.POINTER(ctypes.c_double)
    arguments = (ctypes.c_long(n), theta_2.ctypes.data_as(pointer), out.ctypes.data_as(pointer))

    def call() -> Array:
        loop(*arguments)
        return out

    return call


def floor(theta_2: Array, out: dict[str, Array]) -> Callable[[], object]:
    """What no formula for two angles does without: a tangent, a square root and two arctangents, block by block."""

    def action() -> None:
        for start in range(0, len(theta_2), BLOCK):
            part = slice(start, start + BLOCK)
            t = np.tan(theta_2[part])
            root = np.sqrt(np.abs(t, out=t), out=t)
            for angle in out.values():
                np.arctan(root, out=angle[part])

    return action


@click.command()
@click.option("--positions", default=1_000_000, show_default=True, type=click.IntRange(1000))
@click.option("--rounds", default=5, show_default=True, type=click.IntRange(1))
@click.option("--largest", default=10_000_000, show_default=True, type=click.IntRange(1000), help="For the growth.")
def bench(positions: int, rounds: int, largest: int) -> int:
    """Ratios of speed: formulas, the 13x13 system, a C loop; sizes, stages, import, memory."""
    from rich.console import Console
    from rich.table import Table

    if any(os.environ.get(name) != "1" for name in ONE_THREAD):
        # read when numpy is loaded: too late in this process
        arguments = ["--positions", positions, "--rounds", rounds, "--largest", largest]
        line = [sys.executable, "-m", "validation", "bench", *map(str, arguments)]
        told = subprocess.run(line, env=os.environ | dict.fromkeys(ONE_THREAD, "1"), check=False).returncode
        return told if told >= 0 else BROKEN  # below 0: a signal ended it
    rows = measure(positions, rounds, largest)
    table = Table(title=f"{positions} positions, one core, medians of {rounds} interleaved rounds")
    for column in ("what", "measured", "needed", ""):
        table.add_column(column, justify="left" if column == "what" else "right")
    for what, measured, needed, holds in rows:
        table.add_row(what, measured, needed, "" if holds is None else "holds" if holds else "fails")
    Console().print(table)
    return FAILED if any(holds is False for *_, holds in rows) else HOLDS


def measure(positions: int, rounds: int, largest: int) -> list[tuple[str, str, str, bool | None]]:
    """Rows of the table: what, measured, needed, whether it holds."""
    scene, at = example(), command(positions)
    limits, swing = example(WITH_LIMITS), command(positions, *default_range(WITH_LIMITS))
    everything, angles = preallocated(ALL, positions), preallocated(POSITIONS, positions)
    batch = min(positions, THIRTEEN_BATCH)
    bodies = bodies_of(scene, command(batch))
    actions: dict[str, Callable[[], object]] = {
        "all": lambda: solve(scene, at=at, out=everything),
        "positions": lambda: solve(scene, at=at, out=angles),
        "thirteen": lambda: solve_thirteen(bodies, 2),
        "floor": floor(at.theta_2, angles),
        "all, limits": lambda: solve(limits, at=swing, out=everything),
        "positions, limits": lambda: solve(limits, at=swing, out=angles),
    }
    default = command(min(positions, DEFAULT_SOLVED))
    actions["default"] = lambda: solve(scene, at=default)
    in_c = c_loop(positions)
    if in_c is not None:
        actions["c"] = in_c
    times = interleaved(actions, rounds)
    solved = {"thirteen": batch, "default": len(default.theta_2)}
    per = {name: 1e9 * value / solved.get(name, positions) for name, value in times.items()}
    ratio, staged = per["thirteen"] / per["all"], per["all"] / per["positions"]
    by_default = per["default"] / per["positions"]
    rows: list[tuple[str, str, str, bool | None]] = [
        ("formulas, all", f"{per['all']:.1f} ns/position", "", None),
        ("13x13 assembled and solved", f"{per['thirteen']:.0f} ns/position", "", None),
        ("13x13 / formulas", f"{ratio:.1f}", ">= 25", ratio >= NEEDED["thirteen"]),
        ("positions only", f"{per['positions']:.1f} ns/position", "", None),
        ("all (11 unknowns) / positions only", f"{staged:.2f}", ">= 5", staged >= NEEDED["positions"]),
        ("plain solve(scene): error bars, points", f"{per['default']:.0f} ns/position", "", None),
        ("plain solve(scene) / positions only", f"{by_default:.1f}", ">= 5", by_default >= NEEDED["positions"]),
        ("floor: tangent, root, two arctan", f"{per['floor']:.1f} ns/position", "", None),
        ("input between limits: all", f"{per['all, limits']:.1f} ns/position", "", None),
        (
            "input between limits: all / positions only",
            f"{per['all, limits'] / per['positions, limits']:.2f}",
            "",
            None,
        ),
    ]
    if "c" in per:
        rows.append(("plain C loop, all", f"{per['c']:.1f} ns/position", "", None))
        rows.append(("formulas / C loop", f"{per['all'] / per['c']:.2f}", "", None))
    cost = growth(largest, rounds)
    worst = max(cost.values()) / cost[min(cost)]
    for n, value in cost.items():
        rows.append((f"all, {n} positions", f"{value:.1f} ns/position", "", None))
    rows.append(("growth from 1000 positions on", f"{worst:.2f}", "<= 1.3", worst <= NEEDED["growth"]))
    extra, loaded = memory(min(positions, 1_000_000)), import_cost()
    rows.append(("memory beyond the result", f"{extra:.1f} MB", "<= 50", extra <= NEEDED["memory_MB"]))
    rows.append(("import fourbar after numpy", f"{loaded:.1f} ms", "<= 30", loaded <= NEEDED["import_ms"]))
    return rows


def repeated(scene: Scene, n: int) -> Callable[[], object]:
    """n positions, as often as makes 200 000."""
    at, out = command(n), preallocated(ALL, n)

    def action() -> None:
        for _ in range(max(1, 200_000 // n)):
            solve(scene, at=at, out=out)

    return action


def growth(largest: int, rounds: int) -> dict[int, float]:
    """ns per position for 1000, 10 000, ... positions, into preallocated arrays."""
    sizes = [10**k for k in range(3, 9) if 10**k <= largest]
    scene = example()
    actions: dict[str, Callable[[], object]] = {}
    for n in sizes:
        actions[str(n)] = repeated(scene, n)
    times = interleaved(actions, rounds)
    return {n: 1e9 * times[str(n)] / (n * max(1, 200_000 // n)) for n in sizes}
