"""A joint equality as it is read from a robot's file."""

import math

import mujoco
import numpy as np
import pytest

import fourbar
from fourbar_validation.engines.mujoco.robots.ancestry import list_followers
from fourbar_validation.engines.mujoco.robots.mimic import read_joint_equality
from fourbar_validation.robots.files import read_robot
from tests.support.rows import read_rows

FILE = """<mujoco><worldbody>
<body name="one"><joint name="lead" axis="0 0 1" ref="30"/><geom size="0.1"/></body>
<body name="two"><joint name="follow" axis="0 0 -1"/><geom size="0.1"/></body>
</worldbody><equality>
<joint joint1="follow" joint2="lead" polycoef="0.1 0.5 0 0.2 0"/>
</equality></mujoco>"""


LOOP = fourbar.Scene(fourbar.uniform(0.3, 0.1, 0.3, 0.1), fourbar.Motion(1.0, 1.0))


def test_coefficients_zero_and_sense_are_those_of_the_file(tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(FILE)
    equality = read_joint_equality(read_robot(path), "follow", LOOP)
    assert (equality.follower, equality.leader) == ("follow", "lead")
    assert equality.coefficients == (0.1, 0.5, 0.0, 0.2, 0.0)
    assert round(equality.leader_zero, 6) == 0.523599
    assert equality.sense == -1.0
    assert math.isnan(equality.theta_2)
    assert equality.remark.endswith("but follow is 0.000 mm from lead in the file")


def test_a_leader_on_a_body_that_moves_has_no_ground_beside_it(tmp_path):
    path = tmp_path / "robot.xml"
    body = '<body name="one">'
    slide = '<body name="cart"><joint type="slide"/><geom size="0.1"/>'
    text = FILE.replace(body, slide + body)
    path.write_text(text.replace('<body name="two">', '</body><body name="two">'))
    assert read_joint_equality(read_robot(path), "follow", LOOP).leader == "lead"


TENDONS = """<mujoco><worldbody>
<body name="one"><joint name="lead" axis="0 0 1" ref="30"/><geom size="0.1"/></body>
<body name="two"><joint name="follow" axis="0 0 -1" ref="9"/><geom size="0.1"/></body>
</worldbody><tendon>
<fixed name="both"><joint joint="lead" coef="-3"/><joint joint="follow" coef="2"/>
</fixed>
<fixed name="first"><joint joint="follow" coef="0.5"/></fixed>
<fixed name="second"><joint joint="lead" coef="-1.5"/></fixed>
<fixed name="half"><joint joint="lead" coef="1"/>
<joint joint="follow" coef="0"/></fixed>
</tendon><equality>{}</equality></mujoco>"""
EXACT = 1e-13
"""m; lengths of tendons of a few metres in double precision."""


@pytest.mark.parametrize(
    "equality, followers",
    read_rows("""
<tendon tendon1="both"/> | lead follow
<tendon tendon1="both" polycoef="0.3 1 0 0 0"/> | lead follow
<tendon tendon1="first" tendon2="second" polycoef=".1 .2 .3 .4 .5"/> |
<joint joint1="follow" joint2="lead" polycoef=".1 2 3 4 5"/> | follow
<tendon tendon1="both" tendon2="second"/> |
<tendon tendon1="half"/> |
<tendon tendon1="first"/> |
<joint joint1="follow"/> |
"""),
)
def test_a_follower_at_its_polynomial_leaves_the_equality_no_residual(
    equality, followers
):
    model = mujoco.MjModel.from_xml_string(TENDONS.format(equality))
    data = mujoco.MjData(model)
    ties = list_followers(model, 0)
    assert [model.joint(tie.joint).name for tie in ties] == followers.split()
    for tie in ties:
        for angle in (-0.7, 0.0, 0.4):
            data.qpos[tie.leader] = model.qpos0[tie.leader] + angle
            turned = np.polynomial.polynomial.polyval(angle, tie.coefficients)
            data.qpos[tie.joint] = model.qpos0[tie.joint] + turned
            mujoco.mj_fwdPosition(model, data)
            assert abs(data.efc_pos[0]) <= EXACT
