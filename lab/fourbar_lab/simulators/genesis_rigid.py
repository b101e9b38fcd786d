"""Genesis' rigid solver in double precision, from the MJCF file."""

from importlib.metadata import version
from typing import Any

import genesis
import numpy as np
import torch

from fourbar.scene import Scene
from fourbar_lab.simulators.motion import (
    Instant,
    Readings,
    find_gravity,
    run_through,
    start,
    turn,
    write_temp,
)
from fourbar_lab.simulators.mujoco_c import text

VERSION = version("genesis-world")
DEVICE = torch.cuda.get_device_name() if torch.cuda.is_available() else "CPU"
STEPS = (314, 628)
CHANGED = (
    "precision 64; timestep, gravity and the keyframe's speeds given by hand; its default armature of 0.1 kg m^2 is "
    "deliberate, and documented"
)
SETTINGS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "enable_mujoco_compatibility": ({}, {"enable_mujoco_compatibility": True}),
    "default_armature=None": ({"default_armature": None}, {}),
    "its defaults": ({}, {}),
}
"""Arguments of the MJCF morph and of the rigid solver's options, by setting."""
genesis.init(backend=genesis.gpu if torch.cuda.is_available() else genesis.cpu, precision="64", logging_level="error")


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """Simulate a turn; torque and force are those with which the step began."""
    timestep, _ = turn(scene, steps)
    of_morph, of_solver = SETTINGS[setting]
    common: dict[str, Any] = {"dt": timestep, "gravity": find_gravity(scene)}
    world = genesis.Scene(
        sim_options=genesis.options.SimOptions(**common),
        rigid_options=genesis.options.RigidOptions(
            **common, enable_collision=False, enable_joint_limit=False, **of_solver
        ),
        show_viewer=False,
    )
    with write_temp(text(scene, steps, "genesis"), "four_bar.xml") as file:
        bars = world.add_entity(genesis.morphs.MJCF(file=file, **of_morph))
        world.build()
    world.step()  # compiled before the clock runs
    world.reset()
    bars.set_dofs_velocity(np.array(start(scene).qvel))
    armature, solver = float(bars.get_dofs_armature()[0]), world.sim.rigid_solver

    def advance(n: int) -> tuple[Any, float]:
        for _ in range(n - 1):
            world.step()
        q, speed = bars.get_qpos().cpu().numpy().copy(), float(bars.get_dofs_velocity()[0])
        world.step()
        return q, speed

    def read(before: tuple[Any, float]) -> Instant:
        q, speed = before
        alpha = float(solver.get_dofs_acc().cpu().numpy().ravel()[0])
        closing = solver.constraint_solver.efc_force.to_numpy()[:2].ravel()
        return Instant((q[0], q[0] + q[1], q[2]), speed, alpha, -armature * alpha, {"F43": closing})

    return run_through(scene, steps, setting, advance, read)
