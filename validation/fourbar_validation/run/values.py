"""The formulas' own values: the equations that they satisfy, where they have none, and where friction reverses."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from fourbar.quantities import (
    COUPLE,
    LINE,
    NO_LEVER,
    NO_TORQUE,
    NOT_ASSEMBLED,
    OK,
    OVERFLOW,
    SEVERAL,
    SINGULAR,
)
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar_validation.compare.compare import Mask, counted, touching
from fourbar_validation.compare.error import magnitude, worst
from fourbar_validation.compare.identities import FORMULAS, identities
from fourbar_validation.compare.reversals import reversals
from fourbar_validation.compare.rows import AGREES, FAILS, Row
from fourbar_validation.compare.tolerance import EPS, NOTHING_TO_TELL, Array, condition_of
from fourbar_validation.engines.exact import sines
from fourbar_validation.engines.free_body import solutions
from fourbar_validation.engines.witnesses import not_installed
from fourbar_validation.run.question import Question, select_positions

STAGES = ("omega_3", "alpha_3", COUPLE.value, LINE.value)
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


def check_identities(question: Question) -> list[Row]:
    """Check the equations that the formulas' own numbers must satisfy."""
    return identities(question.name, question.scene, question.at, question.solution)


def check_status(question: Question) -> Iterator[Row]:
    """Check that the formulas have no value exactly where another derivation has none."""
    name, scene, reference, free_body = question.name, question.scene, question.reference, question.free_body
    if reference is not None and question.at.omega_2 is not None:
        yield compare_status(name, scene, question.solution, reference, *_by_exact_means(question))
    elif reference is None and (free_body is None or free_body.refusal is None):
        what = "the free bodies, by which it is judged, broke down"
        yield Row.unmeasured(name, FORMULAS, "exact", "status", FAILS, what)


def _by_exact_means(question: Question) -> tuple[OfSome | None, OfSome | None]:
    """Give the sine between bars 3 and 4 in many digits, and how many solutions friction has, at some positions."""
    scene, at = question.scene, question.at
    unknown = at.remainder is not None or not_installed("flint")
    loaded = any(effect.loaded_pins for effect in scene.effects)
    return (
        None if unknown else lambda where: sines(scene.linkage, select_positions(at, where)),
        (lambda where: solutions(scene, select_positions(at, where))) if loaded else None,
    )


def find_reversals(question: Question) -> tuple[()]:
    """Find where dry friction reverses and the pin forces jump; what is drawn there is no comparison."""
    question.jumps = reversals(question.scene, question.at, question.solution)
    return ()


def compare_status(
    name: str,
    scene: Scene,
    formulas: Solution,
    reference: Solution,
    sines: OfSome | None = None,
    solutions: OfSome | None = None,
) -> Row:
    """Count where the formulas have a value and `reference` has none, or the reverse, where it has digits left.

    That a loop does not close is compared by itself where doubles can decide it.

    Parameters
    ----------
    sines : sin(theta_4 - theta_3) in many digits at some positions, NaN where the loop does not close; near 0 it
        decides whether they are singular. None: nothing is.
    solutions : how many solutions loaded friction has at some positions.
    """
    differ = np.zeros(len(formulas), dtype=bool)
    large = _large(scene, reference)
    for quantity in STAGES:
        ours, theirs = getattr(formulas, quantity), getattr(reference, quantity)
        if ours is None or theirs is None:
            continue
        sound = condition_of(quantity, scene.linkage, reference) * NOTHING_TO_TELL > EPS
        differ |= sound & ~large & (np.isfinite(ours) != np.isfinite(theirs))
    differ &= formulas.status_code != NOT_ASSEMBLED
    if reference.drive_condition is not None:
        own = [formulas.a_G2, formulas.a_G3, formulas.a_G4, *formulas.acceleration.values()]
        # where all is there that the forces need, what is lacking is theirs
        moves = np.isfinite(np.hstack([a for a in own if a is not None])).all(axis=1)
        in_line = reference.drive_condition < IN_ONE_LINE
        differ |= (formulas.status_code == OVERFLOW) & moves & in_line
        differ |= np.isin(formulas.status_code, (NO_TORQUE, NO_LEVER)) & (reference.drive_condition > NEAR)
    if sines is not None and len(near := np.flatnonzero(_near(scene, formulas, reference))):
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


def _near(scene: Scene, formulas: Solution, reference: Solution) -> Mask:
    """Where bars 3 and 4 are so nearly in line that exact arithmetic has to decide, (n,)."""
    close = touching(scene, formulas.theta_2)
    return np.asarray(close | (reference.condition < NEAR) | (formulas.condition < NEAR))


def _large(scene: Scene, reference: Solution) -> Mask:
    """Where numbers are so large that the formulas may have to give up, (n,)."""
    large = np.full(len(reference), max(scene.linkage.lengths) > LARGE or min(scene.linkage.lengths) < 1.0 / LARGE)
    for name in ("omega_2", "alpha_2", *STAGES, "F12", "F43"):
        values = getattr(reference, name)
        if values is not None:
            large |= magnitude(values) > LARGE
    return np.asarray(large)
