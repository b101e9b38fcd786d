"""MJCF for each simulator that reads it: what carries the loop best there, and where its numbers stand."""

from dataclasses import replace
from typing import NamedTuple

from fourbar.errors import InputError
from fourbar.mjcf.document import READING, mjcf
from fourbar.mjcf.settings import RECIPE, Settings
from fourbar.scene import Scene

SINGLE = replace(RECIPE, flywheel=1e3, pad=None)
"""For single precision: there a flywheel of 1e8 and fitted pads lose the closing force entirely."""

FAST = replace(RECIPE, time_constant_steps=2.0)
"""For a closure whose acceleration lacks a term: the quicker it yields, the sooner its error makes up for that."""


class Simulator(NamedTuple):
    """One reader of the file."""

    settings: Settings
    note: str
    """Which numbers hold T2 and the pin force at B, of which instant, and what is known to go wrong."""


SIMULATORS = {
    "mujoco": Simulator(
        RECIPE,
        READING + " MuJoCo before 3.7 left a term out of the closing force, which was wrong by tens of per cent.",
    ),
    "warp": Simulator(
        SINGLE,
        "For MuJoCo Warp, in single precision: a light flywheel, no pads. Numbers: after step call forward twice (it "
        "builds the closure from velocities one evaluation old, so one call leaves the closing force wrong); then "
        "T2 = actuator_force[drive] - dof_armature[0] qacc[0], and efc.force[0], efc.force[1] of the world are the "
        "force of bar 4 on bar 3 at pin B in world axes. Within a step the velocities stay one evaluation old: the "
        "motion errs in proportion to the timestep.",
    ),
    "mjx": Simulator(
        FAST,
        "For MJX in double precision (jax_enable_x64). It leaves the velocity's part out of the closure's "
        "acceleration: forces of a state that was only set, such as a keyframe, are wrong by tens of per cent without "
        "any message. In a motion the closure yields until it makes up for that, the sooner the shorter its time "
        "constant, two timesteps here. Numbers: after at least ten steps call forward; then T2 = "
        "actuator_force[drive] - dof_armature[0] qacc[0], and efc_force[0], efc_force[1] are the force of bar 4 on "
        "bar 3 at pin B in world axes, to about 0.1 %.",
    ),
    "genesis": Simulator(
        RECIPE,
        "For Genesis: gs.init(precision='64') and gs.morphs.MJCF(file=..., default_armature=None); left out, it adds "
        "0.1 kg m^2 to every joint that states no armature, and the forces are another linkage's. Give timestep and "
        "gravity to the options of the scene, and the keyframe's speeds to set_dofs_velocity. Numbers: after step, all "
        "of the instant before it, efc_force[0], efc_force[1] of the rigid solver's constraint_solver are the force of "
        "bar 4 on bar 3 at pin B in world axes, and T2 = - armature of O2 times its get_dofs_acc.",
    ),
    "newton": Simulator(
        SINGLE,
        "For Newton, whose MuJoCo solver works in single precision. add_mjcf takes neither timestep, gravity nor "
        "keyframe from this file: give the timestep to step(), the gravity above to ModelBuilder(gravity=...) with its "
        "up axis left at Z (another one turns the file), and the keyframe's speeds to joint_qd[:3]. Numbers: after "
        "step call mujoco_warp.forward(solver.mjw_model, solver.mjw_data) twice; then in mjw_data T2 = "
        "actuator_force[drive] - dof_armature[0] qacc[0], and efc.force[0], efc.force[1] of the world are the force of "
        "bar 4 on bar 3 at pin B in world axes.",
    ),
}


def mjcf_for(scene: Scene, simulator: str = "mujoco") -> str:
    """The MJCF text of a scene for one simulator, its comment naming where torque and pin force are read.

    Raises
    ------
    InputError : no such simulator; else as `mjcf`.
    """
    if simulator not in SIMULATORS:
        raise InputError("simulator", simulator, f"must be one of {', '.join(SIMULATORS)}")
    return mjcf(scene, *SIMULATORS[simulator])
