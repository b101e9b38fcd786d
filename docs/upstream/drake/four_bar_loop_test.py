"""Forces of a closed four-bar against closed-form values: for bindings/pydrake/multibody/test of Drake.

The mechanism of examples/multibody/four_bar (issue 23842) in the x-y plane, y down,
driven at 1 rad/s by a heavy rotor, as a loop of four revolute joints
(SetEnableLoopTopology) and with a ball constraint in place of the fourth.
"""

import unittest

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.analysis import Simulator

# theta_2 (deg): theta_3, theta_4 (rad), torque on the input (N m), forces of the ground
# on the input and of the output on the coupler (N); from Newton's equations of each
# bar, to some 1e-13 (problem drake_23842)
COLUMNS = ("theta_3", "theta_4", "torque", "F12", "F43")
EXPECTED = {
    90.0: (
        3.271144821,
        2.084745268,
        493.5701539,
        (-123.3925385, -392.3838145),
        (135.4840066, -125.3485555),
    ),
    180.0: (
        4.965069236,
        4.459708725,
        845.5054211,
        (90.70793564, -309.3763553),
        (9.29206436, 77.45966692),
    ),
    270.0: (
        7.340032692,
        6.15363314,
        -422.0216128,
        (-105.5054032, -408.5618926),
        (93.41393513, 90.82952253),
    ),
    360.0: (
        8.702043713,
        7.005919555,
        -1122.245053,
        (20.69615824, -378.5612632),
        (-120.6961582, -17.63834207),
    ),
}
LENGTH, MASS, INERTIA, GROUND, OMEGA = 4.0, 20.0, 29.46666666666666, -2.0, 1.0
AT_START = (2.418858406, 0.722734248)  # theta_3 and theta_4 at theta_2 = 0
RATES = (2 / 3, 2 / 3)  # of theta_3 and theta_4 there, rad/s
STEPS = 7200  # a turn
TOLERANCE = (
    12.0 * 2.0 * np.pi / STEPS
)  # of the largest value in a turn: first order in omega * step, 5 measured
ROTOR = 1e7  # kg m^2: the speed changes by 3e-5


class TestFourBarLoop(unittest.TestCase):
    def simulate(self, loop):
        step = 2 * np.pi / OMEGA / STEPS
        plant = MultibodyPlant(step)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector([0, 9.8, 0])
        about_centre = SpatialInertia.MakeFromCentralInertia(
            MASS, [LENGTH / 2, 0, 0], RotationalInertia(INERTIA, INERTIA, INERTIA)
        )
        bars = [
            plant.AddRigidBody(name, about_centre)
            for name in ("input", "coupler", "output")
        ]

        def pin(name, parent, x, child):
            frame = plant.AddFrame(
                FixedOffsetFrame(f"{name}_parent", parent, RigidTransform([x, 0, 0]))
            )
            return plant.AddJoint(RevoluteJoint(name, frame, child, [0, 0, 1]))

        o2 = pin("O2", plant.world_frame(), 0.0, bars[0].body_frame())
        a = pin("A", bars[0].body_frame(), LENGTH, bars[1].body_frame())
        o4 = pin("O4", plant.world_frame(), GROUND, bars[2].body_frame())
        end = RigidTransform([LENGTH, 0, 0])
        if loop:
            plant.SetEnableLoopTopology(True)
            b_child = plant.AddFrame(
                FixedOffsetFrame("B_child", bars[1].body_frame(), end)
            )
            b = pin("B", bars[2].body_frame(), LENGTH, b_child)
        else:
            plant.AddBallConstraint(bars[1], [LENGTH, 0, 0], bars[2], [LENGTH, 0, 0])
        drive = plant.AddJointActuator("drive", o2)
        drive.set_default_rotor_inertia(ROTOR)
        drive.set_default_gear_ratio(1.0)
        plant.Finalize()
        context = plant.CreateDefaultContext()
        plant.get_actuation_input_port().FixValue(
            context, np.zeros(plant.num_actuators())
        )
        (theta_3, theta_4), (omega_3, omega_4) = AT_START, RATES
        states = [
            (o2, 0.0, OMEGA),
            (a, theta_3, omega_3 - OMEGA),
            (o4, theta_4, omega_4),
        ]
        for joint, angle, rate in states + (
            [(b, theta_3 - theta_4, omega_3 - omega_4)] if loop else []
        ):
            joint.set_angle(context, angle)
            joint.set_angular_rate(context, rate)
        simulator = Simulator(plant, context)
        greatest = {"torque": 2308.0, "F12": 693.0, "F43": 419.0}
        for theta_2, (_, _, torque, on_input, on_coupler) in EXPECTED.items():
            count = round(theta_2 / 360 * STEPS)
            simulator.AdvanceTo((count - 1) * step)
            before, angles = o2.get_angular_rate(context), (
                o2.get_angle(context),
                a.get_angle(context),
            )
            reactions = plant.get_reaction_forces_output_port().Eval(context)
            found = {
                "F12": (
                    RotationMatrix.MakeZRotation(angles[0])
                    @ reactions[int(o2.index())].translational()
                )
            }
            if loop:  # the joint's child is the coupler
                found["F43"] = (
                    RotationMatrix.MakeZRotation(sum(angles))
                    @ reactions[int(b.index())].translational()
                )
            simulator.AdvanceTo(count * step)
            found["torque"] = -ROTOR * (o2.get_angular_rate(context) - before) / step
            for name, expected in (
                ("torque", torque),
                ("F12", on_input),
                ("F43", on_coupler),
            ):
                if name in found:
                    error = (
                        np.abs(np.atleast_1d(found[name])[:2] - expected).max()
                        / greatest[name]
                    )
                    self.assertLess(error, TOLERANCE, f"{name} at {theta_2} deg")

    def test_ball_constraint(self):
        """Compare torque and F12 with m a_G = sum(F), I_G alpha = sum(r x F) + tau of each bar."""
        self.simulate(loop=False)

    @unittest.skipUnless(
        hasattr(MultibodyPlant, "SetEnableLoopTopology"), "needs Drake 1.57"
    )
    def test_loop_topology(self):
        """Compare torque, F12 and F43 of a loop of four joints with the same equations."""
        self.simulate(loop=True)


if __name__ == "__main__":
    unittest.main()
