"""Error bars of what the drive does and of the pin forces: how far they are from the same formulas in longer numbers.

What is stated of the bars, loads, effects and of the command is exact, as doubles; everything else is computed again,
with numbers whose own roundings are a thousandth of those of doubles or less. Whatever the formulas lose at a position,
the two differ by it.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fourbar.evaluation.case import Case, Dynamics
from fourbar.formulas.arithmetic import select
from fourbar.formulas.longer import lengthen, shorten
from fourbar.formulas.motion import State

LAST_ROUNDING = 2.0**-53
"""Relative: half the distance to the next double, or more; the result itself was rounded by as much."""


def compute_error_bars(
    case: Case,
    state: State,
    acceleration: Any,
    sign: Any,
    found: Dynamics,
    exact: NDArray[np.intp],
    remainder: Any,
    lost: Any,
) -> dict[str, Any]:
    """Compute that of the drive (N m or N) and `force_error` (N, worst of the four pin forces), by name, each (n,).

    Parameters
    ----------
    state, acceleration, sign, found : the evaluation that the error bars are for; the sign is that of the path's root.
    exact : indices of the positions whose half angle is known in many digits.
    remainder, lost : what the command leaves out as doubles, as in `Command`.
    """
    longer, angle = case.lengthened(), state.theta_2 if state.q is None else state.q
    if lost is None:
        lost = np.array([0.0 if remainder is None else float(remainder), 0.0, 0.0])
    given = enumerate((angle, state.speed, acceleration))
    q, speed, growth = (lengthen(number) + lost[..., place] for place, number in given)
    half = longer.path.half_angle(q)
    if exact.size:
        from fourbar.formulas.many_digits import decide_half_angles

        left_out = 0.0 if remainder is not None else lost[..., 0]
        half = decide_half_angles(case.linkage, case.path.unit, half, exact, angle, remainder, case.path.bar, left_out)
    position = longer.path.position(q, half, sign)
    near = longer.state(longer.path, q, position, sign, speed, growth)
    other = longer.dynamics(near, growth, case.side)
    pairs = zip((*found.pins, found.drive), (*other.pins, other.drive), strict=True)
    *gaps, drive_gap = (np.abs(shorten(after - before)) for before, after in pairs)
    drive_error = compute_bar(drive_gap, np.abs(found.drive))
    force_error = compute_bar(_find_largest(gaps), _find_largest([np.abs(pin) for pin in found.pins]))
    return {case.names.error: drive_error, "force_error": force_error}


def _find_largest(sizes: list[Any]) -> Any:
    """Find the largest of several numbers, or arrays that broadcast, NaN where one is."""
    return np.maximum(np.maximum(sizes[0], sizes[1]), np.maximum(sizes[2], sizes[3]))


def compute_bar(gap: Any, size: Any) -> Any:
    """Compute the error bar from the distance to the longer number and the size of the value.

    Where there is no longer number, or none in the range of a double, no digit of the value itself is left.
    """
    width = np.maximum(gap, LAST_ROUNDING * size)
    return select(np.isfinite(width), width, size)
