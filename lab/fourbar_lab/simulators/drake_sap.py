"""Drake's own simulation of the SDF file: a discrete plant with the SAP solver.

The loop is closed in two ways.
"""

from importlib.metadata import version
from typing import Any, ClassVar

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.systems import analysis

from fourbar.mjcf import size_flywheel
from fourbar.mjcf.assembly import write_sdf
from fourbar.scene import Scene
from fourbar_lab.simulators.protocol_engines import (
    RECIPE_WITH_A_LIGHT_FLYWHEEL,
    Course,
    Instant,
    Readings,
    Simulator,
    bar_directions,
    gravity_field,
    read_flywheel,
    rotate,
    start,
)
from fourbar_validation.engines.description import PIN_OF_MOVING_BAR


class DrakeSap(Simulator):
    """Drake's discrete plant with the SAP solver."""

    name = "Drake, SAP"
    version = version("drake")
    changed = (
        "a flywheel is the rotor of an actuator; by default a loop of four joints is"
        " refused, so a ball constraint stands in for the fourth (its force is not"
        " offered in Python); SetEnableLoopTopology(True), from 1.57 on, takes the SDF"
        " of four joints"
    )
    quantities = (
        "theta_3",
        "theta_4",
        "torque",
        "F12",
        "F32",
        "F14",
    )  # F43 where the loop has its fourth joint
    settings: ClassVar[dict[str, str]] = {
        "ball constraint": "drake",
        **(
            {"four joints": "gazebo"}
            if hasattr(MultibodyPlant, "SetEnableLoopTopology")
            else {}
        ),
    }
    """Simulator for which the SDF is written; Gazebo's SDF has the fourth joint."""

    def through(self, scene: Scene, course: Course) -> Readings:
        """Run through a course, carried by a flywheel.

        The flywheel is the rotor of an actuator on O2.
        """
        timestep = course.timestep
        written_for = self.settings[self.setting]
        begin = start(scene)
        inertia = size_flywheel(scene, RECIPE_WITH_A_LIGHT_FLYWHEEL)
        plant = MultibodyPlant(timestep)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        if written_for == "gazebo":
            plant.SetEnableLoopTopology(True)
        Parser(plant).AddModelsFromString(write_sdf(scene, written_for, begin), "sdf")
        plant.mutable_gravity_field().set_gravity_vector(gravity_field(scene))
        joints = [plant.GetJointByName(name) for name in PIN_OF_MOVING_BAR.values()]
        joint_speeds = [*begin.qvel]
        if written_for == "gazebo":
            # bar 3 on bar 4
            joints.append(plant.GetJointByName("B"))
            joint_speeds.append(begin.qvel[0] + begin.qvel[1] - begin.qvel[2])
        actuator = plant.AddJointActuator("drive", joints[0])
        actuator.set_default_rotor_inertia(inertia)
        actuator.set_default_gear_ratio(1.0)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        plant.get_actuation_input_port().FixValue(
            context, np.zeros(plant.num_actuators())
        )  # also one of every other joint
        for joint, speed in zip(joints, joint_speeds, strict=True):
            joint.set_angular_rate(context, speed)
        simulator = analysis.Simulator(plant, context)
        done = 0

        def advance(steps: int) -> tuple[Any, float, dict[str, Any]]:
            nonlocal done
            simulator.AdvanceTo((done + steps - 1) * timestep)
            theta = bar_directions(
                [
                    joint.get_angle(context) + q
                    for joint, q in zip(joints[:3], begin.qpos, strict=True)
                ]
            )
            speed = joints[0].get_angular_rate(context)
            reactions = plant.get_reaction_forces_output_port().Eval(context)
            # on the child, in its axes; the child of B is the coupler
            O2, A, O4, *B = (
                np.array(
                    rotate(angle, *reactions[int(joint.index())].translational()[:2])
                )
                for angle, joint in zip((*theta, theta[1]), joints, strict=False)
            )
            forces = {"F12": O2, "F32": -A, "F14": O4}
            forces |= zip(("F43",), B, strict=False)
            done += steps
            simulator.AdvanceTo(done * timestep)
            return theta, speed, forces

        def read(before: tuple[Any, float, dict[str, Any]]) -> Instant:
            theta, speed, forces = before
            speeds = speed, joints[0].get_angular_rate(context)
            return read_flywheel(course, inertia, theta, speeds, forces)

        return self.run(scene, course, advance, read)
