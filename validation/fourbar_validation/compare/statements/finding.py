"""Define the result of checking one statement, and an engine's values at the places where it is asked."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import FourBar, uniform
from fourbar.quantities import FORCES, UNKNOWNS
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.answer import Adapter, Answer
from fourbar_validation.compare.rows import Row
from fourbar_validation.compare.tolerance import EQUIVALENCE, count_half_turns, find_used, wrap_angle

Place = tuple[float, int]
"""theta_2 (rad) and branch."""
Seen = Mapping[Place, Mapping[str, float]]
"""Values that an engine finds at some places."""
OF_BARS = [name for name in UNKNOWNS if name not in FORCES]


class Finding(NamedTuple):
    """Error of a statement against the engine (rad, or the number of wrong answers), and the allowed error."""

    error: float
    allowed: float
    theta_2: float
    what: str


def make_worst_row(name: str, answer: Answer, quantity: str, findings: Sequence[Finding]) -> Row:
    """Make the row of a quantity of the finding that exceeds what it is allowed by most."""
    error, allowed, theta_2 = (np.array(column) for column in zip(*(each[:3] for each in findings), strict=True))
    worst = findings[int(np.argmax(find_used(error, allowed)))]
    condition = EQUIVALENCE.factor / np.maximum(allowed, EQUIVALENCE.factor)
    who = (name, answer.engine, answer.setting)
    return Row.judged(who, quantity, error, allowed, worst.what, theta_2, condition)


def look(engine: Adapter, linkage: FourBar, places: Iterable[Place]) -> Seen:
    """Ask an engine at some places where bar 2 turns at 1 rad/s; the bars are uniform: masses play no part."""
    # neighbours in turn: an engine starts from the position before
    each = sorted(set(places), key=lambda place: place[::-1])
    if not each:
        return {}
    bars = uniform(*linkage.lengths)
    scene = Scene(FourBar(bars.ground, bars.input, bars.coupler, bars.output, linkage.ground_angle), Motion(0.0, 1.0))
    theta_2, branch = (np.array(column) for column in zip(*each, strict=True))
    answer = require_answer(engine, scene, Command(theta_2, branch.astype(np.int8), 1.0, 0.0)).quantities
    names = [name for name in OF_BARS if name in answer]
    return {place: {name: float(answer[name][i]) for name in names} for i, place in enumerate(each)}


def require_answer(engine: Adapter, scene: Scene, at: Command) -> Answer:
    """Give an engine's answer; LimitError where it refuses those positions."""
    answer = engine.answer(scene, at)
    if answer.refusal is not None:
        raise LimitError(answer.refusal)
    return answer


def compare_angles(what: str, stated: Sequence[float], found: Sequence[float], linkage: FourBar) -> Finding:
    """Compare lists of angles, modulo 2 pi in any order: the largest distance of one from the nearest of the other."""
    if not stated or not found:
        return Finding(0.0 if len(stated) == len(found) else math.inf, 0.0, 0.0, what)
    apart = np.abs(wrap_angle(np.subtract.outer(np.array(stated), np.array(found))))
    error = float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))
    return Finding(
        error, EQUIVALENCE.factor * count_half_turns(linkage.ground_angle, np.array(stated)), stated[0], what
    )
