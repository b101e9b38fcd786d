"""Derivatives of every output by every number of a scene: of `sensitivity` and of array libraries, against the balls'.

The error allowed of a derivative s_i = dy/dx_i is 8 eps (|s_i| + sum |x_j ds_i/dx_j| + sum |x_j s_j| / |x_i|): that of
a value, and of what all numbers do to y, or to the vector, together: what cancels leaves a last digit of that.
"""

import math
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from flint import arb

from fourbar.quantities import OK, STATUS_NAMES
from fourbar.scene import Scene
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.function import function
from fourbar.studies.keys import command_key, replace_numbers
from fourbar_validation.engines.balls import STEP_BITS, Values, compute_outputs, make_balls
from fourbar_validation.lab.stress.forward_error.libraries import QUANTITIES, list_numbers, load_library, make_alike
from fourbar_validation.lab.stress.forward_error.tally import Tally, compute_ratio, is_untold, list_components

Slopes = dict[str, dict[str, tuple[Any, float]]]
"""By output and key: a derivative as a ball, and sum |x_j ds/dx_j|."""


def compute_exact_slopes(scene: Scene) -> tuple[Values, Slopes]:
    """Return every output, and its derivatives and theirs by every number, by differences in balls."""
    numbers, angle = list_numbers(scene), command_key(scene)
    make_balls(scene, numbers[angle])  # sets the precision
    steps = {key: arb(abs(number) or 1.0) * arb(2) ** -STEP_BITS for key, number in numbers.items()}

    def moved(*keys: str) -> Values:
        changed: dict[str, Any] = dict(numbers)
        for key in keys:
            changed[key] = changed[key] + steps[key]
        stated = changed.pop(angle)
        other = replace_numbers(scene, {key: changed[key] for key in set(keys) - {angle}})
        found = compute_outputs(other, scene.motion.branch, make_balls(other, stated), scene.drive_bar)
        assert found is not None
        return found

    base, once = moved(), {key: moved(key) for key in numbers}
    by: dict[str, dict[str, Any]] = {name: {} for name in base}
    rates: dict[str, dict[str, float]] = {name: dict.fromkeys(numbers, 0.0) for name in base}
    for one, other in combinations_with_replacement(numbers, 2):
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
    """Differentiate by every number: by `sensitivity`, forwards in JAX, backwards in PyTorch; a row for each number."""
    numbers = list_numbers(scene)
    if library == "numpy":
        found = sensitivity(scene)
        rows = [list(found.keys).index(key) for key in numbers]
        return {name: of[rows, 0] for name, of in found.by.items()}
    f, (xp, doubles) = function(scene, list(numbers), QUANTITIES), load_library(library)
    if library == "jax":
        from jax import jacfwd as jacobian
    else:
        from torch.func import jacrev as jacobian
    with doubles:
        by = jacobian(lambda x: f(*x))(xp.asarray(list(numbers.values()), dtype=xp.float64))
        return {name: np.moveaxis(np.asarray(value), -1, 0) for name, value in by.items()}


def judge_slopes(scene: Scene, tally: Tally, sample: str, library: str) -> None:
    """Compare the derivatives at one position with those of the reference."""
    tally.samples += 1
    scene = make_alike(scene)
    if sensitivity(scene).status != [STATUS_NAMES[OK]]:
        tally.no_torque += 1
        return
    (values, exact), found, numbers = compute_exact_slopes(scene), differentiate(scene, library), list_numbers(scene)
    moves = {  # sum |x_i dy/dx_i|
        name: math.fsum(abs(number * float(by[key][0].mid())) for key, number in numbers.items())
        for name, by in exact.items()
    }
    if library != "numpy" and np.isnan(found["sin_mu"]).any() and is_untold(values["sin_mu"], moves["sin_mu"]):
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
