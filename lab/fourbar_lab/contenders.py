"""Time the libraries that evaluate positions, and draw the times.

Timed are many positions of one linkage, and many linkages at one position.
"""

import ctypes
import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from fourbar import Bar, FourBar, Gravity, Motion, Scene, vary
from fourbar.quantities import UNKNOWNS, VECTORS, Array
from fourbar.scene import Command
from fourbar.show.plot.style import Drawing, apply_style
from fourbar.solving import solve
from fourbar_validation.advise.clocks import time_call, time_in_turns
from fourbar_validation.engines.programs import run_to_end
from fourbar_validation.report.machine import name_machine

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Times = dict[str, dict[int, float]]
"""ns for each, by who and by how many."""
TimedLoop = Callable[[Array, Array], None]
"""Writes theta_3, theta_4, omega_3, omega_4, alpha_3, alpha_4, F12, F32, F43, F14 (two
rows each) and the torque at n angles into an array (15, n).
"""
_SOURCE = Path(__file__).with_name("bench_loop.c")
FLAGS = ("-O3", "-march=native")
_LOOKS = (
    ("#0072B2", "o"),
    ("#D55E00", "s"),
    ("#1a1a1a", "^"),
    ("#007A5A", "v"),
    ("#8A3B78", "D"),
)
"""Colours and marks in the order of the contenders."""
POSITIONS_OF_ONE_CALL = 1_000_000
"""Positions of a call. More are evaluated in pieces of this many, so that their memory
is bounded (150 MB).
"""
LEAST_POSITIONS = 200_000
"""Positions of one timing: fewer are evaluated as often as makes so many."""
_MOST_LINKAGES = 100_000
MOST_LOOPED = 1000
"""Linkages that are solved one after the other. Beyond them the cost of one no longer
changes.
"""
STUDY = "study, NumPy"
ONE_LINKAGE = "one linkage, as many positions"
_LOOPED = "one after the other"
CONTENDED_LINKAGE = FourBar(0.3, Bar(0.1, 0.2), Bar(0.25, 0.5), Bar(0.22, 0.4))
"""Crank-rocker a = 0.1, b = 0.25, c = 0.22, d = 0.3 m, uniform bars."""


def make_example(theta_2: float = 0.0) -> Scene:
    """Return the scene that is timed: a crank at 10 rad/s, driven, with gravity."""
    motion = Motion(theta_2, 10.0)
    return Scene(CONTENDED_LINKAGE, motion, effects=(Gravity(),))


def command_positions(n: int) -> Command:
    """Command n positions over a revolution."""
    angles = np.linspace(0.0, 2.0 * np.pi, n)
    return Command(angles, np.broadcast_to(np.int8(1), (n,)), 10.0, 0.0)


def allocate(names: Iterable[str], command: Command) -> dict[str, Array]:
    """Return arrays by name, of the layout of `solve` for this command.

    Each is written once, so that no page is faulted in while the clock runs.
    """
    first = solve(make_example(), at=command)
    return {name: getattr(first, name) for name in names}


def time_interleaved(
    actions: Mapping[str, Callable[[], object]],
    rounds: int,
    calls: int = 1,
) -> dict[str, float]:
    """Return the median CPU time in s of a call of each action, called in turns.

    The first of the rounds does not count.
    """
    clocks = {
        name: partial(time_call, action, calls) for name, action in actions.items()
    }
    return {
        name: median(times[1:])
        for name, times in time_in_turns(clocks, rounds + 1).items()
    }


def collect_loops() -> tuple[dict[str, TimedLoop], dict[str, str]]:
    """Return the implementations of the closed formulas that write into given arrays.

    The second dictionary names those that cannot be made here, with the reason.
    """
    loop = _compile_loop()
    if isinstance(loop, str):
        return {"NumPy": _make_solve_loop()}, {"C": loop}
    return {"NumPy": _make_solve_loop(), "C": loop}, {}


def _make_solve_loop() -> TimedLoop:
    scene = make_example()

    def call(theta_2: Any, out: Any) -> None:
        into = {}
        row = 0
        for name in UNKNOWNS:
            into[name] = out[row : row + 2].T if name in VECTORS else out[row]
            row += 2 if name in VECTORS else 1
        at = command_positions(len(theta_2))._replace(angle=theta_2)
        solve(scene, at=at, out=into)

    return call


def _compile_loop() -> TimedLoop | str:
    """Compile the loop; the reason where that fails."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return "no C compiler is installed"
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "loop.so"
        words = [*FLAGS, "-fPIC", "-shared", _SOURCE, "-o", library, "-lm"]
        made = run_to_end([compiler, *words])
        if made.failed:
            first, *_ = [*made.errors.strip().splitlines(), "without a word"]
            return f"{compiler} fails: {first}"
        loop = ctypes.CDLL(str(library)).loop
    pointer = ctypes.POINTER(ctypes.c_double)

    def call(theta_2: Array, out: Array) -> None:
        loop(
            ctypes.c_long(len(theta_2)),
            theta_2.ctypes.data_as(pointer),
            out.ctypes.data_as(pointer),
        )

    return call


def time_positions(
    peers: dict[str, TimedLoop],
    largest: int,
    rounds: int,
) -> Times:
    """Return the time per position in ns, for 1000, 10 000, ... positions.

    Results are written into arrays that exist.
    """
    times: Times = {name: {} for name in peers}
    for n in [10**k for k in range(3, 9) if 10**k <= largest]:
        at_once = min(n, POSITIONS_OF_ONE_CALL)
        calls = max(1, LEAST_POSITIONS // n, n // POSITIONS_OF_ONE_CALL)
        theta_2 = command_positions(at_once).theta_2
        out = np.zeros((15, at_once))
        actions = {name: partial(loop, theta_2, out) for name, loop in peers.items()}
        once_each = rounds if n <= POSITIONS_OF_ONE_CALL else 1
        for name, value in time_interleaved(actions, once_each, calls).items():
            times[name][n] = 1e9 * value / at_once
    return times


def time_linkages(largest: int, rounds: int) -> Times:
    """Return the time per linkage in ns at one position, for 1, 10, ... linkages.

    Linkages are solved as one study, and one after the other.
    """
    scene = make_example(theta_2=1.0)
    times: Times = {STUDY: {}, ONE_LINKAGE: {}, _LOOPED: {}}

    def study(lengths: Any) -> None:
        solve(vary(scene, {"lengths.coupler": lengths}))

    def looped(lengths: Any) -> None:
        for length in lengths.tolist():
            coupler = replace(scene.linkage.coupler, length=length)
            linkage = replace(scene.linkage, coupler=coupler)
            solve(replace(scene, linkage=linkage))

    for m in [10**k for k in range(6) if 10**k <= min(largest, _MOST_LINKAGES)]:
        lengths = np.linspace(0.24, 0.26, m)
        actions: dict[str, Callable[[], object]] = {
            STUDY: partial(study, lengths),
            ONE_LINKAGE: partial(solve, scene, at=command_positions(m)),
        }
        if m <= MOST_LOOPED:
            actions[_LOOPED] = partial(looped, lengths)
        calls = max(1, MOST_LOOPED // m)
        for name, value in time_interleaved(actions, rounds, calls).items():
            times[name][m] = 1e9 * value / m
    return times


def draw_bench(
    over_positions: Times,
    over_linkages: Times,
    path: Path,
) -> None:
    """Draw both growths on logarithmic axes into a file."""
    with apply_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.4, 4.0), layout="constrained")
        panels = (
            (over_positions, "ns per position, every unknown", "positions"),
            (
                over_linkages,
                "ns per linkage, every force at one position",
                "linkages",
            ),
        )
        for axes, panel in zip(figure.subplots(1, 2), panels, strict=True):
            _draw_panel(axes, *panel)
        figure.supxlabel(
            f"One core: {name_machine()}",
            size=6.8,
            x=0.012,
            ha="left",
            parse_math=False,
        )
        Drawing(figure).save(path)


def _draw_panel(
    axes: "Axes",
    times: Times,
    title: str,
    over: str,
) -> None:
    for (who, timed), (colour, mark) in zip(times.items(), _LOOKS, strict=False):
        axes.loglog(
            *zip(*timed.items(), strict=True),
            color=colour,
            marker=mark,
            ms=3.5,
            lw=1.1,
            label=who,
        )
    axes.set_title(title)
    axes.set_xlabel(over)
    axes.set_ylabel("ns")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.2), ncols=2)
