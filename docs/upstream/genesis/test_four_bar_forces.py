"""Forces of a closed four-bar against closed-form values: for tests/rigid of Genesis.

A crank that turns at 10 rad/s under its weight; its joint bears an armature of 1e3 kg
m^2, so that the torque is what the armature would have to take. The values come from
Newton's equations of each bar, to some 1e-13 (problem crank_rocker).
"""

import numpy as np
import pytest

import genesis as gs

# theta_2 (deg): theta_3, theta_4 (rad), torque on the crank (N m), force of the rocker
# on the coupler (N)
COLUMNS = ("theta_3", "theta_4", "torque", "F43")
EXPECTED = {
    30.0: (0.7377637735, 1.700265985, 0.09545978615, (1.795785204, 7.456613859)),
    120.0: (0.4020647495, 2.147382005, -0.3810102948, (-1.203698814, 0.07632238863)),
    210.0: (0.6796482647, 2.63299376, -0.4853696015, (-3.749700833, -1.067312099)),
    300.0: (1.215307554, 2.405137024, 0.7750087788, (-0.5263193458, -2.946772403)),
}
A, B, C, OMEGA, ARMATURE, GRAVITY = 0.1, 0.25, 0.22, 10.0, 1e3, (0.0, -9.81, 0.0)
XML = """
<mujoco>
  <default><joint axis="0 0 1" armature="0"/></default>
  <worldbody>
    <body name="crank">
      <joint name="O2" armature="1e3"/>
      <inertial pos=".05 0 0" mass=".2" diaginertia="1.666666667e-4 1.666666667e-4 1.666666667e-4"/>
      <body name="coupler" pos=".1 0 0">
        <joint name="A"/>
        <inertial pos="0.1369406641 0.02910763671 0" mass="0.5" diaginertia="2.604166667e-3 2.604166667e-3 2.604166667e-3"/>
        <site name="on_coupler" pos=".25 0 0"/>
      </body>
    </body>
    <body name="rocker" pos=".3 0 0">
      <joint name="O4"/>
      <inertial pos="0.1188321682 -0.01670077212 0" mass="0.4" diaginertia="1.613333333e-3 1.613333333e-3 1.613333333e-3"/>
      <site name="on_rocker" pos=".22 0 0"/>
    </body>
  </worldbody>
  <equality>
    <connect site1="on_coupler" site2="on_rocker" solref=".001 1" solimp=".9999 .9999 .001 .5 2"/>
  </equality>
</mujoco>
"""


@pytest.mark.required
@pytest.mark.precision("64")
@pytest.mark.parametrize("n_envs", [0, 4])
@pytest.mark.parametrize("backend", [gs.cpu])
def test_four_bar_forces(backend, n_envs, show_viewer, tmp_path):
    """Verify torque and closing force at single states against Newton-Euler values of each bar.

    Reference: m a_G = sum(F), I_G alpha = sum(r x F) + tau. The forces are those with
    which the step begins, so that the step does not matter; the closure's impedance of
    .9999 leaves 1e-3 of the largest force, 8 N.
    """
    file = tmp_path / "four_bar.xml"
    file.write_text(XML)
    scene = gs.Scene(
        sim_options=gs.options.SimOptions(dt=1e-5, gravity=GRAVITY),
        rigid_options=gs.options.RigidOptions(
            dt=1e-5, gravity=GRAVITY, enable_mujoco_compatibility=True,
        ),
        show_viewer=show_viewer,
    )
    robot = scene.add_entity(gs.morphs.MJCF(file=str(file)))
    scene.build(n_envs=n_envs)
    solver = scene.sim.rigid_solver
    joints = [robot.get_joint(name).dofs_idx_local[0] for name in ("O2", "A", "O4")]
    for degrees, (theta_3, theta_4, torque, force) in EXPECTED.items():
        theta_2, sine = np.deg2rad(degrees), np.sin(theta_4 - theta_3)
        omega_3 = A * OMEGA * np.sin(theta_2 - theta_4) / (B * sine)
        omega_4 = A * OMEGA * np.sin(theta_2 - theta_3) / (C * sine)
        shape = (n_envs, 3) if n_envs else (3,)
        scene.reset()
        robot.set_dofs_position(
            np.tile([theta_2, theta_3 - theta_2, theta_4], (*shape[:-1], 1)).reshape(
                shape
            ),
            joints,
        )
        robot.set_dofs_velocity(
            np.tile([OMEGA, omega_3 - OMEGA, omega_4], (*shape[:-1], 1)).reshape(shape),
            joints,
        )
        scene.step()  # acceleration and force are those with which it begins
        alpha = solver.get_dofs_acc().cpu().numpy().reshape(-1, 3)[:, joints[0]]
        closing = solver.constraint_solver.efc_force.to_numpy()[:2].reshape(2, -1)
        np.testing.assert_allclose(-ARMATURE * alpha, torque, atol=1e-3)
        np.testing.assert_allclose(
            closing.T, np.broadcast_to(force, closing.T.shape), atol=8e-3,
        )
