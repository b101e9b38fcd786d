"""Derivatives of every output by every number of a scene: of `sensitivity` and of array libraries, against the balls'.

The error allowed of a derivative s_i = dy/dx_i is 8 eps (|s_i| + sum |x_j ds_i/dx_j| + sum |x_j s_j| / |x_i|): that of
a value, and of what all numbers do to y, or to the vector, together: what cancels leaves a last digit of that.
"""

import math
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from flint import arb

from fourbar.effects import Friction
from fourbar.scene import Scene
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.keys import command_key, replace_numbers
from fourbar_lab.libraries import evaluate, list_numbers, make_alike
from fourbar_lab.tally import Tally, compute_ratio, is_untold, list_components
from fourbar_validation.engines.ball_vectors import Values
from fourbar_validation.engines.balls import STEP_BITS, compute_outputs, make_balls
from fourbar_validation.engines.description import PINS

Slopes = dict[str, dict[str, tuple[Any, float]]]
"""By output and key: a derivative as a ball, and sum |x_j ds/dx_j|."""


def compute_exact_slopes(scene: Scene) -> tuple[Values, Slopes]:
    """Return every output, and its derivatives and theirs by every number, by differences in balls.

    No output where the loop does not close, no derivative where the drive has no torque.
    """
    numbers, angle = list_numbers(scene), command_key(scene)
    make_balls(scene, numbers[angle])  # sets the precision
    steps = {key: arb(abs(number) or 1.0) * arb(2) ** -STEP_BITS for key, number in numbers.items()}

    def moved(*keys: str) -> Values:
        changed: dict[str, Any] = dict(numbers)
        for key in keys:
            changed[key] = changed[key] + steps[key]
        stated = changed.pop(angle)
        other = replace_numbers(scene, {key: changed[key] for key in set(keys) - {angle}})
        return compute_outputs(other, scene.motion.branch, make_balls(other, stated)) or {}

    base = moved()
    if ("torque" if scene.drive is None else "drive_force") not in base:
        return base, {}
    once = {key: moved(key) for key in numbers}
    by: dict[str, dict[str, Any]] = {name: {} for name in base}
    rates: dict[str, dict[str, float]] = {name: dict.fromkeys(numbers, 0.0) for name in base}
    for one, other in combinations_with_replacement(numbers, 2):
        if one != other and numbers[one] == numbers[other] == 0.0:  # neither moves the other's derivative
            continue
        twice = moved(one, other)
        for name, y in base.items():
            change = twice[name] - once[one][name] - once[other][name] + y
            second = abs(float((change / (steps[one] * steps[other])).mid()))
            rates[name][one] += abs(numbers[other]) * second
            if one == other:  # a difference to second order: where a number is 0 that may be all
                by[name][one] = (once[one][name] - y - change / 2) / steps[one]
            else:
                rates[name][other] += abs(numbers[one]) * second
    return base, {name: {key: (by[name][key], rates[name][key]) for key in numbers} for name in base}


def differentiate(scene: Scene, library: str) -> dict[str, Any]:
    """Differentiate by every number: NumPy's by `sensitivity`; a row for each number."""
    if library != "numpy":
        return {name: np.moveaxis(of, -1, 0) for name, of in evaluate(scene, library, derivatives=True).items()}
    found = sensitivity(scene)
    rows = [list(found.keys).index(key) for key in list_numbers(scene)]
    return {name: of[rows, 0] for name, of in found.by.items()}


def judge_slopes(scene: Scene, tally: Tally, sample: str, library: str) -> None:
    """Compare the derivatives at one position with those of the reference."""
    tally.samples += 1
    if library != "numpy":
        scene = make_alike(scene)
    (values, exact), found, numbers = compute_exact_slopes(scene), differentiate(scene, library), list_numbers(scene)
    if not values:
        tally.not_assembled += 1
        if np.nan_to_num(found["F12"]).any():  # a library's are 0: its value is a constant, NaN
            tally.worst["assembled"] = (math.inf, sample)
        return
    if not exact or _is_held(scene, values):
        tally.no_torque += 1
        return
    moves = {  # sum |x_i dy/dx_i|
        name: math.fsum(abs(number * float(by[key][0].mid())) for key, number in numbers.items())
        for name, by in exact.items()
    }
    if np.isnan(found["sin_mu"]).any() and is_untold(values["sin_mu"], moves["sin_mu"]):
        tally.untold += 1
        return
    for name, rows in found.items():
        together = max(moves.get(component, 0.0) for component, _ in list_components(name))
        for component, index in list_components(name):
            if component not in exact:
                continue
            for (key, number), row in zip(numbers.items(), rows, strict=True):
                value, rate = exact[component][key]
                rate += together / (abs(number) or 1.0)
                tally.note(component, compute_ratio("", np.ravel(row)[index], value, rate)[0], f"{sample} by {key}")


def _is_held(scene: Scene, values: Values) -> bool:
    """Whether dry friction holds a pin at rest, so that torque and pin forces have no derivative."""
    dry = [PINS[pin] for term in scene.effects if isinstance(term, Friction) for pin, f in term.torques if f]
    return any(not abs(values.get(f"omega_{j}", 0) - values.get(f"omega_{i}", 0)) > 0 for i, j in dry)
