"""Newton's Kamino solver, from the USD file.

Kamino is a beta in single precision, with maximal coordinates.
"""

from dataclasses import replace
from importlib.metadata import version
from typing import Any, ClassVar

import newton
import numpy as np
import warp

from fourbar.effects import Flywheel
from fourbar.mjcf import size_flywheel
from fourbar.mjcf.assembly import write_usd
from fourbar.quantities import Array
from fourbar.scene import Scene
from fourbar_lab.simulators.protocol_engines import (
    RECIPE_WITH_A_LIGHT_FLYWHEEL,
    Course,
    Instant,
    Readings,
    Simulator,
    read_flywheel,
    rotate,
    start,
    write_temp,
)

TOLERANCE_OPTIONS = ("primal_tolerance", "dual_tolerance", "compl_tolerance")
_PARENTS = {"O2": None, "A": 0, "O4": None, "B": 2}
"""Body on which each joint's axes are fixed, in the order of the joints. None: the
ground.
"""


class NewtonKamino(Simulator):
    """Newton's SolverKamino."""

    name = "Newton, Kamino"
    version = version("newton")
    device = str(warp.get_preferred_device().name)
    made_for = "many worlds at once on a GPU"
    changed = (
        "USD with a fourth revolute joint; a light flywheel on the input; multipliers"
        " from the solver's own data"
    )
    settings: ClassVar[dict[str, dict[str, Any]]] = {
        "its defaults": {},
        "PADMM to 1e-9 in 2000 iterations": {
            "max_iterations": 2000,
            **dict.fromkeys(TOLERANCE_OPTIONS, 1e-9),
        },
    }
    """Settings of the PADMM solver (200 iterations, 1e-6 by default)."""
    tolerance = (0.2, "single precision and first order in the timestep")

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course.

        Forces are those of a step, with the state in which it began.
        """
        begin = start(scene)
        inertia = size_flywheel(scene, RECIPE_WITH_A_LIGHT_FLYWHEEL)
        carried = replace(scene, effects=(*scene.effects, Flywheel(inertia, 2)))
        builder = newton.ModelBuilder()
        with write_temp(write_usd(carried, begin), "four_bar.usda") as file:
            builder.add_usd(file)
        model = builder.finalize(device=warp.get_preferred_device())
        config = newton.solvers.SolverKamino.Config()
        for name, value in self.settings[self.setting].items():
            setattr(config.padmm, name, value)
        solver = newton.solvers.SolverKamino(model, config)
        control = model.control()
        now = model.state()
        then = model.state()
        speeds = now.joint_qd.numpy()
        speeds[:3] = begin.qvel
        now.joint_qd.assign(speeds)
        newton.eval_fk(model, now.joint_q, now.joint_qd, now)
        # compiled before the clock runs
        warmed_up = newton.solvers.SolverKamino(model, config)
        warmed_up.step(now, then, control, None, course.timestep)
        t_2, t_32, t_4 = begin.qpos
        laid = {"O2": t_2, "A": t_32, "O4": t_4, "B": t_2 + t_32 - t_4}

        def step() -> None:
            nonlocal now, then
            solver.step(now, then, control, None, course.timestep)
            now, then = then, now

        def look() -> tuple[Array, float]:
            return directions(now), float(now.joint_qd.numpy()[0])

        def read(before: tuple[Array, float]) -> Instant:
            theta, speed = before
            multipliers = solver._solver_kamino.data.joints.lambda_kin_j.numpy()
            rows = multipliers.astype(float).reshape(4, 5)[:, 1:3]
            on_pins = {}
            for row, (pin, parent) in zip(rows, _PARENTS.items(), strict=True):
                turned = laid[pin] + (0.0 if parent is None else theta[parent])
                on_pins[pin] = np.array(rotate(turned, *row))
            forces = {
                "F12": on_pins["O2"],
                "F32": -on_pins["A"],
                "F43": on_pins["B"],
                "F14": on_pins["O4"],
            }
            speeds = speed, float(now.joint_qd.numpy()[0])
            return read_flywheel(course, inertia, theta.tolist(), speeds, forces)

        return self.run_by_steps(scene, course, step, look, read)


def directions(state: newton.State) -> Array:
    """Return the directions of bars 2, 3, 4, rad."""
    poses = state.body_q.numpy().astype(float)
    return np.asarray(2.0 * np.arctan2(poses[:, 5], poses[:, 6]))
