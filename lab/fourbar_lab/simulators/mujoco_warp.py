"""MuJoCo Warp, in single precision.

`forward` is called once as a user of MuJoCo would, and twice as the file's comment
says.
"""

from functools import partial
from typing import Any, ClassVar

import mujoco_warp as mjw
import numpy as np
import warp

from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_lab.simulators import gradients
from fourbar_lab.simulators.mujoco_c import (
    FileSimulator,
    reading,
    states_of,
    write_opened_mjcf,
)
from fourbar_lab.simulators.protocol_engines import (
    DEFAULT_STEPS_OF_A_TURN,
    Course,
    Floats,
    Instant,
    Readings,
)
from fourbar_validation.engines.mujoco.closed_loop import open_model

VARIED_FIELDS = ("body_mass", "body_inertia", "body_ipos", "site_pos", "dof_armature")
"""Fields of a model that change with a bar's length or mass, or with theta_2."""


class MujocoWarp(FileSimulator):
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

    def write(self, scene: Scene, steps: int = DEFAULT_STEPS_OF_A_TURN) -> str:
        """Write the file; a setting changes nothing of it."""
        return write_opened_mjcf(scene, steps, "warp")

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(self.write(scene, course.steps))
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        # compiled before the clock runs
        mjw.step(theirs, mjw.put_data(model, data))

        def advance(steps: int) -> None:
            for _ in range(steps):
                mjw.step(theirs, state)
            warp.synchronize()

        def read(_: None) -> Instant:
            return read_warp(model, theirs, state, self.settings[self.setting])

        return self.run(scene, course, advance, read)

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states, each after one at another velocity."""
        written = self.write(scene)
        model, data = open_model(written)
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        readings = Readings()
        for q, v in states_of(written, scene):
            _set_states(state, [q], [v])
            now = read_warp(model, theirs, state, self.settings[self.setting])
            readings.read(scene, now)
        return readings

    def prepare(self, model: Any, data: Any, q: Array, v: Array) -> Any:
        """Evaluate the worlds; on a GPU the kernels are launched as one graph."""
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data, nworld=len(q))
        placed = q.astype(np.float32), v.astype(np.float32)
        _set_states(state, *placed)
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
            _set_states(state, *placed)
            evaluate()
            return _read_states(state)

        return evaluate, exchange

    def slopes(self, scene: Scene) -> list[dict[str, Any]]:
        """Differentiate the driving torque at a set state, backwards by Warp's tape.

        The gradients by model and state are then multiplied by each parameter's change.
        """
        _, theta_2 = gradients.choose_quarter(scene)
        model, data, q, v = gradients.compile_and_assemble(scene, theta_2, "warp")
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        _set_states(state, [q], [v])
        inputs = {name: getattr(theirs, name) for name in VARIED_FIELDS} | {
            "qpos": state.qpos,
            "qvel": state.qvel,
        }
        for array in (*inputs.values(), state.qacc, state.actuator_force):
            array.requires_grad = True
        with warp.Tape() as tape:
            now = read_warp(model, theirs, state, 2)
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


def _set_states(state: Any, q: Any, v: Any) -> None:
    """Set positions and speeds of the worlds, a row each."""
    state.qpos.assign(np.asarray(q, dtype=np.float32))
    state.qvel.assign(np.asarray(v, dtype=np.float32))


def _read_states(state: Any) -> tuple[Floats, ...]:
    """Return what `reading` takes, a row for each world."""
    q, v, a = state.qpos.numpy(), state.qvel.numpy(), state.qacc.numpy()
    closing = state.efc.force.numpy()[:, :2]
    return q, v, a, state.actuator_force.numpy(), closing, state.cfrc_int.numpy()


def read_warp(model: Any, theirs: Any, state: Any, times: int) -> Instant:
    """Evaluate the last world so many times, and read it."""
    _evaluate_states(theirs, state, times)
    return reading(model, [array[-1].astype(float) for array in _read_states(state)])
