"""A withheld answer is an answer: where the formulas state no value, another derivation must have none."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import NO_TORQUE, NOT_ASSEMBLED, OK, OVERFLOW, SEVERAL, SINGULAR
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar_validation.compare.compare import Mask, counted, touching
from fourbar_validation.compare.error import magnitude, worst
from fourbar_validation.compare.identities import FORMULAS
from fourbar_validation.compare.rows import AGREES, FAILS, Row
from fourbar_validation.compare.tolerance import EPS, NOTHING_TO_TELL, Array, condition_of

STAGES = ("omega_3", "alpha_3", "torque")
"""One quantity of each stage that a position may lack."""
LARGE = 1e75
"""Numbers beyond this, or their squares, may leave the range of doubles in between: 1e300 in a product of four."""


OfSome = Callable[[NDArray[np.intp]], Array]
"""A number of each of some positions."""
IN_ONE_LINE = 32.0 * 2.0**-53
"""|sin(theta_4 - theta_3)| at which bars 3 and 4 may be called in line: their directions are rounded by that."""
SAMPLE = 5
"""Positions of a scene with several solutions of friction, and with one, that are tried: each may take a search."""
NEAR = 1e-6
"""|sin(theta_4 - theta_3)| below which doubles have no word in it."""


def withheld(
    name: str,
    scene: Scene,
    formulas: Solution,
    basis: Solution,
    sines: OfSome | None = None,
    solutions: OfSome | None = None,
) -> Row:
    """The positions at which the formulas have a value and `basis` has none, or the reverse, where it has digits left.

    That a loop does not close is compared by itself where doubles can decide it.

    Parameters
    ----------
    sines : sin(theta_4 - theta_3) in many digits at some positions, NaN where the loop does not close; near 0 it
        decides whether they are singular. None: nothing is.
    solutions : how many solutions loaded friction has at some positions.
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
    if basis.drive_condition is not None:
        own = [formulas.a_G2, formulas.a_G3, formulas.a_G4, *formulas.acceleration.values()]
        # where all is there that the forces need, what is lacking is theirs
        moves = np.isfinite(np.hstack([a for a in own if a is not None])).all(axis=1)
        in_line = basis.drive_condition < IN_ONE_LINE
        differ |= (formulas.status_code == OVERFLOW) & moves & in_line
        differ |= (formulas.status_code == NO_TORQUE) & (basis.drive_condition > NEAR)
    if sines is not None and len(near := np.flatnonzero(_near(scene, formulas, basis))):
        sine = np.abs(sines(near))
        closes, in_line = np.isfinite(sine), formulas.status_code[near] == SINGULAR
        differ[near] |= (formulas.status_code[near] == NOT_ASSEMBLED) == closes
        differ[near] |= closes & np.where(in_line, sine > IN_ONE_LINE, sine < 1.0 / 16.0 * IN_ONE_LINE)
    if solutions is not None and len(many := np.flatnonzero(formulas.status_code == SEVERAL)[:SAMPLE]):
        differ[many] |= solutions(many) < 2
    if solutions is not None and len(ok := np.flatnonzero(formulas.status_code == OK)):
        some = ok[np.unique(np.linspace(0, len(ok) - 1, SAMPLE).astype(int))]
        differ[some] |= solutions(some) > 1
    index = worst(differ.astype(float))
    stated = counted(formulas.status_code[formulas.status_code != OK])
    reason = f"the formulas state: {stated}" if stated else "every position has its values"
    if differ.any():
        reason = f"{np.count_nonzero(differ)} positions differ, the first is {formulas.status[index]}; {reason}"
    theta_2 = float(formulas.theta_2[index]) if len(formulas) else 0.0
    verdict = FAILS if differ.any() else AGREES
    return Row(name, FORMULAS, "exact", "status", float(np.count_nonzero(differ)), 0.0, verdict, reason, theta_2, 1.0)


def _near(scene: Scene, formulas: Solution, basis: Solution) -> Mask:
    """Where bars 3 and 4 are so nearly in line that exact arithmetic has to decide, (n,)."""
    close = touching(scene, formulas.theta_2)
    return np.asarray(close | (basis.condition < NEAR) | (formulas.condition < NEAR))


def _large(scene: Scene, basis: Solution) -> Mask:
    """Where numbers are so large that the formulas may have to give up, (n,)."""
    large = np.full(len(basis), max(scene.linkage.lengths) > LARGE or min(scene.linkage.lengths) < 1.0 / LARGE)
    for name in ("omega_2", "alpha_2", *STAGES, "F12", "F43"):
        values = getattr(basis, name)
        if values is not None:
            large |= magnitude(values) > LARGE
    return np.asarray(large)
