"""MuJoCo MJX (JAX), in double precision."""

from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from typing import Any, ClassVar

import jax
import numpy as np
from mujoco import mjx

from fourbar.scene import Scene
from fourbar_lab.simulators import gradients
from fourbar_lab.simulators.motion import (
    DEFAULT_STEPS_OF_A_TURN,
    Course,
    Floats,
    Instant,
    Readings,
    Simulator,
    Worlds,
    run_through,
)
from fourbar_lab.simulators.mujoco_c import (
    find_bar_bodies,
    read_last,
    reading,
    repeat_states,
    states_of,
    write_opened_mjcf,
)
from fourbar_validation.engines.mujoco.closed_loop import open_model

jax.config.update("jax_enable_x64", True)


@jax.jit  # type: ignore[untyped-decorator]
def forward(model: Any, state: Any) -> Any:
    """Evaluate a state, and what every body bears."""
    return mjx.rne_postconstraint(model, mjx.forward(model, state))


@jax.jit  # type: ignore[untyped-decorator]
def advance(model: Any, state: Any, steps: int) -> Any:
    """Step on, with the number left open so that it compiles once."""
    return jax.lax.fori_loop(0, steps, lambda _, now: mjx.step(model, now), state)


@jax.jit  # type: ignore[untyped-decorator]
@partial(jax.vmap, in_axes=(None, None, 0, 0))
def _forward_all(
    model: Any,
    state: Any,
    q: Any,
    v: Any,
) -> tuple[Any, ...]:
    """Evaluate states, and return what torque and pin forces are read from."""
    now = forward(model, state.replace(qpos=q, qvel=v))
    inner = getattr(now, "_impl", now)
    return now.qacc, now.actuator_force, inner.efc_force[:2], inner.cfrc_int


class MujocoMjx(Simulator):
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
    single_states = True

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(
            write_opened_mjcf(scene, course.steps, self.settings[self.setting])
        )
        theirs = mjx.put_model(model)
        state = mjx.put_data(model, data)
        jax.block_until_ready(
            advance(theirs, state, 1)
        )  # compiled before the clock runs

        def further(steps: int) -> Any:
            nonlocal state
            state = jax.block_until_ready(advance(theirs, state, steps))
            return state

        return run_through(
            scene,
            course,
            further,
            lambda now: _evaluate_mjx(model, forward(theirs, now)),
            self.choose_clock(),
        )

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states, each set by itself."""
        written = write_opened_mjcf(
            scene, DEFAULT_STEPS_OF_A_TURN, self.settings[self.setting]
        )
        model, data = open_model(written)
        theirs = mjx.put_model(model)
        state = mjx.put_data(model, data)
        readings = Readings()
        for q, v in states_of(written, scene):
            placed = state.replace(qpos=jax.numpy.array(q), qvel=jax.numpy.array(v))
            readings.read(scene, _evaluate_mjx(model, forward(theirs, placed)))
        return readings

    def in_worlds(
        self,
        scene: Scene,
        worlds: int,
        double: bool = True,
    ) -> Worlds:
        """Prepare single states of many worlds, in double or single precision.

        In single precision the file is that for Warp, whose flywheel is light: beside
        the heavy one the linkage's accelerations keep no digit.
        """
        reader = "warp"
        if double:
            reader = self.settings[self.setting]
        written = write_opened_mjcf(scene, DEFAULT_STEPS_OF_A_TURN, reader)
        model, data = open_model(written)
        q, v = repeat_states(written, scene, worlds)
        with jax.enable_x64(double):
            theirs = mjx.put_model(model)
            state = mjx.put_data(model, data)
            placed = jax.numpy.array(q), jax.numpy.array(v)

        def evaluate(states: tuple[Any, Any] = placed) -> Any:
            with jax.enable_x64(double):
                return jax.block_until_ready(_forward_all(theirs, state, *states))

        def exchange() -> tuple[Floats, ...]:
            with jax.enable_x64(double):
                states = jax.numpy.array(q), jax.numpy.array(v)
            return tuple(map(np.array, (*states, *evaluate(states))))

        return Worlds(evaluate, exchange, partial(read_last, scene, model))

    def slopes(self, scene: Scene) -> list[dict[str, Any]]:
        """Differentiate the driving torque by JAX, forwards and backwards.

        Forwards at a set state and through a quarter turn, backwards at the set state.
        """
        begin, end = gradients.choose_quarter(scene)
        ways = [
            ("jax.jvp at a set state", end, 0),
            ("jax.jvp through a quarter turn", begin, gradients.STEPS_OF_A_TURN // 4),
        ]
        ways_tried = [
            _slopes(scene, how, state, partial(_forwards, steps=steps))
            for how, state, steps in ways
        ]
        try:
            ways_tried.append(
                _slopes(scene, "jax.grad at a set state", end, _backwards)
            )
        except ValueError as error:
            ways_tried.append({"how": f"jax.grad: {error}"})
        return [
            *ways_tried,
            _slopes(
                scene,
                'jax.grad at a set state, iterations="1"',
                end,
                partial(_backwards, iterations=1),
            ),
        ]


def _evaluate_mjx(model: Any, state: Any) -> Instant:
    q, v, a, drive = (
        np.array(x) for x in (state.qpos, state.qvel, state.qacc, state.actuator_force)
    )
    inner = getattr(state, "_impl", state)
    closing = np.array(inner.efc_force)[:2]
    on_bodies = np.array(inner.cfrc_int)
    return reading(
        model,
        q,
        v,
        a,
        drive[model.actuator("drive").id],
        closing,
        on_bodies[find_bar_bodies(model)],
    )


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
