"""Newton's MuJoCo solver (MuJoCo Warp inside, single precision), from the MJCF file."""

from importlib.metadata import version
from typing import ClassVar

import newton
import warp

from fourbar.scene import Scene
from fourbar_lab.simulators.mujoco_c import write_opened_mjcf
from fourbar_lab.simulators.mujoco_warp import read_warp
from fourbar_lab.simulators.protocol_engines import (
    Course,
    Instant,
    Readings,
    Simulator,
    gravity_field,
    start,
    write_temp,
)


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
        # compiled before the clock runs
        warmed_up = newton.solvers.SolverMuJoCo(model)
        warmed_up.step(now, then, control, None, course.timestep)

        def advance(steps: int) -> None:
            nonlocal now, then
            for _ in range(steps):
                solver.step(now, then, control, None, course.timestep)
                now, then = then, now

        def read(_: None) -> Instant:
            return read_warp(solver.mj_model, solver.mjw_model, solver.mjw_data, 2)

        return self.run(scene, course, advance, read)
