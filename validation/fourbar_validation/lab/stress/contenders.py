"""Who evaluates the positions of one linkage, and the linkages of one position: their times, side by side."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from fourbar import vary
from fourbar.errors import DependencyError, say_install
from fourbar.quantities import UNKNOWNS, VECTORS
from fourbar.solve import solve
from fourbar.studies.function import function
from fourbar_validation.lab.stress.bench_picture import Times
from fourbar_validation.lab.stress.in_c import Loop, compile_loop
from fourbar_validation.lab.stress.timed import make_command, make_example, time_call, time_in_turns

AT_ONCE = 1_000_000
"""Positions of a call: more are evaluated in pieces of this many, so that their memory is bounded (150 MB)."""
SHORTEST = 200_000
"""Positions of one timing: fewer are evaluated as often as makes so many."""
MOST_LINKAGES = 100_000
MOST_LOOPED = 1000
"""Linkages that are solved one after the other: beyond them the cost of one no longer changes."""


STUDY, POSITIONS, LOOPED = "study, NumPy", "one linkage, as many positions", "one after the other"


class Peers(NamedTuple):
    """What there is, and why the others are not."""

    here: dict[str, Loop]
    not_run: dict[str, str]


def time_interleaved(actions: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Time the actions in turn: the median of each, the first round apart."""
    clocks = {name: partial(time_call, action) for name, action in actions.items()}
    return {name: median(times[1:]) for name, times in time_in_turns(clocks, rounds + 1).items()}


def collect_loops() -> Peers:
    """Collect the closed formulas by several hands: each writes into arrays that are there."""
    scene = make_example()
    result: dict[str, Loop | str] = {"NumPy": _make_solve_loop(False)}
    try:
        solve(scene, at=make_command(2), compiled=True)
        result["compiled"] = _make_solve_loop(True)
    except DependencyError as error:
        result["compiled"] = str(error)
    result["C"] = compile_loop()
    result |= {name: _make_library_loop(name) for name in ("JAX", "PyTorch")}
    reasons = {name: each for name, each in result.items() if isinstance(each, str)}
    return Peers({name: each for name, each in result.items() if not isinstance(each, str)}, reasons)


def _make_solve_loop(compiled: bool) -> Loop:
    scene = make_example()

    def call(theta_2: Any, out: Any) -> None:
        rows, into = iter(range(len(out))), {}
        for name in UNKNOWNS:
            row = next(rows)
            into[name] = out[row : next(rows) + 1].T if name in VECTORS else out[row]
        solve(scene, at=make_command(len(theta_2))._replace(angle=theta_2), out=into, compiled=compiled)

    return call


def _make_library_loop(name: str) -> Loop | str:
    """Evaluate the scene's function, by JAX compiled, by PyTorch as it stands, on the CPU in doubles."""
    try:
        if name == "JAX":
            import jax
        else:
            import torch
        import array_api_compat  # noqa: F401
    except ModuleNotFoundError as error:
        extra = "jax" if name == "JAX" else "torch"
        return f"{error.name} is not installed: {say_install(extra)}"
    f = function(make_example(), ["motion.theta_2"], UNKNOWNS)
    run = jax.jit(f) if name == "JAX" else f

    def call(theta_2: Any, out: Any) -> None:
        if name == "JAX":
            with jax.enable_x64(True):
                found = run(jax.numpy.asarray(theta_2))
        else:
            found = run(torch.from_numpy(theta_2))
        row = 0
        for unknown in UNKNOWNS:
            values = np.atleast_2d(np.asarray(found[unknown]).T)
            out[row : row + len(values)] = values
            row += len(values)

    return call


def time_positions(peers: dict[str, Loop], largest: int, rounds: int) -> Times:
    """Time a position, in ns, for 1000, 10 000, ... of them, into arrays that are there."""
    times: Times = {name: {} for name in peers}
    for n in [10**k for k in range(3, 9) if 10**k <= largest]:
        theta_2, out = make_command(min(n, AT_ONCE)).theta_2, np.zeros((15, min(n, AT_ONCE)))
        calls = max(1, SHORTEST // n, n // AT_ONCE)
        evaluated = calls * len(theta_2)

        def repeated(loop: Loop, theta_2: Any = theta_2, out: Any = out, calls: int = calls) -> Callable[[], None]:
            def action() -> None:
                for _ in range(calls):
                    loop(theta_2, out)

            return action

        own = {name: repeated(loop) for name, loop in peers.items()}
        for name, value in time_interleaved(own, rounds if n <= AT_ONCE else 1).items():
            times[name][n] = 1e9 * value / evaluated
    return times


def time_linkages(largest: int, rounds: int, *, compiled: bool) -> Times:
    """Time a linkage at one position, in ns, for 1, 10, ... of them: solved as a study, and one after the other."""
    scene = make_example(theta_2=1.0)
    times: Times = {STUDY: {}, POSITIONS: {}, LOOPED: {}}
    times |= {"study, compiled": {}} if compiled else {}
    for m in [10**k for k in range(6) if 10**k <= min(largest, MOST_LINKAGES)]:
        lengths = np.linspace(0.24, 0.26, m)
        calls = max(1, MOST_LOOPED // m)
        at = make_command(m)

        def study(compiled: bool, lengths: Any = lengths, calls: int = calls) -> None:
            for _ in range(calls):
                solve(vary(scene, {"lengths.coupler": lengths}), compiled=compiled)

        def positions(at: Any = at, calls: int = calls) -> None:
            for _ in range(calls):
                solve(scene, at=at, compiled=False)

        def looped(lengths: Any = lengths, calls: int = calls) -> None:
            for _ in range(calls):
                for length in lengths.tolist():
                    linkage = replace(scene.linkage, coupler=replace(scene.linkage.coupler, length=length))
                    solve(replace(scene, linkage=linkage))

        actions: dict[str, Callable[[], object]] = {
            STUDY: lambda study=study: study(False),  # type: ignore[misc]
            POSITIONS: positions,
        }
        if compiled:
            actions["study, compiled"] = lambda study=study: study(True)  # type: ignore[misc]
        if m <= MOST_LOOPED:
            actions[LOOPED] = looped
        for name, value in time_interleaved(actions, rounds).items():
            times[name][m] = 1e9 * value / (calls * m)
    return times
