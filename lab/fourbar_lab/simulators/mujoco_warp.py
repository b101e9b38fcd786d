"""MuJoCo Warp, in single precision.

`forward` is called once as a user of MuJoCo would, and twice as the file's comment
says.
"""

from functools import partial
from typing import Any, ClassVar

import mujoco_warp as mjw
import numpy as np
import warp

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

VARIED_FIELDS = ("body_mass", "body_inertia", "body_ipos", "site_pos", "dof_armature")
"""Fields of a model that change with a bar's length or mass, or with theta_2."""


class MujocoWarp(Simulator):
    """MuJoCo Warp with the generated file, on a GPU if there is one."""

    name = "MuJoCo Warp"
    version = getattr(mjw, "__version__", "")
    on_gpu = bool(warp.get_preferred_device().is_cuda)
    device = str(warp.get_preferred_device().name)
    made_for = "many worlds at once on a GPU"
    changed = (
        "a light flywheel and no pads (--for warp): single precision; midphase may not"
        " be switched off"
    )
    settings: ClassVar[dict[str, int]] = {"forward twice": 2, "forward once": 1}
    """Number of evaluations of a state."""
    single_states = True

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(write_opened_mjcf(scene, course.steps, "warp"))
        times = self.settings[self.setting]
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        # compiled before the clock runs
        mjw.step(theirs, mjw.put_data(model, data))

        def advance(steps: int) -> None:
            for _ in range(steps):
                mjw.step(theirs, state)
            warp.synchronize()

        return run_through(
            scene,
            course,
            advance,
            lambda _: _evaluate_warp(model, theirs, state, times),
            self.choose_clock(),
        )

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states, each set by itself."""
        written = write_opened_mjcf(scene, DEFAULT_STEPS_OF_A_TURN, "warp")
        model, data = open_model(written)
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        readings = Readings()
        for q, v in states_of(written, scene):
            state.qpos.assign(np.array([q], dtype=np.float32))
            state.qvel.assign(np.array([v], dtype=np.float32))
            readings.read(
                scene, _evaluate_warp(model, theirs, state, self.settings[self.setting])
            )
        return readings

    def in_worlds(self, scene: Scene, worlds: int) -> Worlds:
        """Prepare single states of many worlds.

        On a GPU the kernels are launched as one graph.
        """
        written = write_opened_mjcf(scene, DEFAULT_STEPS_OF_A_TURN, "warp")
        model, data = open_model(written)
        q, v = (
            array.astype(np.float32) for array in repeat_states(written, scene, worlds)
        )
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data, nworld=worlds)
        state.qpos.assign(q)
        state.qvel.assign(v)
        launch = partial(_evaluate_states, theirs, state, self.settings[self.setting])
        # compiled before a graph of the launches is made
        launch()
        if self.on_gpu:
            with warp.ScopedCapture() as capture:
                launch()
            launch = partial(warp.capture_launch, capture.graph)

        def evaluate() -> None:
            launch()
            warp.synchronize()

        def exchange() -> tuple[Floats, ...]:
            state.qpos.assign(q)
            state.qvel.assign(v)
            evaluate()
            return (
                q,
                v,
                state.qacc.numpy(),
                state.actuator_force.numpy(),
                state.efc.force.numpy()[:, :2],
                state.cfrc_int.numpy(),
            )

        return Worlds(evaluate, exchange, partial(read_last, scene, model))

    def slopes(self, scene: Scene) -> list[dict[str, Any]]:
        """Differentiate the driving torque at a set state, backwards by Warp's tape.

        The gradients by model and state are then multiplied by each parameter's change.
        """
        _, theta_2 = gradients.choose_quarter(scene)
        model, data, q, v = gradients.compile_and_assemble(scene, theta_2, "warp")
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        state.qpos.assign(np.array([q], dtype=np.float32))
        state.qvel.assign(np.array([v], dtype=np.float32))
        inputs = {name: getattr(theirs, name) for name in VARIED_FIELDS} | {
            "qpos": state.qpos,
            "qvel": state.qvel,
        }
        for array in (*inputs.values(), state.qacc, state.actuator_force):
            array.requires_grad = True
        with warp.Tape() as tape:
            now = _evaluate_warp(model, theirs, state, 2)
        drive = warp.full_like(state.actuator_force, 1.0)
        tape.backward(
            grads={
                state.actuator_force: drive,
                state.qacc: warp.full_like(state.qacc, -model.dof_armature[0]),
            }
        )
        by = {}
        for key in gradients.list_keys(scene):
            more, less = (
                {name: getattr(side.model, name) for name in VARIED_FIELDS}
                | {"qpos": side.qpos, "qvel": side.qvel}
                for side in gradients.assemble_either_side(scene, theta_2, key, "warp")
            )
            by[key] = sum(
                np.sum(array.grad.numpy() * gradients.change(more[name], less[name]))
                for name, array in inputs.items()
            )
        here = (now.theta[0], now.omega_2, now.alpha_2, now.torque)
        return [
            gradients.collect_answer(
                scene,
                "warp.Tape at a set state; it warns that its modules have no backward"
                " pass",
                here,
                by,
            )
        ]


def _evaluate_states(theirs: Any, state: Any, times: int) -> None:
    """Evaluate the states so many times, and what every body bears."""
    for _ in range(times):
        mjw.forward(theirs, state)
    mjw.rne_postconstraint(theirs, state)


def _evaluate_warp(
    model: Any,
    theirs: Any,
    state: Any,
    times: int,
) -> Instant:
    _evaluate_states(theirs, state, times)
    arrays = (state.qpos, state.qvel, state.qacc, state.actuator_force, state.cfrc_int)
    q, v, a, drive, on_bodies = (x.numpy()[-1].astype(float) for x in arrays)
    closing = state.efc.force.numpy()[-1, :2].astype(float)
    return reading(
        model,
        q,
        v,
        a,
        drive[model.actuator("drive").id],
        closing,
        on_bodies[find_bar_bodies(model)],
    )
