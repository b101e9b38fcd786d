"""An engine's own assembly: Newton on the engine's closure gap, on the asked branch or not at all.

The engine gives its gap at B and its Jacobian; nothing here knows a formula of the linkage. The
start is guessed from the direction A to O4 as the engine places them, and a step is taken only
where the gap falls and the determinant keeps its sign, so the iteration cannot change the branch.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Closure = Callable[[float, float, float], tuple[Array, Array]]
"""(theta_2, theta_3, theta_4) -> gap at B (2,), m, and its derivatives by theta_3 and theta_4 (2, 2)."""

STARTS = ((30, 30), (15, 15), (45, 45), (5, 5), (5, 120), (120, 5), (60, 60), (2, 150), (150, 2), (1, 1))
"""(alpha, beta) in degrees: bar 3 at alpha from the direction A to O4, bar 4 at beta from its opposite; tried in turn."""
LONGEST_STEP = 0.5
"""rad."""
SHORTEST_STEP = 1e-14
"""rad; a step halved below this no longer moves a double angle."""
CLOSED = 32.0 * 2.0**-52
"""A gap below this part of the sum of the lengths is the rounding of the engine's forward kinematics."""
ITERATIONS = 100


def assemble(
    closure: Closure,
    theta_2: float,
    branch: int,
    towards_O4: float,
    size: float,
    near: tuple[float, float] | None = None,
) -> tuple[float, float] | None:
    """(theta_3, theta_4) of the closed loop on a branch, or None where Newton finds none.

    Parameters
    ----------
    towards_O4 : direction from A to O4 as the engine places them, rad.
    size : sum of the lengths, m.
    near : the angles of a neighbouring position, tried first.
    """
    starts = [] if near is None else [near]
    for at_A, at_O4 in STARTS:
        alpha, beta = branch * math.radians(at_A), branch * math.radians(at_O4)
        starts.append((towards_O4 + alpha, towards_O4 + math.pi - beta))
    for start in starts:
        found = _newton(closure, theta_2, branch, start, CLOSED * size)
        if found is not None:
            return found
    return None


def _newton(
    closure: Closure, theta_2: float, branch: int, start: tuple[float, float], closed: float
) -> tuple[float, float] | None:
    """The closed position reached from a start, or None."""
    q = np.array(start)
    gap, jacobian = closure(theta_2, *start)
    size, det = math.hypot(*gap), _determinant(jacobian)
    if branch_sign(det) != branch:
        return None
    for _ in range(ITERATIONS):
        if size == 0.0:
            break
        step = -np.array(
            [gap[0] * jacobian[1, 1] - gap[1] * jacobian[0, 1], gap[1] * jacobian[0, 0] - gap[0] * jacobian[1, 0]]
        )
        longest = float(np.abs(step).max())
        step *= min(1.0 / abs(det), LONGEST_STEP / longest) * math.copysign(1.0, det)
        while np.abs(step).max() > SHORTEST_STEP:
            trial = q + step
            gap, jacobian = closure(theta_2, *trial)
            if math.hypot(*gap) < size and branch_sign(_determinant(jacobian)) == branch:
                break
            step *= 0.5
        else:
            break
        q, size, det = trial, math.hypot(*gap), _determinant(jacobian)
    return (float(q[0]), float(q[1])) if size <= closed else None


def _determinant(jacobian: Array) -> float:
    return float(jacobian[0, 0] * jacobian[1, 1] - jacobian[0, 1] * jacobian[1, 0])


def branch_sign(determinant: float) -> int:
    """+1 open, -1 crossed, 0 neither.

    The columns are b u3 and -c u4, both turned by 90 deg: the determinant is -b c sin(theta_4 - theta_3),
    and B lies left of the diagonal A to O4 (open) where that sine is positive.
    """
    return int(np.sign(-determinant))
