"""A scene's function in another array library, every number of the scene an argument: JAX compiles it, PyTorch not."""

import math
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from fourbar.effects import Friction, Gravity, Load, Table, Viscous
from fourbar.errors import DependencyError, say_install
from fourbar.linkage import MOVING_BARS
from fourbar.quantities import OF_LINE, STAGE_OF
from fourbar.scene import Scene
from fourbar.studies.function import NEVER, function
from fourbar.studies.keys import command_key, is_left_out, list_entries, read_place, replace_numbers, replace_place
from fourbar_validation.engines.description import PINS

LIBRARIES = ("jax", "torch")
QUANTITIES = tuple(name for name in STAGE_OF if name not in NEVER)


def load_library(library: str) -> tuple[Any, Any]:
    """Return the functions for arrays of a library, and the context in which they are doubles."""
    try:
        import array_api_compat  # noqa: F401

        if library == "torch":
            import torch

            return torch, nullcontext()
        import jax
    except ModuleNotFoundError as error:
        raise DependencyError(f"{error.name} is not installed: {say_install(library)}") from None
    return jax.numpy, jax.enable_x64(True)


def make_alike(scene: Scene) -> Scene:
    """Give a drawn scene gravity, damping and dry friction of size 0 where it has none, so that programs are shared.

    A table goes on to a whole turn, beyond the piece that the position is in.
    """
    own: dict[type, Any] = {type(effect): effect for effect in scene.effects}
    if own.keys() <= {Gravity, Viscous, Friction}:
        viscous, friction = dict.fromkeys(PINS, 0.0), dict.fromkeys(PINS, 0.0)
        viscous.update(own.get(Viscous, Viscous(())).coefficients)
        friction.update(own.get(Friction, Friction(())).torques)
        gravity = own.get(Gravity, Gravity(0.0))
        scene = replace(scene, effects=(gravity, Viscous.at(**viscous), Friction.at(**friction)))
    return replace(scene, loads=tuple(replace(load, table=_close_table(load.table)) for load in scene.loads))


def add_every_load(scene: Scene) -> Scene:
    """Give a scene two loads on every bar in each frame, of size 0 where it has none, so that programs are shared."""
    if any(load.table or load.force is None for load in scene.loads):
        return scene
    left, loads = list(scene.loads), []
    for bar, frame in product(MOVING_BARS, ("world", "bar") * 2):
        own = next((load for load in left if (load.bar, load.frame) == (bar, frame)), None)
        loads.append(own or Load(bar, (0.0, 0.0), frame=frame))
        if own is not None:
            left.remove(own)
    assert not left
    return replace(scene, loads=tuple(loads))


def _close_table(table: Table | None) -> Table | None:
    if table is None or table.covers_a_turn:
        return table
    return Table((*table.theta_2, table.theta_2[0] + math.tau), (*table.factor, table.factor[0]))


def list_numbers(scene: Scene) -> dict[str, float]:
    """List every number that a scene of one position states, its angle too, by key."""
    found = {
        key: read_place(scene, entry.place)
        for key, entry in list_entries(scene).items()
        if not is_left_out(scene, entry)
    }
    return {**found, command_key(scene): float(np.asarray(scene.motion.angle))}


def evaluate(scene: Scene, library: str, *, derivatives: bool = False) -> dict[str, Any]:
    """Evaluate every quantity of a scene of one position in doubles, or its derivatives by each number, last axis."""
    own = make_alike(scene)
    scene = add_every_load(own) if own.loads or len(own.effects) > 1 else own
    numbers, places = list_numbers(scene), {str(k): str(scene.loads.index(load)) for k, load in enumerate(own.loads)}
    scene = replace_place(scene, ("motion", scene.motion.names[0]), 0.0)
    xp, doubles = load_library(library)
    with doubles:
        alike = replace_numbers(scene, dict.fromkeys(list_entries(scene).keys() & numbers, 1.0))
        found = _make_program(alike, library, derivatives)(xp.asarray(list(numbers.values()), dtype=xp.float64))
    if not derivatives:
        return {name: np.asarray(value) for name, value in found.items()}
    parts = (key.split(".") for key in list_numbers(own))
    keys = (".".join(("loads", places[rest[0]], *rest[1:]) if of == "loads" else (of, *rest)) for of, *rest in parts)
    index = [list(numbers).index(key) for key in keys]
    return {name: np.asarray(value)[..., index] for name, value in found.items()}


@cache
def _make_program(scene: Scene, library: str, derivatives: bool) -> Callable[..., Any]:
    """Make the function of every number of a scene; of a table, which is none, there would be too many programs.

    Derivatives go forwards in JAX, backwards in PyTorch.
    """
    of_others = {"torque"} if scene.drive else OF_LINE
    f = function(scene, list(list_numbers(scene)), [name for name in QUANTITIES if name not in of_others])

    def of_row(x: Any) -> Any:
        return f(*x)

    if library == "torch":
        from torch.func import jacrev

        return jacrev(of_row) if derivatives else of_row
    import jax

    program = jax.jacfwd(of_row) if derivatives else of_row
    return program if any(load.table for load in scene.loads) else jax.jit(program)
