"""Newton's MuJoCo solver (MuJoCo Warp inside, single precision), from the MJCF file."""

from importlib.metadata import version
from typing import ClassVar

import mujoco_warp as mjw
import newton
import warp

from fourbar.scene import Scene
from fourbar_lab.simulators.motion import (
    Course,
    Instant,
    Readings,
    Simulator,
    gravity_field,
    run_through,
    start,
    write_temp,
)
from fourbar_lab.simulators.mujoco_c import reading, write_opened_mjcf


class NewtonMujoco(Simulator):
    """Newton's SolverMuJoCo."""

    name = "Newton, MuJoCo solver"
    version = version("newton")
    device = str(warp.get_preferred_device().name)
    made_for = "many worlds at once on a GPU"
    changed = (
        "add_mjcf takes neither timestep, gravity nor keyframe: all three are set by"
        " hand; --for newton"
    )
    settings: ClassVar[dict[str, None]] = {"SolverMuJoCo": None}

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course."""
        builder = newton.ModelBuilder(gravity=gravity_field(scene))
        with write_temp(
            write_opened_mjcf(scene, course.steps, "newton"), "four_bar.xml"
        ) as file:
            builder.add_mjcf(file)
        model = builder.finalize(device=warp.get_preferred_device())
        solver = newton.solvers.SolverMuJoCo(model)
        control = model.control()
        now = model.state()
        then = model.state()
        speeds = now.joint_qd.numpy()
        speeds[:3] = start(scene).qvel
        now.joint_qd.assign(speeds)
        newton.solvers.SolverMuJoCo(model).step(
            now,
            then,
            control,
            None,
            course.timestep,
        )  # compiled before the clock runs
        names = [
            solver.mj_model.body(number).name for number in range(solver.mj_model.nbody)
        ]
        assert [name.rpartition("_")[2] for name in names[2:]] == [
            "input",
            "coupler",
            "output",
        ]

        def advance(steps: int) -> None:
            nonlocal now, then
            for _ in range(steps):
                solver.step(now, then, control, None, course.timestep)
                now, then = then, now

        def read(_: None) -> Instant:
            data = solver.mjw_data
            for _again in range(2):
                mjw.forward(solver.mjw_model, data)
            mjw.rne_postconstraint(solver.mjw_model, data)
            arrays = (
                data.qpos,
                data.qvel,
                data.qacc,
                data.actuator_force,
                data.cfrc_int,
            )
            q, v, a, drive, on_bodies = (x.numpy()[0].astype(float) for x in arrays)
            closing = data.efc.force.numpy()[0, :2].astype(float)
            return reading(solver.mj_model, q, v, a, drive[0], closing, on_bodies[2:5])

        return run_through(scene, course, advance, read)
