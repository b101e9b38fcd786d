"""Blocks of positions: how many at a time, and into which arrays."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import BLOCK, Case, Evaluated
from fourbar.evaluation.stages import ERROR, Part
from fourbar.evaluation.withheld import withhold_in_place
from fourbar.quantities import SCALARS
from fourbar.solution import Array


def choose_block_size(wanted: int) -> int:
    """Of a stage: for the error bars each position is evaluated many times."""
    return BLOCK if wanted < ERROR else BLOCK // 4


def keep(
    case: Case,
    found: Evaluated,
    result: Mapping[str, Array],
    code: NDArray[np.uint8],
    part: Part,
    shape: tuple[int, ...] | None = None,
) -> None:
    """Write what was evaluated into the arrays of all positions, where it is no number with the status that says so.

    `shape`: of the part of the arrays; None: that of what was evaluated.
    """
    codes, values, _ = found
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
