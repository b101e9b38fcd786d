"""Test Jdotv of equality constraints after a change of qvel, through the public forward.

For constraint_test.py beside test_jdotv, which calls make_constraint alone and keeps
the velocities of put_data.
"""

import itertools

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from absl.testing import absltest, parameterized
from mujoco_warp import test_data


class JdotvForwardTest(parameterized.TestCase):
    @parameterized.parameters(
        *itertools.product(
            ("jdotv/connect_2d.xml", "jdotv/connect_3d.xml", "jdotv/weld_3d.xml"),
            (mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_SPARSE),
        )
    )
    def test_jdotv_forward(self, xml, jacobian):
        """Test that forward takes Jdotv from the current qvel.

        Reference: efc_aref of mj_forward, which contains -Jdotv. Free bodies that only
        rotate have the largest Jdotv, of omega^2 times the arm; the keyframe of
        connect_2d.xml has none.
        """
        mjm, mjd, m, d = test_data.fixture(
            xml, keyframe=0, overrides={"opt.jacobian": jacobian},
        )
        mjd.qvel[:] = np.tile([0.0, 0.0, 0.0, 10.0, -20.0, 30.0], mjm.nv // 6)
        mujoco.mj_forward(mjm, mjd)
        wp.copy(d.qvel, wp.array(mjd.qvel.reshape((1, -1)), dtype=float))

        mjw.forward(m, d)

        aref = d.efc.aref.numpy()[0, : mjd.nefc]
        np.testing.assert_allclose(
            aref, mjd.efc_aref, atol=1e-4 * np.abs(mjd.efc_aref).max(),
        )  # single precision


if __name__ == "__main__":
    absltest.main()
