"""MuJoCo Warp, in single precision.

`forward` is called once as a user of MuJoCo would, and twice as the file's comment
says.
"""

import time
from typing import Any, ClassVar

import mujoco_warp as mjw
import numpy as np
import warp

from fourbar.scene import Scene
from fourbar_lab.simulators import gradients
from fourbar_lab.simulators.motion import (
    STEPS,
    Course,
    Instant,
    Readings,
    Simulator,
    run_through,
)
from fourbar_lab.simulators.mujoco_c import find_bars, reading, states_of, text
from fourbar_validation.engines.mujoco.closed_loop import open_model

NUMBERS = ("body_mass", "body_inertia", "body_ipos", "site_pos", "dof_armature")
"""Fields of a model that change with a bar's length or mass, or with theta_2."""
_ON_GPU = warp.get_preferred_device().is_cuda


class MujocoWarp(Simulator):
    """MuJoCo Warp with the generated file, on a GPU if there is one."""

    name = "MuJoCo Warp"
    version = getattr(mjw, "__version__", "")
    device = str(warp.get_preferred_device().name)
    made_for = "many worlds at once on a GPU"
    changed = (
        "a light flywheel and no pads (--for warp): single precision; midphase may not"
        " be switched off"
    )
    settings: ClassVar[dict[str, tuple[int, int]]] = {
        "forward twice": (2, 1),
        "forward once": (1, 1),
        **(
            {f"forward twice, {worlds} worlds": (2, worlds) for worlds in (64, 4096)}
            if _ON_GPU
            else {}
        ),
    }
    """Number of evaluations of a state and of simulated worlds. The last world is read.
    """
    single_states = True

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        model, data = open_model(text(scene, course.steps, "warp"))
        times, worlds = self.settings[self.setting]
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data, nworld=worlds)
        mjw.step(
            theirs, mjw.put_data(model, data, nworld=worlds)
        )  # compiled before the clock runs

        def advance(steps: int) -> None:
            for _ in range(steps):
                mjw.step(theirs, state)
            warp.synchronize()

        if _ON_GPU:
            clock = time.perf_counter
        else:
            clock = time.process_time
        readings = run_through(
            scene,
            course,
            advance,
            lambda _: _evaluated(model, theirs, state, times),
            clock,
        )
        readings.seconds /= worlds
        return readings

    def states(self, scene: Scene) -> Readings:
        """Evaluate single states, each set by itself."""
        written = text(scene, STEPS, "warp")
        model, data = open_model(written)
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        readings = Readings()
        for q, v in states_of(written, scene):
            state.qpos.assign(np.array([q], dtype=np.float32))
            state.qvel.assign(np.array([v], dtype=np.float32))
            readings.read(
                scene, _evaluated(model, theirs, state, self.settings[self.setting][0])
            )
        return readings

    def slopes(self, scene: Scene) -> list[dict[str, Any]]:
        """Differentiate the driving torque at a set state.

        It is backwards, by the tape, then along each change.
        """
        _, theta_2 = gradients.choose_quarter(scene)
        model, data, q, v = gradients.assemble(scene, theta_2, "warp")
        theirs = mjw.put_model(model)
        state = mjw.put_data(model, data)
        state.qpos.assign(np.array([q], dtype=np.float32))
        state.qvel.assign(np.array([v], dtype=np.float32))
        inputs = {name: getattr(theirs, name) for name in NUMBERS} | {
            "qpos": state.qpos,
            "qvel": state.qvel,
        }
        for array in (*inputs.values(), state.qacc, state.actuator_force):
            array.requires_grad = True
        with warp.Tape() as tape:
            now = _evaluated(model, theirs, state, 2)
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
                {name: getattr(side.model, name) for name in NUMBERS}
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


def _evaluated(model: Any, theirs: Any, state: Any, times: int) -> Instant:
    for _ in range(times):
        mjw.forward(theirs, state)
    mjw.rne_postconstraint(theirs, state)
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
        on_bodies[find_bars(model)],
    )
