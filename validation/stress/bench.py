"""Speed of the formulas, side by side in one process: against the 13x13 system, over sizes, stages; and of a run."""

import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import click
import numpy as np
from numpy.typing import NDArray

from fourbar.effects import Gravity
from fourbar.errors import BROKEN, FAILED, HOLDS
from fourbar.formulas.mobility import default_range
from fourbar.linkage import MOVING_BARS, Bar, FourBar
from fourbar.quantities import ANGLES, UNKNOWNS, VECTORS
from fourbar.scene import Command, Scene
from fourbar.solve import BLOCK, solve
from validation.engines.witnesses import WITNESSES, Witness
from validation.published.thirteen import FreeBodies, solve_thirteen
from validation.report.machine import machine
from validation.run.judge import judged
from validation.scenes.random import LinkageType
from validation.scenes.suites import Random
from validation.stress.against import ONE_THREAD
from validation.stress.against import against as against_revision
from validation.stress.timed import LINKAGE, command, example, preallocated, seconds

Array = NDArray[np.float64]

WITH_LIMITS = FourBar(0.3, Bar(0.25, 0.2), Bar(0.1, 0.5), Bar(0.22, 0.4))
"""Its input swings between limit positions: each of its positions has to be looked at."""
THIRTEEN_BATCH = 20_000
"""Positions per batch of the 13x13 system: larger batches are slower per position (27 MB of matrices each)."""
SOLVED = 100_000
"""Positions where every array is allocated, and for the error bars, which evaluate the forces 17 times."""
PER_SCENE = 50_000
"""Positions in whose stead one random scene is judged: twenty of them by default."""
JUDGED = "a scene judged by the exact engines, ms"


class Limit(NamedTuple):
    """What a row of the table is held to, and why: ratios hold with and without AVX-512."""

    sign: str
    bound: float
    reason: str

    def holds(self, measured: float) -> bool:
        """Whether the measured number keeps it; NaN does not."""
        return measured >= self.bound if self.sign == ">=" else measured <= self.bound


LIMITS = {
    "13x13 / formulas": Limit(">=", 5.0, "closed formulas are worth several times the system that they eliminate"),
    "formulas / positions only": Limit(">=", 3.0, "who asks for two angles does not pay for nine more unknowns"),
    "positions only / floor": Limit("<=", 6.0, "the rest of two angles is arithmetic on arrays of a block"),
    "solve to forces / formulas": Limit("<=", 2.0, "new arrays and the points come on top, no second evaluation"),
    "solve with error bars / to forces": Limit(
        "<=", 35.0, "the forces are evaluated 17 times, and every number is rounded anew"
    ),
    "numpy / compiled": Limit(">=", 1.2, "who installs numba gains by it on one core"),
    "compiled / C": Limit("<=", 1.5, "the blocks, statuses and copies around the compiled loop stay small"),
    "compiled error bars / forces": Limit("<=", 17.0, "16 more evaluations, which share the tangent"),
    "growth from 1000 positions on": Limit("<=", 1.3, "the work is linear in the positions: blocks fit the cache"),
    "memory beyond the result, MB": Limit("<=", 50.0, "work space is that of a block, not of the sweep"),
    JUDGED: Limit("<=", 65.0, "a night of ten hours judges a million scenes on twenty cores, statements and all"),
    "import fourbar / import numpy": Limit("<=", 1.0, "it loads numpy alone, and less than that of its own"),
}
"""By the name of the row."""


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
    first = {2: np.zeros_like(s.A), 3: s.A, 4: np.full_like(s.A, (LINKAGE.ground, 0.0))}
    second = {2: s.A, 3: s.B, 4: s.B}
    bars = {k: scene.linkage.bar(k) for k in MOVING_BARS}
    centre = {k: getattr(s, f"G{k}") for k in MOVING_BARS}
    return FreeBodies(
        {k: np.ascontiguousarray(first[k] - centre[k]) for k in MOVING_BARS},
        {k: np.ascontiguousarray(second[k] - centre[k]) for k in MOVING_BARS},
        {k: np.ascontiguousarray(bars[k].mass * (getattr(s, f"a_G{k}") - gravity)) for k in MOVING_BARS},
        {k: bars[k].moment_of_inertia * getattr(s, f"alpha_{k}") for k in MOVING_BARS},
    )


def import_cost() -> float:
    """CPU seconds that `import fourbar` adds over those of `import numpy`, median over fresh interpreters."""
    clock = "time.process_time()"
    code = f"import time; a = {clock}; import numpy; b = {clock}; import fourbar; print(({clock} - b) / (b - a))"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(7)]
    return median(float(run.stdout) for run in runs)


def memory(n: int) -> float:
    """MB allocated at the peak beyond arguments and results."""
    at, out = command(n), preallocated(UNKNOWNS, VECTORS, n)
    tracemalloc.start()
    solve(example(), at=at, out=out, compiled=False)
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
@click.option("--against", metavar="REVISION", help="This tree's times over those of a git revision, instead.")
def bench(positions: int, rounds: int, largest: int, against: str | None) -> int:
    """Ratios of speed: formulas, the 13x13 system, a C loop; sizes, stages, import, memory."""
    if against is not None:
        return compared_with(against, positions, rounds)
    from rich.console import Console
    from rich.table import Table

    if any(os.environ.get(name) != "1" for name in ONE_THREAD):
        # read when numpy is loaded: too late in this process
        arguments = ["--positions", positions, "--rounds", rounds, "--largest", largest]
        line = [sys.executable, "-m", "validation", "bench", *map(str, arguments)]
        status = subprocess.run(line, env=os.environ | dict.fromkeys(ONE_THREAD, "1"), check=False).returncode
        return status if status >= 0 else BROKEN  # below 0: a signal ended it
    rows = measure(positions, rounds, largest)
    table = Table(title=f"{positions} positions, one core, medians of {rounds} interleaved rounds; {machine()}")
    for column in ("what", "measured", "needed", ""):
        table.add_column(column, justify="left" if column == "what" else "right")
    broken = []
    for what, measured in rows.items():
        limit = LIMITS.get(what)
        if limit is None:
            table.add_row(what, f"{measured:.1f} ns/position")
            continue
        holds = limit.holds(measured)
        table.add_row(what, f"{measured:.2f}", f"{limit.sign} {limit.bound:g}", "holds" if holds else "fails")
        broken += [] if holds else [f"{what}: {limit.reason}"]
    Console().print(table)
    for what in broken:
        click.echo(f"fails: {what}")
    return FAILED if broken else HOLDS


def compared_with(revision: str, positions: int, rounds: int) -> int:
    """The table of this tree's times over those of a revision; a measurement, held to nothing."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    found = against_revision(revision, positions, rounds)
    table = Table(
        title=f"CPU ms of a call in this tree and at {escape(revision)}, and their ratio; "
        f"{positions} positions, one core, medians of {rounds} pairs in turns; {machine()}"
    )
    for column in ("what", "ours", "theirs", "ratio", "least", "most"):
        table.add_column(column, justify="left" if column == "what" else "right")
    for what, row in found.items():
        times = (f"{1e3 * each:.4g}" for each in (row.ours, row.theirs))
        table.add_row(what, *times, *(f"{each:.3f}" for each in (row.ratio, row.least, row.most)))
    Console().print(table)
    return HOLDS


def measure(positions: int, rounds: int, largest: int) -> dict[str, float]:
    """Rows of the table: the ratios of LIMITS, and ns per position."""
    scene, at = example(), command(positions)
    limits, swing = example(WITH_LIMITS), command(positions, *default_range(WITH_LIMITS))
    everything, angles = preallocated(UNKNOWNS, VECTORS, positions), preallocated(ANGLES, VECTORS, positions)
    batch, solved = min(positions, THIRTEEN_BATCH), command(min(positions, SOLVED))
    bodies = bodies_of(scene, command(batch))
    actions: dict[str, Callable[[], object]] = {
        "formulas, all 11 unknowns": lambda: solve(scene, at=at, out=everything, compiled=False),
        "the same compiled": lambda: solve(scene, at=at, out=everything, compiled=True),
        "positions only": lambda: solve(scene, at=at, out=angles),
        "13x13 assembled and solved": lambda: solve_thirteen(bodies, 2),
        "floor: tangent, root, two arctan": floor(at.theta_2, angles),
        "input between limits: all": lambda: solve(limits, at=swing, out=everything, compiled=False),
        "input between limits: positions only": lambda: solve(limits, at=swing, out=angles),
        "solve to forces, points too": lambda: solve(scene, "force", at=solved, compiled=False),
        "solve with error bars": lambda: solve(scene, "error", at=solved, compiled=False),
        "compiled to forces, points too": lambda: solve(scene, "force", at=solved, compiled=True),
        "compiled with error bars": lambda: solve(scene, "error", at=solved, compiled=True),
    }
    in_c = c_loop(positions)
    if in_c is not None:
        actions["plain C loop, all"] = in_c
    times = interleaved(actions, rounds)
    counts = {"13x13 assembled and solved": batch}
    to_stages = ["solve to forces, points too", "solve with error bars"]
    to_stages += ["compiled to forces, points too", "compiled with error bars"]
    counts |= dict.fromkeys(to_stages, len(solved.theta_2))
    rows = {name: 1e9 * value / counts.get(name, positions) for name, value in times.items()}
    cost = growth(largest, rounds)
    rows |= {f"all, {n} positions": value for n, value in cost.items()}
    everything_ns, forces = rows["formulas, all 11 unknowns"], rows["solve to forces, points too"]
    if in_c is not None:
        rows["compiled / C"] = rows["the same compiled"] / rows["plain C loop, all"]
    exact = [witness for witness in WITNESSES if not witness.through_time]
    if not any(witness.missing() for witness in exact):
        rows[JUDGED] = judging(exact, max(1, positions // PER_SCENE))
    return rows | {
        "numpy / compiled": everything_ns / rows["the same compiled"],
        "compiled error bars / forces": rows["compiled with error bars"] / rows["compiled to forces, points too"],
        "13x13 / formulas": rows["13x13 assembled and solved"] / everything_ns,
        "formulas / positions only": everything_ns / rows["positions only"],
        "positions only / floor": rows["positions only"] / rows["floor: tangent, root, two arctan"],
        "solve to forces / formulas": forces / everything_ns,
        "solve with error bars / to forces": rows["solve with error bars"] / forces,
        "growth from 1000 positions on": max(cost.values()) / cost[min(cost)],
        "memory beyond the result, MB": memory(min(positions, 1_000_000)),
        "import fourbar / import numpy": import_cost(),
    }


def judging(witnesses: list[Witness], scenes: int) -> float:
    """Milliseconds of CPU in which a random scene is judged as `run` does, nothing drawn; the median."""
    suite = Random(scenes + 1, 0, tuple(LinkageType))
    each = (partial(judged, suite.name(i), suite.scene(i), witnesses, draw=False) for i in range(scenes + 1))
    times = [seconds(action) for action in each]
    return 1e3 * median(times[1:])  # the first one imports the engines


def repeated(scene: Scene, n: int) -> Callable[[], object]:
    """n positions, as often as makes 200 000."""
    at, out = command(n), preallocated(UNKNOWNS, VECTORS, n)

    def action() -> None:
        for _ in range(max(1, 200_000 // n)):
            solve(scene, at=at, out=out, compiled=False)

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
