"""Problems of models/problems and their results: errors of quantities, and levels.

A problem is a question of the protocol with its answer, each value with an error bar;
docs/benchmark.md has the format.
"""

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fourbar.errors import FAILED, HOLDS, InputError
from fourbar.quantities import PIN_FORCES, Array
from fourbar.solution import Solution
from fourbar.solving import solve
from fourbar.writing import read_text
from fourbar_validation.compare.rows import escape_controls, write_one_line
from fourbar_validation.compare.tolerance import (
    EPS,
    K,
    compute_difference,
    magnitude,
)
from fourbar_validation.engines import protocol

PROBLEM_SCHEMA = "fourbar-problem/4"
RESULT = "fourbar-result/1"
LEVELS = {"A": 1e-9, "B": 1e-6, "C": 1e-3}
"""Largest error of each level, over the largest value; D is worse. Error bars of the
problem are allowed.
"""
WORSE = "D"
MISSING = "-"
_GROUPS = {
    **dict.fromkeys((*PIN_FORCES, "guide_force"), "reactions"),
    "torque": "torque",
    "drive_force": "torque",
    "frequency": "frequency",
}
"""Group of each quantity; every quantity that is not listed belongs to the motion."""
SAFE = 8.0
"""Factor on the error bars of the formulas, which are estimates. Against many digits an
answer is up to 6.6 of them off.
"""
LARGEST_PROBLEM_FILE = 10**7
"""Bytes."""


class JudgedQuantity(NamedTuple):
    """One quantity of a result, where it is worst or first has no answer."""

    quantity: str
    group: str
    level: str
    error: float
    """Error relative to the largest value, for an angle in rad. NaN if there is no
    answer.
    """
    position: int


def read_problem(path: str | Path) -> dict[str, Any]:
    """Read a problem; InputError names what is wrong."""
    names = "answers", "errors", "scene", "command"
    objects = dict.fromkeys(names, "must be an object")
    problem = _read_document(path, PROBLEM_SCHEMA, objects)
    return {**problem, "problem": Path(path).stem}


def read_result(path: str | Path, problem: dict[str, Any]) -> dict[str, Any]:
    """Read somebody's answers to a problem; InputError names what is wrong."""
    objects = {"answers": "must be an object: a list for each quantity"}
    answered = _read_document(path, RESULT, objects)
    named = answered.get("problem")
    if named != problem["problem"]:
        allowed = f"must be {problem['problem']!r}"
        raise InputError("problem", named, allowed, str(path))
    return answered


def _read_document(
    path: str | Path, schema: str, objects: dict[str, str]
) -> dict[str, Any]:
    """Read an object of a schema, with what is said of entries that are no objects."""
    text = read_text(path, "JSON file", LARGEST_PROBLEM_FILE)
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        wrong = f"cannot be read: {write_one_line(str(error))}"
        raise InputError("JSON", None, wrong, str(path)) from None
    stated = data.get("schema") if isinstance(data, dict) else None
    if stated != schema:
        raise InputError("schema", stated, f"must be {schema!r}", str(path))
    for name, allowed in objects.items():
        if not isinstance(data.get(name), dict):
            raise InputError(name, data.get(name), allowed, str(path))
    return dict(data)


def judge_answers(
    problem: dict[str, Any],
    answered: dict[str, Any],
) -> list[JudgedQuantity]:
    """Judge every quantity that a problem asks for.

    One that is missing has the level "-".
    """
    answers = problem["answers"]
    errors = problem["errors"]
    if answered.get("at") is not None:
        answers, errors = _answer_at(problem, answered["at"])
    theirs = answered["answers"]
    return [
        _judge_quantity(name, answers[name], errors[name], theirs.get(name))
        for name in answers
    ]


def _answer_at(
    problem: dict[str, Any], motion: Any
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Evaluate the reference at the motion that an engine really made."""
    if problem["mechanism"] != "four-bar" or problem["ask"] != "answer":
        raise InputError(
            "at",
            None,
            "is judged of a four-bar's positions alone: answer at the command",
        )
    scene = protocol.scene_from_json(problem["scene"])
    scene, command = protocol.command_from_json(scene, problem["command"])
    made = protocol.read_answered_motion(motion, command)
    return collect_answers(solve(scene, "error", at=made))


def collect_answers(solution: Solution) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return angles, torque or force of the drive, and pin forces; and error bars.

    Both are arrays by the quantity's name.
    """
    drive = "torque" if solution.drive_force is None else "drive_force"
    angle = K * EPS / solution.condition
    bars = {
        "theta_3": angle,
        "theta_4": angle,
        drive: SAFE * getattr(solution, f"{drive}_error"),
    }
    bars |= dict.fromkeys(PIN_FORCES, SAFE * solution.force_error)
    return {name: getattr(solution, name) for name in bars}, bars


def _judge_quantity(
    name: str,
    values: Any,
    errors: Any,
    theirs: Any,
) -> JudgedQuantity:
    group = _GROUPS.get(name, "motion")
    ours = np.atleast_1d(np.array(values, dtype=float))
    entries = theirs if isinstance(theirs, list) else [theirs]
    answered = np.full_like(ours, np.nan)
    for index, entry in enumerate(entries[: len(ours)]):
        with suppress(TypeError, ValueError, OverflowError):
            answered[index] = np.reshape(entry, ours.shape[1:])
    lacking = [*~np.isfinite(magnitude(answered)), len(entries) > len(ours)]
    if any(lacking):
        return JudgedQuantity(name, group, MISSING, math.nan, lacking.index(True))
    size = 1.0
    if not name.startswith("theta"):
        size = float(magnitude(ours).max()) or 1.0
    off = compute_difference(name, ours, answered) / size
    bars = np.atleast_1d(np.array(errors, dtype=float)) / size
    level = WORSE
    for worse, most in reversed(LEVELS.items()):
        if (off <= np.maximum(most, bars)).all():
            level = worse
    worst = int(np.argmax(off))
    return JudgedQuantity(name, group, level, float(off[worst]), worst)


def find_levels(rows: list[JudgedQuantity]) -> dict[str, str]:
    """Return the worst level of each group of quantities that a problem asks for."""
    order = (*LEVELS, WORSE, MISSING)
    groups = dict.fromkeys(row.group for row in rows)
    return {
        group: max((row.level for row in rows if row.group == group), key=order.index)
        for group in groups
    }


def check_problem(problem_file: Path, result_file: Path) -> int:
    """Print how far each quantity of a result is off, and its level.

    Return the exit status.
    """
    from rich.console import Console
    from rich.markup import escape

    from fourbar_validation.report.sentences import make_words_table, print_sentence

    problem = read_problem(problem_file)
    answered = read_result(result_file, problem)
    rows = judge_answers(problem, answered)
    console = Console(soft_wrap=True)
    engine = escape(escape_controls(str(answered.get("engine", "")))) or "a result"
    cells = [
        (
            row.quantity,
            "no answer" if row.level == MISSING else f"{row.error:.1e}",
            str(row.position),
            row.level,
        )
        for row in rows
    ]
    title = f"{engine}: {problem['problem']}"
    console.print(
        make_words_table(
            ("quantity", "error", "position", "level"),
            cells,
            title=title,
            show_edge=False,
        )
    )
    levels = find_levels(rows)
    listed = ", ".join(f"{group} {level}" for group, level in levels.items())
    print_sentence(f"levels: {listed}")
    limits = ", ".join(f"{level} {most:g}" for level, most in LEVELS.items())
    print_sentence(
        f"of the largest value, angles in rad: {limits}, D worse; - no answer"
    )
    if levels and not set(levels.values()) & {WORSE, MISSING}:
        return HOLDS
    return FAILED
