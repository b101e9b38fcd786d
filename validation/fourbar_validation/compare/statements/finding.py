"""What one statement comes to, and what all of them share: the formulas' words, and the answers to one question."""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import NamedTuple, TypeVar

import numpy as np

from fourbar.errors import LimitError
from fourbar.linkage import FourBar, uniform
from fourbar.scene import Command, Scene
from fourbar.scene.motion import Motion
from fourbar_validation.compare.answer import Answer, Engine
from fourbar_validation.compare.compare import turned
from fourbar_validation.compare.error import used
from fourbar_validation.compare.rows import AGREES, FAILS, Row
from fourbar_validation.compare.tolerance import EQUIVALENCE, Array

TURN = 2.0 * math.pi
T = TypeVar("T")
A = TypeVar("A", float, Array)
Place = tuple[float, int]
"""theta_2 (rad) and branch."""


class Finding(NamedTuple):
    """How far a statement is from what the engine says (rad, or a number of wrong answers), and how far it may be."""

    error: float
    allowed: float
    theta_2: float
    what: str


def worst(name: str, answer: Answer, quantity: str, findings: Iterable[Finding]) -> Row:
    """Make the row of a quantity of the finding that exceeds what it is allowed by most."""
    each = list(findings)
    found = each[int(np.argmax(used(np.array([one.error for one in each]), np.array([one.allowed for one in each]))))]
    holds = found.error <= found.allowed
    error, allowed, theta_2 = (float(number) for number in found[:3])
    verdict, condition = AGREES if holds else FAILS, float(EQUIVALENCE.factor / max(found.allowed, EQUIVALENCE.factor))
    who = (name, answer.engine, answer.setting)
    return Row(*who, quantity, error, allowed, verdict, found.what, theta_2, condition)


class Stated:
    """What the formulas state of a linkage: each of them is evaluated once, for all engines."""

    def __init__(self, linkage: FourBar) -> None:
        self.linkage = linkage
        self._value = cache(lambda formula, *of: formula(linkage, *of))

    def __call__(self, formula: Callable[..., T], *of: int) -> T:
        """Evaluate a formula of the linkage, and of a bar where it is of one."""
        value: T = self._value(formula, *of)
        return value


class Seen:
    """What an engine finds at some places where bar 2 turns at 1 rad/s; the bars are uniform: masses play no part."""

    def __init__(self, engine: Engine, linkage: FourBar, places: Iterable[Place]) -> None:
        # neighbours in turn: an engine starts from the position before
        self._index = {place: i for i, place in enumerate(sorted(set(places), key=lambda each: each[::-1]))}
        if not self._index:
            return
        bars = uniform(*linkage.lengths)
        scene = Scene(
            FourBar(bars.ground, bars.input, bars.coupler, bars.output, linkage.ground_angle), Motion(0.0, 1.0)
        )
        theta_2, branch = (np.array(column) for column in zip(*self._index, strict=True))
        self._found = given(engine, scene, Command(theta_2, branch.astype(np.int8), 1.0, 0.0)).quantities

    def at(self, place: Place, quantity: str) -> float:
        """Give a quantity at one of the places."""
        return float(self._found[quantity][self._index[place]])


def given(engine: Engine, scene: Scene, at: Command) -> Answer:
    """Give an engine's answer; LimitError where it refuses those positions."""
    answer = engine.answer(scene, at)
    if answer.refusal is not None:
        raise LimitError(answer.refusal)
    return answer


def wrapped(angle: A) -> A:
    """Wrap into [-pi, pi)."""
    return (angle + math.pi) % TURN - math.pi


def same(what: str, stated: Sequence[float], found: Sequence[float], linkage: FourBar) -> Finding:
    """Compare lists of angles, modulo 2 pi in any order: the largest distance of one from the nearest of the other."""
    if not stated or not found:
        return Finding(0.0 if len(stated) == len(found) else math.inf, 0.0, 0.0, what)
    apart = np.abs(wrapped(np.subtract.outer(np.array(stated), np.array(found))))
    error = float(max(apart.min(axis=0).max(), apart.min(axis=1).max()))
    return Finding(error, EQUIVALENCE.factor * turned(linkage.ground_angle, np.array(stated)), stated[0], what)


def roundoff(linkage: FourBar) -> float:
    """Compute what two derivations of an angle may differ by, rad: it is one against the ground's."""
    return EQUIVALENCE.factor * turned(linkage.ground_angle)
