"""A withheld answer is an answer: where the formulas state no value, another derivation must have none."""

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import NOT_ASSEMBLED, OK, STATUS_NAMES
from fourbar.scene import Scene
from fourbar.solution import Solution
from validation.compare.error import magnitude, worst
from validation.compare.rows import AGREES, FAILS, Row
from validation.compare.tolerance import EPS, NOTHING_TO_TELL, condition_of

FORMULAS = "formulas"
STAGES = ("omega_3", "alpha_3", "torque")
"""One quantity of each stage that a position may lack."""
LARGE = 1e75
"""Numbers beyond this, or their squares, may leave the range of doubles in between: 1e300 in a product of four."""


def withheld(name: str, scene: Scene, formulas: Solution, basis: Solution) -> Row:
    """The positions at which the formulas have a value and `basis` has none, or the reverse, where it has digits left.

    That a loop does not close is compared by itself.
    """
    differ = np.zeros(len(formulas), dtype=bool)
    large = _large(scene, basis)
    for quantity in STAGES:
        ours, theirs = getattr(formulas, quantity), getattr(basis, quantity)
        if ours is None or theirs is None:
            continue
        sound = condition_of(quantity, scene.linkage, basis) * NOTHING_TO_TELL > EPS
        differ |= sound & ~large & (np.isfinite(ours) != np.isfinite(theirs))
    differ &= formulas.status_code != NOT_ASSEMBLED
    index = worst(differ.astype(float))
    counts = np.bincount(formulas.status_code, minlength=len(STATUS_NAMES)).tolist()
    stated = ", ".join(f"{count} {STATUS_NAMES[code]}" for code, count in enumerate(counts) if count and code != OK)
    reason = f"the formulas state: {stated}" if stated else "every position has its values"
    if differ.any():
        reason = f"{np.count_nonzero(differ)} positions differ, the first is {formulas.status[index]}; {reason}"
    theta_2 = float(formulas.theta_2[index]) if len(formulas) else 0.0
    verdict = FAILS if differ.any() else AGREES
    return Row(name, FORMULAS, "exact", "status", float(np.count_nonzero(differ)), 0.0, verdict, reason, theta_2, 1.0)


def _large(scene: Scene, basis: Solution) -> NDArray[np.bool_]:
    """Where numbers are so large that the formulas may have to give up, (n,)."""
    large = np.full(len(basis), max(scene.linkage.lengths) > LARGE or min(scene.linkage.lengths) < 1.0 / LARGE)
    for name in ("omega_2", "alpha_2", *STAGES, "F12", "F43"):
        values = getattr(basis, name)
        if values is not None:
            large |= magnitude(values) > LARGE
    return np.asarray(large)
