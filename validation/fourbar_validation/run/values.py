"""The formulas' own values: the equations that they satisfy, where they have none, and where friction reverses."""

from collections.abc import Iterator

from fourbar_validation.compare.identities import FORMULAS, identities
from fourbar_validation.compare.reversals import reversals
from fourbar_validation.compare.rows import FAILS, Row
from fourbar_validation.compare.withheld import OfSome, withheld
from fourbar_validation.engines.exact import sines
from fourbar_validation.engines.free_body import solutions
from fourbar_validation.engines.witnesses import not_installed
from fourbar_validation.run.question import Question, select_positions


def check_identities(question: Question) -> list[Row]:
    """Check the equations that the formulas' own numbers must satisfy."""
    return identities(question.name, question.scene, question.at, question.solution)


def check_status(question: Question) -> Iterator[Row]:
    """Check that the formulas have no value exactly where another derivation has none."""
    name, scene, reference, free_body = question.name, question.scene, question.reference, question.free_body
    if reference is not None and question.at.omega_2 is not None:
        yield withheld(name, scene, question.solution, reference, *_by_exact_means(question))
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
