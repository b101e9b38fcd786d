"""MuJoCo, imported in this package alone.

MuJoCo would write its warnings to standard error and to a file of a fixed name in the
working folder. They are read from its data instead.
"""

import mujoco

mujoco.set_mju_user_warning(lambda _: None)
