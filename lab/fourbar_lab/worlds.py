"""`python -m fourbar_lab worlds`: torque and pin forces of many positions at once.

MJX and MuJoCo Warp evaluate them on a GPU, MuJoCo and the formulas on one core.
"""

import math
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import click
import numpy as np

from fourbar.errors import BROKEN, HOLDS, InputError
from fourbar.quantities import PIN_FORCES, UNKNOWNS
from fourbar.scene import Command, Scene
from fourbar.solving import solve
from fourbar_lab.contenders import allocate
from fourbar_lab.simulators.problems import PROBLEMS
from fourbar_lab.tables import show_table
from fourbar_validation.check.problem import judge_answers, read_problem
from fourbar_validation.compare.rows import write_one_line
from fourbar_validation.engines import protocol

_PROBLEM = "crank_rocker"
"""Problem whose positions are repeated over the worlds."""
_WORLDS = "100,10000,100000"
_MOST_TIMINGS = 20
"""Timings of a call at most; their median counts."""
_LONGEST = 2.0
"""Seconds after which a call is not timed once more."""


class Contender(NamedTuple):
    """A simulator that evaluates many worlds in one call."""

    adapter: str
    needs_gpu: bool


FORMULAS_ON_ONE_CORE = "formulas, NumPy, one core"
CONTENDERS = {
    "MuJoCo, one core": Contender("mujoco_c:MujocoFile", False),
    "MJX-JAX, double precision": Contender("mujoco_mjx:MujocoMjx", True),
    "MJX-JAX, single precision": Contender("mujoco_mjx:MjxInSinglePrecision", True),
    "MuJoCo Warp, single precision": Contender("mujoco_warp:MujocoWarp", True),
}
_ABOUT = (
    "Wall-clock time of the torque and the four pin forces of a position, in a call for"
    " so many worlds: of the formulas in ns, of the others as a multiple of theirs. It"
    " is the median of up to 20 calls on assembled states that lie on the device; in"
    " brackets that of calls where states come from NumPy and results return there."
    " The formulas assemble the positions too. Errors are relative to the largest"
    " value. The first call is that of the most positions. It includes compilation,"
    " the assembly of the states, and a whole evaluation."
)


class WorldsCost(NamedTuple):
    """Time and error of one contender at one number of worlds."""

    contender: str
    worlds: int
    seconds: float
    """Seconds of a call on states that lie on the device."""
    exchanged: float
    """Seconds of a call that sets states from NumPy and copies the results back."""
    first: float
    """Seconds until the first call has returned, compilation included."""
    torque: float = math.nan
    """Largest error of the torque, relative to its largest value. The formulas are the
    reference, and have none.
    """
    force: float = math.nan
    """Largest error of a pin force, likewise."""


def _read_question() -> tuple[dict[str, Any], Scene, Command]:
    """Read the problem, with its scene and its command."""
    problem = read_problem(PROBLEMS / f"{_PROBLEM}.json")
    scene = protocol.scene_from_json(problem["scene"])
    return problem, *protocol.command_from_json(scene, problem["command"])


def _time_wall_clock(call: Callable[[], object]) -> float:
    """Time a call in s of wall-clock time, the median of several."""
    times: list[float] = []
    while len(times) < _MOST_TIMINGS and sum(times) < _LONGEST:
        times.append(_time_once(call))
    return median(times)


def _time_once(call: Callable[[], object]) -> float:
    began = time.perf_counter()
    call()
    return time.perf_counter() - began


def _measure_formulas(worlds: int) -> WorldsCost:
    """Time the formulas at as many positions, into arrays that exist."""
    _, scene, command = _read_question()
    repeated = command._replace(
        angle=np.resize(command.angle, worlds),
        branch=np.resize(command.branch, worlds),
    )
    call = partial(solve, scene, at=repeated, out=allocate(UNKNOWNS, repeated))
    first = _time_once(call)
    seconds = _time_wall_clock(call)
    return WorldsCost(FORMULAS_ON_ONE_CORE, worlds, seconds, seconds, first)


def measure_worlds(name: str, worlds: int) -> WorldsCost:
    """Time a contender, and judge the last worlds, one for each position."""
    problem, scene, command = _read_question()
    simulator = load_simulator(CONTENDERS[name].adapter)()
    began = time.perf_counter()
    prepared = simulator.in_worlds(scene, worlds)
    prepared.evaluate()
    first = time.perf_counter() - began
    seconds = _time_wall_clock(prepared.evaluate)
    exchanged = _time_wall_clock(prepared.exchange)
    readings = prepared.read(prepared.exchange())
    rows = np.arange(len(command.angle))
    answer = simulator.make_answer(scene, command, simulator.setting, readings, rows)
    result = protocol.answer_to_json(scene, command, answer)
    errors = {row.quantity: row.error for row in judge_answers(problem, result)}
    # NaN stays NaN
    force = float(np.max([errors[name] for name in PIN_FORCES]))
    torque = errors["torque"]
    return WorldsCost(name, worlds, seconds, exchanged, first, torque, force)


def load_simulator(adapter: str) -> Any:
    """Import the class of a simulator."""
    module, _, name = adapter.partition(":")
    return getattr(import_module(f"fourbar_lab.simulators.{module}"), name)


def _find_obstacle(contender: Contender, on_any_device: bool) -> str:
    """Return why a contender cannot be run here, or an empty text."""
    try:
        simulator = load_simulator(contender.adapter)
    except ImportError as error:
        return write_one_line(str(error))
    if contender.needs_gpu and not on_any_device and not simulator.on_gpu:
        return "no GPU"
    return ""


def _list_devices() -> list[str]:
    """Name the device of each contender whose adapter can be imported."""
    devices = []
    for adapter, _ in CONTENDERS.values():
        with suppress(ImportError):
            one = load_simulator(adapter)
            devices.append(f"{one.name} {one.version} on {one.device}")
    return list(dict.fromkeys(devices))


def list_worlds_rows(costs: Iterable[WorldsCost]) -> tuple[list[str], list[list[str]]]:
    """List the columns of the table, and a row of each contender."""
    by_name: dict[str, dict[int, WorldsCost]] = {}
    for cost in costs:
        by_name.setdefault(cost.contender, {})[cost.worlds] = cost
    formulas = by_name[FORMULAS_ON_ONE_CORE]
    rows = []
    for name, row in by_name.items():
        cells = [_write_time(row.get(worlds), formulas[worlds]) for worlds in formulas]
        if name == FORMULAS_ON_ONE_CORE:
            cells += ["reference", "reference"]
        else:
            # NaN stays NaN
            torque = np.max([cost.torque for cost in row.values()])
            force = np.max([cost.force for cost in row.values()])
            cells += [f"{torque:.1e}", f"{force:.1e}"]
        cells.append(f"{max(cost.first for cost in row.values()):.2g}")
        rows.append([name, *cells])
    numbers = [f"{worlds:,}".replace(",", " ") for worlds in formulas]
    return ["", *numbers, "torque", "worst pin force", "first call, s"], rows


def _write_time(cost: WorldsCost | None, formulas: WorldsCost) -> str:
    """Write the time of a position: of the formulas in ns, else divided by theirs."""
    if cost is None:
        return "failed"
    if cost.contender == FORMULAS_ON_ONE_CORE:
        return f"{1e9 * cost.seconds / cost.worlds:.0f} ns"
    ratio = cost.seconds / formulas.seconds
    return f"{ratio:.2g} ({cost.exchanged / formulas.seconds:.2g})"


def _read_worlds(text: str, positions: int) -> list[int]:
    """Read numbers of worlds, each a multiple of the number of positions."""
    numbers = []
    for word in text.split(","):
        if not word.strip().isdecimal() or int(word) % positions or int(word) == 0:
            allowed = f"must be multiples of {positions}, separated by commas"
            raise InputError("--worlds", word, allowed)
        numbers.append(int(word))
    return numbers


@click.command(name="worlds")
@click.option(
    "--worlds",
    metavar="NUMBERS",
    default=_WORLDS,
    show_default=True,
    help="Worlds.",
)
@click.option(
    "--any-device",
    is_flag=True,
    help="Run MJX and MuJoCo Warp without a GPU too.",
)
@click.option(
    "-o",
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Write the table as Markdown too.",
)
def worlds_command(
    worlds: str,
    any_device: bool,
    out: Path | None,
) -> int:
    """Time torque and pin forces of many positions at once, on a GPU.

    MuJoCo and the formulas stand beside it, on one core. What is not run is named with
    the reason, and the exit status is 3.
    """
    _, _, positions = _read_question()
    numbers = _read_worlds(worlds, len(positions.angle))
    obstacles = {
        name: _find_obstacle(contender, any_device)
        for name, contender in CONTENDERS.items()
    }
    not_run = [
        f"{name}: not run: {reason}" for name, reason in obstacles.items() if reason
    ]
    costs: list[WorldsCost] = []
    for number in numbers:
        actions = {FORMULAS_ON_ONE_CORE: partial(_measure_formulas, number)}
        for name, reason in obstacles.items():
            if not reason:
                actions[name] = partial(measure_worlds, name, number)
        for name, action in actions.items():
            what = f"{name}, {number} worlds"
            try:
                costs.append(action())
            except (ArithmeticError, MemoryError, RuntimeError) as error:
                not_run.append(f"{what}: failed: {write_one_line(str(error))}")
                continue
            click.echo(f"{what}: {1e9 * costs[-1].seconds / number:.0f} ns a position")
    columns, rows = list_worlds_rows(costs)
    show_table("worlds", _ABOUT, columns, rows, out, not_run, _list_devices())
    return BROKEN if not_run else HOLDS
