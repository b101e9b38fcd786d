"""The half angle in many digits, where doubles cannot decide if the loop closes.

Few positions need it.
"""

from typing import Any

import numpy as np

from fourbar.formulas.arithmetic import make_like
from fourbar.formulas.path import LoopPath
from fourbar.formulas.position import (
    TOUCHING,
    HalfAngle,
    compute_factors,
    loop,
    reorder_lengths,
)
from fourbar.linkage import FourBar

WORKING_DIGITS = 120
"""The angle of a limit position near a change point keeps half of them."""
_RESIDUE = 1e-55
"""Relative part that so many digits leave of a factor which is zero at the limit.
"""


def exact_half_angle(
    linkage: FourBar,
    path: LoopPath,
    theta_2: float,
    remainder: Any,
    member: int = 0,
    lost: float = 0.0,
) -> HalfAngle:
    """Compute the half angle of `formulas.position.half_angle` in numbers of mpmath.

    The field `root_sign` is left at 1: doubles decide it.

    Parameters
    ----------
    path : loop as it is read, with the unit of its lengths; theta_2 is its angle.
    theta_2 : rad.
    remainder : what theta_2 as a double leaves out of the angle meant (rad, mpmath),
        where that is known (`Command.remainder`). A position beyond the limit then does
        not assemble, however near.
    member : row of numbers of the linkage that are arrays, (m, 1).
    lost : what a theta_2 that was computed leaves out as a double, rad.
    """
    from mpmath import mp, mpf

    def own(number: Any) -> Any:
        return mpf(float(number[member, 0] if np.ndim(number) else number))

    with mp.workdps(WORKING_DIGITS):
        d, a, b, c = (
            own(length) / own(path.unit)
            for length in reorder_lengths(path.bar, linkage.lengths)
        )
        h = (
            mpf(theta_2)
            + mpf(lost)
            - own(linkage.ground_angle)
            + (0 if remainder is None else remainder)
        ) / 2
        if path.bar == 4:
            h -= mp.pi / 2
        s = mp.sin(h)
        k = mp.cos(h)
        lengths = loop(d, a, b, c)
        half = compute_factors(lengths, s * s, k * k, s * k)
        size = 2 * (a + b + c + d) * mp.sqrt(half.inner + (b - c) ** 2)
        margin = size * (TOUCHING if remainder is None else _RESIDUE)
        outer, inner = (
            0 * factor if abs(factor) <= margin else factor
            for factor in (half.outer, half.inner)
        )
        return half._replace(outer=outer, inner=inner)


def decide_half_angles(
    linkage: FourBar,
    path: LoopPath,
    half: HalfAngle,
    index: Any,
    theta_2: Any,
    remainder: Any = None,
    lost: Any = 0.0,
) -> HalfAngle:
    """Return the half angles with those at an index recomputed in many digits.

    Each number is rounded once, to the kind of number that it replaces.

    `lost`: what a theta_2 that was computed leaves out as a double, rad; for the others
    see `exact_half_angle`.
    """
    flat = np.ravel(theta_2)
    shape = np.shape(theta_2)
    left_out = np.broadcast_to(lost, shape).ravel().tolist()
    mask = np.zeros(flat.shape, dtype=bool)
    mask[index] = True
    high, low = np.zeros((2, 5, flat.size))
    for i in index:
        member = i // shape[-1] if shape else 0
        *numbers, _ = exact_half_angle(
            linkage, path, float(flat[i]), remainder, member, left_out[i]
        )
        for row, value in enumerate(numbers):
            high[row, i] = float(value)
            low[row, i] = float(value - high[row, i])
    *numbers, root_sign = half
    mask = mask.reshape(shape)
    rows = zip(numbers, high.reshape(5, *shape), low.reshape(5, *shape), strict=True)
    decided = (
        np.where(mask, make_like(rounded, number) + rest, number)[()]
        for number, rounded, rest in rows
    )
    return HalfAngle(*decided)._replace(root_sign=root_sign)


def limit_remainder(
    linkage: FourBar,
    limit: float,
    theta_2: float,
    offset: float,
    bar: int,
) -> Any:
    """Compute (limit position + offset) - theta_2 in many digits.

    `limit`: the double of the limit position.

    Where bars 3, 4 are collinear,
        cos(theta_2 - theta_1) = (a^2 + d^2 - (b +- c)^2)/(2 a d);
    likewise as the loop is read from another bar, whose angle theta_2 then is.
    """
    from mpmath import mp, mpf

    with mp.workdps(WORKING_DIGITS):
        d, a, b, c = map(mpf, reorder_lengths(bar, linkage.lengths))
        theta_1 = mpf(linkage.ground_angle) + (mp.pi if bar == 4 else 0)
        exact = []
        for span in (b + c, b - c):
            cosine = (a * a + d * d - span * span) / (2 * a * d)
            psi = mp.acos(min(max(cosine, mpf(-1)), mpf(1)))
            exact += [theta_1 + sign * psi for sign in (1, -1)]
        turn = 2 * mp.pi
        nearest = min(
            (angle + turn * mp.nint((limit - angle) / turn) for angle in exact),
            key=lambda angle: abs(angle - limit),
        )
        return nearest + mpf(offset) - mpf(theta_2)
