"""Measure speed as ratios of times that are taken in turns in one process.

Timed are the stages of `solve`, the 13x13 system, C, and the check of a scene.
"""

import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import click
import numpy as np

from fourbar.errors import BROKEN, FAILED, HOLDS
from fourbar.evaluation.case import POSITIONS_OF_A_BLOCK
from fourbar.quantities import ANGLES, UNKNOWNS, Array
from fourbar.show.plot.style import format_of
from fourbar.solving import solve
from fourbar_lab.contenders import (
    ONE_LINKAGE,
    STUDY,
    Times,
    allocate,
    collect_loops,
    command_positions,
    draw_bench,
    make_example,
    time_interleaved,
    time_linkages,
    time_positions,
)
from fourbar_validation.advise.clocks import time_call
from fourbar_validation.compare.bodies import pose
from fourbar_validation.engines.description import list_speeds
from fourbar_validation.engines.free_body import balance, speeds_and_accelerations
from fourbar_validation.engines.free_body_closure import close
from fourbar_validation.engines.registry import ENGINES, Engine
from fourbar_validation.places import MODELS
from fourbar_validation.report.machine import name_machine
from fourbar_validation.report.sentences import make_words_table
from fourbar_validation.run.judge import judge_for_report
from fourbar_validation.scenes.random import DrawnType
from fourbar_validation.scenes.suites import Random

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_THIRTEEN_BATCH = 20_000
"""Positions per batch of the 13x13 system. Larger batches are slower per position
(27 MB of matrices each).
"""
_OVER_POSITIONS = (
    "all unknowns of a position, over the number of positions (1e6 at once at most)"
)
_OVER_LINKAGES = "all forces of a linkage at one position, over the number of linkages"
SOLVED = 100_000
"""Positions where every array is allocated, and for the error bars. The numbers of
error bars take ten times as long.
"""
ROUNDS = 5
"""Rounds in which what is timed takes turns; of each the median counts."""
SINGLE_CALLS = 20
"""Calls of one position each."""
_PER_SCENE = 50_000
"""Positions in whose stead one random scene is judged: twenty of them by default."""
_SCENE = str(MODELS / "crank_rocker.toml")
_ROW_STEP = 10
"""Rows of the sweep's table of which `check` gets one: 37 rows, as a table by hand."""
_IMPORT = """
import time
a = time.process_time()
import numpy
b = time.process_time()
from fourbar import Motion, Scene, solve, uniform
print((time.process_time() - b) / (b - a))
"""
"""Program that prints the time of `import fourbar` beyond NumPy's, over NumPy's."""
SPEED_LIMITS = {
    "formulas / 13x13": (
        0.057,
        "closed formulas are worth many times the free bodies' solution of the system"
        " that they eliminate",
    ),
    "angles alone / formulas": (
        0.77,
        "two angles cost less than the eleven unknowns",
    ),
    "angles alone / floor": (
        7.5,
        "the rest of two angles is arithmetic on arrays of a block",
    ),
    "solve to forces / formulas": (
        2.0,
        "new arrays and the points come on top, no second evaluation",
    ),
    "solve with error bars / solve to forces": (
        10.0,
        "the same formulas once more, in longer numbers, which the processor takes one"
        " by one",
    ),
    "one position / 13x13 of one position": (
        1.2,
        "some hundred steps of Python, as the engine takes",
    ),
    "one position with error bars / one position": (
        4.5,
        "the same formulas once more, in numbers of NumPy's own",
    ),
    "study of linkages / positions": (
        2.0,
        "a member is a column of the same arrays as a position",
    ),
    "growth from 1000 positions on": (
        1.3,
        "the work is linear in the positions: blocks fit the cache",
    ),
    "memory beyond the result, MB": (
        50.0,
        "work space is that of a block, not of the sweep",
    ),
    "a judged scene / one position": (
        320.0,
        "30 ms where a position takes 0.1 ms: a hundred quantities of the engines are"
        " judged one by one, and the scene is solved as it is stated otherwise",
    ),
    "import fourbar / import numpy": (
        1.0,
        "it loads numpy alone, and less than that of its own",
    ),
    **dict.fromkeys(
        (
            "fourbar --help / import numpy",
            "fourbar-validation --help / import numpy",
            "analyze / import numpy",
            "check / import numpy",
        ),
        (3.0, "a command loads what it uses alone"),
    ),
}
"""The most that a row of the table may be, by its name, and the reason.

Most are ratios of the times of two rows, which are the same with and without AVX-512.
"""


class Measured(NamedTuple):
    """Results of one run."""

    rows: dict[str, float]
    over_positions: Times
    over_linkages: Times
    not_run: dict[str, str]


def _measure_memory(n: int) -> float:
    """Measure the MB allocated at the peak beyond arguments and results."""
    command = command_positions(n)
    out = allocate(UNKNOWNS, command)
    tracemalloc.start()
    solve(make_example(), at=command, out=out)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def _make_floor(theta_2: Array, out: dict[str, Array]) -> Callable[[], object]:
    """Return a call that computes one tangent, one root and two arctangents per angle.

    No closed formula of two angles does with less; blocks are those of `solve`.
    """

    def action() -> None:
        for start in range(0, len(theta_2), POSITIONS_OF_A_BLOCK):
            part = slice(start, start + POSITIONS_OF_A_BLOCK)
            t = np.tan(theta_2[part])
            root = np.sqrt(np.abs(t, out=t), out=t)
            for angle in out.values():
                np.arctan(root, out=angle[part])

    return action


def _prepare_thirteen(n: int) -> Callable[[], object]:
    """Return a call that sets up and solves the thirteen equations of n positions.

    The engine of the free bodies solves them, and refines what LAPACK returns; how the
    bars move is found beforehand.
    """
    scene = make_example()
    at = command_positions(n)
    theta = close(scene.linkage, at.theta_2, at.branch).theta
    posed = pose(scene.linkage, [at.theta_2, *theta])
    motion = speeds_and_accelerations(posed, *list_speeds(at))
    return partial(balance, scene, motion)


@click.command()
@click.option(
    "--positions",
    default=1_000_000,
    show_default=True,
    type=click.IntRange(1000),
)
@click.option(
    "--largest",
    default=1_000_000,
    show_default=True,
    type=click.IntRange(1000, 10**8),
    help="For the growth, to 1e8.",
)
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Draw the growth: svg, png or pdf.",
)
def bench(
    positions: int,
    largest: int,
    picture: Path | None,
) -> int:
    """Time NumPy, C and the 13x13 system side by side; ratios that must hold."""
    if picture is not None:
        format_of(picture)
    from rich.console import Console

    if any(os.environ.get(name) != "1" for name in ONE_THREAD):
        # read when numpy is loaded: too late in this process
        status = subprocess.run(
            [sys.executable, "-m", "fourbar_lab", *sys.argv[1:]],
            env=os.environ | dict.fromkeys(ONE_THREAD, "1"),
            check=False,
        ).returncode
        return status if status >= 0 else BROKEN  # below 0: a signal ended it
    measurement = measure_speed(positions, largest)
    rows: list[tuple[str, ...]] = []
    broken: list[str] = []
    for what, measured in measurement.rows.items():
        if what not in SPEED_LIMITS:
            short = measured < 1e6
            time = f"{measured:.1f} ns" if short else f"{1e-6 * measured:.1f} ms"
            rows.append((what, time))
            continue
        most, reason = SPEED_LIMITS[what]
        verdict = "holds"
        if not measured <= most:  # NaN does not hold
            verdict = "fails"
            broken.append(f"{what}: {reason}")
        rows.append((what, f"{measured:.3g}", f"<= {most:g}", verdict))
    console = Console()
    title = (
        f"{positions} positions, times of one on one core, medians of {ROUNDS}"
        f" interleaved rounds; {name_machine()}"
    )
    console.print(
        make_words_table(("what", "measured", "needed", ""), rows, title=title)
    )
    for title, times in (
        (_OVER_POSITIONS, measurement.over_positions),
        (_OVER_LINKAGES, measurement.over_linkages),
    ):
        counts = sorted({n for timed in times.values() for n in timed})
        head = ["ns each", *(f"{n:.0e}".replace("e+0", "e") for n in counts)]
        cells = [
            [who, *(f"{timed[n]:.4g}" if n in timed else "" for n in counts)]
            for who, timed in times.items()
        ]
        console.print(make_words_table(head, cells, title=title))
    for who, reason in measurement.not_run.items():
        click.echo(f"not run: {who}: {reason}")
    if picture is not None:
        draw_bench(measurement.over_positions, measurement.over_linkages, picture)
    for what in broken:
        click.echo(f"fails: {what}")
    return FAILED if broken else HOLDS


def measure_speed(
    positions: int,
    largest: int,
    rounds: int = ROUNDS,
) -> Measured:
    """Measure the ratios of SPEED_LIMITS, ns per position, and times by how many."""
    scene = make_example()
    command = command_positions(positions)
    everything = allocate(UNKNOWNS, command)
    angles = allocate(ANGLES, command)
    batch = min(positions, _THIRTEEN_BATCH)
    many = min(positions, SOLVED)
    solved = command_positions(many)
    alone = make_example(theta_2=1.0)
    loops, not_run = collect_loops()

    def repeated(call: Callable[..., object], *words: Any) -> Callable[[], object]:
        return lambda: [call(*words) for _ in range(SINGLE_CALLS)]

    single = repeated(solve, alone)
    actions: dict[str, tuple[int, Callable[[], object]]] = {
        "formulas": (positions, partial(solve, scene, at=command, out=everything)),
        "angles alone": (positions, partial(solve, scene, at=command, out=angles)),
        "13x13": (batch, _prepare_thirteen(batch)),
        "floor": (
            positions,
            _make_floor(command.theta_2, angles),
        ),
        "solve to forces": (many, partial(solve, scene, "force", at=solved)),
        "solve with error bars": (many, partial(solve, scene, "error", at=solved)),
        "13x13 of one position": (SINGLE_CALLS, repeated(_prepare_thirteen(1))),
        "one position": (SINGLE_CALLS, single),
        "one position with error bars": (SINGLE_CALLS, repeated(solve, alone, "error")),
    }
    if "C" in loops:
        into = np.zeros((15, positions))
        actions["C, all"] = positions, partial(loops["C"], command.theta_2, into)
    times = time_interleaved(
        {name: action for name, (_, action) in actions.items()}, rounds
    )
    rows = {name: 1e9 * times[name] / count for name, (count, _) in actions.items()}
    by_positions = time_positions(loops, largest, rounds)
    by_linkages = time_linkages(positions, rounds)
    cost = by_positions["NumPy"]
    most = max(by_linkages[STUDY])
    exact = [engine for engine in ENGINES if not engine.through_time]
    if not any(engine.missing() for engine in exact):
        scenes = max(1, positions // _PER_SCENE)
        seconds, ratio = _time_judging(exact, scenes, single)
        rows["a scene judged by the exact engines"] = 1e9 * seconds
        rows["a judged scene / one position"] = ratio
    for name in SPEED_LIMITS:
        of, _, over = name.partition(" / ")
        if {of, over} <= rows.keys():
            rows[name] = rows[of] / rows[over]
    rows |= {
        "study of linkages / positions": (
            by_linkages[STUDY][most] / by_linkages[ONE_LINKAGE][most]
        ),
        "growth from 1000 positions on": max(cost.values()) / cost[min(cost)],
        "memory beyond the result, MB": _measure_memory(min(positions, 1_000_000)),
        **measure_starts(),
    }
    return Measured(rows, by_positions, by_linkages, not_run)


def _time_judging(
    engines: list[Engine],
    scenes: int,
    single: Callable[[], object],
) -> tuple[float, float]:
    """Return the median CPU time in s of judging a random scene without pictures.

    The second number is the median of its ratios to one position; `single`: solves
    SINGLE_CALLS of them, right after each scene, since a processor's speed changes
    within seconds.
    """
    suite = Random(scenes + 1, 0, tuple(DrawnType))
    times = []
    ratios = []
    for i in range(scenes + 1):
        name, scene = suite.name(i), suite.scene(i)
        judge = partial(judge_for_report, name, scene, engines, draw=False)
        times.append(time_call(judge))
        ratios.append(times[-1] * SINGLE_CALLS / time_call(single))
    # the first one imports the engines
    return median(times[1:]), median(ratios[1:])


def measure_starts(rounds: int = 7) -> dict[str, float]:
    """Return the processor time of an import and of each command over that of NumPy.

    The medians of `rounds` ratios, each of two processes that follow one another.
    """
    with TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv"
        head, *rows = _run("-m", "fourbar", "analyze", _SCENE, "--csv").splitlines()
        table.write_text("\n".join([head, *rows[::_ROW_STEP]]), encoding="utf-8")
        commands = {
            "fourbar --help": ("fourbar", "--help"),
            "fourbar-validation --help": ("fourbar_validation", "--help"),
            "analyze": ("fourbar", "analyze", _SCENE),
            "check": ("fourbar_validation", "check", _SCENE, str(table)),
        }
        ratios: dict[str, list[float]] = {name: [] for name in commands}
        ratios["import fourbar"] = []
        for words in commands.values():
            _run("-m", *words)  # compiles what is not compiled yet
        for _ in range(rounds):
            ratios["import fourbar"].append(float(_run("-c", _IMPORT)))
            for name, words in commands.items():
                numpy = _spend("-c", "import numpy")
                ratios[name].append(_spend("-m", *words) / numpy)
    return {f"{name} / import numpy": median(of) for name, of in ratios.items()}


def _run(*words: str) -> str:
    """Run Python, which may write compiled modules, and return what it prints."""
    environment = dict(os.environ)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        check=True,
        encoding="utf-8",
        env=environment,
    )
    return done.stdout


def _spend(*words: str) -> float:
    """Run Python and return its processor time, s.

    `os.times` counts it in ticks of 10 ms, a seventh of what an import of NumPy takes.
    """
    import resource  # Windows has none

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _run(*words)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
