"""A joint equality as it is read from a robot's file."""

from pathlib import Path

import fourbar
from fourbar.linkage import Bar, FourBar
from fourbar.scene import Scene
from fourbar_validation.engines.mujoco.robots.mimic import read_joint_equality
from fourbar_validation.robots.files import read_robot

FILE = """<mujoco><worldbody>
<body name="one"><joint name="lead" axis="0 0 1" ref="30"/><geom size="0.1"/></body>
<body name="two"><joint name="follow" axis="0 0 -1"/><geom size="0.1"/></body>
</worldbody><equality>
<joint joint1="follow" joint2="lead" polycoef="0.1 0.5 0 0.2 0"/>
</equality></mujoco>"""


LOOP = Scene(
    FourBar(0.3, Bar(0.1, 0.1), Bar(0.3, 0.1), Bar(0.1, 0.1)), fourbar.Motion(1.0, 1.0)
)


def test_coefficients_zero_and_sense_are_those_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(FILE)
    equality = read_joint_equality(read_robot(path), "follow", LOOP)
    assert (equality.follower, equality.leader) == ("follow", "lead")
    assert equality.coefficients == (0.1, 0.5, 0.0, 0.2, 0.0)
    assert round(equality.leader_zero, 6) == 0.523599
    assert equality.sense == -1.0
    assert equality.theta_2 is None
