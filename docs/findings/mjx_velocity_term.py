"""MJX (JAX) leaves (dJ/dt) v out of `connect`; MuJoCo C, Warp and Genesis added it
between April and July 2026.

Engine: mujoco-mjx (mujoco.mjx)
With: mujoco=={version}
Expected: at one state of a turning four-bar, in double precision, the closing force of
  mjx.forward is that of mujoco.mj_forward.
Found: The force is 0.250 N in place of 0.206 N; in this project's four-bar it is off by
  65 % of the largest force in a turn. aref in mjx/_src/constraint.py is made of
  position and velocity alone. MuJoCo C has (dJ/dt) v since 3.7.0 (commit 412cee2),
  MuJoCo Warp since #1294.
Since: 3.7.0, when MuJoCo C got the term (3.6.0 agrees with it)
Until: still in 3.17.0
Reported: not reported yet
"""

import sys

import jax
import mujoco
import numpy as np

jax.config.update("jax_enable_x64", True)
from mujoco import mjx  # noqa: E402

XML = """<mujoco><option gravity="0 0 0"/><worldbody>
<body>
  <joint type="hinge" axis="0 0 1"/>
  <inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/>
  <body pos="1 0 0">
    <joint type="hinge" axis="0 0 1"/>
    <inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/>
    <site name="one" pos="2 0 0"/>
  </body>
</body>
<body pos="2 -1 0">
  <joint type="hinge" axis="0 0 1"/>
  <inertial pos="0 .5 0" mass="1" diaginertia=".1 .1 .1"/>
  <site name="other" pos="0 2 0"/>
</body>
</worldbody><equality>
  <connect site1="one" site2="other" solimp=".9999 .9999 .001 .5 2"/>
</equality></mujoco>"""

model = mujoco.MjModel.from_xml_string(XML)
data = mujoco.MjData(model)
# the first link (1 m) along +y, the second (2 m) along +x and for the moment not
# turning, the third (2 m) along +y
data.qpos[:] = np.pi / 2, -np.pi / 2, 0.0
data.qvel[:] = 1.0, -1.0, 0.5
mujoco.mj_forward(model, data)
theirs = mjx.forward(mjx.put_model(model), mjx.put_data(model, data))
closing = np.array(getattr(theirs, "_impl", theirs).efc_force)[:2]
print("MuJoCo", data.efc_force[:2], " MJX", closing)
if np.abs(closing - data.efc_force[:2]).max() < 1e-3:
    sys.exit("fixed")
