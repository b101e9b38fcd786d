"""Genesis adds 0.1 kg m^2 to every joint whose armature the file leaves out or states as 0; MuJoCo adds none.

Its documentation says so (`default_armature` of the MJCF morph; None switches it off). A pendulum of 0.08 kg m^2 about
its pin falls from the horizontal at m g r/I = 12.26 rad/s^2. Exit 0: by default it falls at another rate, with None at
this one, as found with Genesis 1.4.5.
"""

import sys
import tempfile
from pathlib import Path

import genesis

XML = """<mujoco><option gravity="0 -9.81 0"/><worldbody><body><joint type="hinge" axis="0 0 1" armature="0"/>
<inertial pos=".5 0 0" mass=".2" diaginertia=".03 .03 .03"/></body></worldbody></mujoco>"""
INERTIA = 0.03 + 0.2 * 0.5**2
EXACT = -9.81 * 0.2 * 0.5 / INERTIA

genesis.init(backend=genesis.cpu, precision="64", logging_level="error")
found = {}
for name, given in (("by default", {}), ("with None", {"default_armature": None})):
    world = genesis.Scene(sim_options=genesis.options.SimOptions(dt=1e-6, gravity=(0.0, -9.81, 0.0)), show_viewer=False)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "pendulum.xml"
        file.write_text(XML)
        bar = world.add_entity(genesis.morphs.MJCF(file=str(file), **given))
        world.build()
    world.step()
    found[name] = float(bar.get_dofs_velocity()[0]) / 1e-6
    print(f"{name}: {found[name]:.6f} rad/s^2, armature {float(bar.get_dofs_armature()[0])}; m g r/I is {EXACT:.6f}")
right = abs(found["with None"] / EXACT - 1.0) < 1e-6
sys.exit(0 if right and abs(found["by default"] / EXACT - 1.0) > 0.1 else 1)
