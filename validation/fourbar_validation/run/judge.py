"""One scene through every check: its rows, its timings, and what was left out and why."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fourbar.scene import Command, Scene
from fourbar.scene import command as command_of
from fourbar_validation.compare.rows import FORMULAS, Row
from fourbar_validation.engines.guests import list_numbers
from fourbar_validation.engines.registry import ENGINES, Engine
from fourbar_validation.report.record import Record
from fourbar_validation.report.svg import NUMBERS
from fourbar_validation.run.answers import check_mjcf, compare_answers, compare_inertia, compare_statements
from fourbar_validation.run.identities import check_identities, check_status
from fourbar_validation.run.printed import check_blocks, check_error_bars, check_law, check_points, check_residual
from fourbar_validation.run.question import Question, select_positions
from fourbar_validation.run.released import check_released
from fourbar_validation.run.shipped.bounds import extremes
from fourbar_validation.run.shipped.cuts import internal_forces
from fourbar_validation.run.shipped.equilibria import equilibria
from fourbar_validation.run.shipped.files import sdf, usd
from fourbar_validation.run.shipped.sensitivities import sensitivity, study, tolerances


class Check(NamedTuple):
    """A check, and when it is made."""

    rows: Callable[[Question], Iterable[Row]]
    shipped: bool = False
    """True if it checks something shipped besides `solve`: the engine of its rows, by its own name."""
    free: bool = False
    """True if it checks a free motion, False for a prescribed one."""
    theta_2: str = ""
    """Part of it that needs a command of theta_2, and is left out with another command."""


CHECKS = (
    Check(check_identities),
    Check(check_status),
    Check(check_points),
    Check(check_law),
    Check(check_blocks),
    Check(check_error_bars, theta_2="error bars: balls are asked at theta_2, and `stability --bar` at the other bars"),
    Check(check_residual),
    Check(Question.find_reversals, theta_2="reversals of dry friction: they are drawn over theta_2"),
    Check(compare_answers),
    Check(compare_statements, theta_2="statements of the linkage: engines are led to its limits by theta_2"),
    Check(check_mjcf, theta_2="MJCF as shipped: it drives bar 2"),
    Check(compare_inertia),
    Check(check_released, free=True, theta_2="released motions: engines begin at theta_2"),
    *(Check(rows, shipped=True) for rows in (study, sensitivity, internal_forces, extremes, tolerances, equilibria)),
    *(Check(rows, shipped=True, theta_2=f"{rows.__name__}: the file opens at theta_2") for rows in (sdf, usd)),
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
    shipped: bool = False,
) -> Record:
    """Judge a scene and keep what the report needs of it.

    `draw`: with its pictures and observed orders. `shipped`: with what else is shipped.
    """
    record = judge(name, scene, engines, order=draw, shipped=shipped)
    for i, row in enumerate(record.rows):
        if row.failed and row.engine in record.output:
            record.rows[i] = replace(row, reason=f"{row.reason}; what it printed: {OUTPUT}")
    figure = None
    if draw:
        from fourbar_validation.report.figures import draw_scene_figure

        NUMBERS.update(list_numbers(engines))
        figure = draw_scene_figure(record)
    return record.kept(figure)


def judge(
    name: str, scene: Scene, engines: Sequence[Engine] = ENGINES, *, order: bool = True, shipped: bool = False
) -> Record:
    """Make every check of one scene.

    `order`: measure the observed order of what is simulated, which takes two more simulations and changes no row.
    `shipped`: check what else is shipped (studies, sensitivities, files of other simulators), which takes a second.
    """
    question, free = ask(name, scene, engines), scene.motion.free is not None
    question.order = order
    begin = time.perf_counter()
    question.solution  # noqa: B018 - timed
    seconds = time.perf_counter() - begin
    if shipped and not free and (question.at.speed is None or question.free_body is None or question.free_body.refusal):
        what = "judged by what the free bodies say of forces, and here they say nothing"
        question.left_out.append(f"what else is shipped: {what}")
        shipped = False
    rows: list[Row] = []
    for check in CHECKS:
        if check.free == free and (shipped or not check.shipped):
            if check.theta_2 and question.at.commanded != "theta_2":
                question.left_out.append(f"{check.theta_2}; {question.at.commanded} is commanded")
                continue
            called = check.rows.__name__
            engine, part = (called, "") if check.shipped else (FORMULAS, called)
            rows += question.attempt(partial(check.rows, question), engine, part)
    return question.record(rows, seconds)


def ask(name: str, scene: Scene, engines: Sequence[Engine]) -> Question:
    """Put a scene to the engines that it needs, each position once; say what is left out."""
    command = command_of(scene)
    if scene.motion.free is not None:
        return Question(name, scene, command, engines)
    question = Question(name, scene, command)
    numbers = (command.angle, command.branch, 0.0 if command.speed is None else command.speed, command.acceleration)
    if len(command.angle) > 1 and all(np.ptp(values) == 0 for values in numbers):  # constant conditions are not swept
        question.left_out.append("positions: all are the same, one is evaluated")
        question.at = select_positions(command, np.array([0]))._replace(time=None)
    question.engines = list(_choose_called_for(engines, question.at, question.left_out))
    question.solve()  # untimed: the first call of a process pays for what every later one finds loaded
    return question


def _choose_called_for(engines: Iterable[Engine], command: Command, left_out: list[str]) -> Iterator[Engine]:
    """Choose the engines that the question needs; the others are left out before they are imported."""
    for engine in engines:
        reason = None
        if command.speed is None:
            reason = None if engine.positions else "the scene states positions only, and it gives forces"
        elif engine.through_time and not np.any(command.speed):
            reason = "omega_2 is 0: nothing moves through time"
        elif engine.through_time and len(command.angle) == 1:
            reason = "one position is no motion through time"
        if reason is None:
            yield engine if command.speed is not None else replace(engine, answers=engine.positions)
        else:
            left_out.append(f"{engine.name}: {reason}")
