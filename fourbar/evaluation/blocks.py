"""Blocks of positions: how many at a time, by NumPy or compiled, on how many cores, and into which arrays."""

import os
from collections.abc import Callable, Iterable, Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.errors import DependencyError, say_install
from fourbar.evaluation.case import BLOCK, Case, Evaluated
from fourbar.evaluation.stages import ERROR, FORCE, Part, evaluate_command
from fourbar.evaluation.withheld import withhold_in_place
from fourbar.quantities import SCALARS
from fourbar.solution import Array

WORTH_COMPILING = 2_000_000
"""Evaluations of the forces, one a position, with error bars fourteen: loading numba and the loop costs as much."""
PARTS_FOR_THREADS = 4


def choose_block_size(wanted: int) -> int:
    """Of a stage: for the error bars each position is evaluated many times."""
    if wanted < ERROR:
        return BLOCK
    from fourbar.evaluation.error_bars import EVALUATIONS

    return BLOCK // EVALUATIONS


def is_compiled(case: Case, wanted: int, count: int, compiled: bool | None) -> bool:
    """Whether some positions go through the compiled loop; for the parameters see `solve` and `evaluate_command`."""
    if compiled is False or wanted < FORCE:
        return False
    if compiled is None and count * (BLOCK // choose_block_size(wanted)) < WORTH_COMPILING:
        return False
    if not find_spec("numba"):
        if compiled is None:
            return False
        raise DependencyError(f"compiled=True needs numba, which is not installed: {say_install('fast')}")
    from fourbar.evaluation.compiled_case import can_carry

    return can_carry(case)


def choose_evaluation(quick: bool) -> Callable[..., Evaluated]:
    """Of some positions, by the compiled loop or by NumPy."""
    if not quick:
        return evaluate_command
    from fourbar.evaluation.compiled_case import evaluate_compiled

    return evaluate_compiled


def count_threads() -> int:
    """As many as this process may use cores, or as OMP_NUM_THREADS states."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    stated = os.environ.get("OMP_NUM_THREADS", "")
    return min(cores, int(stated)) if stated.isdecimal() and int(stated) else cores


def evaluate_parts(evaluate: Callable[[Any], Any], parts: Iterable[Any], *, at_once: bool) -> None:
    """Evaluate the parts, one after the other or on all cores: compiled code holds no lock of the interpreter."""

    def quietly(part: Any) -> Any:
        with np.errstate(all="ignore"):  # which each thread has of its own
            return evaluate(part)

    parts, found = iter(parts), None
    for part in parts:  # compiled by the first
        # what a part found is freed when the next has its own: else the memory of each goes back to the system
        found = quietly(part)
        if at_once:
            break
    del found
    rest = list(parts)
    if len(rest) < PARTS_FOR_THREADS or (cores := count_threads()) == 1:
        for part in rest:
            quietly(part)
        return
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(cores) as pool:
        for _ in pool.map(quietly, rest):
            pass


def keep(
    case: Case,
    found: Evaluated,
    result: Mapping[str, Array],
    code: NDArray[np.uint8],
    part: Part,
    shape: tuple[int, ...] | None = None,
    *,
    seen: bool = False,
) -> None:
    """Write what was evaluated into the arrays of all positions, where it is no number with the status that says so.

    `seen`: whether what is no number has its status already. `shape`: of the part of the arrays; None: that of what was
    evaluated.
    """
    codes, values, _ = found
    if not seen:
        withhold_in_place(case, found)
    code[part] = codes if shape is None else codes.reshape(shape)
    for name, value in values.items():
        if shape is not None and np.ndim(value):
            value = value.reshape(shape)  # noqa: PLW2901
        if name in SCALARS:
            result[name][part] = value
        else:
            array = result[name]
            if array.strides[-1] == array.itemsize:  # x and y next to each other: one copy
                array.view(complex)[*part, 0] = value
            else:
                array[*part, 0], array[*part, 1] = value.real, value.imag
