"""Genesis' rigid solver in double precision, from the MJCF file."""

from importlib.metadata import version
from typing import Any, ClassVar

import genesis
import numpy as np
import torch

from fourbar.scene import Scene
from fourbar_lab.simulators.mujoco_c import write_opened_mjcf
from fourbar_lab.simulators.protocol_engines import (
    Course,
    Instant,
    Readings,
    Simulator,
    bar_directions,
    gravity_field,
    start,
    write_temp,
)

GENESIS_FLYWHEEL = 1e5
"""Inertia of the flywheel relative to the linkage's; beside 1e8 its solver leaves
gravity to itself unless it is set to MuJoCo's tolerance.
"""
genesis.init(
    backend=genesis.gpu if torch.cuda.is_available() else genesis.cpu,
    precision="64",
    logging_level="error",
)


class GenesisRigid(Simulator):
    """Genesis' rigid solver; it reports no pin force but the closing one."""

    name = "Genesis"
    version = version("genesis-world")
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else "CPU"
    changed = (
        "precision 64; timestep, gravity and the keyframe's speeds are set by hand; a"
        " lighter flywheel"
    )
    quantities = ("theta_3", "theta_4", "torque", "F43")
    settings: ClassVar[dict[str, tuple[dict[str, Any], dict[str, Any]]]] = {
        "enable_mujoco_compatibility": ({}, {"enable_mujoco_compatibility": True}),
        "default_armature=None": ({"default_armature": None}, {}),
        "its defaults": ({}, {}),
    }
    """Arguments of the MJCF morph and of the rigid solver's options."""

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course.

        Torque and force are those with which the step began.
        """
        of_morph, of_solver = self.settings[self.setting]
        common: dict[str, Any] = {
            "dt": course.timestep,
            "gravity": gravity_field(scene),
        }
        world = genesis.Scene(
            sim_options=genesis.options.SimOptions(**common),
            rigid_options=genesis.options.RigidOptions(
                **common,
                enable_collision=False,
                enable_joint_limit=False,
                **of_solver,
            ),
            show_viewer=False,
        )
        with write_temp(
            write_opened_mjcf(
                scene, course.steps, "genesis", flywheel=GENESIS_FLYWHEEL
            ),
            "four_bar.xml",
        ) as file:
            bars = world.add_entity(genesis.morphs.MJCF(file=file, **of_morph))
            world.build()
        world.step()  # compiled before the clock runs
        world.reset()
        bars.set_dofs_velocity(np.array(start(scene).qvel))
        armature = float(bars.get_dofs_armature()[0])
        solver = world.sim.rigid_solver

        def look() -> tuple[Any, float]:
            q = bars.get_qpos().cpu().numpy().copy()
            return q, float(bars.get_dofs_velocity()[0])

        def read(before: tuple[Any, float]) -> Instant:
            q, speed = before
            alpha = float(solver.get_dofs_acc().cpu().numpy().ravel()[0])
            closing = solver.constraint_solver.efc_force.to_numpy()[:2].ravel()
            torque = -armature * alpha
            return Instant(bar_directions(q), speed, alpha, torque, {"F43": closing})

        return self.run_by_steps(scene, course, world.step, look, read)
