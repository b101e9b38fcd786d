"""MuJoCo Warp does not load a file that switches midphase off, with contacts switched
off too.

Engine: mujoco-warp (mujoco_warp)
With: mujoco=={version}
Expected: a flag that changes no result, of a collision stage that is itself switched
  off, is ignored or warned of.
Found: put_model raises NotImplementedError.
Since: 3.5.0 or before
Until: still in 4.0.0
Reported: stated as unsupported in the project's documentation; a limit, no fault
"""

import sys

import mujoco
import mujoco_warp as mjw

model = mujoco.MjModel.from_xml_string(
    '<mujoco><option><flag contact="disable"'
    ' midphase="disable"/></option><worldbody><body><joint/><inertial pos="0 0 0"'
    ' mass="1" diaginertia="1 1 1"/></body></worldbody></mujoco>'
)
try:
    mjw.put_model(model)
except NotImplementedError as error:
    print(error)
else:
    sys.exit("fixed")
