"""`python -m validation write --problems`: the answers of models/problems as JSON for a simulator's own tests."""

import json
from pathlib import Path
from typing import Any

import click
import numpy as np

import fourbar
from fourbar.effects import Friction, Gravity, Springs, Viscous
from fourbar.effects.spring import Spring
from fourbar.errors import LimitError
from fourbar.linkage import BAR_NAMES, MOVING_BARS
from fourbar.quantities import PIN_FORCES, UNITS
from fourbar.scene import Scene
from fourbar.solution import Solution
from fourbar.writing import write_text
from fourbar_validation.compare.answer import Array
from fourbar_validation.compare.tolerance import EPS, K
from fourbar_validation.places import MODELS, find_checkout

PROBLEMS = MODELS / "problems"
SCHEMA = "fourbar-problem/1"
CONVENTIONS = (
    "SI units, radians, world axes x and y, angles counter-clockwise from x. Pins: O2 at the origin, A, B, O4; bars: 1 "
    "ground O2-O4, 2 input O2-A, 3 coupler A-B, 4 output O4-B; theta_3 points from A to B, theta_4 from O4 to B. "
    "centre: from the bar's first pin (O2, A, O4), along the bar and across it, to the left. Fij: force of bar i on "
    "bar j. torque: the couple that the ground exerts on bar 2. branch 1: B left of the line from A to O4, -1: right; "
    "through a change point a motion keeps its smooth path (follow) or its branch (sign). "
    "error: how far off the value may be, besides the rounding of its last digit; of a vector, its Euclidean norm."
)
DESCRIBED = (Gravity, Springs, Viscous, Friction)
"""Effects that `given` has a place for."""
PROMISED = 1e-9
"""rad in 5 s of a released motion, held by test_free_motion_reference.py; beyond them in proportion."""
PROMISED_FOR = 5.0
"""s."""


def collect_problem(file: Path) -> dict[str, Any]:
    """Collect what is given and what is to be answered, each with an error bar.

    Raises LimitError for a scene with loads or other effects: the description in numbers has no place for them.
    """
    scene = fourbar.load(file)
    if scene.loads or any(not isinstance(effect, DESCRIBED) for effect in scene.effects) or scene.drive_bar != 2:
        raise LimitError(f"{file.name}: a problem has weights, springs, dampers and friction alone and drives bar 2")
    found = fourbar.solve(scene, "error")
    answers = _answer_released(found) if scene.motion.free is not None else _answer_prescribed(found)
    named = {name: {"unit": UNITS.get(name, "Hz"), **answer} for name, answer in answers.items()}
    head = {"schema": SCHEMA, "title": scene.title, "source": scene.source, "scene": file.name}
    return {**head, "conventions": CONVENTIONS, "given": _collect_given(scene, found), "answers": named}


def _collect_given(scene: Scene, found: Solution) -> dict[str, Any]:
    linkage, motion = scene.linkage, scene.motion
    bars = {
        BAR_NAMES[number]: {
            "length": bar.length,
            "mass": bar.mass,
            "inertia": bar.moment_of_inertia,
            "centre": [float(bar.to_centre.real), float(bar.to_centre.imag)],
        }
        for number, bar in ((number, linkage.bar(number)) for number in MOVING_BARS)
    }
    fields = [effect.vector for effect in scene.effects if isinstance(effect, Gravity)]
    given = {"ground": linkage.ground, "ground_angle": linkage.ground_angle, "bars": bars, "branch": motion.branch}
    given["gravity"] = [float(x) for x in (fields[0] if fields else (0.0, 0.0))]
    for effect in scene.effects:
        if isinstance(effect, Viscous):
            given["viscous"] = dict(effect.coefficients)
        elif isinstance(effect, Friction):
            given["friction"] = dict(effect.torques)
        elif isinstance(effect, Springs):
            given["springs"] = [_collect_spring(spring) for spring in effect.springs]
    if motion.free is None:
        prescribed = {"theta_2": found.theta_2.tolist(), "omega_2": motion.omega_2, "alpha_2": motion.alpha_2}
        return {**given, "motion": "prescribed", **prescribed}
    assert found.time is not None
    begin = {"theta_2": motion.theta_2, "omega_2": motion.omega_2, "through": motion.through}
    return {**given, "motion": "released", "start": begin, "time": found.time.tolist()}


def _collect_spring(spring: Spring) -> dict[str, Any]:
    ends = []
    for end in (spring.start, spring.end):
        ends.append({"bar": end.bar, "at": [float(end.in_bar.real), float(end.in_bar.imag)]})
    size = {"stiffness": spring.stiffness, "length": spring.length, "preload": spring.preload}
    return {"from": ends[0], "to": ends[1], **size}


def _answer_prescribed(found: Solution) -> dict[str, Any]:
    assert found.torque_error is not None and found.force_error is not None
    angle = K * EPS / found.condition
    answers = {name: _answer(getattr(found, name), angle) for name in ("theta_3", "theta_4")}
    answers["torque"] = _answer(found.torque, found.torque_error)
    return answers | {name: _answer(getattr(found, name), found.force_error) for name in PIN_FORCES}


def _answer_released(found: Solution) -> dict[str, Any]:
    """Answer a released motion: it errs as a time that is off; angle, speed and forces with it."""
    time, omega, alpha = found.time, found.omega_2, found.alpha_2
    assert time is not None and omega is not None and alpha is not None and found.force_error is not None
    angle = PROMISED * max(1.0, float(time[-1] - time[0]) / PROMISED_FOR)
    late = angle / float(np.abs(omega).max())
    answers = {"theta_2": _answer(found.theta_2, np.full(len(time), angle))}
    answers["omega_2"] = _answer(omega, np.full(len(time), late * float(np.abs(alpha).max())))
    for name in PIN_FORCES:
        force = getattr(found, name)
        rate = float(np.hypot(*np.gradient(force, time, axis=0).T).max())
        answers[name] = _answer(force, found.force_error + rate * late)
    if (period := _measure_period(time, found.theta_2, omega, alpha)) is not None:
        answers["frequency"] = {"value": 1.0 / period, "error": 2.0 * late / period**2}
    return answers


def _measure_period(time: Array, theta: Array, omega: Array, alpha: Array) -> float | None:
    """Measure the time between upward passages through mid-swing, s; None where it does not swing."""
    from scipy.interpolate import BPoly

    level = 0.5 * (theta.max() + theta.min())
    passed = np.flatnonzero((theta[:-1] < level) & (theta[1:] >= level))
    if len(passed) < 2:
        return None
    at = []
    for i in (passed[0], passed[-1]):
        ends = np.column_stack([theta, omega, alpha])[i : i + 2]
        ends[:, 0] -= level
        roots = BPoly.from_derivatives(time[i : i + 2], ends)
        low, high = time[i], time[i + 1]
        while (middle := 0.5 * (low + high)) not in (low, high):
            low, high = (middle, high) if roots(middle) < 0.0 else (low, middle)
        at.append(high)
    return float(at[1] - at[0]) / (len(passed) - 1)


def _answer(value: Any, error: Array) -> dict[str, Any]:
    return {"value": value.tolist(), "error": error.tolist()}


@click.command()
def command() -> None:
    """Write the answers of every scene in models/problems next to it, as JSON."""
    find_checkout("write --problems")
    for file in sorted(PROBLEMS.glob("*.toml")):
        write_text(file.with_suffix(".json"), write_json(collect_problem(file)))
        click.echo(f"wrote {file.with_suffix('.json').name}")


def write_json(made: dict[str, Any]) -> str:
    """Write JSON, one entry a line."""
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in made["answers"].items()]
    answers = "{\n" + ",\n".join(lines) + "\n }"
    head = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in made.items() if key != "answers"]
    return "{\n" + ",\n".join([*head, f' "answers": {answers}']) + "\n}\n"
