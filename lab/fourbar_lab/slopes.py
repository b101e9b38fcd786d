"""Derivatives of every output by every number of a scene: of `sensitivity` and of array libraries, against the balls'.

The error allowed of a derivative s_i = dy/dx_i is 8 eps (|s_i| + sum |x_j ds_i/dx_j| + sum |x_j s_j| / |x_i|): that of
a value, and of what all numbers do to y, or to the vector, together: what cancels leaves a last digit of that.
"""

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
from flint import arb

from fourbar.effects import Friction, Gravity, Load, Table, Viscous
from fourbar.errors import DependencyError, say_install
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import LINE_QUANTITIES, STAGE_OF
from fourbar.scene import Scene
from fourbar.studies.derivatives import sensitivity
from fourbar.studies.function import NEVER, function
from fourbar.studies.keys import (
    command_key,
    list_entries,
    read_numbers,
    replace_numbers,
    replace_place,
)
from fourbar_lab.tally import Tally, compute_ratio, is_untold, list_components
from fourbar_validation.engines.balls import (
    STEP_BITS,
    Values,
    compute_outputs,
    make_balls,
)
from fourbar_validation.engines.description import PINS

LIBRARIES = ("jax", "torch")
QUANTITIES = tuple(name for name in STAGE_OF if name not in NEVER)
Slopes = dict[str, dict[str, tuple[Any, float]]]
"""Derivatives by output and key: each as a ball, with sum |x_j ds/dx_j|."""


def load_library(library: str) -> tuple[Any, Any]:
    """Return the functions for arrays of a library, and the context in which they are doubles."""
    try:
        import array_api_compat  # noqa: F401

        if library == "torch":
            import torch

            return torch, nullcontext()
        import jax
    except ModuleNotFoundError as error:
        raise DependencyError(
            f"{error.name} is not installed: {say_install(library)}"
        ) from None
    return jax.numpy, jax.enable_x64(True)


def make_alike(scene: Scene) -> Scene:
    """Give a drawn scene gravity, damping and dry friction of size 0 where it has none, so that programs are shared.

    A table goes on to a whole turn, beyond the piece that the position is in.
    """
    by_kind: dict[type, Any] = {type(effect): effect for effect in scene.effects}
    if by_kind.keys() <= {Gravity, Viscous, Friction}:
        viscous, friction = dict.fromkeys(PINS, 0.0), dict.fromkeys(PINS, 0.0)
        viscous.update(by_kind.get(Viscous, Viscous(())).coefficients)
        friction.update(by_kind.get(Friction, Friction(())).torques)
        gravity = by_kind.get(Gravity, Gravity(0.0))
        scene = replace(
            scene, effects=(gravity, Viscous.at(**viscous), Friction.at(**friction))
        )
    return replace(
        scene,
        loads=tuple(
            replace(load, table=_close_table(load.table)) for load in scene.loads
        ),
    )


def add_every_load(scene: Scene) -> Scene:
    """Give a scene two loads on every bar in each frame, of size 0 where it has none, so that programs are shared."""
    if any(load.table or load.force is None for load in scene.loads):
        return scene
    remaining, loads = list(scene.loads), []
    for bar, frame in product(MOVING_BARS, ("world", "bar") * 2):
        stated = next(
            (load for load in remaining if (load.bar, load.frame) == (bar, frame)), None
        )
        loads.append(stated or Load(bar, (0.0, 0.0), frame=frame))
        if stated is not None:
            remaining.remove(stated)
    assert not remaining
    return replace(scene, loads=tuple(loads))


def _close_table(table: Table | None) -> Table | None:
    if table is None or table.covers_a_turn:
        return table
    return Table(
        (*table.theta_2, table.theta_2[0] + math.tau), (*table.factor, table.factor[0])
    )


def list_numbers(scene: Scene) -> dict[str, float]:
    """List every number that a scene of one position states, its angle too, by key."""
    return {
        **read_numbers(scene),
        command_key(scene): float(np.asarray(scene.motion.angle)),
    }


def evaluate(
    scene: Scene, library: str, *, derivatives: bool = False
) -> dict[str, Any]:
    """Evaluate every quantity of a scene of one position in doubles, or its derivatives by each number, last axis."""
    alike_one = make_alike(scene)
    scene = (
        add_every_load(alike_one)
        if alike_one.loads or len(alike_one.effects) > 1
        else alike_one
    )
    numbers, places = (
        list_numbers(scene),
        {
            str(k): str(scene.loads.index(load))
            for k, load in enumerate(alike_one.loads)
        },
    )
    scene = replace_place(scene, ("motion", "angle"), 0.0)
    xp, doubles = load_library(library)
    with doubles:
        alike = replace_numbers(
            scene, dict.fromkeys(list_entries(scene).keys() & numbers, 1.0)
        )
        outputs = _make_program(alike, library, derivatives)(
            xp.asarray(list(numbers.values()), dtype=xp.float64)
        )
    if not derivatives:
        return {name: np.asarray(value) for name, value in outputs.items()}
    parts = (key.split(".") for key in list_numbers(alike_one))
    keys = (
        ".".join(
            ("loads", places[rest[0]], *rest[1:]) if of == "loads" else (of, *rest)
        )
        for of, *rest in parts
    )
    index = [list(numbers).index(key) for key in keys]
    return {name: np.asarray(value)[..., index] for name, value in outputs.items()}


@cache
def _make_program(scene: Scene, library: str, derivatives: bool) -> Callable[..., Any]:
    """Make the function of every number of a scene; of a table, which is none, there would be too many programs.

    Derivatives go forwards in JAX, backwards in PyTorch.
    """
    of_others = {"torque"} if scene.drive else LINE_QUANTITIES
    f = function(
        scene,
        list(list_numbers(scene)),
        [name for name in QUANTITIES if name not in of_others],
    )

    def of_row(x: Any) -> Any:
        return f(*x)

    if library == "torch":
        from torch.func import jacrev

        return jacrev(of_row) if derivatives else of_row
    import jax

    program = jax.jacfwd(of_row) if derivatives else of_row
    return program if any(load.table for load in scene.loads) else jax.jit(program)


def compute_exact_slopes(scene: Scene) -> tuple[Values, Slopes]:
    """Return every output, and its derivatives and theirs by every number, by differences in balls.

    No output where the loop does not close, no derivative where the drive has no torque.
    """
    numbers, angle = list_numbers(scene), command_key(scene)
    make_balls(scene, numbers[angle])  # sets the precision
    steps = {
        key: arb(abs(number) or 1.0) * arb(2) ** -STEP_BITS
        for key, number in numbers.items()
    }

    def moved(*keys: str) -> Values:
        changed: dict[str, Any] = dict(numbers)
        for key in keys:
            changed[key] = changed[key] + steps[key]
        stated = changed.pop(angle)
        mate = replace_numbers(
            scene, {key: changed[key] for key in set(keys) - {angle}}
        )
        return (
            compute_outputs(mate, scene.motion.branch, make_balls(mate, stated)) or {}
        )

    base = moved()
    if ("torque" if scene.drive is None else "drive_force") not in base:
        return base, {}
    once = {key: moved(key) for key in numbers}
    by: dict[str, dict[str, Any]] = {name: {} for name in base}
    rates: dict[str, dict[str, float]] = {
        name: dict.fromkeys(numbers, 0.0) for name in base
    }
    for first, mate in combinations_with_replacement(numbers, 2):
        if (
            first != mate and numbers[first] == numbers[mate] == 0.0
        ):  # neither moves the other's derivative
            continue
        twice = moved(first, mate)
        for name, y in base.items():
            change = twice[name] - once[first][name] - once[mate][name] + y
            second = abs(float((change / (steps[first] * steps[mate])).mid()))
            rates[name][first] += abs(numbers[mate]) * second
            if (
                first == mate
            ):  # a difference to second order: where a number is 0 that may be all
                by[name][first] = (once[first][name] - y - change / 2) / steps[first]
            else:
                rates[name][mate] += abs(numbers[first]) * second
    return base, {
        name: {key: (by[name][key], rates[name][key]) for key in numbers}
        for name in base
    }


def differentiate(scene: Scene, library: str) -> dict[str, Any]:
    """Differentiate by every number: NumPy's by `sensitivity`; a row for each number."""
    if library != "numpy":
        return {
            name: np.moveaxis(of, -1, 0)
            for name, of in evaluate(scene, library, derivatives=True).items()
        }
    derivatives = sensitivity(scene)
    rows = [list(derivatives.keys).index(key) for key in list_numbers(scene)]
    return {name: of[rows, 0] for name, of in derivatives.by.items()}


def judge_slopes(scene: Scene, tally: Tally, sample: str, library: str) -> None:
    """Compare the derivatives at one position with those of the reference."""
    tally.samples += 1
    if library != "numpy":
        scene = make_alike(scene)
    (values, exact), slopes, numbers = (
        compute_exact_slopes(scene),
        differentiate(scene, library),
        list_numbers(scene),
    )
    if not values:
        tally.not_assembled += 1
        if np.nan_to_num(
            slopes["F12"]
        ).any():  # a library's are 0: its value is a constant, NaN
            tally.worst["assembled"] = (math.inf, sample)
        return
    if not exact or _is_held(scene, values):
        tally.no_torque += 1
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
        tally.untold += 1
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
                tally.note(
                    component,
                    compute_ratio("", np.ravel(row)[index], value, rate)[0],
                    f"{sample} by {key}",
                )


def _is_held(scene: Scene, values: Values) -> bool:
    """Return whether dry friction holds a pin at rest, so that torque and pin forces have no derivative."""
    dry = [
        PINS[pin]
        for term in scene.effects
        if isinstance(term, Friction)
        for pin, f in term.torques
        if f
    ]
    return any(
        not abs(values.get(f"omega_{j}", 0) - values.get(f"omega_{i}", 0)) > 0
        for i, j in dry
    )
