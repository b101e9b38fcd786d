"""Test forces of closed four-bars against Newton-Euler values, dense and sparse, in four worlds.

A crank that turns at 10 rad/s under its weight carries two four-bars. Its joint bears
an armature of 1e3 kg m^2, so that the torque is -armature * qacc. The reference is
    m a_G = sum(F),   I_G alpha = sum(r x F) + tau
of each bar, solved to 1e-13 (problems crank_rocker, second_on_the_crank and sprung).
"""

import mujoco
import mujoco_warp as mjw
import numpy as np
from absl.testing import absltest, parameterized

# theta_2 (deg): theta_3, theta_4 (rad), torque on the crank (N m), force of the rocker
# on the coupler (N)
COLUMNS = ("theta_3", "theta_4", "torque", "F43")
EXPECTED = {
    "crank_rocker": {
        30.0: (0.7377637735, 1.700265985, 0.09545978615, (1.795785204, 7.456613859)),
        120.0: (
            0.4020647495,
            2.147382005,
            -0.3810102948,
            (-1.203698814, 0.07632238863),
        ),
        210.0: (0.6796482647, 2.63299376, -0.4853696015, (-3.749700833, -1.067312099)),
        300.0: (1.215307554, 2.405137024, 0.7750087788, (-0.5263193458, -2.946772403)),
    },
    "second_on_the_crank": {
        30.0: (-2.461944389, -0.5085988941, 0.1860158831, (-2.370313186, 0.5724285511)),
        120.0: (
            -1.9262851,
            -0.7364556297,
            -0.01822660943,
            (-1.139174358, 0.7577843521),
        ),
        210.0: (-2.40382888, -1.441326668, -0.4769895462, (-2.261296411, -3.544452402)),
        300.0: (-2.739527904, -0.9942106484, 0.3653218907, (-2.979117323, 3.032883968)),
    },
    "sprung": {
        52.0: (0.5898077798, 1.710669934, 0.4158489382, (-11.04824729, -4.097936378)),
        127.0: (0.4010795176, 2.203102629, -1.244555448, (-12.29319867, -5.0257582)),
        217.0: (0.7259655221, 2.639989741, -0.1391868851, (-9.898617024, -7.210895317)),
        307.0: (1.227211145, 2.356443833, 2.511435024, (-5.135061474, -17.48850559)),
    },
}
A, B, C, OMEGA, ARMATURE = 0.1, 0.25, 0.22, 10.0, 1e3
COUPLER = (
    'pos="0.1369406641 0.02910763671 0" mass="0.5" diaginertia="0.002604166667'
    ' 0.002604166667 0.002604166667"'
)
ROCKER = (
    'pos="0.1188321682 -0.01670077212 0" mass="0.4" diaginertia="0.001613333333'
    ' 0.001613333333 0.001613333333"'
)
_TOLERANCE = 5e-3  # of the largest value: single precision, and a closure of impedance .9999; no step is made

XML = """
<mujoco>
  <option gravity="0 -9.81 0" timestep="1e-4" jacobian="{jacobian}" tolerance="0" iterations="20"/>
  <default>
    <joint axis="0 0 1"/>
    <equality solref=".001 1" solimp=".9999 .9999 .001 .5 2"/>
  </default>
  <worldbody>
    {rockers}
    <body>
      <joint armature="1e3" {at_o2}/>
      <inertial pos=".05 0 0" mass="0.2" diaginertia="1.666666667e-4 1.666666667e-4 1.666666667e-4"/>
      {couplers}
    </body>
    <site name="anchor" pos="0 -.1 0"/>
  </worldbody>
  {spring}
  <equality>{closures}</equality>
</mujoco>
"""


def model(names, jacobian):
    """Makes two rockers on the ground, then the crank with both couplers."""
    sprung = names == ["sprung"]
    rockers, couplers, closures = "", "", ""
    for i, name in enumerate(names):
        at_a, at_o4 = (
            ('damping=".01"', 'damping=".03" frictionloss=".2"') if sprung else ("", "")
        )
        side = -0.3 if name == "second_on_the_crank" else 0.3
        rockers += (
            f'<body pos="{side} 0 0"><joint {at_o4}/><inertial {ROCKER}/><site'
            f' name="r{i}" pos="{C} 0 0"/><site name="s" pos=".08 0 0"/></body>'
        ).replace('name="s"', f'name="s{i}"')
        couplers += (
            f'<body pos="{A} 0 0"><joint {at_a}/><inertial {COUPLER}/><site name="c{i}"'
            f' pos="{B} 0 0"/></body>'
        )
        closures += f'<connect site1="c{i}" site2="r{i}"/>'
    spring = (
        '<tendon><spatial stiffness="200" springlength=".12"><site site="anchor"/><site'
        ' site="s0"/></spatial></tendon>'
    )
    at_o2 = 'damping=".02" frictionloss=".1"' if sprung else ""
    xml = XML.format(jacobian=jacobian, rockers=rockers, couplers=couplers, closures=closures, at_o2=at_o2,
                   spring=spring if sprung else "")  # fmt: skip
    return mujoco.MjModel.from_xml_string(xml)


def states(names):
    """Yields qpos, qvel, torque and closing forces at each crank angle."""
    for degrees in EXPECTED[names[0]]:
        theta_2, rows = np.deg2rad(degrees), [EXPECTED[name][degrees] for name in names]
        qpos, qvel = [theta_4 for _, theta_4, _, _ in rows] + [theta_2], []
        omegas = []
        for theta_3, theta_4, _, _ in rows:
            sine = np.sin(theta_4 - theta_3)
            omegas.append(
                (
                    A * OMEGA * np.sin(theta_2 - theta_4) / (B * sine),
                    A * OMEGA * np.sin(theta_2 - theta_3) / (C * sine),
                )
            )
        qvel = (
            [omega_4 for _, omega_4 in omegas]
            + [OMEGA]
            + [omega_3 - OMEGA for omega_3, _ in omegas]
        )
        qpos += [theta_3 - theta_2 for theta_3, _, _, _ in rows]
        yield (
            np.array(qpos),
            np.array(qvel),
            sum(row[2] for row in rows),
            np.array([row[3] for row in rows]),
        )


class FourBarTest(parameterized.TestCase):
    """Torque and closing forces, each world at another crank angle."""

    def check(self, names, jacobian):
        mjm = model(names, jacobian)
        worlds = list(states(names))
        mjd = mujoco.MjData(mjm)
        mjd.qpos[:], mjd.qvel[:] = worlds[0][:2]
        mujoco.mj_forward(mjm, mjd)
        m, d = mjw.put_model(mjm), mjw.put_data(mjm, mjd, nworld=len(worlds))
        d.qpos.assign(np.array([world[0] for world in worlds], dtype=np.float32))
        d.qvel.assign(np.array([world[1] for world in worlds], dtype=np.float32))
        for _ in range(2):  # the first builds Jdotv from the qvel of put_data
            mjw.forward(m, d)
        closing, qacc = d.efc.force.numpy(), d.qacc.numpy()
        largest = max(
            np.abs(row[3]).max() for name in names for row in EXPECTED[name].values()
        )
        for i, (_, _, torque, forces) in enumerate(worlds):
            drive = -ARMATURE * qacc[i, len(names)]
            self.assertLess(
                abs(drive - torque), _TOLERANCE * 3.2, f"torque in world {i}"
            )
            for k in range(len(names)):
                found = closing[i, 3 * k : 3 * k + 2]
                self.assertLess(
                    np.abs(found - forces[k]).max() / largest,
                    _TOLERANCE,
                    f"closing force {k} in world {i}",
                )

    @parameterized.parameters("dense", "sparse")
    def test_two_on_a_crank(self, jacobian):
        """Test two loops that share a body, where a sparse factorization has fill-in."""
        self.check(["crank_rocker", "second_on_the_crank"], jacobian)

    def test_spring_damping_friction(self):
        """Test a loop with a spring, viscous dampers and dry friction."""
        self.check(["sprung"], "dense")


if __name__ == "__main__":
    absltest.main()
