"""By default Drake refuses a loop of four revolute joints in SDF;
SetEnableLoopTopology(True) takes it.

Engine: drake (pydrake)
Expected: a four-bar written as four links and four revolute joints is simulated, or the
  error names the option that takes it.
Found: Finalize() raises a RuntimeError that advises a constraint. With
  plant.SetEnableLoopTopology(True), marked "internal use only for now", the same text
  finalizes with one loop constraint and four velocities, and its motion and forces are
  those of the ball constraint.
Since: 1.40.0 or before; SetEnableLoopTopology came with 1.57.0
Until: still in 1.58.0, by default
Reported: known and being worked on, RobotLocomotion/drake #9566, #24864, #24917,
  #24976, #24978
"""

import sys

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

LINK = '<link name="{}"><pose>{} {} 0 0 0 0</pose></link>'
JOINT = (
    '<joint name="{0}{1}" type="revolute"><parent>{0}</parent><child>{1}</child>'
    "<axis><xyz>0 0 1</xyz></axis></joint>"
)
links = "".join(LINK.format(*link) for link in (("a", 0, 0), ("b", 0, 1), ("c", 1, 1)))
joints = "".join(
    JOINT.format(*pair)
    for pair in (("world", "a"), ("a", "b"), ("b", "c"), ("world", "c"))
)
SDF = f'<sdf version="1.9"><model name="loop">{links}{joints}</model></sdf>'

if hasattr(MultibodyPlant, "SetEnableLoopTopology"):
    plant = MultibodyPlant(1e-3)
    plant.SetEnableLoopTopology(True)
    Parser(plant).AddModelsFromString(SDF, "sdf")
    plant.Finalize()
    print(
        "enabled:",
        plant.num_loop_constraints(),
        "loop constraint,",
        plant.num_velocities(),
        "velocities",
    )
plant = MultibodyPlant(1e-3)
Parser(plant).AddModelsFromString(SDF, "sdf")
try:
    plant.Finalize()
except RuntimeError as error:
    print("by default:", str(error).split(".", maxsplit=1)[0])
else:
    sys.exit("fixed")
