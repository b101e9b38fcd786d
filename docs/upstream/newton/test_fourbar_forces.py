# SPDX-License-Identifier: Apache-2.0

"""Verify the forces of a closed four-bar linkage against Newton-Euler equations of its free bodies.

``test_fourbar_linkage`` of ``test_physics_verification.py`` checks angles and closure
of the same linkage. A small closure error does not show wrong constraint forces,
because they follow from accelerations.
"""

import unittest

import numpy as np
import warp as wp

import newton
from newton.tests.unittest_utils import add_function_test, get_test_devices

CRANK, COUPLER, ROCKER, GROUND = 0.2, 0.5, 0.4, 0.5
HALF_THICKNESS, DENSITY = 0.02, 1000.0
OMEGA = 2.0 * np.pi
ARMATURE = 1.0e3


def solve_position(theta_2):
    """Return the angles of coupler and rocker from the loop closure, open configuration.

    With the diagonal p from the crank's pin A to the rocker's pivot O4, the law of
    cosines gives the angle between p and the coupler:
        cos(beta) = (b^2 + |p|^2 - c^2) / (2 b |p|).
    """
    p = GROUND - CRANK * np.exp(1j * theta_2)
    beta = np.arccos((COUPLER**2 + abs(p) ** 2 - ROCKER**2) / (2.0 * COUPLER * abs(p)))
    theta_3 = np.angle(p) + beta
    return theta_3, np.angle(
        CRANK * np.exp(1j * theta_2) + COUPLER * np.exp(1j * theta_3) - GROUND
    )


def solve_rates(theta_2, omega_2, alpha_2):
    """Return the angular velocities and accelerations of coupler and rocker.

    The loop a e^{i theta_2} + b e^{i theta_3} = d + c e^{i theta_4}, differentiated
    once and twice, is linear in them.
    """
    theta_3, theta_4 = solve_position(theta_2)
    a, b, c = (
        r * np.exp(1j * t)
        for r, t in ((CRANK, theta_2), (COUPLER, theta_3), (ROCKER, theta_4))
    )
    matrix = np.array(
        [[(1j * b).real, -(1j * c).real], [(1j * b).imag, -(1j * c).imag]]
    )
    velocity = -1j * omega_2 * a
    omega_3, omega_4 = np.linalg.solve(matrix, [velocity.real, velocity.imag])
    drift = -(1j * alpha_2 - omega_2**2) * a + omega_3**2 * b - omega_4**2 * c
    alpha_3, alpha_4 = np.linalg.solve(matrix, [drift.real, drift.imag])
    return omega_3, omega_4, alpha_3, alpha_4


def solve_free_bodies(theta_2, omega_2, alpha_2):
    """Return the torque on the crank and the force of the ground on the rocker.

    Newton-Euler equations of each bar, m a_G = sum(F) and I_G alpha = sum(r x F) + tau,
    are nine linear equations for the forces at O2, A, B and O4 and the torque of the
    drive.
    """
    theta_3, theta_4 = solve_position(theta_2)
    omega_3, omega_4, alpha_3, alpha_4 = solve_rates(theta_2, omega_2, alpha_2)
    turning = [
        1j * al - om**2
        for om, al in ((omega_2, alpha_2), (omega_3, alpha_3), (omega_4, alpha_4))
    ]
    bars = [
        r * np.exp(1j * t)
        for r, t in ((CRANK, theta_2), (COUPLER, theta_3), (ROCKER, theta_4))
    ]
    starts = [0.0, turning[0] * bars[0], 0.0]  # accelerations of O2, A and O4
    matrix, right = np.zeros((9, 9)), np.zeros(9)
    # columns: O2 on crank, A on coupler, B on coupler, O4 on rocker (x, y each), torque
    acting = (
        ((0, 1, -0.5), (2, -1, 0.5)),
        ((2, 1, -0.5), (4, 1, 0.5)),
        ((6, 1, -0.5), (4, -1, 0.5)),
    )
    for i, (bar, start, turn, forces) in enumerate(
        zip(bars, starts, turning, acting, strict=True)
    ):
        length = abs(bar)
        mass = DENSITY * length * (2.0 * HALF_THICKNESS) ** 2
        inertia = mass * (length**2 + (2.0 * HALF_THICKNESS) ** 2) / 12.0
        centre = mass * (start + 0.5 * turn * bar)
        right[3 * i : 3 * i + 3] = centre.real, centre.imag, inertia * turn.imag
        for column, sign, share in forces:
            arm = share * bar
            matrix[3 * i, column] = matrix[3 * i + 1, column + 1] = sign
            matrix[3 * i + 2, column : column + 2] = -sign * arm.imag, sign * arm.real
    matrix[2, 8] = 1.0
    unknown = np.linalg.solve(matrix, right)
    return unknown[8], unknown[6:8]


def build_model(device, theta_2):
    """Build the linkage with all joints at zero where it stands closed at ``theta_2``; boxes, no gravity.

    The armature of the crank's joint holds the speed: it is far larger than the inertia
    of the bars, so that the torque which the linkage needs is what the armature gives,
    -armature * acceleration.
    """
    theta_3, theta_4 = solve_position(theta_2)
    cfg = newton.ModelBuilder.ShapeConfig(density=DENSITY)
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0), up_axis=newton.Axis.Y)
    joints, parent, reach = [], -1, 0.0
    bars = (
        (CRANK, theta_2, ARMATURE),
        (COUPLER, theta_3 - theta_2, 0.0),
        (ROCKER, theta_4 + np.pi - theta_3, 0.0),
    )
    for length, angle, armature in bars:
        bar = builder.add_link(xform=wp.transform_identity())
        builder.add_shape_box(
            bar, hx=length / 2.0, hy=HALF_THICKNESS, hz=HALF_THICKNESS, cfg=cfg,
        )
        turned = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), float(angle))
        joint = builder.add_joint_revolute(
            parent=parent,
            child=bar,
            axis=(0, 0, 1),
            parent_xform=wp.transform(wp.vec3(reach, 0.0, 0.0), turned),
            child_xform=wp.transform(
                wp.vec3(-length / 2.0, 0.0, 0.0), wp.quat_identity()
            ),
            armature=armature,
        )
        joints.append(joint)
        parent, reach = bar, length / 2.0
    builder.add_articulation(joints)
    loop = builder.add_joint_revolute(
        parent=-1,
        child=parent,
        axis=(0, 0, 1),
        parent_xform=wp.transform(wp.vec3(GROUND, 0.0, 0.0), wp.quat_identity()),
        child_xform=wp.transform(wp.vec3(ROCKER / 2.0, 0.0, 0.0), wp.quat_identity()),
    )
    builder.joint_articulation[loop] = -1
    return builder.finalize(device=device)


def simulate_quarter_turn(device, solver_fn, dt):
    """Simulate a quarter turn from 30 deg at step ``dt``.

    Returns:
        Largest errors of the torque and of the closing force in the second half of the
        motion, divided by their largest values in a turn. The reference is evaluated at
        the simulated angle, velocity and acceleration, so that a drift of the motion is
        no error of the forces.
    """
    start = np.deg2rad(30.0)
    model = build_model(device, start)
    solver, control = solver_fn(model), model.control()
    for name, value in (
        ("eq_solref", [2.0 * dt, 1.0]),
        ("eq_solimp", [0.9999, 0.9999, 0.001, 0.5, 2.0]),
    ):
        if solver.use_mujoco_cpu:
            getattr(solver.mj_model, name)[:] = value
        else:
            field = getattr(solver.mjw_model, name)
            field.assign(np.broadcast_to(np.float32(value), field.numpy().shape))
    state = model.state()
    omega_3, omega_4, _, _ = solve_rates(start, OMEGA, 0.0)
    state.joint_qd.assign(
        np.array([OMEGA, omega_3 - OMEGA, omega_4 - omega_3], dtype=np.float32)
    )
    newton.eval_fk(model, state.joint_q, state.joint_qd, state)
    turn = [
        solve_free_bodies(angle, OMEGA, 0.0)
        for angle in np.linspace(0.0, 2.0 * np.pi, 73)
    ]
    largest_torque = max(abs(torque) for torque, _ in turn)
    largest_force = max(np.linalg.norm(force) for _, force in turn)
    steps = round(0.25 * 2.0 * np.pi / OMEGA / dt)
    torque_error = force_error = 0.0
    for step in range(steps):
        theta_2, omega_2 = start + float(state.joint_q.numpy()[0]), float(
            state.joint_qd.numpy()[0]
        )
        solver.step(state, state, control, None, dt)
        if step < steps // 2:  # until then the closure settles
            continue
        if solver.use_mujoco_cpu:
            forces, alpha_2 = solver.mj_data.efc_force, float(solver.mj_data.qacc[0])
        else:
            forces, alpha_2 = solver.mjw_data.efc.force.numpy()[0], float(
                solver.mjw_data.qacc.numpy()[0, 0]
            )
        torque, force = solve_free_bodies(theta_2, omega_2, alpha_2)
        on_world = (
            forces[:6].reshape(2, 3)[:, :2].sum(axis=0)
        )  # a revolute loop is two CONNECT constraints
        torque_error = max(
            torque_error, abs(-ARMATURE * alpha_2 - torque) / largest_torque
        )
        force_error = max(force_error, np.linalg.norm(on_world + force) / largest_force)
    return torque_error, force_error


class TestFourBarForces(unittest.TestCase):
    pass


def test_fourbar_forces(test, device, solver_fn):
    """Verify drive torque and closing force of a driven four-bar against the Newton-Euler equations of its bars.

    Reference: m a_G = sum(F) and I_G alpha = sum(r x F) + tau for each bar, with a_G
    and alpha from the loop closure a e^{i theta_2} + b e^{i theta_3} = d + c e^{i
    theta_4} differentiated twice.

    The semi-implicit Euler step and the closure's time constant of 2 dt make the error
    first order in omega dt. Both steps must stay below 0.1 omega dt (measured: 0.07 and
    0.05). Below dt = 2 ms single precision limits the forces.
    """
    for dt in (1.0 / 125.0, 1.0 / 250.0):
        tolerance = 0.1 * OMEGA * dt
        torque_error, force_error = simulate_quarter_turn(device, solver_fn, dt)
        test.assertLess(torque_error, tolerance, f"torque, dt = {dt} s")
        test.assertLess(force_error, tolerance, f"closing force, dt = {dt} s")


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
                model, use_mujoco_cpu=use_cpu, iterations=100, ls_iterations=50,
            ),
        )


if __name__ == "__main__":
    unittest.main(verbosity=2)
