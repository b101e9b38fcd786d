"""Forces of a closed four-bar against closed-form values: for unittest/python of Pinocchio.

The parallelogram of examples/simulation-closed-kinematic-chains.py (issue 2729) in the
x-y plane, its first upright turning at 1 rad/s without acceleration under its weight.
With the torque that this takes, each forward dynamics must find no acceleration of that
upright and the force that closes the loop.
"""

import unittest

import numpy as np
import pinocchio as pin

# theta_2 (deg): theta_3, theta_4 (rad), torque on the first upright (N m), force of the
# second on the coupler (N); from Newton's equations of each bar, to some 1e-13 (problem
# pinocchio_2729)
COLUMNS = ("theta_3", "theta_4", "torque", "F43")
EXPECTED = {
    30.0: (0.0, 0.5235987756, 76.4613829, (124.837562, 47.55)),
    70.0: (0.0, 1.221730476, 30.19695845, (25.75304956, 46.23092214)),
    110.0: (0.0, 1.919862177, -30.19695845, (-25.75304956, 46.23092214)),
    150.0: (0.0, 2.617993878, -76.4613829, (-124.837562, 47.55)),
}
UPRIGHT, COUPLER, OMEGA = (
    (0.6, 5.0, 0.15416666666666667),
    (1.0, 10.0, 0.8416666666666667),
    1.0,
)


def at(x):
    return pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))


class TestFourBar(unittest.TestCase):
    def setUp(self):
        self.model = pin.Model()
        self.model.gravity.linear = np.array([0.0, -9.81, 0.0])
        for parent, place, (length, mass, inertia) in (
            (0, 0.0, UPRIGHT),
            (1, 0.6, COUPLER),
            (0, 1.0, UPRIGHT),
        ):
            joint = self.model.addJoint(
                parent, pin.JointModelRZ(), at(place), f"joint_{place}_{length}"
            )
            about_centre = np.diag([inertia, inertia, inertia])
            body = pin.Inertia(mass, np.array([length / 2, 0.0, 0.0]), about_centre)
            self.model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        self.ends = (2, at(COUPLER[0]), 3, at(UPRIGHT[0]))

    def dynamics(self, name, q, v, tau):
        data, models, datas = (
            self.model.createData(),
            pin.StdVec_RigidConstraintModel(),
            pin.StdVec_RigidConstraintData(),
        )
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        models.append(
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, self.model, *self.ends, frame
            )
        )
        datas.append(models[0].createData())
        pin.initConstraintDynamics(self.model, data, models, datas)
        if name == "lcaba":
            pin.computeJointMinimalOrdering(self.model, data, models)
        # of the three rows of a closure in the plane two are independent: mu may not be
        # zero
        settings = pin.ProximalSettings(1e-14, 1e-8, 10)
        a = getattr(pin, name)(
            self.model, data, q, v, tau, models, datas, settings
        ).copy()
        return a, datas[0].contact_force.linear[:2].copy()

    def check(self, name, tolerance):
        """Compare with m a_G = sum(F) and I_G alpha = sum(r x F) + tau of each bar, of the largest force, 133 N."""
        for theta_2, (theta_3, theta_4, torque, force) in EXPECTED.items():
            q = np.array([np.deg2rad(theta_2), theta_3 - np.deg2rad(theta_2), theta_4])
            a, found = self.dynamics(
                name, q, np.array([OMEGA, -OMEGA, OMEGA]), np.array([torque, 0.0, 0.0])
            )
            np.testing.assert_allclose(a, 0.0, atol=tolerance)
            np.testing.assert_allclose(found, force, atol=tolerance * 133.0)

    def test_constraint_dynamics(self):
        """Verify acceleration and closing force; 1e-8 is the tolerance that the proximal settings ask for."""
        self.check("constraintDynamics", 1e-8)

    def test_lcaba_finds_the_force_of_constraint_dynamics(self):
        """Compare the closing forces of two algorithms for one constraint; their accelerations agree to 1e-6."""
        for theta_2, (theta_3, theta_4, torque, _) in EXPECTED.items():
            q = np.array([np.deg2rad(theta_2), theta_3 - np.deg2rad(theta_2), theta_4])
            state = q, np.array([OMEGA, -OMEGA, OMEGA]), np.array([torque, 0.0, 0.0])
            (a, one), (b, other) = (
                self.dynamics(name, *state) for name in ("constraintDynamics", "lcaba")
            )
            np.testing.assert_allclose(b, a, atol=1e-6)
            np.testing.assert_allclose(other, one, atol=1e-6 * 133.0)


if __name__ == "__main__":
    unittest.main()
