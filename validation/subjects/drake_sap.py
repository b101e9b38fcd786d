"""Drake's own simulation of the SDF file: a discrete plant, its SAP solver, a ball constraint at B."""

import time
from importlib.metadata import version

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.systems.analysis import Simulator

from fourbar.mjcf import flywheel
from fourbar.mjcf.sdf import sdf
from fourbar.scene import Scene
from validation.subjects.motion import Readings, gap, start, turn, weight

VERSION = version("drake")
STEPS = (628, 2512)
CHANGED = "SDF with Drake's ball constraint in place of a fourth joint; its force cannot be read"
SETTINGS = {"SAP": None}
PINS = ("O2", "A", "O4")


def through(scene: Scene, steps: int, setting: str) -> Readings:
    """A turn in so many steps, carried by a flywheel, the rotor of an actuator on O2."""
    timestep, stops = turn(scene, steps)
    begin, inertia = start(scene), flywheel(scene)
    plant = MultibodyPlant(timestep)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    Parser(plant).AddModelsFromString(sdf(scene, "drake", begin), "sdf")
    plant.mutable_gravity_field().set_gravity_vector(weight(scene))
    joints = [plant.GetJointByName(name) for name in PINS]
    actuator = plant.AddJointActuator("drive", joints[0])
    actuator.set_default_rotor_inertia(inertia)
    actuator.set_default_gear_ratio(1.0)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.get_actuation_input_port().FixValue(context, np.zeros(plant.num_actuators()))  # also one of every other joint
    for joint, speed in zip(joints, begin.qvel, strict=True):
        joint.set_angular_rate(context, speed)
    simulator = Simulator(plant, context)
    found = Readings(setting, steps)
    for stop in stops:
        began = time.process_time()
        simulator.AdvanceTo((stop - 1) * timestep)
        angles = [joint.get_angle(context) + q for joint, q in zip(joints, begin.qpos, strict=True)]
        speed = joints[0].get_angular_rate(context)
        theta = (angles[0], angles[0] + angles[1], angles[2])
        reactions = plant.get_reaction_forces_output_port().Eval(context)
        on_child = {
            pin: reactions[int(joint.index())].translational()[:2] for pin, joint in zip(PINS, joints, strict=True)
        }
        world = {pin: complex(*on_child[pin]) * np.exp(1j * turned) for pin, turned in zip(PINS, theta, strict=True)}
        forces = {"F12": world["O2"], "F32": -world["A"], "F14": world["O4"]}
        pairs = {name: (force.real, force.imag) for name, force in forces.items()}
        simulator.AdvanceTo(stop * timestep)
        found.seconds += time.process_time() - began
        alpha = (joints[0].get_angular_rate(context) - speed) / timestep
        found.read(theta, speed, alpha, -inertia * alpha, pairs)
        found.gap = max(found.gap, gap(scene, theta))
    return found
