"""Check one scene in every way.

Results are its rows, its timings, and what was left out and why.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fourbar.scene import Scene
from fourbar.scene import command as command_of
from fourbar_validation.compare.rows import FORMULAS, Row
from fourbar_validation.engines.guests import number_guests
from fourbar_validation.engines.registry import ENGINES, Engine
from fourbar_validation.report.scene_pictures import draw_scene_figure
from fourbar_validation.report.scene_record import Record
from fourbar_validation.report.svg import STYLE_NUMBERS
from fourbar_validation.run.identities import check_identities, check_status
from fourbar_validation.run.judge_engines import (
    compare_answers,
    compare_inertia,
    compare_shipped_mjcf,
)
from fourbar_validation.run.law import check_law
from fourbar_validation.run.question import Question, select_positions
from fourbar_validation.run.released import check_released
from fourbar_validation.run.transformed import check_transformed


class Check(NamedTuple):
    """A check: what makes its rows, whether they count, and when it is left out.

    The list `CHECKS` is the only place that names a check.

    >>> from fourbar import Motion, Scene, Sweep, uniform
    >>> motion = Motion(theta_2=Sweep(0.0, 1.0, 10), omega_2=10.0)
    >>> scene = Scene(uniform(0.3, 0.1, 0.25, 0.22, per_metre=2.0), motion)
    >>> def check_power(question):
    ...     solution = question.solution
    ...     error = solution.power - solution.torque * solution.omega_2
    ...     scale = abs(solution.power).max()
    ...     yield question.row("power = T omega", error / scale, 1e-15, "one product")
    >>> question = make_question("mine", scene, ())
    >>> [row.verdict for row in Check(check_power).rows(question)]
    ['agrees']
    """

    make_rows: Callable[[Question], Iterable[Row]]
    compares: bool = False
    """True if its rows compare an answer of an engine. Rows of the other checks are the
    formulas' own and never count as comparisons, whatever engine they name.
    """
    free: bool = False
    """True if it checks a free motion, False for a prescribed one."""
    what: str = ""
    """Words for what is checked, where it may be left out."""
    needs_theta_2: str = ""
    """Reason to leave it out where theta_2 is not commanded; empty for any command."""

    def left_out(self, question: Question) -> str:
        """Say why it is left out of a scene; empty if it is made."""
        if self.needs_theta_2 and question.at.commanded != "theta_2":
            return f"{self.needs_theta_2}; {question.at.commanded} is commanded"
        return ""

    def rows(self, question: Question) -> Iterator[Row]:
        """Make its rows; what it raises is a row that fails."""
        make_rows = partial(self.make_rows, question)
        for row in question.attempt(make_rows, FORMULAS, self.make_rows.__name__):
            yield row if self.compares else replace(row, engine=FORMULAS)


CHECKS = (
    Check(check_identities),
    Check(check_status),
    Check(check_law),
    Check(check_transformed),
    Check(compare_answers, compares=True),
    Check(
        compare_shipped_mjcf,
        compares=True,
        what="MJCF as shipped",
        needs_theta_2="it drives bar 2",
    ),
    Check(compare_inertia, compares=True),
    Check(
        check_released,
        compares=True,
        free=True,
        what="released motions",
        needs_theta_2="engines begin at theta_2",
    ),
)
"""All checks of a scene. An exception in a check fails its own rows only."""
OUTPUT = "output.txt"
"""File in the folder of a run with what the engines printed."""


def judge_for_report(
    name: str,
    scene: Scene,
    engines: Sequence[Engine] = ENGINES,
    *,
    draw: bool = True,
) -> Record:
    """Judge a scene and keep what the report needs of it.

    `draw`: with its pictures.
    """
    question = make_question(name, scene, engines)
    record = _judge(question)
    for i, row in enumerate(record.rows):
        if row.engine in record.output and row.failed:
            record.rows[i] = replace(
                row,
                reason=f"{row.reason}; what it printed: {OUTPUT}",
            )
    STYLE_NUMBERS.update(number_guests(engines))
    if draw:
        answers = [answer for answer, _ in question.list_answers()]
        record.figure = draw_scene_figure(record, scene, question.solution, answers)
    return record


def judge(name: str, scene: Scene, engines: Sequence[Engine] = ENGINES) -> Record:
    """Make every check of one scene."""
    return _judge(make_question(name, scene, engines))


def _judge(question: Question) -> Record:
    free = question.scene.motion.free is not None
    begin = time.perf_counter()
    question.solution  # noqa: B018 - timed
    seconds = time.perf_counter() - begin
    rows: list[Row] = []
    for check in CHECKS:
        if check.free != free:
            continue
        if reason := check.left_out(question):
            question.leave_out(check.what, reason)
            continue
        rows += check.rows(question)
    return question.record(rows, seconds)


def make_question(
    name: str,
    scene: Scene,
    engines: Sequence[Engine],
) -> Question:
    """Make the question of a scene: its positions and the engines that it needs.

    Of a sweep of equal positions one is asked. What is left out is listed. The engines
    are started when their answers are first read.
    """
    command = command_of(scene)
    if scene.motion.free is not None:
        return Question(name, scene, command, engines)
    question = Question(name, scene, command)
    speed = 0.0 if command.speed is None else command.speed
    numbers = (command.angle, command.branch, speed, command.acceleration)
    if len(command.angle) > 1 and not any(map(np.ptp, numbers)):
        question.leave_out("positions", "all are the same, one is evaluated")
        question.at = select_positions(command, np.array([0]))._replace(time=None)
    question.engines = list(_select_needed(engines, question))
    return question


def _select_needed(engines: Iterable[Engine], question: Question) -> Iterator[Engine]:
    """Select the engines that the question needs.

    The others are left out before they are imported.
    """
    command = question.at
    states_speed = command.speed is not None
    for engine in engines:
        reason = ""
        if not states_speed and not engine.positions:
            reason = (
                "the scene states positions only, and this engine computes only forces"
            )
        elif states_speed and engine.through_time:
            if not np.any(command.speed):
                reason = "the commanded speed is 0: nothing moves through time"
            elif len(command.angle) == 1:
                reason = "a simulation needs more than one position"
        if reason:
            question.leave_out(engine.name, reason)
        elif states_speed:
            yield engine
        else:
            yield replace(engine, answers=engine.positions)
