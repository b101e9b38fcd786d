"""A scene in question: its positions, and what each engine answers.

The answer of the formulas is among them; all are computed once.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np

from fourbar.quantities import Array, Indices
from fourbar.scene import Command, Scene
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar_validation.compare.answer import Answer, explain_refusal
from fourbar_validation.compare.reversals import mark_reversing
from fourbar_validation.compare.rows import (
    FORMULAS,
    Row,
    escape_controls,
    make_breakdown,
)
from fourbar_validation.compare.scales import Scale, make_reference
from fourbar_validation.compare.tolerance import Mask
from fourbar_validation.engines.free_body import FreeBody
from fourbar_validation.engines.guests import list_needs
from fourbar_validation.engines.programs import keep_printed
from fourbar_validation.engines.registry import ENGINES, Engine, ask_at
from fourbar_validation.report.scene_record import Record, Timing

FREE_BODY = next(engine for engine in ENGINES if engine.name == FreeBody.name)
"""The free-body solution supplies a second set of condition numbers and sizes. The
stricter of both sets counts, so that a mistake of the formulas alone cannot widen an
allowed error.
"""


class NotAskedError(Exception):
    """A scene has nothing that a check could compare; the message says why."""


@dataclass(eq=False)
class Question:
    """A scene at the positions of a command, and every answer to it.

    What several checks need is computed once, when the first of them reads it.

    >>> from fourbar import Motion, Sweep, command, uniform
    >>> motion = Motion(theta_2=Sweep(0.0, 1.0, 10), omega_2=10.0)
    >>> scene = Scene(uniform(0.3, 0.1, 0.25, 0.22, per_metre=2.0), motion)
    >>> question = Question("mine", scene, command(scene), [FREE_BODY])
    >>> answer = question.answer(FREE_BODY)
    >>> difference = answer.quantities["torque"] - question.solution.torque
    >>> bool(abs(difference).max() < 1e-12 * abs(question.solution.torque).max())
    True
    """

    name: str
    scene: Scene
    at: Command
    engines: Sequence[Engine] = ()
    """Engines that are to answer."""
    output: dict[str, str] = field(default_factory=dict)
    """Text that each engine printed."""
    left_out: list[str] = field(default_factory=list)
    """Comparisons left out, each with the reason."""
    causes: dict[str, list[str]] = field(default_factory=dict)
    """Known mistakes that explain what differs, by engine."""
    against: dict[str, list[str]] = field(default_factory=dict)
    """Quantities in which engines agree with each other against the formulas."""
    failing: dict[str, set[str]] = field(default_factory=dict)
    """What fails in the answer of each engine."""
    timings: list[Timing] = field(default_factory=list)
    answered: dict[str, tuple[Answer, float]] = field(default_factory=dict)
    """Answer of each engine, by its name, and the seconds that it took."""
    scales: dict[str, tuple[Scale, Array]] = field(default_factory=dict)
    """Size and condition of each quantity that was compared."""

    @cached_property
    def solution(self) -> Solution:
        """Return the answer of the formulas, as far as anything is compared.

        Error bars take ten times as long as all the rest.
        """
        if self.scene.motion.free is not None:
            return solve(self.scene)
        stage = "position" if self.at.speed is None else "force"
        return solve(self.scene, stage, at=self.at)

    @cached_property
    def free_body(self) -> Answer | None:
        """Return the answer of the free bodies, or None if they break down.

        A row of their own fails then.
        """
        try:
            with np.errstate(all="ignore"):
                return self.answer(FREE_BODY)
        except Exception:  # a failure as of any engine
            return None

    @cached_property
    def reference(self) -> Solution | None:
        """Return the free bodies' solution, for a second set of conditions and sizes.

        A comparison takes the stricter of these and those of the formulas. None if the
        free bodies break down; the answer that is judged then supplies the second set.
        """
        try:
            with np.errstate(all="ignore"):
                if self.free_body is None:
                    return None
                return make_reference(self.scene, self.free_body)
        except ArithmeticError:
            return None

    def leave_out(self, what: str, reason: object) -> None:
        """Note that something was left out, and why."""
        self.left_out.append(f"{what}: {reason}")

    def answer(self, engine: Engine) -> Answer:
        """Ask an engine, once."""
        if engine.name not in self.answered:
            with keep_printed(self.output, engine.name):
                adapter = engine.start()
                begin = time.perf_counter()
                if refusal := explain_refusal(adapter, self.at):
                    answer = Answer(engine.name, "exact", refusal=refusal)
                else:
                    answer = ask_at(adapter, self.scene, self.at)
                self.answered[engine.name] = answer, time.perf_counter() - begin
        return self.answered[engine.name][0]

    def reversing(self, slip: float) -> Mask:
        """Mark where dry friction reverses.

        A pin slips there by no more than this part of its speeds.
        """
        return mark_reversing(self.scene, self.solution, slip)

    def row(
        self,
        quantity: str,
        error: Array,
        allowed: float,
        reason: str,
        where: Mask | None = None,
        condition: float = 1.0,
        theta_2: Array | None = None,
    ) -> Row:
        """Make a row of the formulas where the error is worst; NaN is beyond all.

        `where`: positions that are held to it; none of them: undecided.
        `theta_2`: of the errors; left out: of the command.
        """
        place = self.at.angle if theta_2 is None else theta_2
        who = (self.name, FORMULAS, "exact")
        further = (place, condition, where)
        return Row.judged(who, quantity, error, allowed, reason, *further)

    def list_answers(self) -> list[tuple[Answer, float]]:
        """Return the answers in the order of the engines, each with its seconds."""
        names = [engine.name for engine in self.engines]
        return [self.answered[name] for name in names if name in self.answered]

    def record(self, rows: list[Row], seconds: float) -> Record:
        """Make the record of the scene; `seconds`: that the formulas took."""
        answered = self.list_answers()
        n = len(self.at.angle)
        ours = Timing(self.name, FORMULAS, "exact", len(self.solution), seconds)
        timings = [ours, *self.timings]
        timings += [
            Timing(self.name, answer.engine, answer.setting, n, took)
            for answer, took in answered
        ]
        return Record(
            self.name,
            escape_controls(self.scene.title),
            escape_controls(self.scene.source),
            list_needs(self.scene),
            rows,
            timings,
            self.left_out,
            {one.engine: [one.shared, one.own] for one, _ in answered if one.own},
            {one.engine: one.evidence for one, _ in answered if one.evidence},
            self.output,
            self.causes,
            self.against,
        )

    def attempt(
        self,
        check: Callable[[], Iterable[Row]],
        engine: str,
        setting: str = "",
    ) -> Iterator[Row]:
        """Yield the rows of a check.

        What it raises is a failure of its own, in a row of its own.

        `engine`, `setting`: of that row; the latter names the check.
        """
        try:
            yield from check()
        except NotAskedError as reason:
            self.leave_out(engine, reason)
        except Exception as error:
            yield make_breakdown(self.name, engine, error, setting)


def spread_evenly(indices: Indices, count: int) -> Indices:
    """Choose some of many positions evenly, with both ends."""
    places = np.linspace(0, len(indices) - 1, count)
    return np.asarray(indices[np.unique(places.astype(int))])


def select_positions(command: Command, indices: Indices) -> Command:
    """Take some positions of a command."""
    return command.part(indices).as_doubles()


def take_member(study: Solution, index: int | Indices) -> Solution:
    """Take one linkage of a solved study, or some positions of one linkage."""

    def take(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: take(values) for name, values in value.items()}
        return value[index] if isinstance(value, np.ndarray) else value

    taken = {one.name: take(getattr(study, one.name)) for one in fields(study)}
    return Solution(**taken | {"at": study.at.part(index)})
