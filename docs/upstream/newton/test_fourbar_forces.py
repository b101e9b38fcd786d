# SPDX-License-Identifier: Apache-2.0

"""Forces of a closed four-bar against closed-form values: what test_fourbar_linkage leaves unchecked.

The linkage of test_physics_verification.py (boxes 0.04 m thick of 1000 kg/m^3 on 0.2, 0.5, 0.4 m, ground 0.5 m, no
gravity) at states of a turn at 1 rev/s. The crank's joint bears an armature of 1e3 kg m^2, so that the torque is what
the armature would have to take.
"""

import unittest

import numpy as np
import warp as wp

import newton
from newton._src.solvers.mujoco.equality import _add_equality_constraint
from newton.tests.unittest_utils import add_function_test, get_test_devices

# theta_2 (deg): theta_3, theta_4 (rad), torque on the crank (N m), force of the ground on the rocker (N);
# from Newton's equations of each bar, to some 1e-13 (problem newton_128)
COLUMNS = ("theta_3", "theta_4", "torque", "F14")
EXPECTED = {
    30.0: (0.6239492098, 1.372005047, 0.03339376364, (-0.00828879632, 9.151518782)),
    120.0: (0.4130879205, 1.93386339, -0.1371038138, (1.292355135, -3.106910731)),
    210.0: (0.7692677477, 2.473472151, -0.2056893803, (0.3855282399, 0.3576513456)),
    300.0: (1.281855265, 2.270287353, 0.95708887, (2.906996997, -2.086653133)),
}
A, B, C, D, OMEGA, ARMATURE = 0.2, 0.5, 0.4, 0.5, 2.0 * np.pi, 1e3
AT_REST = np.deg2rad(30.0)
GREATEST = {"torque": 2.154, "F14": 11.25}
TOLERANCE = 5e-3  # of the greatest value in a turn: an impedance of .9999, single-precision states


def build(device):
    cfg = newton.ModelBuilder.ShapeConfig(density=1000.0)
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0), up_axis=newton.Axis.Y)
    # at joint_q = 0 the linkage stands closed at theta_2 = 30 deg: the closure's second anchor is laid off there
    theta_3, theta_4 = EXPECTED[30.0][:2]
    joints, parent, reach = [], -1, 0.0
    bars = ((A, AT_REST, ARMATURE), (B, theta_3 - AT_REST, 0.0), (C, theta_4 + np.pi - theta_3, 0.0))
    for length, angle, armature in bars:
        bar = builder.add_link(xform=wp.transform_identity())
        builder.add_shape_box(bar, hx=length / 2.0, hy=0.02, hz=0.02, cfg=cfg)
        turned = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), float(angle))
        joints.append(
            builder.add_joint_revolute(
                parent=parent,
                child=bar,
                axis=(0, 0, 1),
                parent_xform=wp.transform(wp.vec3(reach, 0.0, 0.0), turned),
                child_xform=wp.transform(wp.vec3(-length / 2.0, 0.0, 0.0), wp.quat_identity()),
                armature=armature,
            )
        )
        parent, reach = bar, length / 2.0
    builder.add_articulation(joints)
    _add_equality_constraint(
        builder,
        constraint_type=newton.solvers.SolverMuJoCo.EqType.CONNECT,
        body1=-1,
        body2=parent,
        anchor=wp.vec3(D, 0.0, 0.0),
    )
    return builder.finalize(device=device)


class TestFourBarForces(unittest.TestCase):
    pass


def test_fourbar_forces(test, device, solver_fn):
    model = build(device)
    solver, control = solver_fn(model), model.control()
    cpu = solver.use_mujoco_cpu
    for name, value in (("eq_solref", [0.01, 1.0]), ("eq_solimp", [0.9999, 0.9999, 0.001, 0.5, 2.0])):
        if cpu:
            getattr(solver.mj_model, name)[:] = value
        else:
            given = getattr(solver.mjw_model, name).numpy()
            given[:] = value
            getattr(solver.mjw_model, name).assign(given)
    for degrees, (theta_3, theta_4, torque, force) in EXPECTED.items():
        theta_2, sine = np.deg2rad(degrees), np.sin(theta_4 - theta_3)
        omega_3 = A * OMEGA * np.sin(theta_2 - theta_4) / (B * sine)
        omega_4 = A * OMEGA * np.sin(theta_2 - theta_3) / (C * sine)
        state, after = model.state(), model.state()
        first_3, first_4 = EXPECTED[30.0][:2]
        turned_2, turned_3, turned_4 = theta_2 - AT_REST, theta_3 - first_3, theta_4 - first_4
        joint_q = [turned_2, turned_3 - turned_2, turned_4 - turned_3]
        state.joint_q.assign(np.array(joint_q, dtype=np.float32))
        state.joint_qd.assign(np.array([OMEGA, omega_3 - OMEGA, omega_4 - omega_3], dtype=np.float32))
        newton.eval_fk(model, state.joint_q, state.joint_qd, state)
        for _ in range(2):  # MuJoCo Warp takes (dJ/dt) v from the evaluation before
            solver.step(state, after, control, None, 1e-6)
        if cpu:
            on_world, alpha = solver.mj_data.efc_force[:2], solver.mj_data.qacc[0]
        else:
            on_world, alpha = solver.mjw_data.efc.force.numpy()[0, :2], solver.mjw_data.qacc.numpy()[0, 0]
        test.assertLess(abs(-ARMATURE * alpha - torque) / GREATEST["torque"], TOLERANCE, f"torque at {degrees} deg")
        error = np.abs(on_world + force).max() / GREATEST["F14"]
        test.assertLess(error, TOLERANCE, f"closing force at {degrees} deg")


for device in get_test_devices():
    for name, use_cpu in (("mujoco_cpu", True), ("mujoco_warp", False)):
        if device.is_cuda and use_cpu:
            continue
        add_function_test(
            TestFourBarForces,
            f"test_fourbar_forces_{name}",
            test_fourbar_forces,
            devices=[device],
            solver_fn=lambda model, use_cpu=use_cpu: newton.solvers.SolverMuJoCo(
                model, use_mujoco_cpu=use_cpu, iterations=100, ls_iterations=50
            ),
        )


if __name__ == "__main__":
    unittest.main(verbosity=2)
