"""One scene through every check.

It gives its rows, its timings, and what was left out and why.
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
from fourbar_validation.engines.guests import list_numbers
from fourbar_validation.engines.registry import ENGINES, Engine
from fourbar_validation.report.record import Record
from fourbar_validation.report.svg import STYLE_NUMBERS
from fourbar_validation.report.thumbnail import draw_thumbnail
from fourbar_validation.run.answers import (
    check_mjcf,
    compare_answers,
    compare_inertia,
    compare_statements,
)
from fourbar_validation.run.derived.cuts import internal_forces
from fourbar_validation.run.derived.equilibria import equilibria
from fourbar_validation.run.derived.files import sdf, usd
from fourbar_validation.run.derived.sensitivities import sensitivity, study, tolerances
from fourbar_validation.run.derived.summary import summary
from fourbar_validation.run.identities import check_identities, check_status
from fourbar_validation.run.printed import (
    check_blocks,
    check_error_bars,
    check_law,
    check_points,
    check_residual,
)
from fourbar_validation.run.question import Question, select_positions
from fourbar_validation.run.released import check_released
from fourbar_validation.run.transformed import check_transformed


class Check(NamedTuple):
    """A check, and when it is made."""

    make_rows: Callable[[Question], Iterable[Row]]
    derived: bool = False
    """True if it checks a function of fourbar other than `solve`. The function's name
    is then the engine of its rows.
    """
    free: bool = False
    """True if it checks a free motion, False for a prescribed one."""
    what: str = ""
    """Words for what is checked, where it may be left out."""
    needs_theta_2: str = ""
    """Reason to leave it out where theta_2 is not commanded; empty for any command."""

    def is_due(self, *, free: bool, derived: bool) -> bool:
        """Return whether it is made of a free or a prescribed motion.

        `derived`: whether the checks of functions other than `solve` are made.
        """
        return self.free == free and (derived or not self.derived)

    @property
    def engine(self) -> str:
        """Engine of its rows: the function that it checks, or the formulas."""
        return self.make_rows.__name__ if self.derived else FORMULAS


CHECKS = (
    Check(check_identities),
    Check(check_status),
    Check(check_points),
    Check(check_law),
    Check(check_blocks),
    Check(
        check_error_bars,
        what="error bars",
        needs_theta_2=(
            "balls are asked at theta_2, and `stability --bar` at the other bars"
        ),
    ),
    Check(check_residual),
    Check(check_transformed),
    Check(
        Question.find_reversals,
        what="reversals of dry friction",
        needs_theta_2="they are drawn over theta_2",
    ),
    Check(compare_answers),
    Check(
        compare_statements,
        what="statements of the linkage",
        needs_theta_2="engines are led to its limits by theta_2",
    ),
    Check(check_mjcf, what="MJCF as shipped", needs_theta_2="it drives bar 2"),
    Check(compare_inertia),
    Check(
        check_released,
        free=True,
        what="released motions",
        needs_theta_2="engines begin at theta_2",
    ),
    *(
        Check(rows, derived=True)
        for rows in (
            study,
            sensitivity,
            internal_forces,
            summary,
            tolerances,
            equilibria,
        )
    ),
    *(
        Check(
            rows,
            derived=True,
            what=rows.__name__,
            needs_theta_2="the file opens at theta_2",
        )
        for rows in (sdf, usd)
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
    sketch: bool = False,
    derived: bool = False,
) -> Record:
    """Judge a scene and keep what the report needs of it.

    `draw`: with its pictures and observed orders. `sketch`: with its small picture.
    `derived`: with checks of functions other than `solve`.
    """
    record = judge(name, scene, engines, order=draw, derived=derived)
    for i, row in enumerate(record.rows):
        if row.engine in record.output and row.failed:
            record.rows[i] = replace(
                row,
                reason=f"{row.reason}; what it printed: {OUTPUT}",
            )
    figure = thumbnail = None
    STYLE_NUMBERS.update(list_numbers(engines))
    if draw:
        from fourbar_validation.report.figures import draw_scene_figure

        figure = draw_scene_figure(record)
    if draw or sketch:
        thumbnail = draw_thumbnail(record)
    return record.kept(figure, thumbnail)


def judge(
    name: str,
    scene: Scene,
    engines: Sequence[Engine] = ENGINES,
    *,
    order: bool = True,
    derived: bool = False,
) -> Record:
    """Make every check of one scene.

    `order`: measure the observed order of what is simulated, which takes two more
    simulations and changes no row. `derived`: make the derived checks of `CHECKS`
    too, those of functions other than `solve`, which takes a second.
    """
    question = make_question(name, scene, engines)
    free = scene.motion.free is not None
    question.order = order
    begin = time.perf_counter()
    question.solution  # noqa: B018 - timed
    seconds = time.perf_counter() - begin
    if (
        derived
        and not free
        and (
            question.at.speed is None
            or question.free_body is None
            or question.free_body.refusal
        )
    ):
        reason = (
            "they are checked against the free bodies, which have no forces for this"
            " scene"
        )
        question.leave_out("functions other than solve", reason)
        derived = False
    rows: list[Row] = []
    for check in CHECKS:
        if not check.is_due(free=free, derived=derived):
            continue
        if check.needs_theta_2 and question.at.commanded != "theta_2":
            reason = f"{check.needs_theta_2}; {question.at.commanded} is commanded"
            question.leave_out(check.what, reason)
            continue
        setting = "" if check.derived else check.make_rows.__name__
        make_rows = partial(check.make_rows, question)
        rows += question.attempt(make_rows, check.engine, setting)
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
    numbers = (
        command.angle,
        command.branch,
        0.0 if command.speed is None else command.speed,
        command.acceleration,
    )
    if len(command.angle) > 1 and all(
        np.ptp(values) == 0 for values in numbers
    ):  # a sweep of equal positions
        question.leave_out("positions", "all are the same, one is evaluated")
        question.at = select_positions(command, np.array([0]))._replace(time=None)
    question.engines = list(_select_needed(engines, question))
    return question


def _select_needed(engines: Iterable[Engine], question: Question) -> Iterator[Engine]:
    """Select the engines that the question needs.

    The others are left out before they are imported.
    """
    command = question.at
    for engine in engines:
        reason = None
        if command.speed is None:
            if engine.positions:
                reason = None
            else:
                reason = (
                    "the scene states positions only, and this engine computes only"
                    " forces"
                )
        elif engine.through_time and not np.any(command.speed):
            reason = "the commanded speed is 0: nothing moves through time"
        elif engine.through_time and len(command.angle) == 1:
            reason = "a simulation needs more than one position"
        if reason is None:
            yield (
                engine
                if command.speed is not None
                else replace(engine, answers=engine.positions)
            )
        else:
            question.leave_out(engine.name, reason)
