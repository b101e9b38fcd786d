"""Derivatives of every output by every number of a scene, checked by ball arithmetic.

The derivatives by `sensitivity` are compared with those of balls. The error allowed of
a derivative s_i = dy/dx_i is

    8 eps (|s_i| + sum |x_j ds_i/dx_j| + sum |x_j s_j| / |x_i|):

that of a value, and of what all numbers do to y, or to the vector, together: what
cancels leaves a last digit of that.
"""

import math
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from flint import arb

from fourbar.effects import Friction
from fourbar.linkage import PINS
from fourbar.scene import Scene, command, with_signs
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.keys import (
    command_key,
    read_numbers,
    replace_numbers,
)
from fourbar_lab.tally import (
    SAMPLES,
    Tally,
    error_over_allowed,
    is_untold,
    list_components,
)
from fourbar_validation.engines.balls import (
    STEP_BITS,
    BallValues,
    compute_outputs,
    make_balls,
)

Slopes = dict[str, dict[str, tuple[Any, float]]]
"""Derivatives by output and key: each as a ball, with sum |x_j ds/dx_j|."""


def list_numbers_by_key(scene: Scene) -> dict[str, float]:
    """List every number that a scene of one position states, its angle too, by key."""
    return {
        **read_numbers(scene),
        command_key(scene): float(np.asarray(scene.motion.angle)),
    }


def _compute_exact_slopes(scene: Scene) -> tuple[BallValues, Slopes]:
    """Return every output, and its first and second derivatives by every number.

    Derivatives are differences in balls. Outputs are empty where the loop does not
    close, derivatives where the drive has no torque.
    """
    numbers = list_numbers_by_key(scene)
    angle = command_key(scene)
    make_balls(scene, numbers[angle])  # sets the precision
    steps = {}
    for key, number in numbers.items():
        steps[key] = arb(abs(number) or 1.0) * arb(2) ** -STEP_BITS
    sign = int(with_signs(scene.linkage, command(scene)).branch[0])

    def moved(*keys: str) -> BallValues:
        changed: dict[str, Any] = dict(numbers)
        for key in keys:
            changed[key] = changed[key] + steps[key]
        stated = changed.pop(angle)
        replaced = {key: changed[key] for key in set(keys) - {angle}}
        mate = replace_numbers(scene, replaced)
        return compute_outputs(mate, sign, make_balls(mate, stated)) or {}

    base = moved()
    if ("torque" if scene.drive is None else "drive_force") not in base:
        return base, {}
    once = {key: moved(key) for key in numbers}
    by: dict[str, dict[str, Any]] = {}
    rates: dict[str, dict[str, float]] = {}
    for name in base:
        by[name] = {}
        rates[name] = dict.fromkeys(numbers, 0.0)
    for first, mate in combinations_with_replacement(numbers, 2):
        if first != mate and numbers[first] == numbers[mate] == 0.0:
            # neither moves the other's derivative
            continue
        twice = moved(first, mate)
        for name, y in base.items():
            change = twice[name] - once[first][name] - once[mate][name] + y
            curvature = change / (steps[first] * steps[mate])
            second = abs(float(curvature.mid()))
            rates[name][first] += abs(numbers[mate]) * second
            if first == mate:
                # a difference to second order: where a number is 0 that may be all
                by[name][first] = (once[first][name] - y - change / 2) / steps[first]
            else:
                rates[name][mate] += abs(numbers[first]) * second
    slopes = {}
    for name in base:
        slopes[name] = {key: (by[name][key], rates[name][key]) for key in numbers}
    return base, slopes


def differentiate(scene: Scene) -> dict[str, Any]:
    """Return the derivatives at the first position, by quantity, (p,) or (p, 2).

    The p numbers are those of `list_numbers_by_key`, in its order.
    """
    derivatives = sensitivity(scene)
    rows = [list(derivatives.keys).index(key) for key in list_numbers_by_key(scene)]
    return {name: of[rows, 0] for name, of in derivatives.by.items()}


def judge_slopes(
    scene: Scene,
    tally: Tally,
    sample: str,
) -> None:
    """Compare the derivatives at one position with those of the reference."""
    tally.counts[SAMPLES] += 1
    values, exact = _compute_exact_slopes(scene)
    slopes = differentiate(scene)
    numbers = list_numbers_by_key(scene)
    if not values:
        tally.counts["not assembled"] += 1
        if np.nan_to_num(slopes["F12"]).any():
            tally.worst["assembled"] = (math.inf, sample)
        return
    if not exact or _is_held(scene, values):
        tally.counts["no torque"] += 1
        return
    moves = {  # sum |x_i dy/dx_i|
        name: math.fsum(
            abs(number * float(by[key][0].mid())) for key, number in numbers.items()
        )
        for name, by in exact.items()
    }
    if np.isnan(slopes["sin_mu"]).any() and is_untold(
        values["sin_mu"], moves["sin_mu"]
    ):
        tally.counts["no digit tells"] += 1
        return
    for name, rows in slopes.items():
        together = max(
            moves.get(component, 0.0) for component, _ in list_components(name)
        )
        for component, index in list_components(name):
            if component not in exact:
                continue
            for (key, number), row in zip(numbers.items(), rows, strict=True):
                value, rate = exact[component][key]
                rate += together / (abs(number) or 1.0)
                part, _ = error_over_allowed("", np.ravel(row)[index], value, rate)
                tally.note(component, part, f"{sample} by {key}")


def _is_held(scene: Scene, values: BallValues) -> bool:
    """Return whether dry friction holds a pin at rest.

    Torque and pin forces then have no derivative.
    """
    for term in scene.effects:
        if isinstance(term, Friction):
            for pin, f in term.torques:
                i, j = (values.get(f"omega_{bar}", 0) for bar in PINS[pin])
                if f and not abs(j - i) > 0:
                    return True
    return False
