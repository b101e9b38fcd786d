"""`problems`: the problems with their answers, as JSON that needs nothing of ours."""

import json
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import click
import numpy as np

import fourbar
from fourbar.quantities import PIN_FORCES, UNITS, Array
from fourbar.scene import command as list_positions
from fourbar.scene import with_signs
from fourbar.solution import Solution
from fourbar.writing import write_text
from fourbar_lab.simulators import slider_crank
from fourbar_validation.check.problem import PROBLEM_SCHEMA, SAFE, collect_answers
from fourbar_validation.engines import protocol
from fourbar_validation.places import MODELS, find_checkout

PROBLEMS = MODELS / "problems"
FOUR_BAR_CONVENTIONS = (
    "SI units, radians, world axes x and y, angles counter-clockwise from x. Pins: O2"
    " at the origin, A, B, O4; bars: 1 ground O2-O4, 2 input O2-A, 3 coupler A-B, 4"
    " output O4-B; theta_3 points from A to B, theta_4 from O4 to B. Pairs are [size,"
    " angle]; centre: from the bar's first pin (O2, A, O4) and line, mid-bar if left"
    " out; inertia: about the mass centre, m L^2/12 if left out. Fij: force of bar i on"
    " bar j. torque: the couple that the ground exerts on bar 2; drive_force: of a"
    " drive along a line, positive where it pushes its ends apart. branch 1: B left of"
    " the line from A to O4, -1: right; through a change point a released motion keeps"
    " its smooth path (follow) or its branch (sign). error: how far off the value may"
    " be, besides the rounding of its last digit; of a vector, its Euclidean norm. The"
    " rest is the protocol's: docs/protocol.md."
)
_ARCHIVE = "fourbar-problems-1.0"
PROMISED = 1e-9
"""Error of a released motion in 5 s, rad: a thousand times what test_free_motion.py
allows its rates; beyond them it is in proportion.
"""
_PROMISED_FOR = 5.0
"""s."""


def collect_problem(name: str) -> dict[str, Any]:
    """Return a problem as JSON: the question, the answers and their error bars."""
    if name in slider_crank.SLIDER_CRANKS:
        return {"schema": PROBLEM_SCHEMA, **slider_crank.make_problem(name)}
    scene = fourbar.load(PROBLEMS / f"{name}.toml")
    solution = fourbar.solve(scene, "error")
    if scene.motion.free is None:
        ask = "answer"
        commanded = with_signs(scene.linkage, list_positions(scene))
        asked = {"command": protocol.command_to_json(scene, commanded)}
        answers, errors = collect_answers(solution)
    else:
        ask = "release"
        asked = protocol.release_to_json(scene)
        answers, errors = _answer_released(solution)
    return {
        "schema": PROBLEM_SCHEMA,
        "title": scene.title,
        "source": scene.source,
        "conventions": FOUR_BAR_CONVENTIONS,
        "mechanism": "four-bar",
        "ask": ask,
        "scene": protocol.scene_to_json(scene),
        **asked,
        "answers": _list_values(answers),
        "errors": _list_values(errors),
        "units": {quantity: UNITS.get(quantity, "Hz") for quantity in answers},
    }


def _list_values(answers: dict[str, Any]) -> dict[str, Any]:
    return {name: np.asarray(values).tolist() for name, values in answers.items()}


def list_problems() -> list[str]:
    """List the names of all problems, in order."""
    return sorted(
        [file.stem for file in PROBLEMS.glob("*.toml")]
        + list(slider_crank.SLIDER_CRANKS)
    )


def _answer_released(solution: Solution) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the answers of a released motion, and the error bar of each.

    All errors follow from an error in time: angle, speed and forces change by their
    rates times that delay.
    """
    time = solution.time
    omega = solution.omega_2
    alpha = solution.alpha_2
    angle = PROMISED * max(1.0, float(time[-1] - time[0]) / _PROMISED_FOR)
    late = angle / float(np.abs(omega).max())
    n = len(time)
    answers: dict[str, Any] = {
        name: getattr(solution, name) for name in ("theta_2", "omega_2", *PIN_FORCES)
    }
    errors: dict[str, Any] = {
        "theta_2": np.full(n, angle),
        "omega_2": np.full(n, late * float(np.abs(alpha).max())),
    }
    for name in PIN_FORCES:
        rate = float(np.hypot(*np.gradient(answers[name], time, axis=0).T).max())
        errors[name] = SAFE * solution.force_error + rate * late
    period = _measure_period(time, solution.theta_2, omega, alpha)
    if period is not None:
        answers["frequency"] = 1.0 / period
        errors["frequency"] = 2.0 * late / period**2
    return answers, errors


def _measure_period(
    time: Array,
    theta: Array,
    omega: Array,
    alpha: Array,
) -> float | None:
    """Return the period between upward passages through mid-swing, s, or None."""
    from scipy.interpolate import BPoly
    from scipy.optimize import brentq

    level = 0.5 * (theta.max() + theta.min())
    passed = np.flatnonzero((theta[:-1] < level) & (theta[1:] >= level))
    if len(passed) < 2:
        return None
    curve = BPoly.from_derivatives(time, np.column_stack([theta - level, omega, alpha]))
    first, last = (
        brentq(curve, *time[i : i + 2], xtol=1e-300) for i in passed[[0, -1]]
    )
    return float(last - first) / (len(passed) - 1)


@click.command()
@click.option(
    "--archive",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Pack the set into this file instead.",
)
def problems_command(archive: Path | None) -> None:
    """Write the problems of models/problems and their answers as JSON."""
    checkout = find_checkout("problems")
    if archive is not None:
        _write_archive(checkout, archive)
        click.echo(f"wrote {archive}")
        return
    for name in list_problems():
        file = PROBLEMS / f"{name}.json"
        write_text(file, write_problem(collect_problem(name)))
        click.echo(f"wrote {name}.json")


def _write_archive(checkout: Path, archive: Path) -> None:
    """Pack the problems with their page, figures, schema, licence and citation.

    The bytes are the same each time.
    """
    others = (
        "docs/benchmark.md",
        "docs/protocol.md",
        "docs/protocol.schema.json",
        "LICENSE",
        "CITATION.cff",
    )
    files = sorted(PROBLEMS.iterdir()) + [checkout / name for name in others]
    files += sorted((checkout / "docs" / "benchmark").glob("*.svg"))
    with ZipFile(archive, "w", ZIP_DEFLATED) as packed:
        for file in files:
            name = f"{_ARCHIVE}/{file.relative_to(checkout)}"
            entry = ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.compress_type = ZIP_DEFLATED
            packed.writestr(entry, file.read_bytes())


def write_problem(problem: dict[str, Any]) -> str:
    """Write JSON, each quantity on a line."""
    lines = []
    for key, value in problem.items():
        if key in ("answers", "errors"):
            rows = ",\n".join(
                f"  {json.dumps(name)}: {json.dumps(entry)}"
                for name, entry in value.items()
            )
            lines.append(f" {json.dumps(key)}: {{\n{rows}\n }}")
        else:
            lines.append(f" {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"
