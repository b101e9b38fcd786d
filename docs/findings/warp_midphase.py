"""MuJoCo Warp does not load a file that switches midphase off, with contacts switched off too.

Exit 0: NotImplementedError, as found with MuJoCo Warp 4.0.0.
"""

import sys

import mujoco
import mujoco_warp as mjw

model = mujoco.MjModel.from_xml_string(
    '<mujoco><option><flag contact="disable" midphase="disable"/></option><worldbody><body><joint/>'
    '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
)
try:
    mjw.put_model(model)
except NotImplementedError as error:
    print(error)
    sys.exit(0)
sys.exit(1)
