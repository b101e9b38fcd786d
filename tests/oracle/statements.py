"""Statements of the formulas on a linkage: ranges, limits, transmission, assemblies.

An exact engine is asked at their places; they do not depend on the motion.
"""

from typing import NamedTuple

from fourbar.scene import Command, Scene
from fourbar_validation.compare.answer import Adapter, Answer
from fourbar_validation.compare.compare import Predicted
from fourbar_validation.compare.rows import Row
from tests.oracle import limit_positions, transmission
from tests.oracle.limit_positions import look, make_worst_row


class Statements(NamedTuple):
    """Statements of the formulas over a motion, evaluated once for all engines."""

    limits: limit_positions.StatedLimits
    transmission: transmission.StatedTransmission
    over: transmission.StatedOver | None
    """None where the motion has no speed."""
    visit: limit_positions.Visit
    """Places where an engine is asked."""

    @classmethod
    def of(cls, scene: Scene, at: Command | None) -> "Statements":
        """Evaluate the formulas."""
        limits = limit_positions.StatedLimits.of(scene.linkage)
        over = None
        if at is not None and at.omega_2 is not None:
            over = transmission.StatedOver.of(scene, at, limits)
        of_angle = transmission.StatedTransmission.of(limits)
        places = limit_positions.choose_places(limits)
        places += transmission.choose_places(of_angle)
        visit = limit_positions.plan_visit(scene.linkage, places)
        return cls(limits, of_angle, over, visit)


def check_statements(
    name: str,
    scene: Scene,
    engine: Adapter,
    answer: Answer,
    stated: Statements | None = None,
    predicted: Predicted | None = None,
) -> list[Row]:
    """Make a row for each of `range`, `limit_positions`, `transmission`.

    If there are change points, `through` has one.

    Parameters
    ----------
    answer : what the engine found over the scene's own motion.
    stated : what the formulas state, where several engines are held to it at one
        motion.
    predicted : the errors to be expected of the answer.
    """
    if stated is None or (
        stated.over is not None and stated.over.command is not answer.at
    ):
        stated = Statements.of(scene, answer.at)
    limits, of_angle, over, visit = stated
    seen = look(engine, visit)
    findings = {
        "range": limit_positions.compare_ranges(limits, engine, seen),
        "limit_positions": limit_positions.compare_limit_positions(limits, seen),
        "transmission": transmission.compare_transmission(
            of_angle,
            over,
            seen,
            answer,
            predicted,
        ),
    }
    if limits.passages:
        findings["through"] = limit_positions.check_through(limits, seen)
    return [
        make_worst_row(name, answer, quantity, list(rows))
        for quantity, rows in findings.items()
    ]
