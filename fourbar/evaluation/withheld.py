"""Quantities that are no numbers: the status that says so, and NaN in their place."""

import cmath
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import Case, Evaluated
from fourbar.formulas.path import NO_DIGIT_LEFT
from fourbar.quantities import NO_TORQUE, NOT_ASSEMBLED, OK, OVERFLOW, SEVERAL, SINGULAR, STAGE_OF, STAGES
from fourbar.scene.point import OF_POINTS


def is_finite(values: Mapping[str, Any]) -> bool:
    """Whether every entry is a number, from their squares; False also where a square leaves the range of doubles."""
    squares = (np.vdot(value, value) if isinstance(value, np.ndarray) else value for value in values.values())
    return all(cmath.isfinite(square) for square in squares)


def withhold_in_place(case: Case, found: Evaluated) -> None:
    """Write `withhold` in place wherever a result is no number."""
    codes, values, driven = found
    if not is_finite(values):
        in_line: Any = False
        if driven is not None and case.drive is None:
            in_line = np.abs(case.path.drive_sine(driven, case.drive_bar)) <= NO_DIGIT_LEFT
        withhold(values, codes, np.broadcast_to(in_line, codes.shape))


def withhold(values: dict[str, Any], code: NDArray[np.uint8], in_line: NDArray[np.bool_]) -> None:
    """Where a quantity is no number and the status promises one: the status that says so, and NaN from that stage on.

    `code`: status of each position, changed in place. `in_line`: where the two bars that are not driven are in line:
    there no forces hold them in balance.
    """
    gone = np.zeros(code.shape, dtype=bool)
    for stage in STAGES:
        names = [name for name in values if STAGE_OF.get(name, OF_POINTS.get(name[:2], "position")) == stage]
        of_forces = stage in STAGES[3:]
        promised = np.isin(code, (OK, SEVERAL)) if of_forces else ~np.isin(code, (NOT_ASSEMBLED, SINGULAR))
        found = np.zeros_like(gone)
        for name in names:
            found |= ~np.isfinite(values[name])
            values[name] = np.where(np.isfinite(values[name]), values[name], make_no_value(values[name]))
        found &= promised & ~gone
        code[found] = OVERFLOW
        if of_forces:
            code[found & in_line] = NO_TORQUE
        gone |= found
        for name in names:
            if name != "drive_condition":
                values[name] = np.where(gone, make_no_value(values[name]), values[name])


def make_no_value(quantity: Any) -> complex:
    """NaN; of a vector in both components."""
    return complex(np.nan, np.nan) if np.iscomplexobj(quantity) else np.nan
