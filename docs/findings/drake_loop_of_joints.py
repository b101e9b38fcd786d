"""Drake refuses a loop of four revolute joints in SDF; its own ball constraint has to close it.

Exit 0: the loop is refused, as found with Drake 1.51.1.
"""

import sys

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

LINK = '<link name="{}"><pose>{} {} 0 0 0 0</pose></link>'
JOINT = (
    '<joint name="{0}{1}" type="revolute"><parent>{0}</parent><child>{1}</child><axis><xyz>0 0 1</xyz></axis></joint>'
)
links = "".join(LINK.format(*link) for link in (("a", 0, 0), ("b", 0, 1), ("c", 1, 1)))
joints = "".join(JOINT.format(*pair) for pair in (("world", "a"), ("a", "b"), ("b", "c"), ("world", "c")))
plant = MultibodyPlant(1e-3)
Parser(plant).AddModelsFromString(f'<sdf version="1.9"><model name="loop">{links}{joints}</model></sdf>', "sdf")
try:
    plant.Finalize()
except RuntimeError as error:
    print(str(error).split(".", maxsplit=1)[0])
    sys.exit(0)
sys.exit(1)
