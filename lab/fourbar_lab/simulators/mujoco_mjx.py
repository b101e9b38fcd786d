"""MuJoCo MJX (JAX), in double precision; of many worlds in single precision too."""

from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from typing import Any, ClassVar

import jax
import numpy as np
from mujoco import mjx

from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_lab.simulators import gradients
from fourbar_lab.simulators.mujoco_c import FileSimulator, reading, states_of
from fourbar_lab.simulators.protocol_engines import Course, Floats, Instant, Readings
from fourbar_validation.engines.mujoco.closed_loop import open_model

jax.config.update("jax_enable_x64", True)


@jax.jit  # type: ignore[untyped-decorator]
def advance(model: Any, state: Any, steps: int) -> Any:
    """Step on, with the number left open so that it compiles once."""
    return jax.lax.fori_loop(0, steps, lambda _, now: mjx.step(model, now), state)


def evaluate(
    model: Any,
    state: Any,
    q: Any,
    v: Any,
) -> tuple[Any, ...]:
    """Evaluate a state, and return what `reading` takes."""
    placed = state.replace(qpos=q, qvel=v)
    now = mjx.rne_postconstraint(model, mjx.forward(model, placed))
    inner = getattr(now, "_impl", now)
    return q, v, now.qacc, now.actuator_force, inner.efc_force[:2], inner.cfrc_int


_evaluate_one = jax.jit(evaluate)
_evaluate_all = jax.jit(jax.vmap(evaluate, in_axes=(None, None, 0, 0)))


def _read_state(model: Any, theirs: Any, state: Any, q: Any, v: Any) -> Instant:
    world = _evaluate_one(theirs, state, q, v)
    return reading(model, [np.array(array) for array in world])


class MujocoMjx(FileSimulator):
    """MJX in JAX, which takes a GPU where it has one."""

    name = "MJX-JAX"
    version = version("mujoco-mjx")
    on_gpu = jax.default_backend() != "cpu"
    device = str(jax.devices()[0].device_kind) if on_gpu else "CPU"
    changed = "a closure of two timesteps (--for mjx), and jax_enable_x64"
    settings: ClassVar[dict[str, str]] = {
        "written for MJX": "mjx",
        "as for MuJoCo": "mujoco",
    }
    """The file written for MJX yields within two timesteps. That makes up for the term
    that MJX leaves out.
    """
    double = True
    """True in double precision."""

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(self.write(scene, course.steps))
        theirs = mjx.put_model(model)
        state = mjx.put_data(model, data)
        # compiled before the clock runs
        jax.block_until_ready(advance(theirs, state, 1))

        def further(steps: int) -> Any:
            nonlocal state
            state = jax.block_until_ready(advance(theirs, state, steps))
            return state

        def read(now: Any) -> Instant:
            return _read_state(model, theirs, now, now.qpos, now.qvel)

        return self.run(scene, course, further, read)

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states one by one, which compiles once for any number."""
        written = self.write(scene)
        model, data = open_model(written)
        theirs = mjx.put_model(model)
        state = mjx.put_data(model, data)
        readings = Readings()
        for q, v in states_of(written, scene):
            readings.read(scene, _read_state(model, theirs, state, q, v))
        return readings

    def prepare(self, model: Any, data: Any, q: Array, v: Array) -> Any:
        """Evaluate the worlds in one call, in the precision that was chosen."""
        with jax.enable_x64(self.double):
            theirs = mjx.put_model(model)
            state = mjx.put_data(model, data)
            placed = jax.numpy.array(q), jax.numpy.array(v)

        def evaluate_worlds(states: tuple[Any, Any] = placed) -> Any:
            with jax.enable_x64(self.double):
                return jax.block_until_ready(_evaluate_all(theirs, state, *states))

        def exchange() -> tuple[Floats, ...]:
            with jax.enable_x64(self.double):
                states = jax.numpy.array(q), jax.numpy.array(v)
            return tuple(map(np.array, evaluate_worlds(states)))

        return evaluate_worlds, exchange

    def slopes(self, scene: Scene) -> list[dict[str, Any]]:
        """Differentiate the driving torque by JAX, forwards and backwards.

        Forwards at a set state and through a quarter turn, backwards at the set state.
        """
        begin, end = gradients.choose_quarter(scene)
        quarter = gradients.STEPS_OF_A_TURN // 4
        ways: dict[str, tuple[float, Callable[..., Any]]] = {
            "jax.jvp at a set state": (end, partial(_forwards, steps=0)),
            "jax.jvp through a quarter turn": (
                begin,
                partial(_forwards, steps=quarter),
            ),
            "jax.grad at a set state": (end, _backwards),
            'jax.grad at a set state, iterations="1"': (
                end,
                partial(_backwards, iterations=1),
            ),
        }
        tried = []
        for how, (theta_2, differentiate) in ways.items():
            try:
                tried.append(_slopes(scene, how, theta_2, differentiate))
            except ValueError as error:
                tried.append({"how": f"jax.grad: {error}"})
        return tried


class MjxInSinglePrecision(MujocoMjx):
    """MJX in single precision, with the file for Warp.

    The flywheel of that file is light: beside the heavy one the linkage's accelerations
    keep no digit.
    """

    double = False
    settings: ClassVar[dict[str, str]] = {"written for Warp": "warp"}


def _slopes(
    scene: Scene,
    how: str,
    theta_2: float,
    differentiate: Callable[..., Any],
) -> dict[str, Any]:
    """Differentiate along the changes of model and state.

    As trees these differ in what is no number of theirs.
    """
    model, data, q, v = gradients.compile_and_assemble(scene, theta_2, "mjx")
    inputs = (mjx.put_model(model), q, v)
    by = {}
    state = (0.0,) * 4
    for key in gradients.list_keys(scene):
        more, less = (
            jax.tree.leaves((mjx.put_model(side.model), side.qpos, side.qvel))
            for side in gradients.assemble_either_side(scene, theta_2, key, "mjx")
        )
        moves = [gradients.change(x, y) for x, y in zip(more, less, strict=True)]
        by[key], state = differentiate(inputs, moves, mjx.put_data(model, data))
    return gradients.collect_answer(scene, how, state, by)


def _torque(
    part: Any,
    inputs: Any,
    moves: Any,
    data: Any,
    steps: Any,
) -> tuple[Any, Any]:
    """Evaluate the torque where so much of the moves is added.

    The state it is of is returned too.
    """
    leaves, tree = jax.tree.flatten(inputs)
    moved = [
        x + part * y if jax.numpy.issubdtype(x.dtype, float) else x
        for x, y in zip(leaves, moves, strict=True)
    ]
    model, q, v = jax.tree.unflatten(tree, moved)
    now = data.replace(qpos=q, qvel=v)
    now = mjx.forward(model, now if steps is None else advance(model, now, steps))
    torque = now.actuator_force[0] - model.dof_armature[0] * now.qacc[0]
    return torque, (now.qpos[0], now.qvel[0], now.qacc[0], torque)


@jax.jit  # type: ignore[untyped-decorator]
def _forwards(
    inputs: Any,
    moves: Any,
    data: Any,
    steps: int,
) -> Any:
    _, slope, state = jax.jvp(
        lambda part: _torque(part, inputs, moves, data, steps),
        (0.0,),
        (1.0,),
        has_aux=True,
    )
    return slope, state


@partial(jax.jit, static_argnames="iterations")
def _backwards(
    inputs: Any,
    moves: Any,
    data: Any,
    iterations: int = 10,
) -> Any:
    model, *state = inputs
    once = (model.tree_replace({"opt.iterations": iterations}), *state)
    return jax.grad(lambda part: _torque(part, once, moves, data, None), has_aux=True)(
        0.0
    )
