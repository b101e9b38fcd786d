"""What one statement comes to, and the angles and questions that all of them share."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import FourBar, uniform
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from validation.compare.answer import Answer, Engine
from validation.compare.compare import turned
from validation.compare.error import used
from validation.compare.rows import AGREES, FAILS, Row
from validation.compare.tolerance import EQUIVALENCE, Array

TURN = 2.0 * math.pi


class Finding(NamedTuple):
    """How far a statement is from what the engine says (rad, or a number of wrong answers), and how far it may be."""

    error: float
    allowed: float
    theta_2: float
    what: str


def worst(name: str, answer: Answer, quantity: str, findings: Iterable[Finding]) -> Row:
    """The row of a quantity: the finding that exceeds what it is allowed by most."""
    found = max(findings, key=lambda each: float(used(each.error, each.allowed)))
    holds = found.error <= found.allowed
    return Row(
        scene=name,
        engine=answer.engine,
        setting=answer.setting,
        quantity=quantity,
        error=float(found.error),
        allowed=float(found.allowed),
        verdict=AGREES if holds else FAILS,
        reason=found.what,
        theta_2=float(found.theta_2),
        condition=float(EQUIVALENCE.factor / max(found.allowed, EQUIVALENCE.factor)),
    )


def answered(engine: Engine, linkage: FourBar, theta_2: Sequence[float], branch: Sequence[int]) -> dict[str, Array]:
    """What the engine finds where bar 2 turns at 1 rad/s; the bars are uniform: their masses play no part."""
    bars = uniform(*linkage.lengths)
    scene = Scene(FourBar(bars.ground, bars.input, bars.coupler, bars.output, linkage.ground_angle), Motion(0.0, 1.0))
    at = Command(np.array(theta_2, dtype=float), np.array(branch, dtype=np.int8), 1.0, 0.0)
    return given(engine, scene, at).quantities


def given(engine: Engine, scene: Scene, at: Command) -> Answer:
    """An engine's answer; LimitError where it refuses those positions."""
    answer = engine.answer(scene, at)
    if answer.refusal is not None:
        raise LimitError(answer.refusal)
    return answer


def wrapped(angle: Array) -> Array:
    """Into [-pi, pi)."""
    return np.asarray((angle + math.pi) % TURN - math.pi)


def same(what: str, stated: Sequence[float], found: Sequence[float], linkage: FourBar) -> Finding:
    """Two lists of angles, modulo 2 pi and in any order: the largest distance of one from the nearest of the other."""
    if not stated or not found:
        return Finding(0.0 if len(stated) == len(found) else math.inf, 0.0, 0.0, what)
    apart = np.abs(wrapped(np.subtract.outer(np.array(stated), np.array(found))))
    error = float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))
    return Finding(error, EQUIVALENCE.factor * turned(linkage.ground_angle, np.array(stated)), stated[0], what)


def roundoff(linkage: FourBar) -> float:
    """What two derivations of an angle may differ by, rad: it is one against the ground's."""
    return EQUIVALENCE.factor * turned(linkage.ground_angle)
